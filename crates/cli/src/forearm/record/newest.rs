//! The newest joint angles and tactile image that the daemon sends, kept by a thread.

use super::super::angles::JointAngles;
use super::super::touch::TactileFinger;
use crate::client::hands;
use anyhow::{Context, bail};
use std::path::Path;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use taxel_wire::{Received, Subscribe, Subscriber};

/// The newest frame's joints.
#[derive(Debug, Clone)]
pub(super) struct Joints {
    /// The frame's instant on the daemon's clock, nanoseconds.
    pub(super) t_ns: u64,
    pub(super) angles: JointAngles,
    /// The tactile image, where the hand has such a finger and it is felt.
    pub(super) image: Option<Vec<u16>>,
    came: Instant,
}

/// What is known of the stream.
#[derive(Debug, Default)]
struct State {
    joints: Option<Joints>,
    /// Whether the hand has a tactile finger.
    has_touch: bool,
    ended: Option<String>,
}

/// What the thread that reads and whoever waits share.
#[derive(Debug, Default)]
struct Shared {
    state: Mutex<State>,
    news: Condvar,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn change(&self, change: impl FnOnce(&mut State)) {
        change(&mut self.lock());
        self.news.notify_all();
    }

    /// Waits for another frame than that of this time, or for the end, at most so long.
    fn wait_for_another(&self, t_ns: Option<u64>, timeout: Duration) {
        let is_same = |state: &mut State| {
            state.ended.is_none() && state.joints.as_ref().map(|joints| joints.t_ns) == t_ns
        };
        drop(self.news.wait_timeout_while(self.lock(), timeout, is_same));
    }
}

/// The thread that reads frames.
#[derive(Debug)]
pub(super) struct Newest(Arc<Shared>);

/// A daemon that sends no frame for so long is no help.
const STALE: Duration = Duration::from_secs(1);
const FIRST: Duration = Duration::from_secs(5);
/// A machine that stands still for a moment makes one of these long.
const INTERVALS: usize = 3;

impl Newest {
    /// Subscribes to a daemon, and waits for its first frame.
    pub(super) fn start(socket: &Path) -> anyhow::Result<Self> {
        let mut subscriber = Subscriber::connect(socket).map_err(|error| hands::told(error.into()))?;
        subscriber.subscribe(&Subscribe {
            image: false,
            raw: true,
            ..Subscribe::default()
        })?;
        let newest = Self(Arc::default());
        let state = newest.0.clone();
        std::thread::Builder::new().name("frames".into()).spawn(move || {
            let mut finger = None;
            loop {
                let joints = match subscriber.next() {
                    Ok(Received::Hello(hello)) => {
                        finger = TactileFinger::find(hello);
                        state.change(|state| state.has_touch = finger.is_some());
                        continue;
                    }
                    Ok(Received::Raw(header, raw)) => {
                        let mut image = Vec::new();
                        let is_felt = finger
                            .as_ref()
                            .is_some_and(|finger| finger.image(&raw, &mut image));
                        Joints {
                            t_ns: header.t_ns,
                            angles: JointAngles::of(&raw),
                            image: is_felt.then_some(image),
                            came: Instant::now(),
                        }
                    }
                    Ok(_) => continue,
                    Err(error) => {
                        state.change(|state| state.ended = Some(error.to_string()));
                        return;
                    }
                };
                state.change(|state| state.joints = Some(joints));
            }
        })?;
        newest.0.wait_for_another(None, FIRST);
        newest.joints().context("the daemon sends no frames")?;
        Ok(newest)
    }

    /// Whether the hand has a tactile finger.
    pub(super) fn has_touch(&self) -> bool {
        self.0.lock().has_touch
    }

    /// Those of a frame that is newer than the one of this time, and as wanted; after `patience` of one that is not. Waits for
    /// a newer one, at most a second.
    pub(super) fn after(
        &self,
        t_ns: Option<u64>,
        is_wanted: impl Fn(&Joints) -> bool,
        patience: Duration,
    ) -> anyhow::Result<Joints> {
        let began = Instant::now();
        loop {
            let joints = self.joints()?;
            let is_newer = t_ns.is_none_or(|before| joints.t_ns > before);
            if is_newer && (is_wanted(&joints) || began.elapsed() >= patience) {
                return Ok(joints);
            }
            if !is_newer && began.elapsed() > STALE {
                bail!("the daemon's frames stand still; `taxel status` says why");
            }
            let most = if is_newer { patience } else { STALE };
            self.0
                .wait_for_another(Some(joints.t_ns), most.saturating_sub(began.elapsed()));
        }
    }

    /// The shortest time between two frames among the next few, as soon as it is no longer than `enough`.
    pub(super) fn interval(&self, enough: Duration) -> anyhow::Result<Duration> {
        let mut before_ns = self.joints()?.t_ns;
        let mut shortest = Duration::MAX;
        for _ in 0..INTERVALS {
            let t_ns = self.after(Some(before_ns), |_| true, Duration::ZERO)?.t_ns;
            shortest = shortest.min(Duration::from_nanos(t_ns - before_ns));
            if shortest <= enough {
                break;
            }
            before_ns = t_ns;
        }
        Ok(shortest)
    }

    /// The newest frame's; an error where the daemon has ended or sends nothing.
    pub(super) fn joints(&self) -> anyhow::Result<Joints> {
        let state = self.0.lock();
        if let Some(ended) = &state.ended {
            bail!("{ended}; if it has ended, its log says why");
        }
        match &state.joints {
            Some(joints) if joints.came.elapsed() < STALE => Ok(joints.clone()),
            _ => bail!("no frame has come for {STALE:?}; `taxel status` says why"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn joints(t_ns: u64, age_us: u32) -> Joints {
        Joints {
            t_ns,
            angles: JointAngles::from_iter([(1.0, age_us)]),
            image: None,
            came: Instant::now(),
        }
    }

    #[test]
    fn a_frame_with_angles_of_its_sample_is_waited_for_as_long_as_there_is_patience() {
        let hour = Duration::from_secs(3600);
        for (patience, taken) in [(hour, 4), (Duration::ZERO, 2)] {
            let newest = Newest(Arc::default());
            let put = |t_ns, age_us| newest.0.lock().joints = Some(joints(t_ns, age_us));
            put(2, 300_000);
            // Whoever looks at a frame and does not want it is shown the next one.
            let is_wanted = |joints: &Joints| {
                put(joints.t_ns + 1, if joints.t_ns < 3 { 200_000 } else { 10_000 });
                joints.angles.late_ms(0).is_none()
            };
            assert_eq!(newest.after(Some(1), is_wanted, patience).unwrap().t_ns, taken);
        }
    }
}
