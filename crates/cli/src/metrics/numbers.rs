//! What the numbers in the status of a bus, a board and a joint are called as metrics, and what they are.

/// A number in a part of the status.
#[derive(Debug, Clone, Copy)]
pub(super) struct Number {
    /// Its key there.
    pub(super) key: &'static str,
    /// Its metric, behind that of the part.
    pub(super) name: &'static str,
    /// What it is.
    pub(super) help: &'static str,
    /// A value of now, times this in the unit of its name; a count since the start where there is none.
    pub(super) scale: Option<f64>,
}

const fn count(key: &'static str, help: &'static str) -> Number {
    Number {
        key,
        name: key,
        help,
        scale: None,
    }
}

const fn now(key: &'static str, scale: f64, name: &'static str, help: &'static str) -> Number {
    Number {
        key,
        name,
        help,
        scale: Some(scale),
    }
}

/// `taxeld_conditioning_NAME`.
pub(super) const CONDITIONING: &[Number] = &[
    count("samples", "Samples of taxels that conditioning took in."),
    count(
        "held",
        "Samples held back until the next one confirms them, since an axis jumped.",
    ),
    count("glitches", "Samples held back, and not confirmed."),
    count("wraps", "Samples in which an axis wrapped around modulo 65536."),
    count(
        "ambiguous_steps",
        "Steps of about half a turn of 65536, taken to go back towards the baseline.",
    ),
    count(
        "corrected_turns",
        "How often a taxel came to rest a turn away from its baseline and was put back.",
    ),
    count(
        "runaways",
        "How often the turns of a taxel had run away beyond any motion and began anew.",
    ),
    count(
        "dead",
        "Samples not used, since they read 0 or 65535 on every axis.",
    ),
    count(
        "status_errors",
        "Samples not used, since their status reports an error.",
    ),
    count(
        "drift_limited",
        "How often the baseline of a taxel had drifted to its limit and followed no further.",
    ),
];

/// `taxeld_bus_NAME`.
pub(super) const BUS: &[Number] = &[
    count("state_changes", "Changes of the state of a bus's controller."),
    now("frames_hz", 1.0, "frames_hertz", "Frames per second on a bus."),
    now(
        "load_percent",
        0.01,
        "load_ratio",
        "Load of a bus of 1 Mbit/s without stuff bits, 1 where it is full.",
    ),
    now(
        "load_percent_most",
        0.01,
        "load_most_ratio",
        "Load of a bus with as many stuff bits as there can be, 1 where it is full.",
    ),
    count("received", "Frames received."),
    count("readings", "Frames with readings of boards."),
    count("used", "Readings that renewed a taxel."),
    count(
        "unknown",
        "Frames that belong to no board and no joint of the layout.",
    ),
    count("not_data", "Remote frames and error frames."),
    count("commands", "Commands to boards that were seen on a bus."),
    count("joints", "Frames of joints."),
    count("partial", "Frames that are a part of a packet."),
    count("abandoned", "Packets that never came whole."),
    count(
        "malformed",
        "Frames with a taxel's id and another length or content.",
    ),
    count(
        "queue_overflows",
        "How often boards of a bus threw their transmit queue away.",
    ),
    count(
        "duplicate",
        "Readings that came again within half a period of their board.",
    ),
    count(
        "late",
        "Readings that came after the image that should have had them.",
    ),
    count("settling", "Readings that came while their board was starting."),
    count(
        "lost_in_kernel",
        "Frames that the kernel dropped before the daemon read them.",
    ),
    count("undecodable", "Datagrams or lines that were no frame."),
    count("can_fd", "CAN FD frames among these."),
    count("reopens", "How often the source of a bus was opened anew."),
    count("link_losses", "How often the link of a bus was lost."),
    count("sent", "Frames that the daemon sent."),
    count("send_failures", "Frames that the daemon could not send."),
    count(
        "clock_jumps",
        "How often the time of a recording jumped and was not taken as it stands there.",
    ),
    count("remote", "Remote frames."),
];

/// `taxeld_bus_error_frame_causes`, by the label `cause`.
pub(super) const ERROR_CAUSES: [&str; 10] = [
    "tx_timeout",
    "lost_arbitration",
    "controller",
    "controller_overflow",
    "protocol",
    "transceiver",
    "no_acknowledge",
    "bus_off",
    "bus_error",
    "restarted",
];

/// `taxeld_board_NAME`.
pub(super) const BOARD: &[Number] = &[
    count("used", "Readings of a board that renewed a taxel."),
    count(
        "malformed",
        "Frames of a board with a taxel's id and another length or content.",
    ),
    count(
        "queue_overflows",
        "How often a board threw its transmit queue away.",
    ),
    count(
        "duplicate",
        "Readings of a board that came again within half a period.",
    ),
    count(
        "late",
        "Readings of a board that came after the image that should have had them.",
    ),
    count("missed", "Readings of a board that never came."),
    count("settling", "Readings of a board that came while it was starting."),
    count("sweeps", "Sweeps of a board over its taxels that have ended."),
    count(
        "status_errors",
        "Readings of a board whose status reports an error.",
    ),
    count("silences", "How often a board fell silent."),
    count("restarts", "How often a board was started because it was silent."),
    count("recalibrations", "How often a board calibrated itself anew."),
    now(
        "period_ms",
        1e-3,
        "period_seconds",
        "Time between two sweeps of a board.",
    ),
];

/// `taxeld_servos_NAME`.
pub(super) const SERVOS: &[Number] = &[
    count("opened", "How often the port of the servos was opened."),
    now(
        "wanted_hz",
        1.0,
        "wanted_hertz",
        "Readings of each servo per second that the configuration asks for.",
    ),
    now(
        "cycle_ms",
        1e-3,
        "cycle_seconds",
        "What the newest reading of all servos took.",
    ),
    count("writes_ok", "Writes to servos that were confirmed."),
    count("writes_failed", "Writes to servos that were not confirmed."),
    count("cycles", "Rounds of reading all servos."),
    count("requests", "Requests sent to servos."),
    count("readings", "Rounds in which all servos were read."),
    count("timeouts", "Answers of servos that did not come in time."),
    count("bad_crc", "Answers of servos that came damaged."),
    count("alerts", "Answers of servos that report a hardware error."),
    count("late", "Answers of servos that came too late."),
    count("double", "Second answers of servos to one request."),
    count(
        "noise_bytes",
        "Bytes on the servos' port that belong to no packet.",
    ),
    count("foreign", "Packets on the servos' port that are somebody else's."),
];

/// `taxeld_allegro_NAME`.
pub(super) const ALLEGRO: &[Number] = &[
    count("malformed", "Frames of the Allegro hand that gave no angle."),
    count("received", "Frames received from the bus of the Allegro hand."),
    count(
        "lost_in_kernel",
        "Frames of the Allegro hand that the kernel dropped.",
    ),
    count(
        "undecodable",
        "Datagrams or lines of the Allegro hand that were no frame.",
    ),
    count(
        "reopens",
        "How often the source of the Allegro hand was opened anew.",
    ),
    count("sent", "Frames sent to the Allegro hand."),
];

/// `taxeld_joint_NAME`.
pub(super) const JOINT: &[Number] = &[
    now(
        "angle_rad",
        1.0,
        "angle_radians",
        "Angle of a joint in the newest image.",
    ),
    now(
        "age_ms",
        1e-3,
        "angle_age_seconds",
        "Age of the angle of a joint.",
    ),
    now(
        "velocity_rad_s",
        1.0,
        "velocity_radians_per_second",
        "Velocity of a servo.",
    ),
    now("current_a", 1.0, "current_amperes", "Current of a servo."),
    now(
        "temperature_c",
        1.0,
        "temperature_celsius",
        "Temperature of a servo.",
    ),
    now("voltage_v", 1.0, "supply_volts", "Supply of a servo."),
    now(
        "return_delay_us",
        1e-6,
        "return_delay_seconds",
        "How long a servo waits before it answers.",
    ),
    count("readings", "Readings of a servo."),
    count("timeouts", "Answers of a servo that did not come in time."),
    count("bad_crc", "Answers of a servo that came damaged."),
    count("alerts", "Answers of a servo that report a hardware error."),
    count("late", "Answers of a servo that came too late."),
    count("double", "Second answers of a servo to one request."),
    count("refused", "Requests that a servo refused."),
];
