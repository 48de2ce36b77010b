//! What each fuzz target does with its bytes: feeds a parser, and checks what must hold whatever it is fed.
//!
//! The functions are called by libFuzzer (`fuzz_targets/`, `fuzz/run`) and, on stable, by `cargo
//! test` with pseudo-random bytes and with every file under `regressions/TARGET/`. An input that
//! once failed is kept there.
//!
//! Each program in `fuzz_targets/` calls its own function, and not one by its name out of [`TARGETS`]: libFuzzer goes through
//! all coverage counters of a program after each input, and these are then those of one parser, not of the workspace.

mod boards;
mod files;
mod joints;
mod messages;

pub use boards::{cyskin_reassembly, decoder_frames, recognise_frames};
pub use files::{array_file, configuration, csv_file, layout_file, mat_file, recording_file, scene_file};
pub use joints::{allegro_frames, dynamixel_stream};
pub use messages::{candump_line, python_can_datagram, subscribe_text, wire_decode};

/// A target's name and function.
pub type Target = (&'static str, fn(&[u8]));

/// Every target.
pub const TARGETS: [Target; 16] = [
    ("candump_line", candump_line),
    ("python_can_datagram", python_can_datagram),
    ("wire_decode", wire_decode),
    ("subscribe_text", subscribe_text),
    ("decoder_frames", decoder_frames),
    ("cyskin_reassembly", cyskin_reassembly),
    ("recognise_frames", recognise_frames),
    ("dynamixel_stream", dynamixel_stream),
    ("allegro_frames", allegro_frames),
    ("layout_file", layout_file),
    ("configuration", configuration),
    ("scene_file", scene_file),
    ("array_file", array_file),
    ("csv_file", csv_file),
    ("mat_file", mat_file),
    ("recording_file", recording_file),
];

/// A target with a bug, to see that fuzzing finds bugs: it panics on what begins with `TAXELBUG`.
/// Coverage leads there byte by byte; chance would need 2^64 inputs.
pub fn planted(data: &[u8]) {
    let mut right = 0;
    for (byte, wanted) in data.iter().zip(b"TAXELBUG") {
        if byte != wanted {
            break;
        }
        right += 1;
        assert!(right < 8, "the planted bug");
    }
}
