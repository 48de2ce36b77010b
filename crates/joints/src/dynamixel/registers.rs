//! The control table of the XM430-W210, as its data sheet has it, and what its numbers mean.
//!
//! Source: ROBOTIS e-Manual, "XM430-W210-T/R", control table of the EEPROM and of the RAM area. All
//! registers are little-endian, signed ones in two's complement. EEPROM (addresses below 64) can be
//! written only while torque is off. The other X-series servos named in [`Model`] have the same
//! registers from Model Number to Present Temperature at the same addresses, apart from the unit of
//! the current and, on XL430, a load in its place.

use std::f64::consts::PI;

/// One register.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Register {
    /// First address.
    pub address: u16,
    /// Bytes: 1, 2 or 4.
    pub size: u8,
    /// Name, as in the data sheet.
    pub name: &'static str,
    /// Whether it can be written.
    pub access: Access,
    /// Value from the factory; `None` where it differs from servo to servo or is measured.
    pub initial: Option<i32>,
    /// Smallest and largest value that can be written.
    pub range: Option<(i32, i32)>,
    /// What one count is.
    pub unit: Unit,
}

/// Whether a register can be written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Access {
    /// Read only.
    R,
    /// Read and write.
    RW,
}

/// What one count of a register is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unit {
    /// A number, a choice or a set of bits.
    None,
    /// 1/4096 revolution.
    Pulse,
    /// 0.229 revolutions per minute.
    Velocity,
    /// 214.577 revolutions per minute squared; with a time-based profile 1 ms.
    Acceleration,
    /// 2.69 mA on this model; see [`Model::current_unit_a`].
    Current,
    /// 0.113 % of full PWM.
    Pwm,
    /// 0.1 V.
    DeciVolt,
    /// 1 degree Celsius.
    Celsius,
    /// 2 microseconds.
    TwoMicroseconds,
    /// 20 ms.
    TwentyMilliseconds,
    /// 1 ms.
    Millisecond,
}

use Access::{R, RW};
use Unit::{
    Acceleration, Celsius, Current, DeciVolt, Millisecond, Pulse, Pwm, TwentyMilliseconds, TwoMicroseconds,
    Velocity,
};

const fn row(
    address: u16,
    size: u8,
    name: &'static str,
    access: Access,
    initial: Option<i32>,
    range: Option<(i32, i32)>,
    unit: Unit,
) -> Register {
    Register {
        address,
        size,
        name,
        access,
        initial,
        range,
        unit,
    }
}

/// First address of the RAM area: below it is EEPROM.
pub const RAM: u16 = 64;
/// Bytes of the control table.
pub const TABLE_BYTES: usize = 662;
/// Bus Watchdog (address 98) after it has stopped its motor: -1. Goals are refused until it is written 0.
pub const WATCHDOG_TRIPPED: u8 = 0xFF;

/// Address of a register that this crate uses by name.
pub mod address {
    /// Model Number, 2 bytes.
    pub const MODEL_NUMBER: u16 = 0;
    /// Firmware Version, 1 byte.
    pub const FIRMWARE_VERSION: u16 = 6;
    /// ID, 1 byte.
    pub const ID: u16 = 7;
    /// Baud Rate, 1 byte ([`super::baud_of`]).
    pub const BAUD_RATE: u16 = 8;
    /// Return Delay Time, 1 byte, 2 us.
    pub const RETURN_DELAY_TIME: u16 = 9;
    /// Operating Mode, 1 byte.
    pub const OPERATING_MODE: u16 = 11;
    /// PWM Limit, 2 bytes.
    pub const PWM_LIMIT: u16 = 36;
    /// Torque Enable, 1 byte.
    pub const TORQUE_ENABLE: u16 = 64;
    /// Status Return Level, 1 byte.
    pub const STATUS_RETURN_LEVEL: u16 = 68;
    /// Hardware Error Status, 1 byte.
    pub const HARDWARE_ERROR_STATUS: u16 = 70;
    /// Bus Watchdog, 1 byte, 20 ms.
    pub const BUS_WATCHDOG: u16 = 98;
    /// Goal PWM, 2 bytes.
    pub const GOAL_PWM: u16 = 100;
    /// Goal Position, 4 bytes.
    pub const GOAL_POSITION: u16 = 116;
    /// Realtime Tick, 2 bytes, ms.
    pub const REALTIME_TICK: u16 = 120;
    /// Present PWM, 2 bytes; with the three registers behind it 12 bytes that are read every cycle.
    pub const PRESENT_PWM: u16 = 124;
    /// Present Current, 2 bytes.
    pub const PRESENT_CURRENT: u16 = 126;
    /// Present Velocity, 4 bytes.
    pub const PRESENT_VELOCITY: u16 = 128;
    /// Present Position, 4 bytes.
    pub const PRESENT_POSITION: u16 = 132;
    /// Present Input Voltage, 2 bytes; Present Temperature follows.
    pub const PRESENT_INPUT_VOLTAGE: u16 = 144;
    /// Present Temperature, 1 byte.
    pub const PRESENT_TEMPERATURE: u16 = 146;
}

/// The XM430-W210, register by register. The indirect addresses and data follow by [`indirect`].
#[rustfmt::skip]
pub static XM430_W210: [Register; 57] = [
    //  address size name                     access initial     range                        unit
    row(  0, 2, "Model Number",               R,  Some(1030),  None,                          Unit::None),
    row(  2, 4, "Model Information",          R,  None,        None,                          Unit::None),
    row(  6, 1, "Firmware Version",           R,  None,        None,                          Unit::None),
    row(  7, 1, "ID",                         RW, Some(1),     Some((0, 252)),                Unit::None),
    row(  8, 1, "Baud Rate",                  RW, Some(1),     Some((0, 7)),                  Unit::None),
    row(  9, 1, "Return Delay Time",          RW, Some(250),   Some((0, 254)),                TwoMicroseconds),
    row( 10, 1, "Drive Mode",                 RW, Some(0),     Some((0, 5)),                  Unit::None),
    row( 11, 1, "Operating Mode",             RW, Some(3),     Some((0, 16)),                 Unit::None),
    row( 12, 1, "Secondary(Shadow) ID",       RW, Some(255),   Some((0, 255)),                Unit::None),
    row( 13, 1, "Protocol Type",              RW, Some(2),     Some((1, 2)),                  Unit::None),
    row( 20, 4, "Homing Offset",              RW, Some(0),     Some((-1_044_479, 1_044_479)), Pulse),
    row( 24, 4, "Moving Threshold",           RW, Some(10),    Some((0, 1023)),               Velocity),
    row( 31, 1, "Temperature Limit",          RW, Some(80),    Some((0, 100)),                Celsius),
    row( 32, 2, "Max Voltage Limit",          RW, Some(160),   Some((95, 160)),               DeciVolt),
    row( 34, 2, "Min Voltage Limit",          RW, Some(95),    Some((95, 160)),               DeciVolt),
    row( 36, 2, "PWM Limit",                  RW, Some(885),   Some((0, 885)),                Pwm),
    row( 38, 2, "Current Limit",              RW, Some(1193),  Some((0, 1193)),               Current),
    row( 44, 4, "Velocity Limit",             RW, Some(330),   Some((0, 1023)),               Velocity),
    row( 48, 4, "Max Position Limit",         RW, Some(4095),  Some((0, 4095)),               Pulse),
    row( 52, 4, "Min Position Limit",         RW, Some(0),     Some((0, 4095)),               Pulse),
    row( 60, 1, "Startup Configuration",      RW, Some(0),     Some((0, 3)),                  Unit::None),
    row( 63, 1, "Shutdown",                   RW, Some(52),    Some((0, 63)),                 Unit::None),
    row( 64, 1, "Torque Enable",              RW, Some(0),     Some((0, 1)),                  Unit::None),
    row( 65, 1, "LED",                        RW, Some(0),     Some((0, 1)),                  Unit::None),
    row( 68, 1, "Status Return Level",        RW, Some(2),     Some((0, 2)),                  Unit::None),
    row( 69, 1, "Registered Instruction",     R,  Some(0),     None,                          Unit::None),
    row( 70, 1, "Hardware Error Status",      R,  Some(0),     None,                          Unit::None),
    row( 76, 2, "Velocity I Gain",            RW, Some(1920),  Some((0, 16_383)),             Unit::None),
    row( 78, 2, "Velocity P Gain",            RW, Some(100),   Some((0, 16_383)),             Unit::None),
    row( 80, 2, "Position D Gain",            RW, Some(0),     Some((0, 16_383)),             Unit::None),
    row( 82, 2, "Position I Gain",            RW, Some(0),     Some((0, 16_383)),             Unit::None),
    row( 84, 2, "Position P Gain",            RW, Some(800),   Some((0, 16_383)),             Unit::None),
    row( 88, 2, "Feedforward 2nd Gain",       RW, Some(0),     Some((0, 16_383)),             Unit::None),
    row( 90, 2, "Feedforward 1st Gain",       RW, Some(0),     Some((0, 16_383)),             Unit::None),
    row( 98, 1, "Bus Watchdog",               RW, Some(0),     Some((0, 127)),                TwentyMilliseconds),
    row(100, 2, "Goal PWM",                   RW, None,        Some((-885, 885)),             Pwm),
    row(102, 2, "Goal Current",               RW, None,        Some((-1193, 1193)),           Current),
    row(104, 4, "Goal Velocity",              RW, None,        Some((-1023, 1023)),           Velocity),
    row(108, 4, "Profile Acceleration",       RW, Some(0),     Some((0, 32_767)),             Acceleration),
    row(112, 4, "Profile Velocity",           RW, Some(0),     Some((0, 32_767)),             Velocity),
    row(116, 4, "Goal Position",              RW, None,        Some((-1_048_575, 1_048_575)), Pulse),
    row(120, 2, "Realtime Tick",              R,  None,        None,                          Millisecond),
    row(122, 1, "Moving",                     R,  Some(0),     None,                          Unit::None),
    row(123, 1, "Moving Status",              R,  Some(0),     None,                          Unit::None),
    row(124, 2, "Present PWM",                R,  None,        None,                          Pwm),
    row(126, 2, "Present Current",            R,  None,        None,                          Current),
    row(128, 4, "Present Velocity",           R,  None,        None,                          Velocity),
    row(132, 4, "Present Position",           R,  None,        None,                          Pulse),
    row(136, 4, "Velocity Trajectory",        R,  None,        None,                          Velocity),
    row(140, 4, "Position Trajectory",        R,  None,        None,                          Pulse),
    row(144, 2, "Present Input Voltage",      R,  None,        None,                          DeciVolt),
    row(146, 1, "Present Temperature",        R,  None,        None,                          Celsius),
    row(147, 1, "Backup Ready",               R,  Some(0),     None,                          Unit::None),
    row(168, 2, "Indirect Address 1",         RW, Some(224),   Some((64, 661)),               Unit::None),
    row(224, 1, "Indirect Data 1",            RW, Some(0),     Some((0, 255)),                Unit::None),
    row(578, 2, "Indirect Address 29",        RW, Some(634),   Some((64, 661)),               Unit::None),
    row(634, 1, "Indirect Data 29",           RW, Some(0),     Some((0, 255)),                Unit::None),
];

/// Addresses of Indirect Address `n` (2 bytes) and of Indirect Data `n` (1 byte), for `n` from 1 to
/// 56; `None` outside.
pub fn indirect(n: u16) -> Option<(u16, u16)> {
    match n {
        1..=28 => Some((168 + 2 * (n - 1), 224 + (n - 1))),
        29..=56 => Some((578 + 2 * (n - 29), 634 + (n - 29))),
        _ => None,
    }
}

/// The register of this name, as the data sheet writes it.
pub fn register(name: &str) -> Option<&'static Register> {
    XM430_W210.iter().find(|r| r.name == name)
}

/// A servo of the X series, by its model number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Model {
    /// Model Number (address 0).
    pub number: u16,
    /// Name on the case.
    pub name: &'static str,
    /// What one count of Present Current is, in milliamperes times 100; 0 where there is no current sensor, or its unit is not
    /// known here.
    current_unit_10ua: u16,
}

/// X-series servos whose registers agree with those above, by ROBOTIS's own tables (`control_table` of the Dynamixel SDK). The
/// currents' units are their data sheets'.
static MODELS: [Model; 31] = {
    const fn model(number: u16, name: &'static str, current_unit_10ua: u16) -> Model {
        Model {
            number,
            name,
            current_unit_10ua,
        }
    }
    [
        model(1000, "XH430-W350", 269),
        model(1010, "XH430-W210", 269),
        model(1020, "XM430-W350", 269),
        model(1030, "XM430-W210", 269),
        model(1040, "XH430-V350", 134),
        model(1050, "XH430-V210", 134),
        model(1060, "XL430-W250", 0),
        model(1120, "XM540-W270", 269),
        model(1130, "XM540-W150", 269),
        model(1190, "XL330-M077", 100),
        model(1200, "XL330-M288", 100),
        model(1001, "XD430-T350", 0),
        model(1011, "XD430-T210", 0),
        model(1070, "XC430-W150", 0),
        model(1080, "XC430-W240", 0),
        model(1090, "2XL430-W250", 0),
        model(1100, "XH540-W270", 0),
        model(1101, "XD540-T270", 0),
        model(1110, "XH540-W150", 0),
        model(1111, "XD540-T150", 0),
        model(1140, "XH540-V270", 0),
        model(1150, "XH540-V150", 0),
        model(1160, "2XC430-W250", 0),
        model(1170, "XW540-T260", 0),
        model(1180, "XW540-T140", 0),
        model(1210, "XC330-T181", 0),
        model(1220, "XC330-T288", 0),
        model(1230, "XC330-M181", 0),
        model(1240, "XC330-M288", 0),
        model(1270, "XW430-T333", 0),
        model(1310, "XW540-H260", 0),
    ]
};

impl Model {
    /// The model of this number; `None` for one this table does not know.
    pub fn of(number: u16) -> Option<&'static Model> {
        MODELS.iter().find(|m| m.number == number)
    }

    /// What one count of Present Current is, in amperes; `None` where the servo has no current sensor, or that is not known.
    pub fn current_unit_a(&self) -> Option<f64> {
        (self.current_unit_10ua > 0).then(|| f64::from(self.current_unit_10ua) * 1e-5)
    }
}

/// Angle of a position in radians: 4096 pulses per revolution, 2048 is 0.
pub fn angle_rad(pulses: i32) -> f64 {
    (f64::from(pulses) - 2048.0) * (2.0 * PI / 4096.0)
}

/// Velocity in radians per second: 0.229 revolutions per minute per count.
pub fn velocity_rad_s(counts: i32) -> f64 {
    f64::from(counts) * (0.229 * 2.0 * PI / 60.0)
}

/// Share of full PWM, -1 to 1: 0.113 % per count.
pub fn pwm_share(counts: i16) -> f64 {
    f64::from(counts) * 0.00113
}

/// Input voltage in volts: 0.1 V per count.
pub fn volts(counts: u16) -> f64 {
    f64::from(counts) * 0.1
}

/// Bits per second of a value of Baud Rate (address 8); `None` for a value the data sheet does not list.
pub fn baud_of(value: u8) -> Option<u32> {
    const BAUDS: [u32; 8] = [
        9600, 57_600, 115_200, 1_000_000, 2_000_000, 3_000_000, 4_000_000, 4_500_000,
    ];
    BAUDS.get(usize::from(value)).copied()
}

/// Hardware Error Status (address 70). Cleared only by a reboot.
#[derive(Default, Clone, Copy, PartialEq, Eq)]
pub struct HardwareError(pub u8);

impl HardwareError {
    /// Bit and meaning, as in the data sheet.
    const BITS: [(u8, &'static str); 5] = [
        (0x01, "input voltage"),
        (0x04, "overheating"),
        (0x08, "motor encoder"),
        (0x10, "electrical shock"),
        (0x20, "overload"),
    ];

    /// Whether nothing is wrong.
    pub fn is_none(self) -> bool {
        self.0 == 0
    }

    /// What is wrong, in the data sheet's words.
    pub fn names(self) -> impl Iterator<Item = &'static str> {
        Self::BITS
            .into_iter()
            .filter(move |(bit, _)| self.0 & bit != 0)
            .map(|(_, name)| name)
    }
}

impl std::fmt::Display for HardwareError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut separator = "";
        for name in self.names() {
            write!(f, "{separator}{name}")?;
            separator = ", ";
        }
        if separator.is_empty() {
            write!(
                f,
                "{}",
                if self.is_none() {
                    "none"
                } else {
                    "a bit the data sheet does not list"
                }
            )?;
        }
        Ok(())
    }
}

impl std::fmt::Debug for HardwareError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "HardwareError({:#04x}: {self})", self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn registers_are_in_order_and_do_not_overlap() {
        for pair in XM430_W210.windows(2) {
            assert!(
                pair[0].address + u16::from(pair[0].size) <= pair[1].address,
                "{} and {}",
                pair[0].name,
                pair[1].name
            );
        }
        for r in &XM430_W210 {
            assert!(matches!(r.size, 1 | 2 | 4), "{}", r.name);
            assert_eq!(r.access == RW, r.range.is_some(), "{}", r.name);
            if let (Some((low, high)), Some(initial)) = (r.range, r.initial) {
                assert!((low..=high).contains(&initial), "{}", r.name);
            }
        }
    }

    #[test]
    fn named_addresses_are_those_of_the_table() {
        for (address, name) in [
            (address::MODEL_NUMBER, "Model Number"),
            (address::FIRMWARE_VERSION, "Firmware Version"),
            (address::ID, "ID"),
            (address::BAUD_RATE, "Baud Rate"),
            (address::RETURN_DELAY_TIME, "Return Delay Time"),
            (address::OPERATING_MODE, "Operating Mode"),
            (address::PWM_LIMIT, "PWM Limit"),
            (address::TORQUE_ENABLE, "Torque Enable"),
            (address::STATUS_RETURN_LEVEL, "Status Return Level"),
            (address::HARDWARE_ERROR_STATUS, "Hardware Error Status"),
            (address::BUS_WATCHDOG, "Bus Watchdog"),
            (address::GOAL_PWM, "Goal PWM"),
            (address::GOAL_POSITION, "Goal Position"),
            (address::REALTIME_TICK, "Realtime Tick"),
            (address::PRESENT_PWM, "Present PWM"),
            (address::PRESENT_CURRENT, "Present Current"),
            (address::PRESENT_VELOCITY, "Present Velocity"),
            (address::PRESENT_POSITION, "Present Position"),
            (address::PRESENT_INPUT_VOLTAGE, "Present Input Voltage"),
            (address::PRESENT_TEMPERATURE, "Present Temperature"),
        ] {
            assert_eq!(register(name).map(|r| r.address), Some(address), "{name}");
        }
    }

    #[test]
    fn indirect_registers_are_two_blocks() {
        assert_eq!(indirect(1), Some((168, 224)));
        assert_eq!(indirect(28), Some((222, 251)));
        assert_eq!(indirect(29), Some((578, 634)));
        assert_eq!(indirect(56), Some((632, 661)));
        assert_eq!((indirect(0), indirect(57)), (None, None));
        assert_eq!(TABLE_BYTES, 662);
    }

    #[test]
    fn counts_become_si_units() {
        assert_eq!(angle_rad(2048), 0.0);
        // 166 and 2079 are the positions of the manual's examples: 0.087890625 degree each.
        assert!((angle_rad(2079).to_degrees() - 31.0 * 0.087_890_625).abs() < 1e-12);
        assert!((angle_rad(0) + PI).abs() < 1e-12);
        assert!((velocity_rad_s(-100) + 2.398_08).abs() < 1e-4);
        assert!((Model::of(1030).unwrap().current_unit_a().unwrap() - 0.00269).abs() < 1e-12);
        assert_eq!(Model::of(1060).unwrap().current_unit_a(), None);
        // Of the others only that their angles are those of the table is known.
        for (number, name) in [(1110, "XH540-W150"), (1240, "XC330-M288")] {
            let model = Model::of(number).unwrap();
            assert_eq!((model.name, model.current_unit_a()), (name, None));
        }
        assert_eq!(Model::of(311), None, "an MX-64 has no bus watchdog");
        assert!((pwm_share(885) - 1.0).abs() < 1e-3);
        assert!((volts(121) - 12.1).abs() < 1e-12);
    }

    #[test]
    fn a_hardware_error_is_said_in_words() {
        for (bits, words) in [
            (0x00, "none"),
            (0x01, "input voltage"),
            (0x24, "overheating, overload"),
            (0x02, "a bit the data sheet does not list"),
        ] {
            assert_eq!(HardwareError(bits).to_string(), words);
        }
    }
}
