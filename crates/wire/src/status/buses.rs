//! The buses, their boards and taxels.

use super::report::report;
use serde::{Deserialize, Serialize};

report! {
    /// One bus.
    BusStatus {
        /// Its name in the layout.
        name: String,
        /// Its source.
        source: String,
        /// `up`, `down` or `absent`.
        link: String,
        /// State of its controller: `error-active`, `error-warning`, `error-passive` or `bus-off`.
        state: String,
        /// How often the state of the controller changed.
        state_changes: u64,
        /// Error counters of the controller.
        error_counters: ErrorCounterStatus,
        /// Frames per second.
        frames_hz: f64,
        /// Load of a bus of 1 Mbit/s, without stuff bits, 0 to 100.
        load_percent: f64,
        /// The same with as many stuff bits as there can be.
        load_percent_most: f64,
        /// Kinds of the problems of the bus.
        problems: Vec<String>,
        /// Frames received.
        received: u64,
        /// Frames with readings of boards. What became of these readings is in `used`, `duplicate`, `late` and
        /// `settling`, which count taxels.
        readings: u64,
        /// Readings that renewed a taxel.
        used: u64,
        /// Frames that belong to no board and no joint of the layout.
        unknown: u64,
        /// Remote and error frames.
        not_data: u64,
        /// Commands to boards, seen on the bus.
        commands: u64,
        /// Frames of joints.
        joints: u64,
        /// Frames that are a part of a packet.
        partial: u64,
        /// Packets that never came whole.
        abandoned: u64,
        /// Frames with a taxel's id and another length or content.
        malformed: u64,
        /// How often boards threw their transmit queue away.
        queue_overflows: u64,
        /// Readings that came again within half a board period.
        duplicate: u64,
        /// Readings that came after the image that should have had them.
        late: u64,
        /// Readings that came while their board was starting.
        settling: u64,
        /// Frames that the kernel dropped before the daemon read them.
        lost_in_kernel: u64,
        /// Datagrams or lines that were no frame.
        undecodable: u64,
        /// CAN FD frames among the undecodable ones.
        can_fd: u64,
        /// How often the source was opened anew.
        reopens: u64,
        /// How often the link was lost.
        link_losses: u64,
        /// Frames sent.
        sent: u64,
        /// Frames that could not be sent.
        send_failures: u64,
        /// How often the time of a recording jumped and was not taken as it stands there.
        clock_jumps: u64,
        /// Remote frames.
        remote: u64,
        /// Error frames, by cause.
        errors: ErrorFrameStatus,
        /// What came to the socket of a pressure array; null for a bus.
        array: Option<ArrayStatus>,
    }

    /// What came to the socket of a pressure array, in messages.
    ArrayStatus {
        /// Taken.
        taken: u64,
        /// Never came, by their sequence.
        lost: u64,
        /// Taken, and measured more than a quarter of a second before.
        late: u64,
        /// How often the sequence began anew, or went back.
        restarts: u64,
        /// Refused: no message of a pressure array.
        foreign: u64,
        /// Refused: of another version.
        version: u64,
        /// Refused: of other rows or columns.
        size: u64,
        /// Refused: fewer or more counts than its rows and columns have.
        torn: u64,
    }

    /// Error counters of a controller.
    ErrorCounterStatus {
        /// Of sending.
        tx: u8,
        /// Of receiving.
        rx: u8,
    }

    /// Error frames of one bus, by cause. One frame may have several.
    ErrorFrameStatus {
        /// All of them.
        frames: u64,
        /// A frame could not be sent in time.
        tx_timeout: u64,
        /// A sender was overtaken by a more important frame, which is no error.
        lost_arbitration: u64,
        /// Something of the controller.
        controller: u64,
        /// The controller's queue was full.
        controller_overflow: u64,
        /// A frame was broken.
        protocol: u64,
        /// Something of the transceiver.
        transceiver: u64,
        /// Nobody acknowledged a frame.
        no_acknowledge: u64,
        /// The controller has left the bus.
        bus_off: u64,
        /// The bus has an error.
        bus_error: u64,
        /// The controller was restarted.
        restarted: u64,
    }

    /// The board of one module.
    BoardStatus {
        /// Name of the module.
        module: String,
        /// Its bus.
        bus: String,
        /// Its address.
        board: u8,
        /// Whether it speaks: `unheard`, `settling`, `living` or `silent`.
        state: String,
        /// Kinds of its problems.
        problems: Vec<String>,
        /// Readings that renewed a taxel.
        used: u64,
        /// Frames with a taxel's id and another length or content.
        malformed: u64,
        /// How often the board threw its transmit queue away.
        queue_overflows: u64,
        /// Readings that came again within half a period.
        duplicate: u64,
        /// Readings that came after the image that should have had them.
        late: u64,
        /// Readings that were not in their sweep; those that came in the one behind are also in `duplicate`.
        missed: u64,
        /// Readings that came while the board was starting.
        settling: u64,
        /// Sweeps that have ended.
        sweeps: u64,
        /// Readings whose status reports an error.
        status_errors: u64,
        /// How often the board fell silent.
        silences: u64,
        /// How often the board was started because it was silent.
        restarts: u64,
        /// How often the board calibrated itself anew.
        recalibrations: u64,
        /// Time between two sweeps; null until it is known.
        period_ms: Option<f64>,
        /// Since when it was not heard; null if it never was.
        silent_ms: Option<u64>,
    }

    /// One taxel out of use, or in use and at an end of its range.
    TaxelStatus {
        /// Its index.
        taxel: usize,
        /// Its module.
        module: String,
        /// Its number in the module.
        k: u16,
        /// Why.
        reasons: Vec<String>,
    }
}
