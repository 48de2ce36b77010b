//! `taxel servo`: torque and PWM of one servo, through the daemon.

use crate::client::control;
use crate::errors::wrong_use;
use serde_json::json;
use std::path::PathBuf;
use taxeld::stdout;

/// Switch a servo's motor on or off, or give it a PWM, through the running daemon.
///
/// Refused unless `allow_writes = true` in `[joints]`. Torque arms the servo's bus watchdog first:
/// it stops by itself when taxeld ends, hangs or loses the port for `watchdog_ms`. What it was told
/// holds as long as taxeld reads it.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
PWM turns the motor in operating mode 16 (PWM control) and limits it in the others; the mode is set
with ROBOTIS's tools.

Examples:
  taxel servo \"index 0\" --torque on --pwm 0     it begins with this PWM
  taxel servo \"index 0\" --pwm -12.5
  taxel servo \"index 0\" --torque off")]
#[command(group(clap::ArgGroup::new("what").required(true).multiple(true).args(["torque", "pwm"])))]
pub(crate) struct Args {
    /// The joint's name in the configuration
    joint: String,
    /// Switch its motor on or off
    #[arg(long, value_name = "WHICH")]
    torque: Option<Switch>,
    /// Percent of full PWM, -100 to 100, positive the way in which the joint's angle grows; with --torque on or after
    /// it
    #[arg(long, value_name = "PERCENT", allow_negative_numbers = true, value_parser = percent)]
    pwm: Option<f64>,
    /// The daemon's control socket [default: where the daemon of this user, or of the system, puts it]
    #[arg(long, value_name = "PATH")]
    socket: Option<PathBuf>,
    /// One JSON object: what the joint was told (null where it was not), and what the daemon warns of
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Switch {
    On,
    Off,
}

fn percent(text: &str) -> Result<f64, String> {
    let percent = text.parse().ok().filter(|p: &f64| p.is_finite());
    percent.ok_or_else(|| "a number from -100 to 100".into())
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    if args.torque == Some(Switch::Off) && args.pwm.is_some() {
        return Err(wrong_use(
            "a motor that is switched off takes no PWM: --pwm goes with --torque on, or after it",
        ));
    }
    let socket = args
        .socket
        .clone()
        .unwrap_or_else(|| taxeld::config::running_socket("control.sock"));
    let mut request = json!({ "cmd": "servo", "joint": args.joint });
    if let Some(torque) = args.torque {
        request["torque"] = (torque == Switch::On).into();
    }
    if let Some(percent) = args.pwm {
        request["pwm_percent"] = percent.into();
    }
    let reply = control::request(&socket, &request)?;
    if let Some(warning) = reply["warning"].as_str() {
        say!("taxel: {warning}");
    }
    if args.json {
        let (torque, pwm) = (&request["torque"], &request["pwm_percent"]);
        let told =
            json!({ "joint": args.joint, "torque": torque, "pwm_percent": pwm, "warning": reply["warning"] });
        stdout::print(&format!("{told}\n"))?;
    }
    Ok(())
}
