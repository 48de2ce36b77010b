//! What the log says of the joints: each change once, in words.

use super::JointsView;
use taxel_can::LinkState;
use taxel_joints::bus::{FastState, ServoState};
use taxel_joints::registers::HardwareError;
use taxel_joints::{JointSource, JointsConfig, PortLatency, PortState};

/// How long after a port or a link came up every joint should have been heard, nanoseconds.
const ROLL_CALL_NS: u64 = 2_000_000_000;
/// Return Delay Time from which a cycle takes markedly longer, microseconds.
const LONG_DELAY_US: u16 = 50;

/// How much a sentence matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Weight {
    Info,
    Warn,
    Error,
}

/// What has been said so far.
#[derive(Debug, Default)]
pub(crate) struct Told {
    up: Option<bool>,
    opened: u64,
    roll_call_ns: Option<u64>,
    /// Of each servo or finger: whether it was last said to speak; `None` before anything was said of it.
    speaks: Vec<Option<bool>>,
    errors: Vec<HardwareError>,
    fast: Option<FastState>,
    delays: bool,
}

impl Told {
    /// What is new since the last call.
    pub(crate) fn news(&mut self, config: &JointsConfig, view: &JointsView) -> Vec<(Weight, String)> {
        let mut news = Vec::new();
        match &config.source {
            JointSource::Dynamixel { .. } => self.of_servos(config, view, &mut news),
            JointSource::Allegro { bus } => self.of_hand(&bus.to_string(), view, &mut news),
        }
        news
    }

    fn of_servos(&mut self, config: &JointsConfig, view: &JointsView, news: &mut Vec<(Weight, String)>) {
        let Some((snapshot, port)) = &view.servos else {
            return;
        };
        let path = port.path.display();
        match &port.state {
            PortState::Starting => return,
            PortState::Away { reason, .. } => {
                if self.up != Some(false) {
                    self.up = Some(false);
                    let waits = "images go on, with unknown joint angles";
                    news.push((Weight::Error, format!("joints: {reason}; {waits}")));
                }
                return;
            }
            PortState::Open if self.up == Some(true) && port.opened == self.opened => {}
            PortState::Open => {
                let device = port.device.as_ref().filter(|device| **device != port.path);
                let device = device.map_or(String::new(), |device| format!(" (now {})", device.display()));
                let verb = if port.opened > 1 { "is back" } else { "is open" };
                let baud = config.baud;
                news.push((
                    Weight::Info,
                    format!("joints: {path}{device} {verb} at {baud} bit/s"),
                ));
                if port.opened == 1 {
                    news.extend(
                        port.latency
                            .and_then(|latency| slow_adapter(latency, port.device.as_deref())),
                    );
                }
                self.up = Some(true);
                self.opened = port.opened;
                self.roll_call_ns = Some(view.now_ns + ROLL_CALL_NS);
                self.speaks.clear();
                self.speaks.resize(config.servo.len(), None);
                self.errors.resize(config.servo.len(), HardwareError(0));
            }
        }
        let named: Vec<String> = config
            .servo
            .iter()
            .map(|s| format!("{} (id {})", s.name, s.id))
            .collect();
        let speaks: Vec<bool> = snapshot.servos.iter().map(|s| s.alive).collect();
        self.call(&named, &speaks, "servos answer", view.now_ns, news, |name, speaks| match speaks {
            true => format!("joints: servo {name} answers again"),
            false => format!(
                "joints: servo {name} is silent; check its power and cable. The others go on; it is asked again twice a second"
            ),
        });
        for ((name, before), servo) in named.iter().zip(&mut self.errors).zip(&snapshot.servos) {
            let now = servo.hardware_error.unwrap_or(*before);
            if now != *before {
                *before = now;
                news.push(match now.is_none() {
                    true => (Weight::Info, format!("joints: servo {name} has no hardware error any more")),
                    false => (
                        Weight::Error,
                        format!(
                            "joints: servo {name} reports a hardware error: {now}. It holds its motor off until it is rebooted; its angles go on"
                        ),
                    ),
                });
            }
        }
        if self.fast != Some(snapshot.fast) && snapshot.fast != FastState::Probing {
            let first = self.fast.replace(snapshot.fast).is_none();
            match snapshot.fast {
                FastState::On if first => {
                    news.push((
                        Weight::Info,
                        "joints: all servos answer in one packet (fast sync read)".into(),
                    ));
                }
                FastState::NotSupported => news.push((
                    Weight::Info,
                    "joints: not every servo knows fast sync read; each answers with its own packet".into(),
                )),
                _ => {}
            }
        }
        if !self.delays && self.roll_call_ns.is_none() {
            self.delays = true;
            news.extend(long_delays(&named, &snapshot.servos));
        }
    }

    fn of_hand(&mut self, bus: &str, view: &JointsView, news: &mut Vec<(Weight, String)>) {
        let up = view.tick.link == LinkState::Up;
        if self.up != Some(up) {
            self.up = Some(up);
            if up {
                news.push((Weight::Info, format!("joints: the hand's bus {bus} is up")));
                self.roll_call_ns = Some(view.now_ns + ROLL_CALL_NS);
                self.speaks.clear();
                self.speaks.resize(4, None);
            } else {
                let link = view.tick.link;
                news.push((
                    Weight::Warn,
                    format!("joints: the hand's bus {bus} is {link}; waiting for it. Images go on, with unknown joint angles"),
                ));
            }
        }
        if !up {
            return;
        }
        let names = ["index", "middle", "ring", "thumb"].map(String::from);
        let speaks: Vec<bool> = (0..4)
            .map(|finger| view.finger_speaks(finger) == Some(true))
            .collect();
        self.call(&names, &speaks, "fingers send their angles", view.now_ns, news, |name, speaks| match speaks {
            true => format!("joints: the hand's {name} finger sends its angles again"),
            false => format!(
                "joints: the hand's {name} finger sends no angles; is the program that controls the hand running?"
            ),
        });
    }

    /// Says who fell silent and who came back, and, some time after the start, who was never heard.
    fn call(
        &mut self,
        names: &[String],
        speaks: &[bool],
        what: &str,
        now_ns: u64,
        news: &mut Vec<(Weight, String)>,
        words: impl Fn(&str, bool) -> String,
    ) {
        for ((name, speaks), before) in names.iter().zip(speaks).zip(&mut self.speaks) {
            match (*before, *speaks) {
                (Some(true), false) => news.push((Weight::Warn, words(name, false))),
                (Some(false), true) => news.push((Weight::Info, words(name, true))),
                (None, false) => continue,
                _ => {}
            }
            *before = Some(*speaks);
        }
        if self.roll_call_ns.take_if(|at| *at <= now_ns).is_none() {
            return;
        }
        let unheard: Vec<&str> = (names.iter().zip(&self.speaks))
            .filter(|(_, speaks)| **speaks != Some(true))
            .map(|(name, _)| name.as_str())
            .collect();
        for speaks in self.speaks.iter_mut().filter(|speaks| speaks.is_none()) {
            *speaks = Some(false);
        }
        let (all, heard) = (names.len(), names.len() - unheard.len());
        news.push(match unheard.is_empty() {
            true => (Weight::Info, format!("joints: all {all} {what}")),
            false => (
                Weight::Warn,
                format!(
                    "joints: {heard} of {all} {what}; not heard: {}. Check power, cable, ids and bit rate",
                    unheard.join(", ")
                ),
            ),
        });
    }
}

/// An adapter that keeps bytes back for so long that cycles are slow.
fn slow_adapter(latency: PortLatency, device: Option<&std::path::Path>) -> Option<(Weight, String)> {
    let ms = latency.ftdi_timer_ms.filter(|ms| *ms > 1)?;
    let name = device?.file_name()?.to_string_lossy().into_owned();
    Some((
        Weight::Warn,
        format!(
            "joints: the FTDI adapter keeps answers back for up to {ms} ms; `echo 1 > /sys/bus/usb-serial/devices/{name}/latency_timer` as root, or the udev rule in the guide, makes it 1 ms"
        ),
    ))
}

fn long_delays(names: &[String], servos: &[ServoState]) -> Option<(Weight, String)> {
    let slow: Vec<String> = (names.iter().zip(servos))
        .filter_map(|(name, servo)| Some((name, servo.identity?.return_delay_us)))
        .filter(|(_, us)| *us > LONG_DELAY_US)
        .map(|(name, us)| format!("{name} {us} us"))
        .collect();
    (!slow.is_empty()).then(|| {
        let text = format!(
            "joints: servos wait before they answer (Return Delay Time, address 9): {}. Set it to 0 with ROBOTIS's tools for faster cycles",
            slow.join(", ")
        );
        (Weight::Warn, text)
    })
}
