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
    /// Whether it was said that fast sync read works, and that it does not.
    fast_told: [bool; 2],
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
                    // The newest reason is that it cannot be opened anew, which says nothing of how it went.
                    let gone = match port.opened {
                        0 => String::new(),
                        _ => format!(
                            "{path} is gone, unplugged or reset by its driver, and is used again as soon as it is back: "
                        ),
                    };
                    let angles = "until then images go on with unknown joint angles";
                    news.push((Weight::Error, format!("joints: {gone}{reason}. {angles}")));
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
            self.fast = Some(snapshot.fast);
            match snapshot.fast {
                FastState::On if !std::mem::replace(&mut self.fast_told[0], true) => {
                    news.push((
                        Weight::Info,
                        "joints: all servos answer in one packet (fast sync read)".into(),
                    ));
                }
                FastState::NotSupported if !std::mem::replace(&mut self.fast_told[1], true) => news.push((
                    Weight::Info,
                    "joints: fast sync read is not answered as it should be; each servo answers with its own packet".into(),
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::joints::JointsSnapshot;
    use taxel_joints::bus::{BusCounters, NoReading, ServoIdentity};
    use taxel_joints::{AllegroConfig, JointSnapshot, PortStatus};

    const S: u64 = 1_000_000_000;

    fn servos(n: u8) -> (JointsConfig, JointsView) {
        let config = JointsConfig::dynamixel("/dev/servos", 1..=n);
        let n = usize::from(n);
        let snapshot = JointSnapshot {
            results: vec![Err(NoReading::NotAsked); n],
            servos: vec![ServoState::default(); n],
            counters: BusCounters::default(),
            fast: FastState::Off,
        };
        let port = PortStatus {
            path: "/dev/servos".into(),
            device: None,
            state: PortState::Starting,
            latency: None,
            opened: 0,
        };
        let view = JointsView {
            now_ns: S,
            tick: JointsSnapshot::new(n),
            servos: Some((snapshot, port)),
        };
        (config, view)
    }

    fn open(view: &mut JointsView, device: &str, latency_ms: u32) {
        let (_, port) = view.servos.as_mut().unwrap();
        port.state = PortState::Open;
        port.device = Some(device.into());
        port.latency = Some(PortLatency {
            low_latency: true,
            ftdi_timer_ms: Some(latency_ms),
        });
        port.opened += 1;
    }

    fn away(view: &mut JointsView) {
        let (snapshot, port) = view.servos.as_mut().unwrap();
        port.state = PortState::Away {
            reason: "No such file".into(),
            since_ns: 0,
        };
        for servo in &mut snapshot.servos {
            servo.alive = false;
        }
    }

    fn servo(view: &mut JointsView, joint: usize) -> &mut ServoState {
        &mut view.servos.as_mut().unwrap().0.servos[joint]
    }

    /// What is said at this moment: each sentence must hold its words, in order, and there must be no other.
    #[track_caller]
    fn says(told: &mut Told, config: &JointsConfig, view: &JointsView, sentences: &[&[&str]]) {
        let news = told.news(config, view);
        assert_eq!(news.len(), sentences.len(), "{news:#?}");
        for ((_, text), words) in news.iter().zip(sentences) {
            for word in *words {
                assert!(text.contains(word), "`{word}` in {text}");
            }
        }
        assert_eq!(told.news(config, view), [], "said twice");
    }

    #[test]
    fn a_port_that_goes_and_returns_and_those_behind_it_are_told_once() {
        let (config, mut view) = servos(2);
        let mut told = Told::default();
        says(&mut told, &config, &view, &[]);
        open(&mut view, "/dev/ttyUSB0", 16);
        let slow = ["16 ms", "/sys/bus/usb-serial/devices/ttyUSB0/latency_timer"];
        says(
            &mut told,
            &config,
            &view,
            &[
                &["/dev/servos (now /dev/ttyUSB0) is open at 1000000 bit/s"],
                &slow,
            ],
        );
        servo(&mut view, 0).alive = true;
        says(&mut told, &config, &view, &[]);
        view.now_ns += 2 * S;
        says(
            &mut told,
            &config,
            &view,
            &[&["1 of 2 servos answer", "not heard: servo 2 (id 2)"]],
        );
        servo(&mut view, 1).alive = true;
        says(&mut told, &config, &view, &[&["servo 2 (id 2) answers again"]]);

        // With the port all are gone; nobody wants sixteen sentences.
        away(&mut view);
        says(
            &mut told,
            &config,
            &view,
            &[&["/dev/servos is gone", "No such file", "images go on"]],
        );
        open(&mut view, "/dev/ttyUSB1", 1);
        says(&mut told, &config, &view, &[&["(now /dev/ttyUSB1) is back"]]);
        servo(&mut view, 0).alive = true;
        servo(&mut view, 1).alive = true;
        view.now_ns += 2 * S;
        says(&mut told, &config, &view, &[&["all 2 servos answer"]]);
    }

    #[test]
    fn errors_and_long_delays_are_told_with_their_servo() {
        let (config, mut view) = servos(2);
        let mut told = Told::default();
        open(&mut view, "/dev/servos", 1);
        says(&mut told, &config, &view, &[&["is open"]]);
        for joint in 0..2 {
            servo(&mut view, joint).alive = true;
            servo(&mut view, joint).identity = Some(ServoIdentity {
                model_number: 1030,
                firmware: 46,
                baud_register: 3,
                return_delay_us: if joint == 1 { 500 } else { 0 },
                drive_mode: 0,
            });
        }
        view.now_ns += 2 * S;
        let sentences: [&[&str]; 2] = [&["all 2"], &["servo 2 (id 2) 500 us", "address 9"]];
        says(&mut told, &config, &view, &sentences);
        servo(&mut view, 0).hardware_error = Some(HardwareError(0x24));
        says(
            &mut told,
            &config,
            &view,
            &[&["servo 1 (id 1)", "overheating, overload"]],
        );
        servo(&mut view, 0).hardware_error = Some(HardwareError(0));
        says(
            &mut told,
            &config,
            &view,
            &[&["servo 1 (id 1)", "no hardware error"]],
        );
    }

    #[test]
    fn a_finger_that_falls_silent_is_told_and_so_is_its_return() {
        let (mut config, mut view) = servos(1);
        config.source = "allegro:can2".parse().unwrap();
        config.allegro = Some(AllegroConfig::new(4));
        view.servos = None;
        let mut told = Told::default();
        says(&mut told, &config, &view, &[&["can:can2 is absent"]]);
        view.tick.link = LinkState::Up;
        view.tick.finger_ns = [Some(S), Some(S), Some(S), None];
        says(&mut told, &config, &view, &[&["can:can2 is up"]]);
        view.now_ns += 2 * S;
        view.tick.finger_ns[..3].fill(Some(view.now_ns));
        says(
            &mut told,
            &config,
            &view,
            &[&["3 of 4 fingers", "not heard: thumb"]],
        );
        view.tick.finger_ns[3] = Some(view.now_ns);
        says(
            &mut told,
            &config,
            &view,
            &[&["thumb finger sends its angles again"]],
        );
        view.now_ns += S;
        view.tick.finger_ns = [
            Some(view.now_ns),
            Some(view.now_ns - S),
            Some(view.now_ns),
            Some(view.now_ns),
        ];
        says(&mut told, &config, &view, &[&["middle finger sends no angles"]]);
    }
}
