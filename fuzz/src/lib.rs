//! What each fuzz target does with its bytes: feeds a parser, and checks what must hold whatever it is fed.
//!
//! The functions are called by libFuzzer (`fuzz_targets/`, `cargo +nightly fuzz run TARGET --features libfuzzer`) and, on
//! stable, by `cargo test` with pseudo-random bytes and with every file under `regressions/TARGET/`. An input that once
//! failed is kept there.

use std::sync::LazyLock;
use taxel_can::{CanFrame, LogReader};
use taxel_skin::{BoardCounters, Decoded, Decoder, Discovery, Layout, Readings};

/// A target's name and function.
pub type Target = (&'static str, fn(&[u8]));

/// Every target.
pub const TARGETS: [Target; 5] = [
    ("candump_line", candump_line),
    ("wire_decode", wire_decode),
    ("decoder_frames", decoder_frames),
    ("cyskin_reassembly", cyskin_reassembly),
    ("layout_file", layout_file),
];

/// A candump log: as many results as lines at most, and a frame that was read prints as a line that reads as the same.
pub fn candump_line(data: &[u8]) {
    let lines = data.split(|b| *b == b'\n').count();
    let mut results = 0;
    for entry in LogReader::new(data).flatten() {
        results += 1;
        let line = format!("(1.000000) can0 {}\n", entry.frame);
        let again = LogReader::new(line.as_bytes()).next();
        let again = again.expect("a line").expect("what was printed can be read");
        assert_eq!(again.frame, entry.frame, "{line}");
    }
    assert!(results <= lines);
}

/// A message of the wire format: decoded within the bytes given, alone and as a packet.
pub fn wire_decode(data: &[u8]) {
    if let Ok((_, used)) = taxel_wire::decode(data) {
        assert!(used <= data.len());
    }
    let _ = taxel_wire::decode_packet(data);
}

/// The frames that the bytes stand for: four bytes of raw identifier, one of length, and the data.
fn frames(mut data: &[u8]) -> impl Iterator<Item = CanFrame> + '_ {
    std::iter::from_fn(move || {
        let (id, rest) = data.split_first_chunk::<4>()?;
        let (len, rest) = rest.split_first()?;
        let len = usize::from(len % 9).min(rest.len());
        data = &rest[len..];
        CanFrame::from_raw(u32::from_le_bytes(*id), &rest[..len]).ok()
    })
}

static HANDS: LazyLock<Vec<Layout>> = LazyLock::new(|| {
    Layout::builtin_names()
        .map(|name| Layout::builtin(name).expect("built in"))
        .collect()
});

/// Any frames to the decoder of every built-in hand and to a discovery: each frame in one count.
pub fn decoder_frames(data: &[u8]) {
    for hand in HANDS.iter() {
        let mut decoder = Decoder::new(hand, 0);
        check_decoder(hand, &mut decoder, frames(data));
    }
    let mut discovery = Discovery::scan(1);
    for (ms, frame) in (0..).step_by(7).zip(frames(data)) {
        while discovery.poll(ms * 1_000_000).is_some() {}
        discovery.hear(0, &frame, ms * 1_000_000);
    }
    assert!(discovery.finish().0.boards.len() <= 16);
}

fn check_decoder(hand: &Layout, decoder: &mut Decoder, frames: impl Iterator<Item = CanFrame>) {
    let mut readings = Readings::new();
    for (t_ns, frame) in (0..).step_by(1_000_000).zip(frames) {
        let decoded = decoder.decode_at(t_ns, &frame, &mut readings);
        assert!(decoded == Decoded::Readings || readings.is_empty());
        assert!(readings.iter().all(|r| usize::from(r.taxel) < hand.len()));
    }
    let bus = *decoder.counters();
    let mut board = BoardCounters::default();
    for module in 0..hand.modules.len() {
        decoder.add_to(module as u16, &mut board);
    }
    let counted = bus.readings + bus.unknown + bus.not_data + bus.commands + bus.partial;
    assert_eq!(counted + board.malformed + board.queue_overflows, bus.frames);
    assert!(bus.abandoned <= bus.partial);
}

/// Frames of one CySkin hub, under parameters that the first byte chooses. Checksums are mostly off, so that the bytes
/// behind them are reached.
pub fn cyskin_reassembly(data: &[u8]) {
    let Some((choice, mut rest)) = data.split_first() else {
        return;
    };
    static SKINS: LazyLock<Vec<Layout>> = LazyLock::new(|| {
        let mut skins = Vec::new();
        for checksum in ["unchecked", "unchecked", "unchecked", "crc8"] {
            for (above, sensors) in [(0, 12), (5, 12), (255, 12), (5, 1)] {
                let text = format!(
                    "name = \"c\"\nimage = {{ width = 11, height = 248 }}\nbuses = [\"b\"]\n[cyskin]\nbyte_order = \"big\"\n\
                     checksum = \"{checksum}\"\nsequence_bytes_above = {above}\nsensors_per_module = {sensors}\n\
                     [[cyskin.hub]]\nname = \"h\"\nbus = \"b\"\naddress = 1\n"
                );
                let modules = (0..248).map(|m| {
                    format!(
                        "[[module]]\nname = \"{m}\"\npart = \"p\"\nbus = \"b\"\nhub = \"h\"\nboard = {m}\n\
                         protocol = \"cyskin\"\nat = [0, {m}]\norder = [[1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11]]\n"
                    )
                });
                let text = text + &modules.collect::<String>();
                skins.push(Layout::parse(&text, "c.toml").expect("a layout"));
            }
        }
        skins
    });
    let hand = &SKINS[usize::from(*choice) % SKINS.len()];
    let mut decoder = Decoder::new(hand, 0);
    let frames = std::iter::from_fn(|| {
        let (head, after) = rest.split_first()?;
        let len = usize::from(head >> 3 & 15).min(8).min(after.len());
        let (data, after) = after.split_at(len);
        rest = after;
        CanFrame::extended(u32::from(head & 7) << 26 | 1, data).ok()
    });
    check_decoder(hand, &mut decoder, frames);
}

/// The text of a layout file: a layout that can be used, or an error that can be printed.
pub fn layout_file(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else {
        return;
    };
    match Layout::parse(text, "fuzz.toml") {
        Ok(layout) => {
            for bus in 0..layout.buses.len() {
                Decoder::new(&layout, bus as u8);
            }
            for (n, taxel) in layout.taxels.iter().enumerate() {
                assert_eq!(layout.taxel_at(taxel.x, taxel.y), Some(n));
            }
        }
        Err(error) => assert!(error.to_string().starts_with("fuzz.toml:")),
    }
}
