//! Readers of version 1.0 read what 1.1 sends: a decoder that does what 1.0's did, and knows
//! nothing of what came later.

mod vectors;

use serde::Deserialize;
use taxel_wire::{Body, decode_packet};

fn u16_at(bytes: &[u8], at: usize) -> usize {
    u16::from_le_bytes(bytes[at..at + 2].try_into().unwrap()).into()
}

fn u32_at(bytes: &[u8], at: usize) -> usize {
    u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize
}

fn floats(bytes: &[u8], at: usize, count: usize) -> Vec<f32> {
    let number = |bytes: &[u8]| f32::from_le_bytes(bytes.try_into().unwrap());
    bytes[at..at + 4 * count].chunks(4).map(number).collect()
}

/// What 1.0 knew of a message.
#[derive(Debug)]
enum Old {
    Image {
        pixels: Vec<u8>,
        levels: Vec<f32>,
        actuators: usize,
        joints: Vec<f32>,
    },
    Raw {
        counts: Vec<[usize; 3]>,
        forces: Vec<f32>,
        joints: Vec<f32>,
    },
    /// HELLO, STATUS, EVENT and SUBSCRIBE.
    Text(Vec<u8>),
    PassedOver,
}

/// The checks of 1.0 in their order, by the lengths in the message.
fn decode_as_1_0(packet: &[u8]) -> Result<Old, &'static str> {
    let check = |holds: bool, error| if holds { Ok(()) } else { Err(error) };
    check(packet.len() >= 40, "short_header")?;
    check(&packet[..4] == b"TCT1", "bad_magic")?;
    check(packet[4] == 1, "major_version")?;
    let header_len = u16_at(packet, 6);
    check(header_len >= 40, "header_len")?;
    let end = header_len + u32_at(packet, 12);
    check(end <= 409_600, "too_long")?;
    check(end <= packet.len(), "truncated")?;
    check(end == packet.len(), "trailing")?;
    let payload = &packet[header_len..];
    match u16_at(packet, 8) {
        2 => image(payload),
        5 => raw(payload),
        1 | 3 | 4 | 16 => Ok(Old::Text(payload.to_vec())),
        _ => Ok(Old::PassedOver),
    }
}

fn image(payload: &[u8]) -> Result<Old, &'static str> {
    if payload.len() < 24 {
        return Err("section_short");
    }
    let fixed_len = u16_at(payload, 10);
    if fixed_len < 24 || !fixed_len.is_multiple_of(4) {
        return Err("fixed_len");
    }
    let [width, height, levels, actuators, joints] = [0, 2, 4, 6, 8].map(|at| u16_at(payload, at));
    let actuators_at = fixed_len + 4 * levels;
    let joints_at = actuators_at + 12 * actuators;
    let pixels_at = joints_at + 4 * joints;
    if pixels_at + width * height > payload.len() {
        return Err("section_short");
    }
    let is_bad = |force: &f32| !(force.is_finite() && *force >= 0.0);
    let level_forces = floats(payload, fixed_len, levels);
    if level_forces.iter().any(is_bad) {
        return Err("bad_force");
    }
    for at in (0..actuators).map(|i| actuators_at + 12 * i) {
        let [x, y, level] = [2, 4, 6].map(|field| u16_at(payload, at + field));
        if x >= width || y >= height || !(1..=levels).contains(&level) {
            return Err("bad_actuator");
        }
        if is_bad(&floats(payload, at + 8, 1)[0]) {
            return Err("bad_force");
        }
    }
    Ok(Old::Image {
        pixels: payload[pixels_at..][..width * height].to_vec(),
        levels: level_forces,
        actuators,
        joints: floats(payload, joints_at, joints),
    })
}

fn raw(payload: &[u8]) -> Result<Old, &'static str> {
    if payload.len() < 16 {
        return Err("section_short");
    }
    let (taxels, record_len, fixed_len) = (u32_at(payload, 0), u16_at(payload, 4), u16_at(payload, 6));
    let is_len = |len: usize, least| len >= least && len.is_multiple_of(4);
    if !is_len(fixed_len, 16) || !is_len(record_len, 20) {
        return Err("fixed_len");
    }
    let joints = u16_at(payload, 12);
    let joints_at = fixed_len + taxels * record_len;
    if joints_at + 4 * joints > payload.len() {
        return Err("section_short");
    }
    let records = (0..taxels).map(|i| fixed_len + i * record_len);
    let counts = |at: usize| [0, 2, 4].map(|axis| u16_at(payload, at + axis));
    Ok(Old::Raw {
        counts: records.clone().map(counts).collect(),
        forces: records.map(|at| floats(payload, at + 8, 1)[0]).collect(),
        joints: floats(payload, joints_at, joints),
    })
}

/// The same numbers, those that are none included.
fn same(ours: impl Iterator<Item = f32>, theirs: &[f32]) -> bool {
    ours.map(f32::to_bits)
        .eq(theirs.iter().map(|value| value.to_bits()))
}

#[test]
fn a_reader_of_1_0_gets_from_messages_of_1_1_what_it_knows() {
    let mut read = 0;
    for vector in vectors::all() {
        let name = vector.name;
        let (old, new) = match (decode_as_1_0(&vector.packet), decode_packet(&vector.packet)) {
            (Ok(old), Ok(new)) => (old, new),
            (Err(old), Err(new)) => {
                assert_eq!(old, new.name(), "{name}");
                continue;
            }
            // What 1.1 misses behind the joint angles 1.0 never looked for.
            (Ok(_), Err(new)) => {
                assert!(name.starts_with("bad_raw_sections"), "{name}: {new}");
                assert_eq!(new.name(), "section_short", "{name}");
                continue;
            }
            (Err(old), Ok(_)) => panic!("{name}: 1.0 finds {old}"),
        };
        read += usize::from(!vector.is_1_0);
        match (old, new.body) {
            (
                Old::Image {
                    pixels,
                    levels,
                    actuators,
                    joints,
                },
                Body::Image(image),
            ) => {
                assert_eq!(pixels, image.pixels(), "{name}");
                assert_eq!(actuators, image.actuators().len(), "{name}");
                assert!(same(image.levels(), &levels), "{name}");
                assert!(same(image.joints(), &joints), "{name}");
            }
            (
                Old::Raw {
                    counts,
                    forces,
                    joints,
                },
                Body::Raw(raw),
            ) => {
                let ours = raw.taxels().map(|taxel| taxel.counts.map(usize::from));
                assert_eq!(counts, ours.collect::<Vec<_>>(), "{name}");
                assert!(same(raw.taxels().map(|taxel| taxel.force), &forces), "{name}");
                assert!(same(raw.joints(), &joints), "{name}");
            }
            (
                Old::Text(old),
                Body::Hello(new) | Body::Status(new) | Body::Event(new) | Body::Subscribe(new),
            ) => assert_eq!(old, new, "{name}"),
            (Old::PassedOver, Body::Touch(_) | Body::Estimate(_) | Body::Unknown(_)) => {}
            (old, new) => panic!("{name}: {old:?} is {new:?}"),
        }
    }
    assert!(read >= 12, "only {read} messages of 1.1 were read");
}

/// The keys of a HELLO's modules as 1.0 had them.
#[derive(Deserialize)]
struct OldHello {
    modules: Vec<OldModule>,
}

#[derive(Deserialize)]
struct OldModule {
    name: String,
    part: String,
    first_taxel: u16,
    taxels: u16,
}

#[derive(Deserialize)]
struct OldEvent {
    event: OldEventKind,
    message: String,
}

#[derive(Debug, PartialEq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum OldEventKind {
    Refused,
    Disconnect,
    Calibrating,
    Calibrated,
    Paused,
    Resumed,
    Notice,
    #[serde(other)]
    Other,
}

fn text_of(name: &str) -> Vec<u8> {
    let all = vectors::all();
    let vector = all.iter().find(|vector| vector.name == name).unwrap();
    match decode_as_1_0(&vector.packet) {
        Ok(Old::Text(text)) => text,
        other => panic!("{name}: {other:?}"),
    }
}

#[test]
fn a_reader_of_1_0_reads_the_texts_of_1_1() {
    let hello: OldHello = serde_json::from_slice(&text_of("hello_pose")).unwrap();
    let OldModule {
        name,
        part,
        first_taxel,
        taxels,
    } = &hello.modules[0];
    assert_eq!((name.as_str(), part.as_str()), ("index tip", "index"));
    assert_eq!((*first_taxel, *taxels), (0, 2));
    let mark: OldEvent = serde_json::from_slice(&text_of("event_mark")).unwrap();
    assert_eq!(mark.event, OldEventKind::Other);
    assert_eq!(mark.message, "squeeze 3 begins");
}
