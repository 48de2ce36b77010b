//! The robot hand's skin: its layout, the boards' protocols, sweep assembly and conditioning.
//!
//! Nothing here holds a clock, and nothing does I/O but [`Layout::load`] and [`Layout::resolve`], which read a layout
//! file: frames and times come in as arguments, so that a recording replays to the bit.

mod boards;
mod condition;
mod counters;
mod decoder;
mod discovery;
mod layout;
mod period;
mod protocol;
mod reading;
mod recognise;
mod search;
mod start;
mod sweep;
mod sweep_board;
mod sweep_config;
mod watch;

// Other modules say `crate::uskin`.
use protocol::uskin;

pub use boards::{BoardSupervisor, BoardsConfig, BoardsMode, Command, TxMode};
pub use condition::{
    BaselineSource, CalibrationReport, ConditionConfig, ConditionCounters, ConditionError, Conditioner,
    FaultRule, MagnitudeMode, ThresholdSource,
};
pub use counters::{BoardCounters, BoardState, RangeError};
pub use decoder::{BusCounters, Decoded, Decoder, MAX_READINGS, Readings};
pub use discovery::{
    AlreadyStarted, BoardKind, BusTraffic, Discovery, DiscoveryCommand, DiscoveryReport, Firmware, FoundBoard,
};
pub use layout::{Layout, LayoutError, LayoutProblem, Wiring};
pub use protocol::Protocol;
pub use protocol::cpm_finger::cpm_finger_frames;
pub use protocol::cyskin::{
    ByteOrder, Checksum, CyskinHub, CyskinPacket, CyskinPacketError, CyskinSetup, cyskin_frames,
};
pub use protocol::icub::{ICUB_NO_ACK, ICUB_NOT_CONNECTED, ICUB_OUT_OF_RANGE, IcubSetup, icub_triangle_data};
pub use protocol::uskin::{STATUS_ERROR, STATUS_NO_ANSWER, status_is_error};
pub use reading::TaxelReading;
pub use recognise::{CyskinGuess, RecognisedBoard, RecognisedBus, Recogniser, Recognition};
pub use sweep::{Push, SweepAssembler};
pub use sweep_config::SweepConfig;
pub use watch::{BusLoad, Finding, TrafficWatch};
