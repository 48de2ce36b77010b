//! A simulated servo's control table: what may be read and written, and what it refuses.

use taxel_joints::protocol2::StatusError;
use taxel_joints::registers::{
    Access, RAM, Register, TABLE_BYTES, WATCHDOG_TRIPPED, XM430_W210, address, indirect,
};

/// Data Limit registers: a goal, the register of its limit.
const LIMITS: [(u16, u16); 3] = [(100, 36), (102, 38), (104, 44)];
const GOAL_POSITION: u16 = address::GOAL_POSITION;
const MAX_POSITION_LIMIT: u16 = 48;
const MIN_POSITION_LIMIT: u16 = 52;
/// Operating Mode in which a goal position has limits.
const POSITION_MODE: i32 = 3;

/// The bytes of a control table.
#[derive(Debug, Clone)]
pub(crate) struct ControlTable {
    bytes: [u8; TABLE_BYTES],
}

/// Every register, the indirect ones written out.
fn registers() -> impl Iterator<Item = Register> {
    let first = |name: &str| XM430_W210.iter().find(|r| r.name == name).copied();
    let plain = XM430_W210
        .iter()
        .filter(|r| !r.name.starts_with("Indirect"))
        .copied();
    let numbered = (1..=56).filter_map(indirect).flat_map(move |(at, data)| {
        let a = first("Indirect Address 1").map(|r| Register {
            address: at,
            initial: Some(i32::from(data)),
            ..r
        });
        let d = first("Indirect Data 1").map(|r| Register { address: data, ..r });
        [a, d].into_iter().flatten()
    });
    plain.chain(numbered)
}

impl ControlTable {
    /// The table of a servo from the factory, with this id.
    pub(crate) fn new(id: u8) -> Self {
        let mut table = Self {
            bytes: [0; TABLE_BYTES],
        };
        for r in registers() {
            table.put(r.address, r.size, r.initial.unwrap_or(0));
        }
        table.put(address::ID, 1, i32::from(id));
        table.put(address::FIRMWARE_VERSION, 1, 46);
        table.put(address::GOAL_PWM, 2, table.get(address::PWM_LIMIT, 2));
        table
    }

    /// RAM as after power-up; EEPROM stays.
    pub(crate) fn restart(&mut self) {
        let fresh = Self::new(0);
        self.bytes[usize::from(RAM)..].copy_from_slice(&fresh.bytes[usize::from(RAM)..]);
        self.put(address::GOAL_PWM, 2, self.get(address::PWM_LIMIT, 2));
    }

    /// A register's value; two and four bytes are signed.
    pub(crate) fn get(&self, at: u16, size: u8) -> i32 {
        let b = &self.bytes[usize::from(at)..];
        match size {
            1 => i32::from(b[0]),
            2 => i32::from(i16::from_le_bytes([b[0], b[1]])),
            _ => i32::from_le_bytes([b[0], b[1], b[2], b[3]]),
        }
    }

    /// Sets a register, whatever its access.
    pub(crate) fn put(&mut self, at: u16, size: u8, value: i32) {
        let (from, n) = (usize::from(at), usize::from(size));
        self.bytes[from..from + n].copy_from_slice(&value.to_le_bytes()[..n]);
    }

    /// Bytes as they are read, indirect data looked up.
    pub(crate) fn read(&self, at: u16, length: u16) -> Result<Vec<u8>, StatusError> {
        let end = usize::from(at) + usize::from(length);
        if length == 0 || end > TABLE_BYTES {
            return Err(StatusError::Access);
        }
        Ok((usize::from(at)..end)
            .map(|a| self.bytes[self.target(a)])
            .collect())
    }

    /// Writes whole registers; refuses as the servo does, and then changes nothing.
    pub(crate) fn write(&mut self, at: u16, data: &[u8]) -> Result<(), StatusError> {
        let mut new = self.clone();
        let mut rest = data;
        let mut at = usize::from(at);
        if rest.is_empty() {
            return Err(StatusError::DataLength);
        }
        while !rest.is_empty() {
            if at >= TABLE_BYTES {
                return Err(StatusError::Access);
            }
            let target = self.target(at);
            let register = registers()
                .find(|r| (r.address..r.address + u16::from(r.size)).contains(&(target as u16)))
                .ok_or(StatusError::Access)?;
            if target == at {
                self.may_write(&register)?;
                let size = usize::from(register.size);
                if usize::from(register.address) != at || rest.len() < size {
                    return Err(StatusError::DataLength);
                }
                let (value, after) = rest.split_at(size);
                new.bytes[at..at + size].copy_from_slice(value);
                new.check(&register)?;
                rest = after;
                at += size;
            } else {
                // Indirect data is written byte by byte, into whatever register it stands for.
                self.may_write(&register)?;
                new.bytes[target] = rest[0];
                rest = &rest[1..];
                at += 1;
            }
        }
        *self = new;
        Ok(())
    }

    /// Where the byte at an address really is: indirect data stands for another byte.
    fn target(&self, at: usize) -> usize {
        let n = match at {
            224..=251 => at - 223,
            634..=661 => at - 605,
            _ => return at,
        };
        let Some((pointer, _)) = indirect(n as u16) else {
            return at;
        };
        let target = self.get(pointer, 2) as u16;
        let is_indirect = matches!(target, 224..=251 | 634..=661);
        if is_indirect || usize::from(target) >= TABLE_BYTES {
            at
        } else {
            usize::from(target)
        }
    }

    fn may_write(&self, register: &Register) -> Result<(), StatusError> {
        let torque = self.get(address::TORQUE_ENABLE, 1) != 0;
        if register.access == Access::R || (register.address < RAM && torque) {
            return Err(StatusError::Access);
        }
        let is_goal = (address::GOAL_PWM..=GOAL_POSITION).contains(&register.address);
        if is_goal && self.bytes[usize::from(address::BUS_WATCHDOG)] == WATCHDOG_TRIPPED {
            return Err(StatusError::DataRange);
        }
        Ok(())
    }

    /// Whether a register's new value is one that the servo takes.
    fn check(&self, register: &Register) -> Result<(), StatusError> {
        let value = self.get(register.address, register.size);
        if let Some((low, high)) = register.range
            && !(low..=high).contains(&value)
        {
            return Err(StatusError::DataRange);
        }
        for (goal, limit) in LIMITS {
            let size = if goal == 104 { 4 } else { 2 };
            if register.address == goal && value.abs() > self.get(limit, size) {
                return Err(StatusError::DataLimit);
            }
        }
        let position_mode = self.get(address::OPERATING_MODE, 1) == POSITION_MODE;
        if register.address == GOAL_POSITION && position_mode {
            let limits = self.get(MIN_POSITION_LIMIT, 4)..=self.get(MAX_POSITION_LIMIT, 4);
            if !limits.contains(&value) {
                return Err(StatusError::DataLimit);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_servo_refuses_has_its_number() {
        use StatusError::{Access, DataLength, DataLimit, DataRange};
        let le = |v: i32, n: usize| v.to_le_bytes()[..n].to_vec();
        for (torque, at, data, result) in [
            (false, 64, le(1, 1), Ok(())),
            (false, 64, le(2, 1), Err(DataRange)),
            (false, 116, le(512, 4), Ok(())),
            (false, 116, le(5000, 4), Err(DataLimit)),
            (false, 116, le(512, 2), Err(DataLength)),
            (false, 117, le(512, 4), Err(DataLength)),
            (false, 116, vec![], Err(DataLength)),
            (false, 132, le(1, 4), Err(Access)),
            (false, 71, le(1, 1), Err(Access)),
            (false, 661, le(1, 2), Err(Access)),
            (false, 9, le(0, 1), Ok(())),
            (true, 9, le(0, 1), Err(Access)),
            (true, 65, le(1, 1), Ok(())),
            (false, 100, le(885, 2), Ok(())),
            (false, 100, le(-886, 2), Err(DataRange)),
            // Profile acceleration, profile velocity and goal position in one go.
            (false, 108, [le(1, 4), le(2, 4), le(3, 4)].concat(), Ok(())),
        ] {
            let mut table = ControlTable::new(1);
            table.put(address::TORQUE_ENABLE, 1, i32::from(torque));
            let before = table.bytes;
            assert_eq!(table.write(at, &data), result, "{at}: {data:?}");
            if result.is_ok() {
                assert_eq!(table.read(at, data.len() as u16).unwrap(), data);
            } else {
                assert_eq!(table.bytes, before);
            }
        }
    }

    #[test]
    fn indirect_data_stands_for_other_registers() {
        let mut table = ControlTable::new(1);
        table.put(144, 2, 0x1234);
        table.write(168, &[145, 0]).unwrap();
        table.write(578, &[65, 0]).unwrap();
        assert_eq!(table.read(224, 2).unwrap(), [0x12, 0]);
        table.write(634, &[1]).unwrap();
        assert_eq!(table.get(65, 1), 1);
        assert_eq!(table.write(224, &[1]), Err(StatusError::Access));
    }

    #[test]
    fn a_tripped_watchdog_refuses_goals_until_it_is_cleared() {
        let mut table = ControlTable::new(1);
        table.put(address::BUS_WATCHDOG, 1, i32::from(WATCHDOG_TRIPPED));
        assert_eq!(table.write(100, &[1, 0]), Err(StatusError::DataRange));
        table.write(98, &[0]).unwrap();
        assert_eq!(table.write(100, &[1, 0]), Ok(()));
    }

    #[test]
    fn a_restart_forgets_ram_and_keeps_eeprom() {
        let mut table = ControlTable::new(5);
        table.write(9, &[7]).unwrap();
        table.write(65, &[1]).unwrap();
        table.put(70, 1, 0x20);
        table.restart();
        assert_eq!(
            [
                table.get(7, 1),
                table.get(9, 1),
                table.get(65, 1),
                table.get(70, 1)
            ],
            [5, 7, 0, 0]
        );
    }

    #[test]
    fn reads_beyond_the_table_are_refused() {
        let table = ControlTable::new(1);
        assert_eq!(table.read(0, 662).unwrap().len(), 662);
        for (at, length) in [(0, 663), (661, 2), (65_535, 65_535), (0, 0)] {
            assert_eq!(table.read(at, length), Err(StatusError::Access));
        }
    }
}
