//! What error frames say, counted by cause (`linux/can/error.h`).

use crate::{BusState, CanFrame, ErrorCauses, SourceCounters};

const TX_TIMEOUT: u32 = 0x001;
const LOST_ARBITRATION: u32 = 0x002;
const CONTROLLER: u32 = 0x004;
const PROTOCOL: u32 = 0x008;
const TRANSCEIVER: u32 = 0x010;
const NO_ACKNOWLEDGE: u32 = 0x020;
const BUS_OFF: u32 = 0x040;
const BUS_ERROR: u32 = 0x080;
const RESTARTED: u32 = 0x100;
const COUNTERS: u32 = 0x200;

/// Bits of data byte 1, valid with `CONTROLLER`.
const RX_OVERFLOW: u8 = 0x01;
const WARNING: u8 = 0x04 | 0x08;
const PASSIVE: u8 = 0x10 | 0x20;
const ACTIVE: u8 = 0x40;

/// Error counters from which a controller is in that state.
const WARNING_COUNT: u8 = 96;
const PASSIVE_COUNT: u8 = 128;
/// A controller that is off the bus hears nothing. So many data frames are more than any driver had
/// in its queue when it went off: the frame that told of the restart was lost.
const HEARS_AGAIN: u64 = 256;

impl ErrorCauses {
    /// Adds every cause that one error frame names. Class bits this list does not know count as a frame only.
    fn add(&mut self, frame: &CanFrame) {
        let class = frame.id();
        self.frames += 1;
        for (bit, count) in [
            (TX_TIMEOUT, &mut self.tx_timeout),
            (LOST_ARBITRATION, &mut self.lost_arbitration),
            (CONTROLLER, &mut self.controller),
            (PROTOCOL, &mut self.protocol),
            (TRANSCEIVER, &mut self.transceiver),
            (NO_ACKNOWLEDGE, &mut self.no_acknowledge),
            (BUS_OFF, &mut self.bus_off),
            (BUS_ERROR, &mut self.bus_error),
            (RESTARTED, &mut self.restarted),
        ] {
            *count += u64::from(class & bit != 0);
        }
        if class & CONTROLLER != 0 && byte(frame, 1) & RX_OVERFLOW != 0 {
            self.controller_overflow += 1;
        }
    }
}

impl BusState {
    /// The controller's state after an error frame.
    ///
    /// The worst state a frame names holds. Bus-off is left only through a restart or a named
    /// state; bare error counters, which drivers attach to any frame, set the state only while the
    /// controller is on the bus.
    fn after(self, frame: &CanFrame) -> BusState {
        let class = frame.id();
        let controller = if class & CONTROLLER != 0 {
            byte(frame, 1)
        } else {
            0
        };
        if class & BUS_OFF != 0 {
            BusState::BusOff
        } else if controller & PASSIVE != 0 {
            BusState::ErrorPassive
        } else if controller & WARNING != 0 {
            BusState::ErrorWarning
        } else if controller & ACTIVE != 0 || class & RESTARTED != 0 {
            BusState::ErrorActive
        } else if class & COUNTERS != 0 && self != BusState::BusOff {
            match byte(frame, 6).max(byte(frame, 7)) {
                PASSIVE_COUNT.. => BusState::ErrorPassive,
                WARNING_COUNT.. => BusState::ErrorWarning,
                _ => BusState::ErrorActive,
            }
        } else {
            self
        }
    }
}

impl SourceCounters {
    /// Counts one frame that a source hands to its caller: the frame itself, and what an error frame tells.
    pub fn count(&mut self, frame: &CanFrame) {
        self.received += 1;
        if frame.is_error() {
            self.errors.add(frame);
            self.set_bus_state(self.bus_state.after(frame));
            let counters = [byte(frame, 6), byte(frame, 7)];
            if frame.id() & COUNTERS != 0 || (frame.id() & CONTROLLER != 0 && counters != [0, 0]) {
                self.error_counters = counters;
            }
            return;
        }
        if frame.is_remote() {
            self.remote += 1;
        }
        if self.bus_state == BusState::BusOff {
            self.since_bus_off += 1;
            if self.since_bus_off >= HEARS_AGAIN {
                self.set_bus_state(BusState::ErrorActive);
            }
        }
    }

    /// The controller is in this state now, from wherever that is known.
    pub(crate) fn set_bus_state(&mut self, state: BusState) {
        self.state_changes += u64::from(self.bus_state != state);
        self.bus_state = state;
        if state != BusState::BusOff {
            self.since_bus_off = 0;
        }
        if state == BusState::ErrorActive {
            self.error_counters = [0, 0];
        }
    }
}

fn byte(frame: &CanFrame, index: usize) -> u8 {
    frame.data().get(index).copied().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The class of an error frame and its data.
    type Error = (u32, [u8; 8]);

    fn counted(frames: &[Error]) -> SourceCounters {
        let mut counters = SourceCounters::default();
        for (class, data) in frames {
            counters.count(&CanFrame::error(*class, *data));
        }
        counters
    }

    /// Data of an error frame: byte 1 and the two error counters.
    fn data(controller: u8, tx: u8, rx: u8) -> [u8; 8] {
        [0, controller, 0, 0, 0, 0, tx, rx]
    }

    #[test]
    fn each_class_bit_is_counted_under_its_own_cause() {
        type Count = fn(&ErrorCauses) -> u64;
        let cases: [(u32, Count); 9] = [
            (0x001, |e| e.tx_timeout),
            (0x002, |e| e.lost_arbitration),
            (0x004, |e| e.controller),
            (0x008, |e| e.protocol),
            (0x010, |e| e.transceiver),
            (0x020, |e| e.no_acknowledge),
            (0x040, |e| e.bus_off),
            (0x080, |e| e.bus_error),
            (0x100, |e| e.restarted),
        ];
        for (class, _) in cases {
            let errors = counted(&[(class, [0; 8])]).errors;
            assert_eq!(errors.frames, 1);
            for (other, count) in cases {
                assert_eq!(
                    count(&errors),
                    u64::from(other == class),
                    "{class:#x} as {other:#x}"
                );
            }
        }
    }

    #[test]
    fn a_frame_with_several_causes_counts_under_all_of_them() {
        let errors = counted(&[(0x008 | 0x080 | 0x020 | 0x200, data(0, 40, 0))]).errors;
        assert_eq!(
            (
                errors.frames,
                errors.protocol,
                errors.bus_error,
                errors.no_acknowledge
            ),
            (1, 1, 1, 1)
        );
    }

    #[test]
    fn only_the_receive_overflow_flag_counts_as_overflow() {
        assert_eq!(
            counted(&[(0x004, data(0x01, 0, 0))]).errors.controller_overflow,
            1
        );
        assert_eq!(
            counted(&[(0x004, data(0x02, 0, 0))]).errors.controller_overflow,
            0
        );
        // Byte 1 means nothing without the controller class.
        assert_eq!(
            counted(&[(0x080, data(0x01, 0, 0))]).errors.controller_overflow,
            0
        );
    }

    #[test]
    fn the_bus_state_follows_the_frames() {
        use BusState::*;
        let off = (0x240, data(0, 0, 0));
        let cases: &[(&[Error], BusState)] = &[
            (&[], ErrorActive),
            (&[(0x004, data(0x08, 0, 0))], ErrorWarning),
            (&[(0x204, data(0x0C, 96, 96))], ErrorWarning),
            (&[(0x004, data(0x10, 0, 0))], ErrorPassive),
            (&[(0x004, data(0x24, 0, 0))], ErrorPassive),
            (
                &[(0x004, data(0x20, 0, 0)), (0x004, data(0x40, 0, 0))],
                ErrorActive,
            ),
            (&[off], BusOff),
            (&[off, (0x100, [0; 8])], ErrorActive),
            (&[off, (0x200, data(0, 1, 1))], BusOff),
            (&[off, (0x080, [0; 8])], BusOff),
            (&[off, (0x004, data(0x04, 0, 0))], ErrorWarning),
            (&[(0x200, data(0, 95, 0))], ErrorActive),
            (&[(0x200, data(0, 96, 0))], ErrorWarning),
            (&[(0x200, data(0, 0, 128))], ErrorPassive),
            (&[(0x004, data(0x10, 0, 0)), (0x002, [0; 8])], ErrorPassive),
        ];
        for (frames, state) in cases {
            assert_eq!(counted(frames).bus_state, *state, "{frames:x?}");
        }
    }

    #[test]
    fn changes_of_state_are_counted_and_the_error_counters_kept() {
        let passive = (0x204, data(0x20, 130, 7));
        let counters = counted(&[passive, passive, (0x008, data(0, 1, 1))]);
        assert_eq!((counters.state_changes, counters.error_counters), (1, [130, 7]));
        let flapping: Vec<Error> = (0..10)
            .map(|i| {
                if i % 2 == 0 {
                    passive
                } else {
                    (0x004, data(0x40, 0, 0))
                }
            })
            .collect();
        let counters = counted(&flapping);
        assert_eq!((counters.state_changes, counters.error_counters), (10, [0, 0]));
    }

    #[test]
    fn a_controller_that_hears_is_back_on_the_bus_even_if_nobody_told_so() {
        let mut counters = counted(&[(0x040, [0; 8])]);
        let frame = CanFrame::standard(0x123, &[1]).unwrap();
        // What a driver had in its queue when the controller went off the bus.
        for _ in 0..HEARS_AGAIN - 1 {
            counters.count(&frame);
        }
        assert_eq!(counters.bus_state, BusState::BusOff);
        counters.count(&frame);
        assert_eq!(
            (counters.bus_state, counters.since_bus_off),
            (BusState::ErrorActive, 0)
        );
    }

    #[test]
    fn remote_frames_are_counted_apart() {
        let mut counters = SourceCounters::default();
        counters.count(&CanFrame::remote(0x123, false, 2).unwrap());
        counters.count(&CanFrame::standard(0x123, &[1]).unwrap());
        assert_eq!((counters.received, counters.remote), (2, 1));
    }
}
