//! `taxel forearm fingers`: the angle of a finger that no sensor reads, and how it follows from those that are read.

use super::sessions;
use std::fmt::Write as _;
use std::path::PathBuf;
use taxel_forearm::FINGERS;
use taxel_gripper::FiveBar;

/// Print what the angles of squeezes say of the fingers' phalanges, as CSV.
///
/// theta_u is the angle of the proximal phalanx, by the linkage of five bars; du_da and du_dp are how much it turns with
/// the motor (theta_a) and with the angle between the phalanges (theta_p). They are empty where an angle is unknown or the
/// bars do not close. That angles have the zero and the sign of the linkage is not verified.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// A session: an .npz or a folder of .mat files
    #[arg(value_name = "DATA")]
    data: PathBuf,
}

pub(super) fn run(args: &Args) -> anyhow::Result<String> {
    let mut text =
        "location_percent,repetition,time_ms,finger,theta_a_deg,theta_p_deg,theta_u_deg,du_da,du_dp\n"
            .to_owned();
    for trial in &sessions::open(&args.data)?.trials {
        for row in 0..trial.squeeze.len() {
            let sample = trial.squeeze.sample(row);
            for finger in 0..FINGERS {
                let [actuated, passive] = [sample.theta_a_deg[finger], sample.theta_p_deg[finger]];
                let of = (actuated.to_radians(), passive.to_radians());
                let proximal = FiveBar::FINGER.proximal_rad(of.0, of.1).ok();
                let turning = FiveBar::FINGER.turning(of.0, of.1).ok();
                let numbers = [
                    Some(actuated),
                    Some(passive),
                    proximal.map(f64::to_degrees),
                    turning.map(|[by_motor, _]| by_motor),
                    turning.map(|[_, by_joint]| by_joint),
                ];
                write!(
                    text,
                    "{:.1},{},{},{finger}",
                    trial.location_percent,
                    trial.number(),
                    sample.time_ms
                )?;
                for number in numbers {
                    match number.filter(|number| number.is_finite()) {
                        Some(number) => write!(text, ",{number:.4}")?,
                        None => text.push(','),
                    }
                }
                text.push('\n');
            }
        }
    }
    Ok(text)
}
