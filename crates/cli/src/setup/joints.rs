//! The table `[joints]` of the configuration: what reports angles, and under which names.

use super::answers::{Answers, say};
use crate::doctor::BAUDS;
use crate::doctor::capacity::plural;
use anyhow::{Context, bail};
use std::path::{Path, PathBuf};
use taxel_joints::registers::Model;

/// Where joint angles come from, as the command line and the question have it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Joints {
    None,
    /// A serial port of Dynamixel servos.
    Dynamixel(PathBuf),
    /// An Allegro hand on this CAN source.
    Allegro(String),
}

impl std::str::FromStr for Joints {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once(':') {
            None if text == "none" => Ok(Self::None),
            Some(("dynamixel", port)) if !port.is_empty() => Ok(Self::Dynamixel(port.into())),
            Some(("allegro", bus)) if !bus.is_empty() => Ok(Self::Allegro(bus.into())),
            _ => Err("write dynamixel:DEVICE, allegro:INTERFACE or none".into()),
        }
    }
}

/// The table as text; empty for none. `heard` is the bus on which an Allegro hand was heard, with its version.
pub(super) fn table(
    stated: Option<&Joints>,
    heard: Option<(String, u8)>,
    answers: &Answers,
) -> anyhow::Result<String> {
    let joints = match stated {
        Some(joints) => joints.clone(),
        None => ask(heard.as_ref(), answers)?,
    };
    match joints {
        Joints::None => Ok(String::new()),
        Joints::Allegro(bus) => {
            let version = match heard {
                Some((_, version)) => version,
                None => answers
                    .ask("Version of the Allegro hand, 1 to 5", "4")?
                    .parse()
                    .context("a version is a number from 1 to 5")?,
            };
            let source = toml::Value::from(format!("allegro:{bus}"));
            Ok(format!(
                "\n[joints]\nsource = {source}\n\n[joints.allegro]\nversion = {version}\n"
            ))
        }
        Joints::Dynamixel(port) => servos(&port),
    }
}

fn ask(heard: Option<&(String, u8)>, answers: &Answers) -> anyhow::Result<Joints> {
    let ports = serial_ports(Path::new("/dev"));
    if !ports.is_empty() {
        say(&format!("Serial ports: {}", ports.join(", ")));
    }
    let proposal = heard.map_or("none".into(), |(bus, _)| format!("allegro:{bus}"));
    loop {
        match answers
            .ask(
                "Joint angles from (dynamixel:DEVICE, allegro:INTERFACE, none)",
                &proposal,
            )?
            .parse()
        {
            Ok(joints) => return Ok(joints),
            Err(why) => answers.refuse(&why)?,
        }
    }
}

/// USB adapters, by their lasting names where they have such.
fn serial_ports(dev: &Path) -> Vec<String> {
    let files = |dir: PathBuf, prefixes: &[&str]| -> Vec<String> {
        let entries = std::fs::read_dir(dir).into_iter().flatten().flatten();
        let names = entries.filter(|entry| {
            let name = entry.file_name();
            prefixes
                .iter()
                .any(|prefix| name.to_string_lossy().starts_with(prefix))
        });
        let mut names: Vec<String> = names.map(|entry| entry.path().display().to_string()).collect();
        names.sort();
        names
    };
    let lasting = files(dev.join("serial/by-id"), &[""]);
    match lasting.is_empty() {
        true => files(dev.into(), &["ttyUSB", "ttyACM"]),
        false => lasting,
    }
}

/// Asks the servos of a port who they are, at each bit rate until some answer.
fn servos(port: &Path) -> anyhow::Result<String> {
    for baud in BAUDS {
        let found = taxel_joints::scan(port, baud).with_context(|| {
            format!(
                "{}: `taxel doctor --joints dynamixel:{0}` says more",
                port.display()
            )
        })?;
        if found.is_empty() {
            continue;
        }
        say(&format!(
            "{} at {baud} bit/s on {}:",
            plural(found.len(), "servo"),
            port.display()
        ));
        let port = std::path::absolute(port)?;
        let source = toml::Value::from(format!("dynamixel:{}", port.display()));
        let mut text = format!("\n[joints]\nsource = {source}\nbaud = {baud}\n");
        for servo in &found {
            let model = Model::of(servo.model_number).map_or("unknown model", |model| model.name);
            say(&format!("  id {}, {model}", servo.id));
            text += &format!(
                "\n# {model}\n[[joints.servo]]\nid = {0}\nname = \"servo {0}\"\n",
                servo.id
            );
        }
        return Ok(text);
    }
    bail!(
        "{}: no servo answers at any usual bit rate; `taxel doctor --joints dynamixel:{0} --ids 1` says what may be wrong",
        port.display()
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sources_of_angles_are_read_and_others_refused() {
        for (text, joints) in [
            ("none", Joints::None),
            ("dynamixel:/dev/ttyUSB0", Joints::Dynamixel("/dev/ttyUSB0".into())),
            ("allegro:udp::43113", Joints::Allegro("udp::43113".into())),
        ] {
            assert_eq!(text.parse(), Ok(joints));
        }
        for text in ["", "servos", "dynamixel:", "allegro"] {
            assert!(text.parse::<Joints>().is_err(), "{text}");
        }
    }

    #[test]
    fn adapters_are_named_as_they_last() {
        let dev = tempfile::TempDir::new().unwrap();
        for name in ["ttyUSB1", "ttyUSB0", "tty0", "ttyACM0"] {
            std::fs::write(dev.path().join(name), "").unwrap();
        }
        let file = |name: &str| dev.path().join(name).display().to_string();
        let names = ["ttyACM0", "ttyUSB0", "ttyUSB1"].map(file);
        assert_eq!(serial_ports(dev.path()), names);
        std::fs::create_dir_all(dev.path().join("serial/by-id")).unwrap();
        std::fs::write(dev.path().join("serial/by-id/usb-FTDI"), "").unwrap();
        assert_eq!(serial_ports(dev.path()), [file("serial/by-id/usb-FTDI")]);
    }
}
