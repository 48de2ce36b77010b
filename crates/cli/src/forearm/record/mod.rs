//! `taxel forearm record`: squeezes through the daemon, into the publication's files.

mod followed;
mod gripper;
mod lock;
mod newest;
mod plan;

use super::sessions;
use crate::client::control::Held;
use crate::client::hands;
use crate::errors::wrong_use;
use crate::notices;
use anyhow::{Context, bail};
use gripper::Gripper;
use lock::Lock;
use plan::{Next, Plan, Settings};
use std::io::BufRead;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};
use taxel_forearm::{FULL_PWM, PLACES, Ramp, Squeeze, location_percent};
use taxel_hand::shell_word;
use taxel_playback::interrupt::Interrupt;
use taxel_playback::output_file::OutputFile;
use taxeld::stdout;

/// Record squeezes of a forearm: moves the gripper through the running daemon, and says what comes next.
///
/// The daemon's `[joints]` has the two servos of the fingers, in operating mode 16 (PWM), with allow_writes = true, and
/// the potentiometers of the fingers where there are any. Nothing moves without --allow-motion. The motors are switched
/// off between squeezes, on any fault, on Ctrl-C, and by the daemon when this program dies or hangs for a second.
///
/// FOLDER is filled with the publication's files, PLACE/distancePLACE_REPETITION.mat, one for each whole squeeze: what is
/// interrupted goes on with the first that is missing. Where the daemon's hand has a module of 28 x 50 taxels, the images
/// of the samples are beside each, tactilePLACE_REPETITION.npy, and a squeeze in which one is missing is not kept.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  taxel forearm record session                                what there is, and what comes next; nothing moves
  taxel forearm record session --allow-motion                 13 places, 60 squeezes at each, as the files have them
  taxel forearm record session --allow-motion --ramp article --max-pwm 92
  taxel forearm record session --allow-motion --npz session.npz")]
pub(crate) struct Args {
    /// Where the files are, and the settings of the session
    folder: PathBuf,
    /// Let the motors move
    #[arg(long)]
    allow_motion: bool,
    /// How hard it squeezes: `data`, 400 of 885 counts at the peak, as the publication's files have it; `article`, 10 to
    /// 90 %, as it says
    #[arg(long, value_name = "NAME", default_value = "data")]
    ramp: Ramp,
    /// The most PWM that may be asked for, percent of full PWM; a ramp that goes beyond is refused
    #[arg(long, value_name = "PERCENT", default_value_t = 50.0, value_parser = percent)]
    max_pwm: f64,
    /// Joints of the two servos, whose PWM above 0 closes [default: the first two joints that are servos]
    #[arg(long, value_name = "NAME,NAME", value_delimiter = ',')]
    fingers: Vec<String>,
    /// Joints of the two potentiometers, in the order of the fingers [default: the first two joints that are no servos;
    /// where there are none, those columns are not numbers]
    #[arg(long, value_name = "NAME,NAME", value_delimiter = ',')]
    potentiometers: Vec<String>,
    /// Places, evenly from wrist to elbow: 1, 2, 3, 4, 5, 7 or 13
    #[arg(long, value_name = "N", default_value_t = PLACES, value_parser = places)]
    places: usize,
    /// Squeezes at each place
    #[arg(long, value_name = "N", default_value_t = 60, value_parser = clap::value_parser!(u32).range(1..=1000))]
    repetitions: u32,
    /// Only this place, from 0
    #[arg(long, value_name = "PLACE")]
    place: Option<usize>,
    /// The gripper is simulated, as `taxel sim forearm` has it: say so in the files, since nothing else tells
    #[arg(long)]
    simulated: bool,
    /// Do not wait for Enter before each place
    #[arg(long)]
    no_wait: bool,
    /// Make a squeeze that a fault has ended again, up to so many times in a row, the motors off for a second before;
    /// otherwise the session ends with the fault, and the same command goes on there
    #[arg(long, value_name = "TIMES", default_value_t = 0, value_parser = clap::value_parser!(u32).range(0..=10))]
    again: u32,
    /// When it ends, also write all squeezes of the folder to this .npz; without --allow-motion those that are there
    #[arg(long, value_name = "FILE")]
    npz: Option<PathBuf>,
    /// The daemon's image socket [default: where the daemon of this user, or of the system, puts it]
    #[arg(long, value_name = "PATH")]
    socket: Option<PathBuf>,
    /// The daemon's control socket [default: where the daemon of this user, or of the system, puts it]
    #[arg(long, value_name = "PATH")]
    control: Option<PathBuf>,
}

fn percent(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(percent) if (1.0..=100.0).contains(&percent) => Ok(percent),
        _ => Err("a number from 1 to 100".into()),
    }
}

fn places(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(1) => Ok(1),
        Ok(places) if (2..=PLACES).contains(&places) && (PLACES - 1).is_multiple_of(places - 1) => Ok(places),
        _ => Err("1, 2, 3, 4, 5, 7 or 13: those that are even among the publication's 13".into()),
    }
}

/// Between two squeezes at one place: the finger opens.
const REST: Duration = Duration::from_secs(1);

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let most = 100.0 * args.ramp.most() / FULL_PWM;
    if most > args.max_pwm {
        return Err(wrong_use(format!(
            "this ramp goes up to {most:.0} % of full PWM, and --max-pwm is {}; allow it with --max-pwm {:.0} where the \
             gripper may press so hard",
            args.max_pwm,
            most.ceil()
        )));
    }
    let plan = Plan::new(&args.folder, args.places, args.repetitions as usize, args.place)?;
    plan.check(args.ramp, &args.fingers, &args.potentiometers)?;
    say!("taxel: {plan}");
    if !args.allow_motion {
        say!("taxel: nothing moves without --allow-motion");
        return keep_npz(args, &plan);
    }
    let interrupt = Interrupt::install()?;
    let control = args
        .control
        .clone()
        .unwrap_or_else(|| taxeld::config::running_socket("control.sock"));
    let images = args
        .socket
        .clone()
        .unwrap_or_else(|| taxeld::config::running_socket("images.sock"));
    if args.control.is_none() {
        let options = |control: &Path| {
            let images = control.with_file_name("images.sock");
            format!(
                "--control {} {}",
                shell_word(control.display()),
                hands::socket_option(&images)
            )
        };
        hands::refuse_others(&control, options)?;
    }
    let gripper = Gripper::find(control, &images, &args.fingers, &args.potentiometers)?;
    gripper.keeps_up(period(args.ramp))?;
    let _lock = Lock::take(&args.folder)?;
    plan.keep(&Settings {
        ramp: args.ramp,
        fingers: gripper.fingers().to_vec(),
        potentiometers: gripper.potentiometers().to_vec(),
        touch: gripper.has_touch(),
        simulated: args.simulated,
    })?;
    say!("taxel: {gripper}");
    let recorded = session(args, &plan, &gripper, &interrupt);
    // The fault before what it may have left behind.
    let kept = keep_npz(args, &plan);
    recorded.and(kept)
}

/// How long a step of a ramp lasts.
fn period(ramp: Ramp) -> Duration {
    Duration::from_secs_f64(ramp.period_ms() / 1e3)
}

/// All squeezes of the folder in one file, where that is wanted.
fn keep_npz(args: &Args, plan: &Plan) -> anyhow::Result<()> {
    let Some(npz) = args.npz.as_ref().filter(|_| plan.done() > 0) else {
        return Ok(());
    };
    let mut file = OutputFile::begin(npz)?;
    sessions::open(&args.folder)?.write_npz(file.path())?;
    file.finish()?;
    say!(
        "taxel: all squeezes of {} are in {}",
        args.folder.display(),
        npz.display()
    );
    Ok(())
}

/// Squeeze after squeeze, until all are there.
fn session(args: &Args, plan: &Plan, gripper: &Gripper, interrupt: &Interrupt) -> anyhow::Result<()> {
    let keys = Keys::start();
    let mut at = None;
    let mut faults = 0;
    while let Some(next) = plan.next() {
        if at != Some(next.place) {
            say!("taxel: {next}. Put the gripper there, open, with the forearm in it.");
            if !args.no_wait && !keys.wait_for_enter(interrupt)? {
                return stopped(plan);
            }
            at = Some(next.place);
            // Meanwhile it may have come from elsewhere.
            if plan.next().as_ref() != Some(&next) {
                continue;
            }
        } else if !interrupt.sleep_until(Instant::now() + REST) {
            return stopped(plan);
        }
        let pwm = args.ramp.pwm(next.repetition as u64);
        let made = gripper
            .squeeze(&pwm, period(args.ramp), interrupt)
            .with_context(|| {
                format!("{next}; this squeeze is not kept, and the same command makes it again")
            });
        let squeeze = match made {
            Ok(Some(squeeze)) => squeeze,
            Ok(None) => return stopped(plan),
            // Who else has the gripper is not to be waited for.
            Err(fault) if faults < args.again && !fault.is::<Held>() => {
                faults += 1;
                // The next one may be of the same kind.
                notices::warn(&format!(
                    "taxel: {fault:#}. It is made again ({faults} of {})",
                    args.again
                ));
                continue;
            }
            Err(fault) => return Err(fault),
        };
        faults = 0;
        plan.write(&next, &squeeze)?;
        say(&next, &squeeze)?;
    }
    say!("taxel: all {} squeezes are there", plan.all());
    Ok(())
}

fn stopped(plan: &Plan) -> anyhow::Result<()> {
    say!("taxel: stopped; {plan}. The same command goes on there");
    Ok(())
}

/// A line for each squeeze that is written.
fn say(next: &Next, squeeze: &Squeeze) -> anyhow::Result<()> {
    let most = |angles: &Vec<f64>| angles.iter().copied().fold(f64::NAN, f64::max);
    // Samples whose angle is unknown, or was read too long before.
    let unknown = |angles: &Vec<f64>| angles.iter().filter(|angle| angle.is_nan()).count();
    let line = serde_json::json!({
        "file": next.file,
        "place": next.place,
        "location_percent": location_percent(next.place),
        "repetition": next.repetition,
        "samples": squeeze.len(),
        "touch": squeeze.tactile.is_some(),
        "duration_ms": squeeze.time_ms.last(),
        "unknown_theta_a": squeeze.theta_a_deg.each_ref().map(unknown),
        "unknown_theta_p": squeeze.theta_p_deg.each_ref().map(unknown),
        "most_theta_a_deg": squeeze.theta_a_deg.each_ref().map(most),
        "most_theta_p_deg": squeeze.theta_p_deg.each_ref().map(most),
    });
    stdout::print(&format!("{line}\n"))
}

/// Lines of the keyboard, which can be waited for without missing Ctrl-C.
struct Keys(Receiver<()>);

impl Keys {
    fn start() -> Self {
        let (lines, keys) = channel();
        // Ends with the process: nothing else can end a read of a terminal.
        std::thread::spawn(move || {
            for line in std::io::stdin().lock().lines() {
                if line.is_err() || lines.send(()).is_err() {
                    return;
                }
            }
        });
        Self(keys)
    }

    /// Waits for Enter; `false` where it was asked to stop.
    fn wait_for_enter(&self, interrupt: &Interrupt) -> anyhow::Result<bool> {
        say!("taxel: Enter begins, Ctrl-C ends.");
        while self.0.try_recv().is_ok() {}
        loop {
            match self.0.recv_timeout(Duration::from_millis(50)) {
                Ok(()) => return Ok(true),
                Err(_) if interrupt.is_set() => return Ok(false),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => {
                    bail!("nobody is there to press Enter; --no-wait goes on without")
                }
            }
        }
    }
}
