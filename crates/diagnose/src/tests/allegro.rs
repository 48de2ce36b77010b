//! Problems of a hand that sends its own joint angles, as they come and go.

use super::joints::JointsBench;
use super::*;
use crate::Place;
use crate::joints::test_views::{S, allegro, finger};
use taxel_can::CanFrame;
use taxel_joints::{AllegroConfig, AllegroDecoder, JointSource};

#[test]
fn a_hand_and_its_fingers_that_are_silent_are_told_and_so_is_its_bus() {
    let mut bench = JointsBench::new(allegro());
    bench.pass(500, |_| {});
    bench.said(&[&["the hand's bus can:can2 is not there", "unknown joint angles"]]);
    bench.pass(900, |view| view.link = LinkState::Up);
    bench.said(&[&["can:can2 is up"]]);
    bench.pass(500, |_| {});
    bench.said(&[&[
        "the Allegro hand on can:can2 sends no angles",
        "taxeld only listens",
    ]]);
    let speak = |view: &mut JointsView, fingers: &[usize]| {
        view.tick.angles.fill(0.0);
        fingers.iter().for_each(|f| finger(view, *f));
    };
    bench.pass(1500, |view| speak(view, &[0, 1, 2, 3]));
    bench.said(&[&["can:can2 sends its angles"]]);
    bench.pass(2000, |view| speak(view, &[0, 1, 3]));
    bench.said(&[&["the hand's ring finger sends no angles"]]);
    let problem = &bench.bench.problems.current()[0].problem;
    assert_eq!(
        (problem.kind, problem.place),
        (Kind::FingerSilent, Place::Joint(8))
    );
    bench.pass(1000, |view| view.now_ns += S / 1000);
    assert_eq!(bench.bench.kinds(), ["hand-silent"]);
}

#[test]
fn an_error_that_a_hand_reports_of_a_motor_is_told_with_its_joint_until_it_is_not_reported_any_more() {
    let (mut config, view) = allegro();
    let JointSource::Allegro(hand) = &mut config.source else {
        panic!("a hand");
    };
    let hand_config = AllegroConfig::new(5);
    hand.hand = Some(hand_config.clone());
    let mut decoder = AllegroDecoder::new(&hand_config).unwrap();
    let mut bench = JointsBench::new((config, view));
    // What it reports in each tenth of a second.
    let mut pass = |bench: &mut JointsBench, ms: u64, report: Option<[u8; 2]>| {
        bench.pass(ms, |view| {
            view.link = LinkState::Up;
            view.tick.angles.fill(0.0);
            (0..4).for_each(|f| finger(view, f));
            if let Some(report) = report {
                let frame = CanFrame::standard(0x3B8, &report).unwrap();
                decoder.push(&frame, view.now_ns);
            }
            view.tick.motor_errors = *decoder.motor_errors();
        });
    };
    pass(&mut bench, 1000, None);
    bench.said(&[]);
    pass(&mut bench, 20_000, Some([6, 0x24]));
    bench.said(&[&[
        "reports an error of motor 6 (middle 2): overheating, overload (0x24)",
        "Let it cool down, free the joint",
    ]]);
    let problem = &bench.bench.problems.current()[0].problem;
    assert_eq!((problem.kind, problem.place), (Kind::HandError, Place::Joint(6)));
    // It goes on for ten seconds, since nobody knows how often the hand repeats it.
    pass(&mut bench, 9_900, None);
    bench.said(&[]);
    pass(&mut bench, 200, None);
    bench.said(&[&["no error of motor 6 (middle 2) for 10 s"]]);
    assert_eq!(bench.bench.kinds(), [""; 0]);
    // Bits and motors that the manual does not name.
    pass(&mut bench, 100, Some([15, 0x48]));
    bench.said(&[&["motor 15 (thumb 3): bits that its manual does not name (0x48)"]]);
    pass(&mut bench, 100, Some([15, 0x00]));
    bench.said(&[&["motor 15 (thumb 3)", "or says that it is over"]]);
    pass(&mut bench, 100, Some([16, 0x41]));
    bench.said(&[&["motor 16, which no joint has: input voltage, and bits", "(0x41)"]]);
    assert_eq!(bench.bench.problems.current()[0].problem.place, Place::Joints);
}

#[test]
fn an_error_of_a_motor_is_not_over_while_the_hand_is_silent() {
    let (config, view) = allegro();
    let hand_config = AllegroConfig::new(5);
    let mut decoder = AllegroDecoder::new(&hand_config).unwrap();
    let mut bench = JointsBench::new((config, view));
    bench.pass(1000, |view| {
        view.link = LinkState::Up;
        view.tick.angles.fill(0.0);
        (0..4).for_each(|f| finger(view, f));
        let frame = CanFrame::standard(0x3B8, &[6, 0x20]).unwrap();
        decoder.push(&frame, view.now_ns);
        view.tick.motor_errors = *decoder.motor_errors();
    });
    bench.said(&[&["motor 6 (middle 2): overload (0x20)"]]);
    bench.pass(20_000, |_| {});
    bench.said(&[&["sends no angles"]]);
    bench.pass(10_000, |view| (0..4).for_each(|f| finger(view, f)));
    bench.said(&[&["sends its angles"], &["no error of motor 6"]]);
}

/// A hand of this version whose joints are at these angles, degrees, and at others after a while.
fn moving_hand(version: u8, angles: [f32; 16], then: [f32; 16]) -> JointsBench {
    let (mut config, view) = allegro();
    let JointSource::Allegro(hand) = &mut config.source else {
        panic!("a hand");
    };
    hand.hand = Some(AllegroConfig::new(version));
    let mut bench = JointsBench::new((config, view));
    for degrees in [angles, then] {
        bench.pass(500, |view| {
            view.link = LinkState::Up;
            (view.tick.angles.iter_mut().zip(degrees))
                .for_each(|(angle, degrees)| *angle = degrees.to_radians());
            (0..4).for_each(|f| finger(view, f));
        });
    }
    bench
}

#[test]
fn angles_that_a_hand_of_the_version_given_cannot_have_are_told() {
    // The thumb of version 4 is never turned in by less than 15 degrees; that of version 5 says up to 190.
    let open: [f32; 16] = std::array::from_fn(|joint| if joint == 12 { 16.0 } else { 1.0 });
    let closed: [f32; 16] = std::array::from_fn(|joint| if joint == 13 { 188.0 } else { 70.0 });
    let scaled = |angles: [f32; 16], by: f32| angles.map(|degrees| degrees * by);
    let counts = (333.3 / 65_536.0) / 0.088;
    let none: &[&str] = &[];
    let cases = [
        ("as it is", 4, open, scaled(open, 1.2), none),
        ("as it is, 5", 5, open, closed, none),
        (
            "a hand at rest says nothing",
            4,
            scaled(open, counts),
            scaled(open, counts),
            none,
        ),
        (
            "5 as 4",
            4,
            scaled(open, counts),
            scaled(closed, counts),
            &["10.9 degrees", "write `version = 5`"],
        ),
        (
            "4 as 5",
            5,
            scaled(open, 1.0 / counts),
            scaled(open, 2.0 / counts),
            &["joint 12", "write `version = 4`"],
        ),
        (
            "3 with wrong offsets",
            3,
            open,
            scaled(closed, 2.0),
            &["joint 13", "zero.yaml"],
        ),
    ];
    for (what, version, angles, then, wanted) in cases {
        let bench = moving_hand(version, angles, then);
        let found: Vec<_> = bench
            .bench
            .problems
            .current()
            .iter()
            .map(|p| &p.problem)
            .collect();
        match (&found[..], wanted) {
            ([], []) => {}
            ([problem], [_, ..]) => {
                assert_eq!(
                    (problem.kind, problem.place),
                    (Kind::HandVersion, Place::Joints),
                    "{what}"
                );
                let sentence = problem.sentence();
                assert!(
                    wanted.iter().all(|part| sentence.contains(part)),
                    "{what}: {sentence}"
                );
            }
            _ => panic!("{what}: {found:?}"),
        }
    }
}
