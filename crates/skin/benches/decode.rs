//! Frames per second through decoder and sweep assembly, from memory: the whole default hand, 15
//! boards on two buses.
//!
//! `cargo bench -p taxel-skin --bench decode`; the goal is 5 million frames per second on one core.

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use taxel_can::Received;
use taxel_hand::TactileFrame;
use taxel_skin::{Decoded, Decoder, Layout, Readings, SweepAssembler, SweepConfig};

const PERIOD_NS: u64 = 10_000_000;
const SWEEPS: u64 = 100;

fn main() {
    divan::main();
}

/// A second of traffic, with each sweep in the order in which a LIFO transmit queue gives it out.
fn traffic(layout: &Layout) -> Vec<(u8, Received)> {
    let mut frames = Vec::new();
    for sweep in 0..SWEEPS {
        for i in (0..layout.len()).rev() {
            let (module, k) = (layout.wiring_of(i), layout.k[i]);
            let counts = [32_768 + sweep as u16, 32_700, 12_300 + i as u16];
            let frame = module
                .protocol
                .frame(module.board, k, counts, 0x82)
                .expect("a taxel of the layout");
            let t_ns = 1_000_000_000 + sweep * PERIOD_NS + frames.len() as u64 % 240 * 30_000;
            frames.push((module.bus, Received { t_ns, frame }));
        }
    }
    frames
}

#[divan::bench]
fn decode(bencher: Bencher<'_, '_>) {
    let layout = Layout::builtin("allegro-uskin-15").expect("built in");
    let frames = traffic(&layout);
    let mut decoders = [Decoder::new(&layout, 0), Decoder::new(&layout, 1)];
    bencher.counter(ItemsCount::new(frames.len())).bench_local(|| {
        let mut readings = Readings::new();
        for (bus, received) in &frames {
            black_box(decoders[*bus as usize].decode(&received.frame, &mut readings));
            black_box(&readings);
        }
    });
}

#[divan::bench]
fn decode_and_assemble(bencher: Bencher<'_, '_>) {
    let layout = Layout::builtin("allegro-uskin-15").expect("built in");
    let frames = traffic(&layout);
    let mut decoders = [Decoder::new(&layout, 0), Decoder::new(&layout, 1)];
    let config = SweepConfig {
        settle_ms: 0.0,
        ..SweepConfig::default()
    };
    let mut assembler = SweepAssembler::new(&layout, &config, true);
    let mut tactile = TactileFrame::new(layout.len());
    let mut offset_ns = 0;
    let mut taken = 0;
    bencher.counter(ItemsCount::new(frames.len())).bench_local(|| {
        let mut readings = Readings::new();
        for (bus, received) in &frames {
            let t_ns = received.t_ns + offset_ns;
            if decoders[*bus as usize].decode(&received.frame, &mut readings) == Decoded::Readings {
                for reading in readings.iter() {
                    assert!(!assembler.overtaken_by(reading, t_ns));
                    black_box(assembler.push(reading, t_ns));
                }
            }
            if assembler.is_complete() {
                assembler.take(t_ns, &mut tactile);
                assert_eq!(tactile.missing(), 0);
                taken += 1;
            }
        }
        offset_ns += SWEEPS * PERIOD_NS;
    });
    assert!(
        taken > 0 && taken % SWEEPS == 0,
        "every sweep gave one frame, not {taken}"
    );
}
