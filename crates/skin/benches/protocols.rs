//! Frames per second through the decoder of each board protocol, from memory.
//!
//! `cargo bench -p taxel-skin --bench protocols`; the goal is 5 million frames per second on one
//! core, for each. A frame carries 1 (uSkin), 5 to 7 (iCub), 4 (CPM finger) or up to 4 values
//! (CySkin, a module of seven sensors in three frames).

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use taxel_can::CanFrame;
use taxel_skin::{Decoder, Layout, Readings, cyskin_frames, icub_triangle_data};

fn main() {
    divan::main();
}

/// One sweep of the built-in hand or layout file, bus 0 only.
fn uskin(name: &str) -> (Layout, Vec<CanFrame>) {
    let layout = Layout::builtin(name).expect("built in");
    let frames = (0..layout.len())
        .filter(|n| layout.wiring_of(*n).bus == 0)
        .map(|n| {
            let (module, k) = (layout.wiring_of(n), layout.k[n]);
            let counts = [32_768, 32_700, 12_300 + n as u16];
            let frame = module.protocol.frame(module.board, k, counts, 0x82);
            frame.expect("a taxel of the layout")
        });
    let frames = frames.collect();
    (layout, frames)
}

fn icub(protocol: &str) -> (Layout, Vec<CanFrame>) {
    let text = Layout::builtin_text("icub-forearm").expect("built in");
    let layout = Layout::parse(&text.replace("\"icub-mtb3\"", protocol), "icub").expect("a layout");
    let frames = (0..8).flat_map(|triangle| {
        icub_triangle_data([240 + triangle as u8; 12], 0, 0)
            .map(|data| CanFrame::standard(0x410 + triangle, &data).expect("eight bytes"))
    });
    (layout, frames.collect())
}

/// Forty modules of seven taxels on two hubs, each in a packet of its own.
fn cyskin(checksum: &str) -> (Layout, Vec<CanFrame>) {
    let mut text = format!(
        "name = \"cy\"\nimage = {{ width = 280, height = 2 }}\nbuses = [\"can0\"]\n[cyskin]\nids = \"extended\"\nbyte_order = \"big\"\n\
         checksum = \"{checksum}\"\nsequence_bytes_above = 5\nsensors_per_module = 12\n"
    );
    for hub in 0..2 {
        text += &format!(
            "[[cyskin.hub]]\nname = \"h{hub}\"\nbus = \"can0\"\naddress = {}\n",
            0x123 + hub
        );
    }
    for hub in 0..2 {
        for m in 0..40 {
            text += &format!(
                "[[module]]\nname = \"{hub}/{m}\"\npart = \"p\"\nbus = \"can0\"\nhub = \"h{hub}\"\nboard = {m}\n\
                 protocol = \"cyskin\"\nat = [{}, {hub}]\norder = [[1, 2, 3, 4, 5, 6, 7]]\n",
                m * 7
            );
        }
    }
    let layout = Layout::parse(&text, "cy").expect("a layout");
    let setup = layout.cyskin.clone().expect("a table");
    let frames = (0..80u8).flat_map(|m| {
        let mut data = vec![m % 40, 1];
        data.extend([1; 14]);
        cyskin_frames(&setup, 0x123 + u32::from(m / 40), 0x43, &data).expect("a packet")
    });
    let frames = frames.collect();
    (layout, frames)
}

fn finger() -> (Layout, Vec<CanFrame>) {
    let layout = Layout::builtin("cpm-finger").expect("built in");
    let ids = [0x405, 0x407, 0x409, 0x40B, 0x601];
    let frames = ids.map(|id| CanFrame::standard(id, &[1, 0, 2, 0, 3, 0, 4, 0]).expect("eight bytes"));
    (layout, frames.to_vec())
}

#[divan::bench(args = ["uskin-l1", "uskin-l2", "uskin-l3", "icub-mtb3", "icub-mtb4", "cyskin sum", "cyskin crc8", "cpm-finger"])]
fn decode(bencher: Bencher<'_, '_>, protocol: &str) {
    let (layout, sweep) = match protocol {
        "uskin-l1" => uskin("uskin-module"),
        "uskin-l2" => uskin("allegro-uskin-15"),
        "uskin-l3" => uskin("allegro-xela-18"),
        "icub-mtb3" => icub("\"icub-mtb3\""),
        "icub-mtb4" => icub("\"icub-mtb4\""),
        "cyskin sum" => cyskin("sum"),
        "cyskin crc8" => cyskin("crc8"),
        _ => finger(),
    };
    let frames: Vec<CanFrame> = sweep
        .iter()
        .copied()
        .cycle()
        .take(24_000 / sweep.len() * sweep.len())
        .collect();
    let mut decoder = Decoder::new(&layout, 0);
    bencher.counter(ItemsCount::new(frames.len())).bench_local(|| {
        let mut readings = Readings::new();
        for (t_ns, frame) in (0..).zip(&frames) {
            black_box(decoder.decode_at(t_ns, frame, &mut readings));
            black_box(&readings);
        }
    });
    let counters = decoder.counters();
    assert_eq!(
        counters.readings + counters.partial,
        counters.frames,
        "every frame was understood"
    );
}
