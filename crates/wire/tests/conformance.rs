//! The readers of all three languages agree on the committed byte vectors and on mutations of them.
//!
//! `TAXEL_WIRE_REGENERATE=1 cargo test -p taxel-wire --test conformance` writes `vectors/` anew,
//! but for the files of version 1.0, which never change.

mod c_program;
mod vectors;

use serde_json::{Map, Value, json};
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use taxel_wire::{Body, Header, decode_packet};
use vectors::Vector;

fn here(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

#[test]
fn the_committed_vectors_are_what_the_encoder_makes() {
    let regenerate = std::env::var_os("TAXEL_WIRE_REGENERATE").is_some();
    let mut names = Vec::new();
    for Vector {
        name,
        description,
        packet,
        is_1_0,
    } in vectors::all()
    {
        let (bin, json) = (
            here(&format!("vectors/{name}.bin")),
            here(&format!("vectors/{name}.json")),
        );
        let expected = dump(&packet);
        if regenerate && !is_1_0 {
            fs::write(&bin, &packet).unwrap();
            let text = format!(
                "{{\n  \"description\": {},\n  \"expected\": {expected}\n}}\n",
                json!(description)
            );
            fs::write(&json, text).unwrap();
        }
        let again = "run with TAXEL_WIRE_REGENERATE=1 if the format was changed on purpose";
        assert_eq!(fs::read(&bin).unwrap(), packet, "{name}.bin: {again}");
        let committed: Value = serde_json::from_slice(&fs::read(&json).unwrap()).unwrap();
        assert_eq!(committed["description"], description, "{name}.json: {again}");
        assert_eq!(
            normal(&committed["expected"]),
            normal(&expected),
            "{name}.json: {again}"
        );
        names.push(name.to_owned());
    }
    let mut files: Vec<String> = fs::read_dir(here("vectors"))
        .unwrap()
        .map(|entry| {
            entry
                .unwrap()
                .path()
                .file_stem()
                .unwrap()
                .to_string_lossy()
                .into_owned()
        })
        .collect();
    files.sort();
    files.dedup();
    names.sort();
    assert_eq!(files, names, "files in vectors/ that no vector makes");
}

/// FNV-1a over names and bytes: the files of version 1.0 as they were when 1.1 was made.
const FILES_OF_1_0: u64 = 0x0fd4_78f4_ffcf_e8f3;

#[test]
fn the_vectors_of_version_1_0_are_what_they_were() {
    let mut names: Vec<&str> = vectors::all()
        .iter()
        .filter(|v| v.is_1_0)
        .map(|v| v.name)
        .collect();
    names.sort();
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    for name in names {
        let (bin, json) = (format!("vectors/{name}.bin"), format!("vectors/{name}.json"));
        let files = [fs::read(here(&bin)).unwrap(), fs::read(here(&json)).unwrap()];
        for byte in name.bytes().chain(files.into_iter().flatten()) {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3);
        }
    }
    assert_eq!(hash, FILES_OF_1_0, "{hash:#x}");
}

#[test]
fn every_error_has_a_vector() {
    let errors: Vec<String> = vectors::all()
        .iter()
        .filter_map(|vector| dump(&vector.packet)["error"].as_str().map(str::to_owned))
        .collect();
    for name in [
        "short_header",
        "bad_magic",
        "major_version",
        "header_len",
        "too_long",
        "truncated",
        "trailing",
        "fixed_len",
        "section_short",
        "bad_force",
        "bad_actuator",
    ] {
        assert!(
            errors.iter().any(|e| e == name),
            "no vector with the error {name}"
        );
    }
}

#[test]
fn the_python_reader_agrees_on_every_vector_and_mutation() {
    let mut python = Command::new("python3");
    python.arg(here("tests/dump.py"));
    match python3_missing() {
        true => println!("SKIPPED: no python3 on this machine; the Python reader was NOT checked"),
        false => agrees(python),
    }
}

#[test]
fn the_c_reader_agrees_on_every_vector_and_mutation_under_the_sanitizers() {
    let dir = tempfile::tempdir().unwrap();
    let program = dir.path().join("dump");
    if c_program::compile("tests/dump.c", &program).is_none() {
        return;
    }
    agrees(Command::new(program));
}

fn python3_missing() -> bool {
    !Command::new("python3")
        .arg("--version")
        .output()
        .is_ok_and(|out| out.status.success())
}

/// Feeds the vectors and their mutations to a program and compares what it says with the Rust reader.
fn agrees(mut program: Command) {
    let mut packets: Vec<(String, Vec<u8>)> = vectors::all()
        .into_iter()
        .map(|v| (v.name.to_owned(), v.packet))
        .collect();
    packets.extend(vectors::mutations(3000));
    let mut input = Vec::new();
    for (_, packet) in &packets {
        input.extend_from_slice(&(packet.len() as u32).to_le_bytes());
        input.extend_from_slice(packet);
    }
    let mut child = program
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut stdin = child.stdin.take().unwrap();
    let writer = std::thread::spawn(move || stdin.write_all(&input));
    let output = child.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    writer.join().unwrap().unwrap();
    let lines: Vec<&[u8]> = output
        .stdout
        .split(|b| *b == b'\n')
        .filter(|l| !l.is_empty())
        .collect();
    assert_eq!(lines.len(), packets.len(), "{said}");
    let mut accepted = 0;
    for ((name, packet), line) in packets.iter().zip(lines) {
        let theirs: Value = serde_json::from_slice(line).unwrap();
        let ours = dump(packet);
        accepted += usize::from(ours["error"].is_null());
        assert_eq!(normal(&theirs), normal(&ours), "{name}: {packet:02x?}");
    }
    assert!(
        accepted > 300 && accepted < packets.len() - 300,
        "mutations are too mild or too wild: {accepted} decode"
    );
}

/// What the Rust reader makes of a packet, in the form of the vectors' JSON.
fn dump(packet: &[u8]) -> Value {
    let message = match decode_packet(packet) {
        Ok(message) => message,
        Err(error) => return json!({ "error": error.name() }),
    };
    let mut out = dump_header(&message.header);
    let joints = |joints: &mut dyn Iterator<Item = f32>| joints.map(float).collect::<Value>();
    match message.body {
        Body::Image(image) => {
            out.insert("width".into(), image.width.into());
            out.insert("height".into(), image.height.into());
            out.insert("contacts".into(), image.contacts.into());
            out.insert("faulty".into(), image.faulty.into());
            out.insert("missing".into(), image.missing.into());
            out.insert("levels".into(), image.levels().map(float).collect());
            let actuators = image
                .actuators()
                .map(|a| json!([a.id, a.x, a.y, a.level, float(a.force)]));
            out.insert("actuators".into(), actuators.collect());
            out.insert("joints".into(), joints(&mut image.joints()));
            out.insert("pixels".into(), hex(image.pixels()).into());
        }
        Body::Raw(raw) => {
            out.insert("threshold".into(), float(raw.threshold));
            out.insert("joints".into(), joints(&mut raw.joints()));
            let taxels = raw.taxels().map(|t| {
                json!({
                    "counts": t.counts,
                    "faults": t.faults,
                    "force": float(t.force),
                    "age_us": t.age_us,
                    "freshness": t.freshness as u8,
                    "status": t.status,
                    "contact": u8::from(t.contact),
                    "repaired": u8::from(t.repaired),
                })
            });
            out.insert("taxels".into(), taxels.collect());
            let floats = |values: &mut dyn Iterator<Item = f32>| values.map(float).collect::<Value>();
            if let Some(ages) = raw.joint_ages_us() {
                out.insert("joint_ages_us".into(), ages.collect());
            }
            if let Some(mut velocities) = raw.joint_velocities_rad_s() {
                out.insert("joint_velocities".into(), floats(&mut velocities));
            }
            if let Some(mut currents) = raw.joint_currents_a() {
                out.insert("joint_currents".into(), floats(&mut currents));
            }
            if let (Some(baselines), Some(rest)) = (raw.baselines(), raw.baselines()) {
                let presses = raw.taxels().zip(rest).map(|(taxel, rest)| taxel.press(rest));
                let of_taxel = |values: [f32; 3]| floats(&mut values.into_iter());
                out.insert("baselines".into(), baselines.map(of_taxel).collect());
                out.insert("presses".into(), presses.map(of_taxel).collect());
            }
        }
        Body::Hello(bytes)
        | Body::Status(bytes)
        | Body::Event(bytes)
        | Body::Touch(bytes)
        | Body::Estimate(bytes)
        | Body::Subscribe(bytes)
        | Body::Unknown(bytes) => {
            out.insert("payload".into(), hex(bytes).into());
        }
    }
    Value::Object(out)
}

fn dump_header(header: &Header) -> Map<String, Value> {
    let fields = json!({
        "major": header.major,
        "minor": header.minor,
        "header_len": header.header_len,
        "type": header.kind.number(),
        "flags": header.flags.0,
        "payload_len": header.payload_len,
        "seq": header.seq,
        "t_ns": header.t_ns,
        "skipped": header.skipped,
    });
    match fields {
        Value::Object(fields) => fields,
        _ => unreachable!("a JSON object was written"),
    }
}

fn float(value: f32) -> Value {
    serde_json::Number::from_f64(value.into()).map_or(Value::Null, Value::Number)
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

/// The same numbers in the same form, however they were printed: integers, or the value of a 32-bit float.
fn normal(value: &Value) -> Value {
    match value {
        Value::Number(number) if number.is_u64() => value.clone(),
        Value::Number(number) => {
            let float = f64::from(number.as_f64().unwrap() as f32);
            if float >= 0.0 && float.fract() == 0.0 && float < 1e15 {
                (float as u64).into()
            } else {
                float.into()
            }
        }
        Value::Array(values) => values.iter().map(normal).collect(),
        Value::Object(fields) => Value::Object(fields.iter().map(|(k, v)| (k.clone(), normal(v))).collect()),
        other => other.clone(),
    }
}
