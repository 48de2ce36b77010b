//! The robot hand's skin: its layout, the boards' protocols, sweep assembly and conditioning.
//!
//! | stage | in | out | here |
//! |---|---|---|---|
//! | layout | a file, or a name | [`Layout`]: where taxels sit, how boards are wired | `layout/` |
//! | protocols | | [`Protocol`]: how a kind of board speaks | `protocol/`, a folder per kind |
//! | decoding | CAN frames of a bus | [`Readings`] | [`Decoder`] |
//! | boards | what is heard, and the time | commands to boards: [`BoardSupervisor`], [`Discovery`] | `boards/` |
//! | the bus | CAN frames, readings | what is wrong with it: [`BusMonitor`] | `bus_monitor/` |
//! | sweep assembly | readings | [`taxel_hand::TactileFrame`] | `sweep/`: [`SweepAssembler`] |
//! | conditioning | tactile frames | [`taxel_hand::ForceFrame`] | `condition/`: [`Conditioner`] |
//! | recognition | frames of unknown buses | a layout file: [`Recogniser`] | `recognise/` |
//!
//! No stage holds a clock or a bus: frames and times come in as arguments, so that a recording
//! replays to the bit. Only [`Layout::load`] and [`Layout::resolve`] read a file.

mod board_account;
mod board_status;
mod boards;
mod bus_monitor;
mod condition;
mod decoder;
mod discovery;
mod layout;
mod protocol;
mod range;
mod reading;
mod recognise;
mod sweep;

// Layout
pub use layout::{Layout, LayoutError, LayoutProblem, Wiring, read_text_file};

// Protocols, and what each of them has of its own
pub use protocol::cpm_finger::decode::cpm_finger_frames;
pub use protocol::cyskin::packet::{CyskinPacketError, cyskin_frames};
pub use protocol::cyskin::setup::{
    ByteOrder, Checksum, CommandsTo, CyskinHub, CyskinPacket, CyskinSetup, HubIds,
};
pub use protocol::icub::decode::{ICUB_NO_ACK, ICUB_NOT_CONNECTED, ICUB_OUT_OF_RANGE, icub_triangle_data};
pub use protocol::icub::setup::IcubSetup;
pub use protocol::icub::start::{ICUB_CALIBRATION_MS, icub_configuration};
pub use protocol::mtb::{BoardKind, MtbCommand};
pub use protocol::{Measures, Mtb, Protocol};

// Decoding
pub use decoder::{BusCounters, Decoded, Decoder};
pub use reading::{MAX_READINGS, Readings, STATUS_ERROR, TaxelReading};

// Boards: starting them, who they are, how they fare
pub use board_status::{BoardState, BoardStatus};
pub use boards::{BoardSupervisor, BoardsConfig, BoardsMode, OutgoingCommand};
pub use discovery::{
    AlreadyStarted, BusTraffic, Discovery, DiscoveryCommand, DiscoveryReport, Firmware, FoundBoard,
};
pub use protocol::commands::TxMode;

// The buses
pub use bus_monitor::{BusLoad, BusMonitor, Finding};

// Sweep assembly
pub use sweep::{Push, SweepAssembler, SweepConfig, stale_after_ns};

// Conditioning
pub use condition::{
    BaselineSource, Calibrated, CalibrationReport, ConditionConfig, ConditionCounters, ConditionError,
    ConditionSettings, Conditioner, FaultRule, MagnitudeMode, Movement, Preset, ThresholdSource,
};

// Recognition of unknown buses
pub use protocol::cyskin::recognise::CyskinGuess;
pub use protocol::recognised::{RecognisedBoard, RecognisedBus};
pub use recognise::{Fit, Recogniser, Recognition};

// Settings
