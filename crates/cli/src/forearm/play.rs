//! `taxel sim forearm`: a simulated forearm's touch on the socket of a pressure array, and servos that squeeze it.

use crate::errors::wrong_use;
use anyhow::Context;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};
use taxel_can::pressure_frames;
use taxel_forearm::{FINGERS, Ramp, TACTELS, TACTILE_COLUMNS, TACTILE_ROWS};
use taxel_playback::interrupt::Interrupt;
use taxel_playback::target::{TargetAddress, Targets, of_buses};
use taxel_sim::forearm::{ForearmTouch, SimulatedForearm};
use taxel_sim::servo::{
    ForearmFinger, LinePty, Motion, SERVO_BAUD, ServoBuild, ServoBus, ServoPty, StableLink, servo_clock_ns,
};
use taxel_skin::Layout;
use taxeld::stdout;

/// What `taxel sim` calls it.
pub(crate) const SCENE: &str = "forearm";
pub(crate) const ABOUT: &str = "a gripper's tactile finger under a forearm, 28 x 50";
/// The hand that it is.
pub(crate) const LAYOUT: &str = "tekscan-6077";
const SIZE: [u16; 2] = [TACTILE_ROWS as u16, TACTILE_COLUMNS as u16];
/// Between two frames of the sensor.
const PERIOD: Duration = Duration::from_millis(100);
/// PWM (X-series, operating mode).
const PWM_MODE: u8 = 16;
/// What the converter of the potentiometers gives for how far they turn (SV01, 10 bits), and how often.
const COUNTS: f64 = 1023.0;
const WHOLE_TURN_DEG: f64 = 333.3;
const LINE_PERIOD: Duration = Duration::from_millis(10);
/// After a squeeze, at one place.
const REST_MS: f64 = 1500.0;

/// What is squeezed, and who listens.
pub(crate) struct Playing<'a> {
    pub(crate) to: &'a [TargetAddress],
    /// A link to be made to simulated servos that squeeze.
    pub(crate) servos: Option<&'a Path>,
    /// A link to be made to the lines of their potentiometers.
    pub(crate) potentiometers: Option<&'a Path>,
    /// From 0 (wrist) to 100 (elbow).
    pub(crate) place_percent: f64,
    pub(crate) seed: u64,
    pub(crate) limit_ns: Option<u64>,
}

pub(crate) fn run(playing: &Playing<'_>) -> anyhow::Result<()> {
    let layout = Layout::resolve(LAYOUT)?;
    let named = of_buses(playing.to, &layout)?;
    let mut targets = Targets::open(&named)?;
    let interrupt = Interrupt::install()?;
    match playing.servos {
        Some(link) if targets.are_logs() => {
            return Err(wrong_use(format!(
                "--servos {}: servos move in real time; a log is written at once and has none",
                link.display()
            )));
        }
        Some(link) => squeeze_by_servos(playing, link, &interrupt, &mut targets)?,
        None if playing.potentiometers.is_some() => {
            return Err(wrong_use(
                "--potentiometers: they are of the fingers that the servos move; give --servos LINK too",
            ));
        }
        None => squeeze_by_itself(playing, &interrupt, &mut targets)?,
    }
    targets.finish()?;
    targets.check()
}

/// Touch as two servos press, whoever moves them.
fn squeeze_by_servos(
    playing: &Playing<'_>,
    link: &Path,
    interrupt: &Interrupt,
    targets: &mut Targets,
) -> anyhow::Result<()> {
    let location = playing.place_percent / 100.0;
    let finger = ForearmFinger::at(location)?;
    let touch = ForearmTouch::at(location, playing.seed)?;
    let servos = (1..=FINGERS as u8).map(|id| ServoBuild {
        motion: Motion::Still(finger.open().round() as i32),
        load: Some(Arc::new(finger)),
        ..ServoBuild::new(id)
    });
    let mut bus = ServoBus::new(servos, SERVO_BAUD);
    for id in 1..=FINGERS as u8 {
        if let Some(servo) = bus.servo_mut(id) {
            servo.set_operating_mode(PWM_MODE);
        }
    }
    let pty = ServoPty::open(bus).context("a pseudo terminal for the servos")?;
    let _link = StableLink::new(link, pty.path())
        .with_context(|| format!("--servos {}: cannot make this link", link.display()))?;
    let _lines = match playing.potentiometers {
        Some(link) => Some(offer_potentiometers(&finger, link)?),
        None => None,
    };
    let potentiometers = playing.potentiometers.map(std::path::absolute).transpose()?;
    let table = joints_table(&std::path::absolute(link)?, potentiometers.as_deref());
    stdout::print(&table)?;
    let begin = Instant::now();
    for frame in 0.. {
        let due = begin + PERIOD * frame;
        let is_over = playing
            .limit_ns
            .is_some_and(|limit| (due - begin).as_nanos() as u64 >= limit);
        if is_over || !interrupt.sleep_until(due) {
            break;
        }
        let now_ns = servo_clock_ns();
        let angle = |id: u8| {
            let pulses = pty.bus().servo(id).map_or(2048.0, |servo| servo.position(now_ns));
            (pulses - 2048.0) * 360.0 / 4096.0
        };
        let counts = touch.counts(0.5 * (angle(1) + angle(2)), frame.into());
        send(targets, now_ns, frame, &counts)?;
    }
    Ok(())
}

/// Lines of both fingers' potentiometers behind a link, as long as the returned values live.
fn offer_potentiometers(finger: &ForearmFinger, link: &Path) -> anyhow::Result<(StableLink, LinePty)> {
    let count = (finger.passive_deg() / WHOLE_TURN_DEG * COUNTS).round();
    let line = format!("p1 {count} p2 {count}\n").into_bytes();
    let lines = LinePty::open(LINE_PERIOD, move |_| line.clone())
        .context("a pseudo terminal for the potentiometers")?;
    let made = StableLink::new(link, lines.path())
        .with_context(|| format!("--potentiometers {}: cannot make this link", link.display()))?;
    Ok((made, lines))
}

/// The table `[joints]` with which taxeld reads them.
fn joints_table(servos: &Path, potentiometers: Option<&Path>) -> String {
    let source = format!("dynamixel:{}", servos.display());
    let mut text = format!(
        "[joints]\nsource = {source:?}\nbaud = {SERVO_BAUD}\nallow_writes = true\n\n\
         [[joints.servo]]\nid = 1\nname = \"left\"\n\n[[joints.servo]]\nid = 2\nname = \"right\"\n"
    );
    if let Some(link) = potentiometers {
        text += &format!("\n[joints.analogue]\ndevice = {:?}\n", link.display().to_string());
        for (name, channel) in [("left p", "p1"), ("right p", "p2")] {
            text += &format!(
                "\n[[joints.analogue.joint]]\nname = {name:?}\nchannel = {channel:?}\ncounts = [0, {COUNTS}]\n\
                 degrees = [0, {WHOLE_TURN_DEG}]\n"
            );
        }
    }
    text
}

/// Touch of one squeeze after another.
fn squeeze_by_itself(
    playing: &Playing<'_>,
    interrupt: &Interrupt,
    targets: &mut Targets,
) -> anyhow::Result<()> {
    let forearm = SimulatedForearm::new(playing.seed, Ramp::Data);
    let (waits, begin) = (!targets.are_logs(), Instant::now());
    let (mut began_ms, mut frame) = (0.0, 0);
    for repetition in 0.. {
        let squeeze = forearm.squeeze(playing.place_percent / 100.0, repetition)?;
        for (time_ms, counts) in squeeze.time_ms.iter().zip(squeeze.touch.chunks_exact(TACTELS)) {
            let t_ns = ((began_ms + time_ms) * 1e6) as u64;
            let due = begin + Duration::from_nanos(t_ns);
            if playing.limit_ns.is_some_and(|limit| t_ns >= limit) || (waits && !interrupt.sleep_until(due)) {
                return Ok(());
            }
            send(targets, t_ns, frame, counts)?;
            frame = frame.wrapping_add(1);
        }
        began_ms += squeeze.time_ms.last().copied().unwrap_or_default() + REST_MS;
        if !waits && playing.limit_ns.is_none() {
            return Ok(());
        }
    }
    Ok(())
}

fn send(targets: &mut Targets, t_ns: u64, frame: u32, counts: &[u16]) -> anyhow::Result<()> {
    for frame in pressure_frames(SIZE, frame, counts) {
        targets.send(0, t_ns, &frame)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_of_the_simulated_gripper_is_one_that_taxeld_reads() {
        for (potentiometers, names) in [
            (None, &["left", "right"][..]),
            (
                Some(Path::new("/tmp/pots")),
                &["left", "right", "left p", "right p"],
            ),
        ] {
            let table = joints_table(Path::new("/tmp/servos"), potentiometers);
            let bus = "[[bus]]\nsource = \"pressure:/tmp/touch.sock\"\n";
            let text = format!("layout = {LAYOUT:?}\n{bus}{table}");
            let config = taxeld::Config::parse(&text, Path::new("taxeld.toml")).unwrap();
            assert_eq!(config.joints.unwrap().joint_names(), names);
        }
    }
}
