//! A tactile image as one line: the JSON that scripts read, and the words that people read.

use serde::Serialize;
use std::fmt::Write;
use taxel_hand::plural;
use taxel_wire::{Flags, Header, ImageView};

/// The object that `taxel watch --json` prints for each image; its keys are fixed.
#[derive(Debug, Serialize)]
struct ImageLine<'a> {
    seq: u64,
    t_ns: u64,
    /// Microseconds from the time of validity to now; null where the clock tells none, as for recordings.
    latency_us: Option<f64>,
    width: u16,
    height: u16,
    image: &'a [u8],
    levels: Vec<f32>,
    actuators: Vec<ActuatorLine>,
    contacts: u32,
    faulty: u32,
    missing: u32,
    joints: Vec<Option<f32>>,
    /// Images that the reader was not given since its last one.
    skipped: u32,
    /// Whether the baseline is being measured, so that the image is empty.
    calibrating: bool,
    /// Whether a taxel is at an end of its range.
    saturated: bool,
    /// Whether a value was repaired: a count that wrapped around, or a glitch.
    repaired: bool,
}

#[derive(Debug, Serialize)]
struct ActuatorLine {
    id: u16,
    x: u16,
    y: u16,
    level: u16,
    force: f32,
}

/// The image as one line of JSON, without the line break. An angle that could not be read is null.
pub fn json(header: &Header, image: &ImageView<'_>, latency_ns: Option<i64>) -> String {
    let actuators = image.actuators();
    let line = ImageLine {
        seq: header.seq,
        t_ns: header.t_ns,
        latency_us: latency_ns.map(|ns| ns as f64 / 1000.0),
        width: image.width,
        height: image.height,
        image: image.pixels(),
        levels: image.levels().collect(),
        actuators: actuators
            .map(|a| ActuatorLine {
                id: a.id,
                x: a.x,
                y: a.y,
                level: a.level,
                force: a.force,
            })
            .collect(),
        contacts: image.contacts,
        faulty: image.faulty,
        missing: image.missing,
        joints: image
            .joints()
            .map(|angle| angle.is_finite().then_some(angle))
            .collect(),
        skipped: header.skipped,
        calibrating: header.flags.contains(Flags::CALIBRATING),
        saturated: header.flags.contains(Flags::SATURATED),
        repaired: header.flags.contains(Flags::REPAIRED),
    };
    serde_json::to_string(&line).expect("numbers and lists always serialise")
}

/// The image in words: number, time, latency, contacts, actuators, what is missing.
pub fn words(header: &Header, image: &ImageView<'_>, latency_ns: Option<i64>) -> String {
    let mut line = start(header, latency_ns);
    let (contacts, actuators) = (image.contacts, image.actuators().len());
    let _ = write!(line, "  {contacts:>3} contacts  {actuators:>3} actuators");
    if let Some(strongest) = image.levels().last() {
        let _ = write!(line, "  up to {strongest:.0}");
    }
    line += &joints(image.joints());
    for (count, what) in [
        (image.missing, "missing"),
        (image.faulty, "faulty"),
        (header.skipped, "skipped"),
    ] {
        if count > 0 {
            let _ = write!(line, "  {count} {what}");
        }
    }
    line + remarks(header)
}

/// How many joint angles are known; nothing where no joints are read.
pub fn joints(angles: impl ExactSizeIterator<Item = f32>) -> String {
    let all = angles.len();
    match (all, angles.filter(|angle| angle.is_finite()).count()) {
        (0, _) => String::new(),
        (_, known) if known == all => format!("  {}", plural(all, "joint")),
        (_, known) => format!("  {known} of {}", plural(all, "joint")),
    }
}

/// `#SEQ  TIME  LATENCY`, as every line for people begins.
pub fn start(header: &Header, latency_ns: Option<i64>) -> String {
    let mut line = format!("#{:<6} {:>10.3} s", header.seq, header.t_ns as f64 / 1e9);
    if let Some(ns) = latency_ns {
        let _ = write!(line, "  {:>6.2} ms", ns as f64 / 1e6);
    }
    line
}

/// What else is to be said about a message.
pub fn remarks(header: &Header) -> &'static str {
    if header.flags.contains(Flags::CALIBRATING) {
        "  calibrating: do not touch the hand"
    } else if header.flags.contains(Flags::SATURATED) {
        "  saturated"
    } else if header.flags.contains(Flags::REPAIRED) {
        "  repaired"
    } else {
        ""
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_hand::{Actuator, TactileImage};
    use taxel_wire::{Body, decode_packet, encode_image_payload};

    fn lines(image: &TactileImage, latency_ns: Option<i64>, skipped: u32) -> (String, String) {
        let mut payload = Vec::new();
        encode_image_payload(image, &mut payload).unwrap();
        let header = Header::of_image(image, payload.len()).with_skipped(skipped);
        let packet = [&header.to_bytes()[..], &payload].concat();
        let message = decode_packet(&packet).unwrap();
        let Body::Image(view) = message.body else {
            panic!("not an image")
        };
        (
            json(&message.header, &view, latency_ns),
            words(&message.header, &view, latency_ns),
        )
    }

    fn image() -> TactileImage {
        TactileImage {
            seq: 7,
            t_ns: 1_500_000_000,
            width: 2,
            height: 2,
            pixels: vec![0, 255, 128, 0],
            levels: vec![40.5, 80.0],
            actuators: vec![
                Actuator {
                    id: 0,
                    x: 1,
                    y: 0,
                    level: 2,
                    force: 80.0,
                },
                Actuator {
                    id: 1,
                    x: 0,
                    y: 1,
                    level: 1,
                    force: 40.5,
                },
            ],
            contacts: 2,
            faulty: 1,
            joints: vec![0.5, f32::NAN],
            ..TactileImage::default()
        }
    }

    #[test]
    fn json_has_the_keys_that_scripts_rely_on() {
        let (json, _) = lines(&image(), Some(250_500), 3);
        let value: serde_json::Value = serde_json::from_str(&json).unwrap();
        let expected = serde_json::json!({
            "seq": 7, "t_ns": 1_500_000_000, "latency_us": 250.5, "width": 2, "height": 2,
            "image": [0, 255, 128, 0], "levels": [40.5, 80.0],
            "actuators": [
                {"id": 0, "x": 1, "y": 0, "level": 2, "force": 80.0},
                {"id": 1, "x": 0, "y": 1, "level": 1, "force": 40.5},
            ],
            "contacts": 2, "faulty": 1, "missing": 0, "joints": [0.5, null], "skipped": 3, "calibrating": false,
            "saturated": false, "repaired": false,
        });
        assert_eq!(value, expected);
        let all = TactileImage {
            calibrating: true,
            repaired: true,
            ..image()
        };
        let (all, _) = lines(&all, None, 0);
        assert!(
            all.contains("\"calibrating\":true") && all.contains("\"repaired\":true"),
            "{all}"
        );
        assert!(!json.contains('\n'));
    }

    #[test]
    fn latency_is_null_where_the_clock_tells_none() {
        let (json, words) = lines(&image(), None, 0);
        assert!(json.contains("\"latency_us\":null"), "{json}");
        assert!(!words.contains("ms"), "{words}");
    }

    #[test]
    fn words_tell_what_is_wrong_and_nothing_that_is_not() {
        let (_, words) = lines(&image(), Some(250_000), 3);
        for part in [
            "#7",
            "1.500 s",
            "0.25 ms",
            "2 contacts",
            "2 actuators",
            "1 of 2 joints",
            "1 faulty",
            "3 skipped",
        ] {
            assert!(words.contains(part), "{part}: {words}");
        }
        assert!(
            !words.contains("missing") && !words.contains("calibrating"),
            "{words}"
        );
        let known = TactileImage {
            joints: vec![0.5, 1.0],
            ..image()
        };
        assert!(lines(&known, None, 0).1.contains("  2 joints"));
        let (_, words) = lines(
            &TactileImage {
                calibrating: true,
                joints: Vec::new(),
                ..image()
            },
            None,
            0,
        );
        assert!(
            words.contains("do not touch") && !words.contains("joints"),
            "{words}"
        );
    }
}
