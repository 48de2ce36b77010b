//! What each fuzz target does with its bytes: feeds a parser, and checks what must hold whatever it is fed.
//!
//! The functions are called by libFuzzer (`fuzz_targets/`, `fuzz/run`) and, on stable, by `cargo
//! test` with pseudo-random bytes and with every file under `regressions/TARGET/`. An input that
//! once failed is kept there.

mod boards;
mod files;
mod joints;
mod messages;

/// A target's name and function.
pub type Target = (&'static str, fn(&[u8]));

/// Every target.
pub const TARGETS: [Target; 16] = [
    ("candump_line", messages::candump_line),
    ("python_can_datagram", messages::python_can_datagram),
    ("wire_decode", messages::wire_decode),
    ("subscribe_text", messages::subscribe_text),
    ("decoder_frames", boards::decoder_frames),
    ("cyskin_reassembly", boards::cyskin_reassembly),
    ("recognise_frames", boards::recognise_frames),
    ("dynamixel_stream", joints::dynamixel_stream),
    ("allegro_frames", joints::allegro_frames),
    ("layout_file", files::layout_file),
    ("configuration", files::configuration),
    ("scene_file", files::scene_file),
    ("array_file", files::array_file),
    ("csv_file", files::csv_file),
    ("mat_file", files::mat_file),
    ("recording_file", files::recording_file),
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

/// Runs the target of this name.
///
/// # Panics
/// Where there is no such target, and where what must hold does not.
pub fn run(target: &str, data: &[u8]) {
    let (_, function) = TARGETS
        .iter()
        .find(|(name, _)| *name == target)
        .unwrap_or_else(|| panic!("there is no target {target}"));
    function(data);
}
