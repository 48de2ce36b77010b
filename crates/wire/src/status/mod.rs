//! The status report: what a STATUS message holds, and what the control socket answers to `{"cmd":"status"}`.
//!
//! The daemon fills these, and programs parse them: `serde_json::from_slice::<Status>(text)`. A key
//! that a daemon does not send has its default; one that is not known here is passed over. Counts
//! are those since the daemon's start; a key is a count if its type is `u64`.

mod conditioning;
mod joints;
mod report;

pub use conditioning::ConditioningStatus;
pub use joints::{AllegroStatus, AnalogueStatus, JointStatus, JointsStatus, ServoStatus, ServosStatus};
pub use report::{Key, Report};

use report::report;
use serde::{Deserialize, Deserializer, Serialize};
use taxel_hand::Profile;

report! {
    /// Everything the daemon knows of itself and of the hand.
    Status {
        /// The daemon's version.
        version: String,
        /// Seconds since its start.
        uptime_s: f64,
        /// Name of the layout.
        layout: String,
        /// When images are made.
        tick: TickStatus,
        /// What became of them.
        images: ImagesStatus,
        /// Whether images show no contact because somebody asked for that.
        paused: bool,
        /// Whether the baseline is being measured.
        calibrating: bool,
        /// Contact threshold, in the unit of the forces.
        threshold: f64,
        /// Taxels in contact.
        contacts: usize,
        /// Taxels without a usable value.
        missing: usize,
        /// Taxels out of use for another reason.
        faulty: usize,
        /// What conditioning made of their counts.
        conditioning: ConditioningStatus,
        /// The display profile of whoever states none.
        #[serde(deserialize_with = "known_profile")]
        profile: Profile,
        /// The profiles that images are made for.
        profiles: Vec<ProfileStatus>,
        /// What these may take of a tick.
        profile_budget: ProfilesBudget,
        /// What is wrong.
        problems: Vec<ProblemStatus>,
        /// One entry per bus of the layout.
        buses: Vec<BusStatus>,
        /// One entry per module of the layout that has a board.
        boards: Vec<BoardStatus>,
        /// The joints; null where none are read.
        joints: Option<JointsStatus>,
        /// The taxels out of use.
        faults: Vec<TaxelStatus>,
        /// The taxels in use that are at an end of their range in the newest frame; the reason is `saturated`.
        saturated: Vec<TaxelStatus>,
        /// The connections to the control sockets.
        control: ControlStatus,
        /// Who is connected.
        subscribers: Vec<SubscriberStatus>,
    }

    /// The connections to both control sockets.
    ControlStatus {
        /// How many there are.
        clients: usize,
        /// How many lost their place to a new one, idle for longest.
        made_room: u64,
        /// Requests that had to wait because their client asks more often than it may.
        slowed: u64,
    }

    /// When images are made.
    TickStatus {
        /// `timer` or `sweep`.
        mode: String,
        /// Images per second in timer mode.
        rate_hz: f64,
    }

    /// What became of the images.
    ImagesStatus {
        /// Images made.
        made: u64,
        /// Images per second over the last second or so.
        rate_hz: f64,
        /// Ticks given up because the daemon was held up.
        overruns: u64,
        /// Images that could not be handed over.
        unpublished: u64,
        /// From a tick's newest reading until its images were handed over to the thread that sends
        /// them, microseconds.
        latency_us: QuantileStatus,
        /// The same as a histogram, of which differences can be taken: rows of microseconds and the ticks that took
        /// up to that and more than the row before.
        latencies: Vec<(u64, u64)>,
        /// What all of them add up to, microseconds.
        latency_sum_us: u64,
        /// From when a tick was due until its images were handed over to the thread that sends
        /// them, microseconds.
        lateness_us: QuantileStatus,
        /// The same as a histogram, as `latencies`.
        latenesses: Vec<(u64, u64)>,
        /// What all of them add up to, microseconds.
        lateness_sum_us: u64,
        /// The jitter of the tick: the part of its lateness until the tick thread began with it, microseconds.
        jitter_us: QuantileStatus,
        /// The same as a histogram, as `latencies`.
        jitters: Vec<(u64, u64)>,
        /// What all of them add up to, microseconds.
        jitter_sum_us: u64,
        /// The part of a tick's lateness from then on, which is what its images take, microseconds.
        duration_us: QuantileStatus,
        /// The same as a histogram, as `latencies`.
        durations: Vec<(u64, u64)>,
        /// What all of them add up to, microseconds.
        duration_sum_us: u64,
        /// What became of them after that, for all subscribers together.
        sent: SentStatus,
        /// How long it took in the last half to whole minute.
        recent: RecentStatus,
    }

    /// The times of the last half to whole minute; those above are since the start.
    RecentStatus {
        /// As `images.lateness_us`, microseconds.
        lateness_us: QuantileStatus,
        /// As `images.sent.age_us`, microseconds; zeros where nobody was sent any.
        age_us: QuantileStatus,
    }

    /// Images that all subscribers were sent since the start, those that are gone included.
    SentStatus {
        /// How many are connected now.
        subscribers: usize,
        /// Images they were sent.
        images: u64,
        /// Images that were made while one of them asked for images, and that it was not sent, nor will be, since it was too
        /// slow for them.
        skipped: u64,
        /// The same of images that came too soon for the `max_rate_hz` that it asked for.
        paced: u64,
        /// From when an image was due until it was sent, microseconds.
        age_us: QuantileStatus,
        /// The same as a histogram, of which differences can be taken: rows of an age in microseconds
        /// and the images up to that age and above that of the row before.
        ages: Vec<(u64, u64)>,
        /// What all of them add up to, microseconds.
        age_sum_us: u64,
        /// The longest that one of them was without an image between two, milliseconds; those that go on included.
        longest_gap_ms: f64,
    }

    /// How long something takes.
    QuantileStatus {
        /// Median.
        p50: f64,
        /// 99 of 100 take less.
        p99: f64,
        /// 999 of 1000 take less.
        p999: f64,
        /// The longest.
        max: f64,
    }

    /// One thing that is wrong.
    ProblemStatus {
        /// Its kind, which programs go by.
        kind: String,
        /// The bus it is on; null for joints and for the daemon itself.
        bus: Option<String>,
        /// The address of the board it is about.
        board: Option<u8>,
        /// The module of that board; of a hub, the first.
        module: Option<String>,
        /// All modules of that board.
        modules: Vec<String>,
        /// The joint it is about.
        joint: Option<String>,
        /// Whether it is an error, and not only a warning.
        severe: bool,
        /// What is wrong and what to do.
        sentence: String,
        /// Seconds since it came.
        since_s: f64,
    }

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

    /// One display profile that images are made for.
    ProfileStatus {
        /// Its number, never used twice.
        id: u32,
        /// Whether it is that of whoever states none.
        own: bool,
        /// What the display can do.
        #[serde(deserialize_with = "known_profile")]
        profile: Profile,
        /// The parts of the hand it shows; null for all.
        region: Option<Vec<String>>,
        /// How many are shown it.
        subscribers: usize,
        /// Images made.
        images: u64,
        /// What an image takes.
        cost_us: CostStatus,
    }

    /// Time that a profile's images take, microseconds.
    CostStatus {
        /// Median.
        p50: f64,
        /// 99 of 100 take less.
        p99: f64,
        /// What is set aside.
        reserved: f64,
    }

    /// What is set aside for all profiles and what they take of it.
    ProfilesBudget {
        /// Most profiles at once.
        max: usize,
        /// Time between two images, microseconds.
        tick_us: f64,
        /// What is set aside of it, microseconds.
        budget_us: f64,
        /// What the profiles there are take, microseconds.
        spent_us: f64,
    }

    /// One subscriber.
    SubscriberStatus {
        /// Its process, where the system tells.
        pid: Option<i32>,
        /// Its user, where the system tells.
        uid: Option<u32>,
        /// Seconds since it connected.
        connected_s: f64,
        /// Images it was sent.
        images: u64,
        /// Images that were made while it asked for images, and that it was not sent, nor will be, since it was too slow for
        /// them.
        skipped: u64,
        /// The same of images that came too soon for the `max_rate_hz` that it asked for.
        paced: u64,
        /// Whether it is sent raw frames.
        raw: bool,
        /// Raw frames it was sent.
        raw_frames: u64,
        /// Raw frames that were made while it asked for them, and that it was not sent, nor will be, since it was too slow
        /// for them.
        raw_skipped: u64,
        /// The same of raw frames that came too soon for the `max_rate_hz` that it asked for.
        raw_paced: u64,
        /// Whether it is sent every message in order, and not only the newest.
        every: bool,
        /// Number of the display profile it is shown.
        profile: u32,
        /// From when an image was due until this one was sent it, microseconds. Where it takes every
        /// image or asked for a lower rate, the time that images waited for that is in it.
        age_us: QuantileStatus,
        /// The longest that it was without an image between two, milliseconds; that which goes on included.
        longest_gap_ms: f64,
    }
}

/// Of JSON that was read already. It is here, and not with those who need it, so that it is compiled once.
impl TryFrom<serde_json::Value> for Status {
    type Error = serde_json::Error;

    fn try_from(json: serde_json::Value) -> Result<Self, serde_json::Error> {
        serde_json::from_value(json)
    }
}

/// A profile without the keys that only later versions have, which a configuration must not have.
fn known_profile<'de, D: Deserializer<'de>>(from: D) -> Result<Profile, D::Error> {
    use serde::de::Error;
    let mut keys = serde_json::Map::deserialize(from)?;
    loop {
        match serde_json::from_value(keys.clone().into()) {
            Ok(profile) => return Ok(profile),
            Err(error) => {
                let text = error.to_string();
                let unknown = text
                    .strip_prefix("unknown field `")
                    .and_then(|rest| rest.split('`').next());
                if unknown.and_then(|key| keys.remove(key)).is_none() {
                    return Err(D::Error::custom(text));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn what_a_daemon_of_another_version_sends_is_parsed() {
        let status: Status = serde_json::from_value(json!({
            "layout": "uskin-module", "moods": [1], "profile": { "levels": 4, "moods": 1 },
            "buses": [{ "name": "can0", "moods": 1 }],
        }))
        .unwrap();
        assert_eq!(
            (status.layout.as_str(), status.profile.levels),
            ("uskin-module", 4)
        );
        assert_eq!(
            (status.buses[0].name.as_str(), status.buses[0].received),
            ("can0", 0)
        );
        assert_eq!((status.joints, status.version.as_str()), (None, ""));
    }
}
