//! The fuzz targets on stable: regressions, seeds, and a fixed set of pseudo-random changes of them.

use std::path::Path;
use taxel_fuzz::TARGETS;
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
        "layout_file" => Layout::builtin_names()
            .filter_map(Layout::builtin_text)
            .flat_map(|text| [text.as_bytes().to_vec(), text.replace("#!", "").into_bytes()])
            .collect(),
        _ => (0..5u8)
            .map(|kind| {
                // Magic, version, length of the header, kind; then a payload.
                let mut message = taxel_wire::MAGIC.to_vec();
                message.extend([taxel_wire::MAJOR, taxel_wire::MINOR, taxel_wire::HEADER_LEN as u8, 0, kind, 0, 0, 0]);
                message.extend(60u32.to_le_bytes());
                message.resize(taxel_wire::HEADER_LEN, 0);
                message.extend([1, 0, 0, 0].repeat(15));
                message
            })
            .collect(),
    }
}

#[test]
fn every_target_stands_its_regressions_seeds_and_their_changes() {
    for (target, run) in TARGETS {
        let mut random = Random(7);
        let folder = Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("regressions")
            .join(target);
        for file in std::fs::read_dir(folder).into_iter().flatten().flatten() {
            run(&std::fs::read(file.path()).expect("a readable file"));
        }
        let seeds = seeds(target);
        let rounds = if target == "layout_file" { 300 } else { 5_000 };
        for seed in &seeds {
            run(seed);
        }
        for _ in 0..rounds {
            let mut input = seeds[random.below(seeds.len())].clone();
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
            run(&input);
            let noise: Vec<u8> = (0..random.below(200)).map(|_| random.next() as u8).collect();
            run(&noise);
        }
    }
}
