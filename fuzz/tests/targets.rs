//! The fuzz targets on stable: regressions, seeds, and a fixed set of pseudo-random changes of them.

use std::io::Write;
use std::path::Path;
use taxel_can::{CanFrame, Received};
use taxel_forearm::{Matrix, write_mat};
use taxel_fuzz::TARGETS;
use taxel_joints::protocol2::Encoder;
use taxel_recorder::{Attached, CanBlock, Entry, Preamble, RecordingWriter, Topic, event_message};
use taxel_sim::{Scene, Simulator, with_stand_in_boards};
use taxel_skin::{Layout, icub_triangle_data};

/// SplitMix64.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ z >> 31
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n.max(1) as u64) as usize
    }
}

fn raw(frames: &[(u32, Vec<u8>)]) -> Vec<u8> {
    let mut bytes = Vec::new();
    for (id, data) in frames {
        bytes.extend(id.to_le_bytes());
        bytes.push(data.len() as u8);
        bytes.extend(data);
    }
    bytes
}

/// A msgpack map with these keys and encoded values.
fn map(entries: &[(&str, &[u8])]) -> Vec<u8> {
    let mut bytes = vec![0x80 | entries.len() as u8];
    for (key, value) in entries {
        bytes.push(0xA0 | key.len() as u8);
        bytes.extend(key.bytes());
        bytes.extend_from_slice(value);
    }
    bytes
}

/// An array file, version 1.0, with this in its header.
fn npy(header: &str, data: &[u8]) -> Vec<u8> {
    let header = format!("{{{header}}}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.bytes());
    bytes.extend_from_slice(data);
    bytes
}

/// A layout file without boards, with taxel numbers that no board has.
fn array_layout() -> String {
    let order: Vec<Vec<u32>> = (0..20)
        .map(|row| (0..20).map(|n| 20 * row + n).collect())
        .collect();
    let module = "name = \"m\"\npart = \"m\"\nprotocol = \"offline\"\nat = [0, 0]\n";
    format!("name = \"a\"\nimage = {{ width = 20, height = 20 }}\n[[module]]\n{module}order = {order:?}\n")
}

/// Inputs that reach deep into each target.
fn seeds(target: &str) -> Vec<Vec<u8>> {
    match target {
        "candump_line" => vec![
            b"(1436509052.249713) can0 044#2A366C2BBA\n(1.5) vcan1 14000123#43\n(2.000000) can0 20000040#0000000000000000\n".to_vec(),
            b"(1.0) can0 123#R4\n(1.0) can0 123##1AABB\n".to_vec(),
        ],
        "decoder_frames" => {
            let [first, second] = icub_triangle_data([245; 12], 0xFFF, 1);
            vec![raw(&[
                (0x410, first.to_vec()),
                (0x410, second.to_vec()),
                (0x405, vec![1; 8]),
                (0x715, vec![]),
                (0x201, vec![7, 0]),
                (0x700, vec![0xFF, 5, 1, 2, 3]),
                (0x250, vec![0x1C, 5, 1, 2, 3, 1, 0, 1]),
            ])]
        }
        "cyskin_reassembly" => {
            let mut packet = vec![1];
            // FIRST, MIDDLE and LAST of a packet of 20 data bytes, frame numbers included.
            packet.extend([1 | 8 << 3, 0x43, 20, 0, 1, 1, 2, 3, 4]);
            packet.extend([2 | 8 << 3, 1, 5, 6, 7, 8, 9, 10, 11]);
            packet.extend([4 | 8 << 3, 2, 12, 13, 14, 15, 16, 17, 18]);
            vec![packet]
        }
        "python_can_datagram" => vec![
            map(&[("arbitration_id", &[0xCD, 0x01, 0x23]), ("is_extended_id", &[0xC2]), ("data", &[0xC4, 2, 7, 0])]),
            map(&[("arbitration_id", &[5]), ("is_remote_frame", &[0xC3]), ("dlc", &[8]), ("channel", &[0xC0])]),
            map(&[("is_error_frame", &[0xC3]), ("arbitration_id", &[4]), ("dlc", &[3]), ("data", &[0x93, 1, 2, 3])]),
            map(&[("x", &[0xDE, 0, 1, 0xA1, b'y', 0xDC, 0, 2, 1, 0xCB, 0, 0, 0, 0, 0, 0, 0, 0]), ("is_fd", &[0xC2])]),
        ],
        "subscribe_text" => vec![
            b"{}".to_vec(),
            br#"{"image":true,"raw":true,"status":false,"max_rate_hz":30.5,"region":["index","thumb"]}"#.to_vec(),
            br#"{"profile":{"levels":8,"actuators":16,"method":"optimal"}}"#.to_vec(),
            br#"{"raw":true,"every":true}"#.to_vec(),
            br#"{"event":"mark","message":"squeeze 3"}"#.to_vec(),
            br#"{"event":"stopping","message":"bye"}"#.to_vec(),
        ],
        "recognise_frames" => Layout::builtin_names()
            .map(|name| {
                let layout = with_stand_in_boards(&Layout::builtin(name).expect("built in")).expect("boards");
                let idle = Scene::builtin("idle").expect("built in");
                let mut hand = Simulator::new(&idle, &layout, 1).expect("a hand");
                hand.start_all();
                let mut frames = Vec::new();
                hand.advance(200_000_000, &mut frames);
                let frames = frames.iter().filter(|(bus, _)| *bus == 0).take(150);
                raw(&frames.map(|(_, r)| (r.frame.raw_id(), r.frame.data().to_vec())).collect::<Vec<_>>())
            })
            .collect(),
        "dynamixel_stream" => {
            let mut encoder = Encoder::with_capacity(64);
            let mut stream = vec![0xF7];
            stream.extend_from_slice(encoder.ping(1));
            stream.extend_from_slice(encoder.status(1, 0, &[0xFF, 0xFF, 0xFD, 0, 6]).expect("a packet"));
            stream.extend_from_slice(encoder.sync_read(126, 10, &[1, 2, 3]).expect("a packet"));
            stream.extend_from_slice(encoder.fast_sync_read(126, 2, &[1, 2]).expect("a packet"));
            vec![stream]
        }
        "allegro_frames" => vec![raw(&[
            (0x3D3, vec![0, 128, 1, 128, 2, 128, 3, 128]),
            (0x3D6, vec![0; 8]),
            (0x080, vec![1; 8]),
            (0x084, vec![1; 7]),
            (0x3C4, vec![]),
        ])],
        "configuration" => vec![
            b"[[bus]]\nsource = \"can:can0\"\n[[bus]]\nsource = \"udp:239.74.163.2:43113\"\n".to_vec(),
            b"layout = \"icub-forearm\"\n[[bus]]\nsource = \"sim:roll\"\n[tick]\nmode = \"sweep\"\nrate_hz = 30.0\n\
              [boards]\nmode = \"triggered\"\n[profile]\nlevels = 8\n[socket]\nimages = \"/run/x\"\n"
                .to_vec(),
        ],
        "scene_file" => Scene::names()
            .filter_map(|name| Some(Scene::builtin_text(name)?.as_bytes().to_vec()))
            .collect(),
        "mat_file" => vec![write_mat(&Matrix {
            name: "datos".into(),
            rows: 4,
            values: (0..40).map(f64::from).collect(),
        })],
        "array_file" => {
            let npy = npy("'descr': '<u2', 'fortran_order': False, 'shape': (2, 3, 3), ", &[1; 36]);
            let mut zip = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
            zip.start_file("a.npy", zip::write::SimpleFileOptions::default()).expect("a member");
            zip.write_all(&npy).expect("memory");
            let zip = zip.finish().expect("an archive").into_inner();
            let magnitudes = self::npy("'descr': '>f4', 'fortran_order': True, 'shape': (3, 2), ", &[0; 24]);
            vec![[&[0][..], &npy].concat(), [&[1][..], &zip].concat(), [&[2][..], &magnitudes].concat()]
        }
        "csv_file" => vec![
            b"\x00time_s,a,b\n0.0,1,2\n0.1,3,4.5e3\n".to_vec(),
            b"\x000F1B0X,0F1B0Y,0F1B0Z\n1,2,3\n".to_vec(),
            b"\x0A5,1,2,3\n6,4,5,6\n".to_vec(),
            b"\x00\xEF\xBB\xBF# c\r\n\"t\";a\r\n0;\"1\"\r\n".to_vec(),
        ],
        "recording_file" => {
            let mut block = CanBlock::default();
            let frame = CanFrame::standard(0x201, &[7, 0]).expect("a frame");
            block.push(0, &Received { t_ns: 5, frame });
            let can = block.take(&["can0".into()], &[0]);
            let attached = vec![Attached {
                name: "taxeld.toml".into(),
                media_type: "application/toml".into(),
                data: vec![b'#'],
            }];
            let preamble = Preamble { attached, ..Preamble::default() };
            let mut file = RecordingWriter::begin(std::io::Cursor::new(Vec::new()), &preamble, 1).expect("memory");
            let entry = Entry { topic: Topic::Can, wall_ns: 2, data: can.clone() };
            file.put(&entry).expect("memory");
            let file = file.finish().expect("memory").into_inner();
            let event = event_message("mark", "squeeze 3", 7);
            // Numbers that are lengths of lists, and what is in them.
            let lists = [&[0, 1, 0, 0][..], &[1, 0, 0, 0].repeat(60)].concat();
            [(0, file), (1, can), (2, lists), (3, event)]
                .into_iter()
                .map(|(choice, bytes)| [&[choice][..], &bytes].concat())
                .collect()
        }
        "layout_file" => Layout::builtin_names()
            .filter_map(Layout::builtin_text)
            .flat_map(|text| {
                let posed = text.replace(
                    "\n[[module]]\n",
                    "\n[[module]]\njoint = \"index 3\"\npose = { position_mm = [1, -2, 30.5], orientation = [0.6, 0, 0.8, 0] }\n",
                );
                [text.into(), text.replace("#!", ""), posed].map(String::into_bytes)
            })
            .chain([array_layout().into_bytes()])
            .collect(),
        _ => (0..9u8)
            .map(|kind| {
                // Magic, version, length of the header, kind; then a payload.
                let mut message = taxel_wire::MAGIC.to_vec();
                message.extend([taxel_wire::MAJOR, taxel_wire::MINOR, taxel_wire::HEADER_LEN as u8, 0, kind, 0, 0, 0]);
                message.extend(60u32.to_le_bytes());
                message.resize(taxel_wire::HEADER_LEN, 0);
                message.extend([1, 0, 0, 0].repeat(15));
                if kind == 8 {
                    // RAW of one taxel and one joint, with every section.
                    (message[8], message[12]) = (5, 72);
                    let raw = [1, 0, 0, 0, 20, 0, 20, 0, 0, 0, 32, 66, 1, 0, 0, 0, 15, 0, 0, 0];
                    message[taxel_wire::HEADER_LEN..][..raw.len()].copy_from_slice(&raw);
                    message.extend([0; 12]);
                }
                message
            })
            .collect(),
    }
}

/// What the target makes of the input; what fails is shown so that it can be kept.
fn check(target: &str, what: &str, input: &[u8]) {
    let (_, function) = TARGETS
        .iter()
        .find(|(name, _)| *name == target)
        .expect("a target");
    let failed = std::panic::catch_unwind(|| function(input)).is_err();
    assert!(!failed, "{target} fails on {what}: b\"{}\"", input.escape_ascii());
}

/// Up to seven bytes or pieces changed, cut off, put in or repeated.
fn change(random: &mut Random, input: &mut Vec<u8>) {
    for _ in 0..=random.below(6) {
        let at = random.below(input.len());
        match random.below(4) {
            0 => input.truncate(at),
            1 => input.insert(at, random.next() as u8),
            2 if !input.is_empty() => input[at] = random.next() as u8,
            _ => {
                let part: Vec<u8> = input[at..].iter().take(random.below(64)).copied().collect();
                input.extend(part);
            }
        }
    }
}

/// Runs the target on its regressions, its seeds, changes of them, and noise.
fn stands(target: &str, rounds: usize) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("regressions")
        .join(target);
    for file in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let input = std::fs::read(file.path()).expect("a readable file");
        check(target, &file.path().display().to_string(), &input);
    }
    let seeds = seeds(target);
    for seed in &seeds {
        check(target, "a seed", seed);
        // `fuzz/run` begins with these.
        if let Some(corpus) = std::env::var_os("TAXEL_FUZZ_SEEDS") {
            let folder = Path::new(&corpus).join(target);
            std::fs::create_dir_all(&folder).expect("a folder for seeds");
            let name = seed.iter().fold(seed.len() as u64, |h, b| {
                h.wrapping_mul(31).wrapping_add(u64::from(*b))
            });
            std::fs::write(folder.join(format!("seed-{name:016x}")), seed).expect("a file");
        }
    }
    let mut random = Random(7);
    for _ in 0..rounds {
        let mut input = seeds[random.below(seeds.len())].clone();
        change(&mut random, &mut input);
        check(target, "a changed seed", &input);
        let noise: Vec<u8> = (0..random.below(200)).map(|_| random.next() as u8).collect();
        check(target, "noise", &noise);
    }
}

macro_rules! targets {
    ($($name:ident: $rounds:literal,)*) => {
        const TESTED: [&str; TARGETS.len()] = [$(stringify!($name)),*];
        $(
            #[test]
            fn $name() {
                stands(stringify!($name), $rounds);
            }
        )*
    };
}

targets! {
    candump_line: 3_000,
    python_can_datagram: 3_000,
    wire_decode: 3_000,
    subscribe_text: 3_000,
    decoder_frames: 300,
    cyskin_reassembly: 3_000,
    recognise_frames: 300,
    dynamixel_stream: 3_000,
    allegro_frames: 3_000,
    layout_file: 300,
    configuration: 300,
    scene_file: 3_000,
    array_file: 3_000,
    csv_file: 3_000,
    mat_file: 3_000,
    recording_file: 1_000,
}

#[test]
fn every_target_is_tested_and_built_for_the_fuzzer() {
    let manifest = include_str!("../Cargo.toml");
    for (target, _) in TARGETS {
        assert!(TESTED.contains(&target), "{target}");
        assert!(
            manifest.contains(&format!("path = \"fuzz_targets/{target}.rs\"")),
            "{target}"
        );
    }
}

/// `fuzz/check` runs the fuzzer on it.
#[test]
fn the_planted_bug_is_a_bug() {
    taxel_fuzz::planted(b"TAXELBU");
    taxel_fuzz::planted(b"taxelbug");
    assert!(std::panic::catch_unwind(|| taxel_fuzz::planted(b"TAXELBUGS")).is_err());
}
