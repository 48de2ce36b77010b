//! `taxel forearm simulate`: a session of a simulated forearm, with touch.

use crate::errors::wrong_use;
use serde_json::json;
use std::path::PathBuf;
use taxel_forearm::{PLACES, Ramp, Session, Squeeze, Trial, location_percent};
use taxel_playback::output_file::OutputFile;
use taxel_sim::forearm::{SimulatedForearm, SimulatedSqueeze};

/// Most squeezes at each place: the session is in memory as it is written.
const MOST: usize = 200;

/// Make a session of a simulated forearm: both fingers' angles, and touch. It is no evidence about people.
///
/// An .npz as the other commands take it: `data` (13 places x repetitions x samples x 10), `location_percent`, and `tactile`
/// (13 x repetitions x samples x 28 x 50 counts from 0 to 255); `simulated` is 1. The tenth column, of which the publication says nothing, is
/// not a number. What is modelled, and what was assumed, is in docs/forearm.md.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  taxel forearm simulate --out synthetic.npz
  taxel forearm simulate --out synthetic.npz --ramp article --seed 2
  taxel forearm eval synthetic.npz")]
pub(crate) struct Args {
    /// Where to write the session
    #[arg(long, value_name = "NPZ")]
    out: PathBuf,
    /// Squeezes at each of the 13 places
    #[arg(long, value_name = "N", default_value_t = 20)]
    repetitions: usize,
    /// Another number is another arm in another gripper: places are missed by other amounts
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// How PWM rises and falls: data (the publication's data, to 46 %) or article (its text, to 90 %)
    #[arg(long, alias = "profile", value_name = "NAME", default_value = "data")]
    ramp: Ramp,
    /// One JSON object: {"out", "squeezes", "places"}
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<String> {
    if !(1..=MOST).contains(&args.repetitions) {
        return Err(wrong_use(format!(
            "--repetitions {}; give 1 to {MOST}",
            args.repetitions
        )));
    }
    let mut file = OutputFile::begin(&args.out)?;
    let forearm = SimulatedForearm::new(args.seed, args.ramp);
    let session = session(forearm, &(0..PLACES).collect::<Vec<_>>(), args.repetitions)?;
    session.write_npz(file.path())?;
    file.finish()?;
    let (out, squeezes) = (args.out.display().to_string(), session.trials.len());
    Ok(match args.json {
        true => format!(
            "{}\n",
            json!({ "out": out, "squeezes": squeezes, "places": PLACES })
        ),
        false => format!(
            "{out}: {squeezes} squeezes at {PLACES} places of a simulated forearm, with touch; synthetic\n"
        ),
    })
}

/// Squeezes at some of the publication's places, by their numbers.
pub(crate) fn session(
    forearm: SimulatedForearm,
    places: &[usize],
    repetitions: usize,
) -> anyhow::Result<Session> {
    let mut trials = Vec::with_capacity(places.len() * repetitions);
    for place in places {
        for repetition in 0..repetitions {
            trials.push(trial(forearm, *place, repetition)?);
        }
    }
    Ok(Session {
        name: "a simulated forearm".into(),
        simulated: true,
        passed_over: Vec::new(),
        trials,
    })
}

/// A squeeze at one of the publication's places.
pub(crate) fn trial(forearm: SimulatedForearm, place: usize, repetition: usize) -> anyhow::Result<Trial> {
    let location_percent = location_percent(place);
    let simulated = forearm.squeeze(location_percent / 100.0, repetition as u64)?;
    Ok(Trial {
        location_percent,
        repetition,
        squeeze: squeeze(simulated),
    })
}

fn squeeze(simulated: SimulatedSqueeze) -> Squeeze {
    Squeeze {
        undocumented_deg: vec![f64::NAN; simulated.time_ms.len()],
        time_ms: simulated.time_ms,
        theta_p_deg: simulated.passive_deg,
        theta_a_deg: simulated.actuated_deg,
        pwm: simulated.pwm,
        tactile: Some(simulated.touch),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_simulated_session_is_read_back_as_it_was_made() {
        let forearm = SimulatedForearm::new(1, Ramp::Data);
        let made = session(forearm, &[0, 7, 12], 2).unwrap();
        assert!(made.has_touch());
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("session.npz");
        made.write_npz(&path).unwrap();
        let read = Session::open(&path).unwrap();
        assert!(read.simulated);
        assert_eq!(read.trials.len(), made.trials.len());
        for (read, made) in read.trials.iter().zip(&made.trials) {
            assert_eq!(read.location_percent, made.location_percent);
            assert_eq!(read.squeeze.tactile, made.squeeze.tactile);
            assert_eq!(read.squeeze.theta_a_deg, made.squeeze.theta_a_deg);
            assert_eq!(read.squeeze.len(), 95);
        }
    }
}
