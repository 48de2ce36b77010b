//! Goals that are given to several servos together: all are, or none.

use crate::World;
use crate::writes::{register, start, watched};
use taxel_joints::bus::{WriteCommand, WriteError, WriteRefused};
use taxel_joints::protocol2::{Encoder, Instruction};
use taxel_sim::servo::ServoFault;

/// The goals that servos hold.
fn goals(w: &World) -> [i32; 3] {
    [1, 2, 3].map(|id| register(w, id, 100, 2))
}

fn outcomes(w: &World, number: u64) -> [Option<Result<(), WriteError>>; 3] {
    [0, 1, 2].map(|servo| w.bus.outcome(servo, number))
}

#[test]
fn none_is_given_where_the_start_fails_that_one_of_them_waits_for() {
    for together in [[(0, 10), (1, 20), (2, 30)], [(2, 30), (1, 20), (0, 10)]] {
        let mut w = watched(3, 2540);
        // Its first goal is beyond its PWM Limit (36).
        let limit = Encoder::default()
            .packet(1, Instruction::Write, [36, 0, 100, 0])
            .unwrap()
            .to_vec();
        w.servos.receive(&limit, w.now_ns);
        w.servos.take_due(u64::MAX, &mut Vec::new());
        start(&mut w, [1, 2]);
        w.bus.numbered_command(1, 0, WriteCommand::Start(400)).unwrap();
        w.bus.command_together(2, &together).unwrap();
        w.bus.numbered_command(3, 0, WriteCommand::GoalPwm(7)).unwrap();
        w.bus.numbered_command(4, 1, WriteCommand::GoalPwm(5)).unwrap();
        w.cycles(10);
        assert_eq!(w.bus.outcome(0, 1), Some(Err(WriteError::NotHeld)));
        let off = Some(Err(WriteError::NotTaken(WriteRefused::MotorOff(0))));
        assert_eq!(outcomes(&w, 2), [off; 3]);
        assert_eq!(w.bus.outcome(0, 3), off);
        assert_eq!(
            w.bus.outcome(1, 4),
            Some(Ok(())),
            "what is told to it alone it is given"
        );
        assert_eq!(goals(&w)[1..], [5, 0]);
        assert!(!w.bus.has_writes());
    }
}

#[test]
fn none_is_given_where_one_of_them_is_switched_off_before_they_are_sent() {
    for off in 0..3 {
        let mut w = watched(3, 2540);
        start(&mut w, 0..3);
        w.bus.command_together(2, &[(0, 10), (1, 20), (2, 30)]).unwrap();
        w.bus.command_together(3, &[((off + 1) % 3, 50)]).unwrap();
        w.bus.command(off, WriteCommand::Torque(false)).unwrap();
        w.cycles(5);
        let refused = Some(Err(WriteError::NotTaken(WriteRefused::MotorOff(off))));
        let mut expected = [refused; 3];
        expected[off] = Some(Err(WriteError::SwitchedOff));
        assert_eq!(outcomes(&w, 2), expected);
        let mut held = [0; 3];
        held[(off + 1) % 3] = 50;
        assert_eq!(goals(&w), held);
        assert!(!w.bus.has_writes());
    }
}

#[test]
fn once_they_are_sent_the_others_go_on_without_one_that_is_switched_off() {
    let mut w = watched(3, 2540);
    start(&mut w, 0..3);
    // The last two are not heard at first, though they obey.
    w.fault(2, ServoFault::BadCrc);
    w.fault(3, ServoFault::BadCrc);
    w.bus.command_together(2, &[(0, 10), (1, 20), (2, 30)]).unwrap();
    w.cycles(1);
    assert_eq!(outcomes(&w, 2), [Some(Ok(())), None, None]);
    w.bus.command(1, WriteCommand::Torque(false)).unwrap();
    for id in [2, 3] {
        w.servos.set_fault(id, None, 1);
    }
    w.cycles(3);
    let off = Some(Err(WriteError::SwitchedOff));
    assert_eq!(outcomes(&w, 2), [Some(Ok(())), off, Some(Ok(()))]);
    assert_eq!([goals(&w)[0], goals(&w)[2]], [10, 30]);
    assert_eq!(register(&w, 2, 64, 1), 0);
}
