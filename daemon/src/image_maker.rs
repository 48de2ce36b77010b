//! What the daemon serves: how a display profile becomes images, and what they cost.

use crate::tick::Shared;
use nix::time::{ClockId, clock_gettime};
use std::sync::Arc;
use std::time::Duration;
use taxel_config::Config;
use taxel_engine::{Display, Frames, RawFrames, TickMode, resolve_region};
use taxel_hand::{ForceFrame, Geometry, Profile};
use taxel_joints::{JointsConfig, MAX_JOINTS};
use taxel_serve::{Cost, DisplayProfile, MadeOutput, Measurement, ProfileMaker};
use taxel_wire::{Clock, Encode, HEADER_LEN, Hello, HelloRate, MAX_MESSAGE};

/// How often each kind of frame is compressed to measure its cost, at most.
const RUNS: usize = 9;
/// After this long no further run is begun, beyond the first of each kind.
const PATIENCE: Duration = Duration::from_millis(100);

/// Makes tactile images of a hand.
pub(crate) struct ImageMaker {
    hand: Geometry,
    /// The description of the hand, for any display.
    hello: Hello,
    period_ns: u64,
    shared: Arc<Shared>,
}

impl ImageMaker {
    pub(crate) fn new(config: &Config, clock: Clock, shared: Arc<Shared>) -> Self {
        Self {
            hand: config.layout.geometry.clone(),
            hello: describe(config, clock),
            period_ns: config.period_ns(),
            shared,
        }
    }

    fn display(&self, wanted: &DisplayProfile) -> Result<Display, String> {
        let region = wanted.region.as_deref();
        Display::new(wanted.profile.clone(), region, &self.hand).map_err(|e| e.to_string())
    }
}

impl ProfileMaker for ImageMaker {
    type Frames = Frames;

    fn hello(&self, wanted: &DisplayProfile) -> Hello {
        Hello {
            profile: (&wanted.profile).into(),
            region: wanted.region.clone(),
            ..self.hello.clone()
        }
    }

    fn output(&self, wanted: &DisplayProfile) -> Result<Option<MadeOutput<Frames>>, String> {
        let payload_len = image_payload_len(&self.hand, &wanted.profile);
        check_message_size(&self.hand, payload_len)?;
        Ok(Some((Box::new(self.display(wanted)?), payload_len)))
    }

    fn measurement(&self, wanted: &DisplayProfile, hopeless_ns: u64) -> Result<Measurement, String> {
        check_message_size(&self.hand, image_payload_len(&self.hand, &wanted.profile))?;
        let display = self.display(wanted)?;
        let shared = self.shared.clone();
        // The snapshot is locked on the measuring thread: a report being made of it at this moment
        // must not hold up the one that sends images.
        Ok(Box::new(move || {
            let newest = {
                let snapshot = shared.snapshot.lock().unwrap_or_else(|e| e.into_inner());
                snapshot.force.clone()
            };
            measure(display, newest, hopeless_ns)
        }))
    }

    fn raw(&self) -> Option<MadeOutput<Frames>> {
        let payload_len = taxel_wire::raw_payload_len(self.hand.len(), MAX_JOINTS);
        Some((Box::new(RawFrames), payload_len))
    }

    fn region(&self, names: &[String]) -> Result<Option<Vec<String>>, String> {
        resolve_region(names, &self.hand).map_err(|e| e.to_string())
    }

    fn period_ns(&self) -> u64 {
        self.period_ns
    }
}

/// Whether images of this profile can be made of a hand and sent. The error is fit for a person.
pub(crate) fn check_profile(hand: &Geometry, profile: &Profile) -> Result<(), String> {
    check_message_size(hand, image_payload_len(hand, profile))?;
    let display = Display::new(profile.clone(), None, hand);
    display.map(drop).map_err(|e| e.to_string())
}

/// Bytes of the largest image payload of a hand and display.
fn image_payload_len(hand: &Geometry, profile: &Profile) -> usize {
    let (levels, actuators) = (profile.level_count().into(), profile.actuators.into());
    taxel_wire::image_payload_len(hand.width, hand.height, levels, actuators, MAX_JOINTS)
}

/// Refuses a hand and display whose messages no subscriber's socket carries. The error is fit for an EVENT.
fn check_message_size(hand: &Geometry, image_len: usize) -> Result<(), String> {
    let raw_len = taxel_wire::raw_payload_len(hand.len(), MAX_JOINTS);
    let bytes = HEADER_LEN + image_len.max(raw_len);
    if bytes <= MAX_MESSAGE {
        return Ok(());
    }
    Err(format!(
        "layout {}: a message of {bytes} bytes is over the {MAX_MESSAGE} that a subscriber's socket carries",
        hand.name
    ))
}

/// HELLO without a display: what is the same for every subscriber.
fn describe(config: &Config, clock: Clock) -> Hello {
    let (mode, hz) = match config.tick.mode {
        TickMode::Timer => ("timer", Some(config.tick.rate_hz)),
        TickMode::Sweep => ("sweep", None),
    };
    let rate = HelloRate {
        mode: mode.into(),
        hz,
    };
    let daemon = concat!("taxeld ", env!("CARGO_PKG_VERSION"));
    Hello {
        force_unit: config.force_unit().into(),
        joints: config
            .joints
            .as_ref()
            .map(JointsConfig::joint_names)
            .unwrap_or_default(),
        ..Hello::new(daemon, &config.layout, &config.profile, rate, clock)
    }
}

/// Measures what a display costs that was made for nothing else: it is left with a memory of frames
/// that never were.
///
/// Time is that of the calling thread on its processor, so that whatever else the machine does is
/// not counted. A display whose first image takes longer than `hopeless_ns` is not measured
/// further.
pub(crate) fn measure(mut display: Display, newest: ForceFrame, hopeless_ns: u64) -> Cost {
    let taxels = newest.force.len();
    let mut payload = Vec::new();
    let mut frames = Frames::new(taxels);
    let mut random = 0x9e37_79b9_7f4a_7c15_u64;
    let mut spent_ns = 0_u64;
    let mut median = |frames: &mut Frames, next: &mut dyn FnMut(&mut ForceFrame)| {
        let mut costs = [0; RUNS];
        let mut runs = 0;
        for cost in &mut costs {
            if runs > 0 && spent_ns > PATIENCE.as_nanos() as u64 {
                break;
            }
            next(&mut frames.force);
            let before_ns = thread_ns();
            // What cannot be encoded is refused for that elsewhere; here it costs what it costs.
            let _ = display.encode(frames, &mut payload);
            *cost = thread_ns().saturating_sub(before_ns);
            spent_ns = spent_ns.saturating_add(*cost);
            runs += 1;
            if *cost > hopeless_ns {
                spent_ns = u64::MAX;
            }
        }
        let costs = &mut costs[..runs];
        costs.sort_unstable();
        costs[runs / 2]
    };

    let worst_ns = median(&mut frames, &mut |force: &mut ForceFrame| {
        for (force, contact) in force.force.iter_mut().zip(&mut force.contact) {
            // xorshift64
            random ^= random << 13;
            random ^= random >> 7;
            random ^= random << 17;
            *force = 1.0 + (random % 20_000) as f64;
            *contact = true;
        }
    });
    if worst_ns > hopeless_ns {
        return Cost {
            worst_ns,
            newest_ns: worst_ns,
        };
    }
    frames.force = newest;
    let newest_ns = median(&mut frames, &mut |_| {});
    Cost { worst_ns, newest_ns }
}

fn thread_ns() -> u64 {
    clock_gettime(ClockId::CLOCK_THREAD_CPUTIME_ID)
        .map_or(0, |t| t.tv_sec() as u64 * 1_000_000_000 + t.tv_nsec() as u64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_hand::Profile;
    use taxel_skin::Layout;

    fn cost(profile: Profile, hopeless_ns: u64) -> Cost {
        let layout = Layout::builtin("allegro-uskin-15").unwrap();
        let display = Display::new(profile, None, &layout).unwrap();
        measure(display, ForceFrame::new(layout.len()), hopeless_ns)
    }

    #[test]
    fn a_display_a_hundred_times_larger_costs_more() {
        let of = |levels, actuators| Profile {
            levels,
            actuators,
            ..Profile::default()
        };
        let (few, many) = (cost(of(2, 2), u64::MAX), cost(of(200, 200), u64::MAX));
        assert!(few.newest_ns > 0, "{few:?}");
        assert!(few.worst_ns < many.worst_ns, "{few:?} {many:?}");
        assert_eq!(many.reserved_ns(), many.worst_ns.max(many.newest_ns));
    }

    #[test]
    fn what_is_hopeless_is_measured_once() {
        let hopeless = cost(Profile::default(), 1);
        assert_eq!(hopeless.newest_ns, hopeless.worst_ns);
    }
}
