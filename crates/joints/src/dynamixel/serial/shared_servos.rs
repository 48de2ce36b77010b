//! What the thread that reads servos shares with those who ask.

use crate::dynamixel::bus::{
    Bus, BusCounters, FastState, JointReading, NoReading, Outcomes, ServoState, WriteCommand, WriteError,
    Written,
};
use crate::serial::PortStatus;
use crate::synchrony::JointHistory;

/// The newest cycle and what is known of the servos, one entry per joint in the order of the configuration.
#[derive(Debug, Clone, PartialEq)]
pub struct ServoSnapshot {
    /// Readings of the newest cycle, or why there is none.
    pub results: Vec<Result<JointReading, NoReading>>,
    /// Counters, voltage, temperature and hardware error of each servo.
    pub servos: Vec<ServoState>,
    /// Counters of the bus.
    pub counters: BusCounters,
    /// Whether all servos answer in one packet.
    pub fast: FastState,
}

/// What is known of the servos, and what they are to be told.
#[derive(Debug)]
pub(super) struct Shared {
    pub(super) snapshot: ServoSnapshot,
    pub(super) history: JointHistory,
    pub(super) port: PortStatus,
    /// Those that switch motors off come first.
    pub(super) commands: Vec<(u64, usize, WriteCommand)>,
    /// Commands so far.
    pub(super) numbers: u64,
    pub(super) outcomes: Outcomes,
}

impl Shared {
    /// What else a servo was to be told is forgotten, since its motor is to be off.
    pub(super) fn forget_commands(&mut self, joint: usize) {
        let outcomes = &mut self.outcomes;
        self.commands.retain(|(number, other, _)| {
            let result = Err(WriteError::SwitchedOff);
            if *other == joint {
                outcomes.push(
                    joint,
                    Written {
                        number: *number,
                        result,
                    },
                );
            }
            *other != joint
        });
    }

    /// Takes over what is known of the servos and their bus, and what became of what they were told.
    pub(super) fn take_servos(&mut self, bus: &mut Bus) {
        for (i, state) in self.snapshot.servos.iter_mut().enumerate() {
            if let Some(servo) = bus.servo(i) {
                *state = *servo;
            }
        }
        // Whoever is told that it holds finds it counted.
        self.snapshot.counters = bus.counters();
        self.outcomes.append(bus.take_outcomes());
    }
}
