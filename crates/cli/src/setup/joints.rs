//! The table `[joints]` of the configuration: what reports angles, and under which names.

use super::answers::{Answers, say};
use crate::doctor::BAUDS;
use anyhow::bail;
use std::fmt::Display;
use std::path::{Path, PathBuf};
use taxel_can::SourceAddress;
use taxel_hand::{plural, shell_word, why_no_name};
use taxel_joints::registers::Model;
use taxel_joints::{JointSource, JointSourceError};

/// Where joint angles come from, as the command line and the question have it; nothing for `none`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Joints(Option<JointSource>);

impl std::str::FromStr for Joints {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "none" => Ok(Self(None)),
            source => (source.parse().map(|source| Self(Some(source))))
                .map_err(|why: JointSourceError| or_none(&why)),
        }
    }
}

fn or_none<E: Display>(why: &E) -> String {
    format!("{why}; `none` leaves the joints out")
}

/// An Allegro hand that was heard: the bus and its version.
pub(super) type HeardHand = (SourceAddress, u8);

/// What reports angles, before the joints of servos have names; nothing for none.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Table {
    /// The table without its servos.
    text: String,
    /// Ids, and what is said of each.
    servos: Vec<(u8, &'static str)>,
}

impl Table {
    /// The table as text. Where the layout names joints, it is asked which of them each servo moves: nothing shows it,
    /// and a name that is guessed would move another finger.
    pub(super) fn named(self, joints: &[&str], answers: &Answers) -> anyhow::Result<String> {
        let mut text = self.text;
        let mut names: Vec<String> = Vec::new();
        for (id, model) in self.servos {
            let name = match joints.is_empty() {
                true => format!("servo {id}"),
                false => ask_name(id, joints, &names, answers)?,
            };
            text += &format!(
                "\n# {model}\n[[joints.servo]]\nid = {id}\nname = {}\n",
                toml::Value::from(name.as_str())
            );
            names.push(name);
        }
        Ok(text)
    }
}

/// The name of the joint that a servo moves, other than those `given`.
fn ask_name(id: u8, joints: &[&str], given: &[String], answers: &Answers) -> anyhow::Result<String> {
    let left: Vec<&str> = (joints.iter().copied())
        .filter(|joint| !given.iter().any(|name| name == joint))
        .collect();
    let question = match left.is_empty() {
        true => format!("Joint that servo {id} moves (those of the layout have servos)"),
        false => format!("Joint that servo {id} moves (of the layout: {})", left.join(", ")),
    };
    loop {
        let name = answers.ask(&question, &format!("servo {id}"))?;
        let why = why_no_name(&name).or(given.contains(&name).then_some("that of another servo"));
        match why {
            Some(why) => answers.refuse(&format!("`{name}` is {why}"))?,
            None => return Ok(name),
        }
    }
}

/// What the command line states.
pub(super) fn stated(joints: &Joints, heard: Option<&HeardHand>, answers: &Answers) -> anyhow::Result<Table> {
    match &joints.0 {
        None => Ok(Table::default()),
        Some(source @ JointSource::Allegro(_)) => {
            let version = match heard {
                Some((_, version)) => *version,
                None => ask_version(answers)?,
            };
            let source = toml::Value::from(source.to_string());
            Ok(Table {
                text: format!("\n[joints]\nsource = {source}\n\n[joints.allegro]\nversion = {version}\n"),
                servos: Vec::new(),
            })
        }
        Some(JointSource::Dynamixel(at)) => servos(&at.path),
    }
}

/// What is answered. Who types is asked until something answers there: this is the last question,
/// and the modules have been pressed.
pub(super) fn asked(heard: Option<&HeardHand>, answers: &Answers) -> anyhow::Result<Table> {
    let ports = serial_ports(Path::new("/dev"));
    if !ports.is_empty() {
        say(&format!("Serial ports: {}", ports.join(", ")));
    }
    let question = format!("Joint angles from ({}, none)", JointSource::FORMS.join(", "));
    let proposal = heard.map_or("none".into(), |(bus, _)| format!("allegro:{bus}"));
    loop {
        let joints = answers.ask(&question, &proposal)?.parse::<Joints>();
        let table = joints.and_then(|joints| stated(&joints, heard, answers).map_err(|why| or_none(&why)));
        match table {
            Ok(table) => return Ok(table),
            Err(why) => answers.refuse(&why)?,
        }
    }
}

fn ask_version(answers: &Answers) -> anyhow::Result<u8> {
    loop {
        let answer = answers.ask("Version of the Allegro hand, 1 to 5", "4")?;
        match answer.parse() {
            Ok(version @ 1..=5) => return Ok(version),
            _ => answers.refuse(&format!("`{answer}` is no version; it is a number from 1 to 5"))?,
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
fn servos(port: &Path) -> anyhow::Result<Table> {
    for baud in BAUDS {
        let found = taxel_joints::scan(port, baud)?;
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
        let model = |number| Model::of(number).map_or("unknown model", |model| model.name);
        let servos: Vec<_> = (found.iter())
            .map(|servo| (servo.id, model(servo.model_number)))
            .collect();
        for (id, model) in &servos {
            say(&format!("  id {id}, {model}"));
        }
        return Ok(Table {
            text: format!("\n[joints]\nsource = {source}\nbaud = {baud}\n"),
            servos,
        });
    }
    bail!(
        "{}: no servo answers at any usual bit rate; `taxel doctor --joints {} --ids 1` says what may be wrong",
        port.display(),
        shell_word(format!("dynamixel:{}", port.display()))
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sources_of_angles_are_read_and_others_refused() {
        for (text, joints) in [
            ("none", None),
            ("dynamixel:/dev/ttyUSB0", Some("dynamixel:/dev/ttyUSB0")),
            ("allegro:can2", Some("allegro:can:can2")),
            (
                "allegro:udp:239.74.163.2:43114",
                Some("allegro:udp:239.74.163.2:43114"),
            ),
        ] {
            let Joints(source) = text.parse().unwrap();
            assert_eq!(source.map(|source| source.to_string()).as_deref(), joints);
        }
        let why = "servos".parse::<Joints>().unwrap_err();
        assert!(JointSource::FORMS.iter().all(|form| why.contains(form)), "{why}");
        for text in ["", "servos", "dynamixel:", "allegro", "allegro:", "allegro:a b"] {
            assert!(text.parse::<Joints>().is_err(), "{text}");
        }
    }

    #[test]
    fn each_servo_is_asked_for_its_joint_where_the_layout_names_joints() {
        let table = || Table {
            text: "[joints]\n".into(),
            servos: vec![(3, "XL430-W250"), (7, "XL430-W250")],
        };
        let names = |joints: &[&str], lines: &[&str]| {
            let text = table()
                .named(joints, &Answers::of_lines(lines))
                .map_err(|e| e.to_string())?;
            let table: toml::Table = text.parse().unwrap();
            let servos = table["joints"]["servo"].as_array().unwrap();
            Ok(servos
                .iter()
                .map(|servo| servo["name"].as_str().unwrap().to_owned())
                .collect::<Vec<_>>())
        };
        let of = |names: [&str; 2]| Ok::<_, String>(names.map(str::to_owned).to_vec());
        let joints = ["index 2", "thumb 2"];
        assert_eq!(
            names(&joints, &["thumb 2", "index 2"]),
            of(["thumb 2", "index 2"])
        );
        // Nobody guesses, and a servo may move what has no skin.
        assert_eq!(names(&joints, &["", "wrist"]), of(["servo 3", "wrist"]));
        assert_eq!(names(&[], &[]), of(["servo 3", "servo 7"]));
        let twice = names(&joints, &["thumb 2", "thumb 2"]).unwrap_err();
        assert!(twice.contains("`thumb 2` is that of another servo"), "{twice}");
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
