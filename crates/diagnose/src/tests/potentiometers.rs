//! Problems of potentiometers, as they come and go.

use super::joints::JointsBench;
use super::*;
use crate::Place;
use crate::joints::test_views::{open, servo, servos};
use taxel_joints::{
    AnalogueConfig, AnalogueCounters, AnalogueJointConfig, AnalogueSnapshot, Channel, HeardChannel, NoAngle,
    PortState, PortStatus,
};

/// Two servos that answer, and two potentiometers beside them.
pub(super) fn with_potentiometers() -> JointsBench {
    let (mut config, mut view) = servos(2);
    let potentiometer = |n: u8, name: &str| AnalogueJointConfig {
        name: name.into(),
        channel: Channel::Place(n),
        counts: [100.0, 900.0],
        degrees: [0.0, 80.0],
    };
    config.analogue = Some(AnalogueConfig {
        device: "/dev/lines".into(),
        baud: 115_200,
        ends: [0.0, 1023.0],
        joint: vec![potentiometer(0, "left p"), potentiometer(1, "right p")],
    });
    open(&mut view, "/dev/ttyUSB0", 1);
    for joint in 0..2 {
        servo(&mut view, joint).alive = true;
    }
    view.tick = taxel_joints::JointsSnapshot::new(4);
    view.tick.angles.fill(0.0);
    view.analogue = Some(AnalogueSnapshot {
        angles: vec![Ok(0.5); 2],
        heard: vec![None; 2],
        counters: AnalogueCounters::default(),
        port: PortStatus {
            path: "/dev/lines".into(),
            device: None,
            state: PortState::Open,
            latency: None,
            opened: 1,
            taken_ns: None,
            abandoned: false,
        },
        open_ns: view.now_ns,
    });
    JointsBench::new((config, view))
}

/// A line comes.
pub(super) fn line(view: &mut JointsView) {
    let now_ns = view.now_ns;
    let counters = &mut view.analogue.as_mut().expect("potentiometers").counters;
    counters.lines += 1;
    counters.heard_ns = Some(now_ns);
}

#[test]
fn potentiometers_that_fall_silent_are_one_problem_and_one_whose_wire_is_off_is_named() {
    let mut bench = with_potentiometers();
    bench.pass(900, |_| {});
    bench.said(&[]);
    bench.pass(300, |_| {});
    bench.said(&[&[
        "nothing comes from the potentiometers on /dev/lines",
        "115200 bit/s",
        "p0 512",
    ]]);
    assert_eq!(bench.bench.kinds(), ["analogue-silent"]);
    bench.pass(2000, line);
    bench.said(&[&["lines come from the potentiometers on /dev/lines"]]);
    let angles = |view: &mut JointsView, angle| view.analogue.as_mut().unwrap().angles[1] = angle;
    bench.pass(300, |view| {
        line(view);
        angles(view, Err(NoAngle::AtEnd(1023.0)));
    });
    bench.said(&[&[
        "the potentiometer of right p",
        "at an end (1023 of 0 to 1023 counts)",
        "a wire that is off",
    ]]);
    assert_eq!(bench.bench.problems.current()[0].problem.place, Place::Joint(3));
    bench.pass(3000, |view| {
        line(view);
        angles(view, Ok(0.1));
    });
    bench.said(&[&["the potentiometer of right p gives its angle again"]]);
    bench.pass(1000, |view| {
        line(view);
        view.analogue.as_mut().unwrap().counters.malformed += 5;
    });
    bench.said(&[&["lines of the potentiometers on /dev/lines in", "cannot be read"]]);
    bench.pass(3000, |view| {
        view.analogue.as_mut().unwrap().port.state = PortState::Away {
            reason: "No such file".into(),
            since_ns: 0,
        };
    });
    assert_eq!(bench.bench.kinds(), ["analogue-absent"]);
}

#[test]
fn a_channel_that_comes_on_a_line_of_its_own_is_not_missing_until_it_was_in_none_for_hold_ms() {
    let mut bench = with_potentiometers();
    let mut looks = 0;
    // Each line has one channel: the one of this look, and what the other said in the line before.
    let mut turns = |view: &mut JointsView, right: Option<Result<f64, NoAngle>>| {
        line(view);
        looks += 1;
        let t_ns = view.now_ns;
        let analogue = view.analogue.as_mut().unwrap();
        let channel = looks % 2;
        if looks == 1 {
            analogue.heard.fill(Some(HeardChannel { t_ns, angle: Ok(0.5) }));
        }
        let said = match channel {
            0 => Some(Ok(0.5)),
            _ => right,
        };
        analogue.angles.fill(Err(NoAngle::Missing));
        if let Some(angle) = said {
            analogue.angles[channel] = angle;
            analogue.heard[channel] = Some(HeardChannel { t_ns, angle });
        }
    };
    bench.pass(3000, |view| turns(view, Some(Ok(0.1))));
    bench.said(&[]);
    bench.pass(3000, |view| turns(view, Some(Err(NoAngle::AtEnd(1023.0)))));
    bench.said(&[&["the potentiometer of right p", "at an end (1023"]]);
    bench.pass(3000, |view| turns(view, None));
    assert_eq!(bench.bench.kinds(), ["potentiometer-lost"]);
    let problem = &bench.bench.problems.current()[0].problem;
    assert!(
        problem.found.contains("channel 1 is not in the lines"),
        "{}",
        problem.found
    );
}

#[test]
fn the_thread_of_potentiometers_that_has_died_is_told_as_that() {
    let mut bench = with_potentiometers();
    bench.pass(1000, |view| {
        line(view);
        view.analogue.as_mut().unwrap().port.abandoned = true;
    });
    bench.said(&[&[
        "the thread that reads the potentiometers on /dev/lines has died",
        "restart taxeld",
    ]]);
    assert_eq!(bench.bench.kinds(), ["analogue-silent"]);
}
