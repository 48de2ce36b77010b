//! The status report: what a STATUS message holds, and what the control socket answers to `{"cmd":"status"}`.
//!
//! The daemon fills these, and programs parse them: `serde_json::from_slice::<Status>(text)`. A key
//! that a daemon does not send has its default; one that is not known here is passed over. Counts
//! are those since the daemon's start; a key is a count if its type is `u64`.

mod buses;
mod conditioning;
mod images;
mod joints;
mod report;

pub use buses::{ArrayStatus, BoardStatus, BusStatus, ErrorCounterStatus, ErrorFrameStatus, TaxelStatus};
pub use conditioning::ConditioningStatus;
pub use images::{ImagesStatus, QuantileStatus, RecentStatus, SentStatus, TickStatus};
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
