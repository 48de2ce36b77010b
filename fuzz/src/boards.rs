//! Frames on a bus of skin.

use std::sync::LazyLock;
use taxel_can::{CanFrame, Received};
use taxel_skin::{
    BoardStatus, BusMonitor, Decoded, Decoder, Discovery, HubIds, Layout, Readings, Recogniser,
};

/// The frames that the bytes stand for: four bytes of raw identifier, one of length, and the data.
pub(crate) fn frames(mut data: &[u8]) -> impl Iterator<Item = CanFrame> + '_ {
    std::iter::from_fn(move || {
        let (id, rest) = data.split_first_chunk::<4>()?;
        let (len, rest) = rest.split_first()?;
        let len = usize::from(len % 9).min(rest.len());
        data = &rest[len..];
        CanFrame::from_raw(u32::from_le_bytes(*id), &rest[..len]).ok()
    })
}

static HANDS: LazyLock<Vec<(Layout, Decoder, BusMonitor)>> = LazyLock::new(|| {
    Layout::builtin_names()
        .map(|name| {
            let hand = Layout::builtin(name).expect("built in");
            let (decoder, monitor) = (Decoder::new(&hand, 0), BusMonitor::new(&hand));
            (hand, decoder, monitor)
        })
        .collect()
});

/// Any frames to the decoder of every built-in hand and to a discovery: each frame in one count.
pub fn decoder_frames(data: &[u8]) {
    for (hand, decoder, monitor) in HANDS.iter() {
        let mut decoder = decoder.clone();
        check_decoder(hand, &mut decoder, frames(data));
        let mut monitor = monitor.clone();
        for (ms, frame) in (0..).step_by(97).zip(frames(data)) {
            let t_ns = ms * 1_000_000;
            monitor.handle_frame(0, &Received { t_ns, frame });
        }
    }
    let mut discovery = Discovery::scan(1);
    for (ms, frame) in (0..).step_by(7).zip(frames(data)) {
        while discovery.poll_command(ms * 1_000_000).is_some() {}
        let t_ns = ms * 1_000_000;
        discovery.handle_frame(0, &Received { t_ns, frame });
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
    let mut board = BoardStatus::default();
    for module in 0..hand.modules.len() {
        decoder.add_to(module as u16, &mut board);
    }
    let counted = bus.readings + bus.unknown + bus.not_data + bus.commands + bus.partial;
    assert_eq!(counted + board.malformed + board.queue_overflows, bus.frames);
    assert!(bus.abandoned <= bus.partial);
}

/// Frames of one CySkin hub, under parameters that the first byte chooses. Checksums are mostly
/// off, so that the bytes behind them are reached.
pub fn cyskin_reassembly(data: &[u8]) {
    let Some((choice, mut rest)) = data.split_first() else {
        return;
    };
    static SKINS: LazyLock<Vec<Layout>> = LazyLock::new(|| {
        let mut skins = Vec::new();
        let variants = ["extended", "standard"]
            .map(|ids| ["unchecked", "unchecked", "unchecked", "crc8"].map(|c| (ids, c)));
        for (ids, checksum) in variants.into_iter().flatten() {
            for (above, sensors) in [(0, 12), (5, 12), (255, 12), (5, 1)] {
                let text = format!(
                    "name = \"c\"\nimage = {{ width = 11, height = 248 }}\nbuses = [\"b\"]\n[cyskin]\nids = \"{ids}\"\nbyte_order = \"big\"\n\
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
    let ids = hand.cyskin.as_ref().map_or(HubIds::Extended, |setup| setup.ids);
    let frames = std::iter::from_fn(|| {
        let (head, after) = rest.split_first()?;
        let len = usize::from(head >> 3 & 15).min(8).min(after.len());
        let (data, after) = after.split_at(len);
        rest = after;
        let place = u16::from(head & 7);
        match ids {
            HubIds::Standard => CanFrame::standard(place << 8 | 1, data).ok(),
            HubIds::Extended => CanFrame::extended(u32::from(place) << 26 | 1, data).ok(),
        }
    });
    check_decoder(hand, &mut decoder, frames);
}

/// Any frames to the recogniser of unknown buses: the layout file that it proposes is one.
pub fn recognise_frames(data: &[u8]) {
    let mut recogniser = Recogniser::new(2);
    for (i, frame) in (0u64..).zip(frames(data)) {
        let t_ns = i * 700_000;
        recogniser.handle_frame((i % 2) as u8, &Received { t_ns, frame });
    }
    if let Some(text) = recogniser.finish().layout_file("fuzz", &["a", "b"]) {
        Layout::parse(&text, "fuzz.toml").unwrap_or_else(|e| panic!("{e}\n{text}"));
    }
}
