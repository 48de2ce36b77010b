//! What is wrong with a `[joints]` table, told with the key and the numbers.

use std::path::PathBuf;
use taxel_can::AddressError;
use taxel_hand::RangeError;

/// Most joints one daemon reads.
pub const MAX_JOINTS: usize = 64;

/// How each kind of source is written.
pub(crate) const SOURCE_FORMS: [&str; 2] = ["dynamixel:DEVICE", "allegro:INTERFACE"];

/// Why a text names no source of joint angles.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum JointSourceError {
    /// Neither of the known beginnings.
    #[error(
        "`{0}` is no source of joint angles: write {forms}, such as dynamixel:/dev/ttyUSB0 or allegro:can2",
        forms = SOURCE_FORMS.join(" or ")
    )]
    Unknown(String),
    /// `dynamixel:` alone.
    #[error("`dynamixel:` needs the serial device behind it, such as dynamixel:/dev/ttyUSB0")]
    NoDevice,
    /// What stands behind `allegro:` is no CAN source.
    #[error("behind `allegro:` {0}")]
    Bus(#[from] AddressError),
}

/// A value of the `[joints]` table that makes no sense.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum JointsConfigError {
    /// A number outside its range.
    #[error(transparent)]
    Range(#[from] RangeError),
    /// No servo, or too many.
    #[error(
        "joints has {0} [[joints.servo]] tables; source dynamixel needs 1 to {MAX_JOINTS}, one per joint with its id and name"
    )]
    ServoCount(usize),
    /// Two servos with one id.
    #[error("joints: servo id {id} is given to both {first} and {second}; each servo on a bus needs its own")]
    SameId {
        /// The id.
        id: u8,
        /// A joint.
        first: String,
        /// Another joint.
        second: String,
    },
    /// A joint without a name of its own that can be read.
    #[error("joints: servo {id} has the name {name:?}, which is {why}; each joint needs its own")]
    Name {
        /// The servo.
        id: u8,
        /// Its name.
        name: String,
        /// Why it cannot be.
        why: &'static str,
    },
    /// Not a direction.
    #[error(
        "joints: servo {id} has direction = {direction}; write 1, or -1 if the joint turns the other way"
    )]
    Direction {
        /// The servo.
        id: u8,
        /// What it says.
        direction: i8,
    },
    /// The bus watchdog counts in steps of 20 ms.
    #[error("joints.watchdog_ms = {0} is no multiple of 20, the step of the servo's bus watchdog")]
    WatchdogStep(u16),
    /// Servos that would stop between two cycles.
    #[error(
        "joints.watchdog_ms = {watchdog_ms} is shorter than two cycles at rate_hz = {rate_hz}: motors would stop by themselves; make it longer, or read faster"
    )]
    WatchdogShort {
        /// The watchdog's time.
        watchdog_ms: u16,
        /// Cycles per second.
        rate_hz: f64,
    },
    /// Servos that would stop while another one is waited for.
    #[error(
        "joints.watchdog_ms = {watchdog_ms} is shorter than joints.answer_margin_ms = {answer_margin_ms} and a cycle of {cycle_ms} ms and {wire_ms:.1} ms on the wire at {baud} bit/s: motors would stop by themselves, at the latest while a servo is silent; it is to be {least_ms} or more (2540 is the most), or the margin shorter, or the bus faster"
    )]
    WatchdogMargin {
        /// The watchdog's time.
        watchdog_ms: u16,
        /// How long an answer is waited for.
        answer_margin_ms: f64,
        /// From one cycle to the next.
        cycle_ms: f64,
        /// The shortest that is long enough.
        least_ms: u32,
        /// What all answers take on the wire.
        wire_ms: f64,
        /// Bits per second.
        baud: u32,
    },
    /// No potentiometer.
    #[error(
        "joints.analogue has no [[joints.analogue.joint]] tables; write one per joint with its name and channel"
    )]
    NoPotentiometer,
    /// Ends of a converter that are none.
    #[error(
        "joints.analogue.ends = [{low}, {high}]: write the lowest and the highest count that the converter gives"
    )]
    ConverterEnds {
        /// The first.
        low: f64,
        /// The second.
        high: f64,
    },
    /// Two points for one count give no line.
    #[error("joints.analogue: both counts of {name} are {counts}; write two for which the angle is known")]
    SameCounts {
        /// The joint.
        name: String,
        /// Its counts.
        counts: f64,
    },
    /// Not a name that a line can have.
    #[error(
        "joints.analogue: \"{0}\" is no channel; write its place in the line from 0, or a name of letters and digits"
    )]
    ChannelName(String),
    /// Two joints with one channel.
    #[error(
        "joints.analogue: channel {channel} is given to both {first} and {second}; each joint needs its own"
    )]
    SameChannel {
        /// The channel.
        channel: String,
        /// A joint.
        first: String,
        /// Another joint.
        second: String,
    },
    /// A joint of the potentiometers without a name of its own that can be read.
    #[error("joints.analogue: the name {name:?} is {why}; each joint needs its own")]
    AnalogueName {
        /// The name.
        name: String,
        /// Why it cannot be.
        why: &'static str,
    },
    /// Potentiometers at the device that the servos are at.
    #[error(
        "joints.analogue: device = {0:?} is the servos' own; potentiometers come over a device of theirs"
    )]
    AnalogueDevice(PathBuf),
    /// More joints than one daemon reads.
    #[error("there are {0} joints; one daemon reads at most {MAX_JOINTS}")]
    TooMany(usize),
    /// A key or table of another kind of source.
    #[error("joints: {key} has no meaning with source {source_kind}; leave it out")]
    OfAnotherSource {
        /// The key or table.
        key: &'static str,
        /// The kind of source.
        source_kind: &'static str,
    },
    /// An Allegro hand whose version is not said.
    #[error("joints: source allegro needs a table [joints.allegro] with version = 1, 2, 3, 4 or 5")]
    NoAllegro,
    /// Not a version of the hand.
    #[error("joints.allegro.version = {0}; there are versions 1 to 5")]
    AllegroVersion(u8),
    /// Not a direction.
    #[error("joints.allegro.enc_dir[{joint}] = {value}; write 1 or -1")]
    EncoderDirection {
        /// The joint, 0 to 15.
        joint: usize,
        /// What it says.
        value: i8,
    },
}
