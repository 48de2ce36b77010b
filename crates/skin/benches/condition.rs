//! Cost of conditioning one frame. `cargo bench -p taxel-skin --bench condition`

use divan::{Bencher, black_box};
use taxel_hand::{ForceFrame, Freshness, TactileFrame};
use taxel_skin::{ConditionConfig, Conditioner, MagnitudeMode};

/// Shows that a frame costs no allocation.
#[global_allocator]
static ALLOCATIONS: divan::AllocProfiler = divan::AllocProfiler::system();

fn main() {
    divan::main();
}

const FRAMES: usize = 256;

/// A second of noise on idle levels, then taxels pressed in turn; the numbers come from a linear congruence.
fn frames(taxels: usize, pressed: bool) -> Vec<TactileFrame> {
    let mut seed = 1u64;
    let mut noise = |spread: u16| {
        seed = seed
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (seed >> 40) as u16 % spread
    };
    (0..FRAMES)
        .map(|i| {
            let mut frame = TactileFrame::new(taxels);
            frame.t_ns = 10_000_000 * (i as u64 + 1);
            frame.freshness.fill(Freshness::Fresh);
            frame.age_ns.fill(0);
            for counts in &mut frame.counts {
                let press = if pressed { 4_000 + 37 * (i % 8) as u16 } else { 0 };
                *counts = [
                    32_700 + noise(8) + press / 4,
                    32_700 + noise(16),
                    12_500 - press + noise(60),
                ];
            }
            frame
        })
        .collect()
}

/// Calibrated and warm; then the same frames over and over, with time going on.
fn run(bencher: Bencher, taxels: usize, pressed: bool, config: ConditionConfig) {
    let mut conditioner = Conditioner::new(taxels, config).expect("valid");
    let mut out = ForceFrame::new(taxels);
    let mut t_ns = 0;
    for mut frame in frames(taxels, false) {
        t_ns += 10_000_000;
        frame.t_ns = t_ns;
        conditioner.process(&frame, &mut out);
    }
    assert!(!out.calibrating && out.faults.iter().all(|f| f.is_empty()));
    let mut frames = frames(taxels, pressed);
    let mut i = 0;
    bencher
        .counter(divan::counter::ItemsCount::new(taxels))
        .bench_local(|| {
            t_ns += 10_000_000;
            let frame = &mut frames[i % FRAMES];
            frame.t_ns = t_ns;
            i += 1;
            conditioner.process(black_box(frame), &mut out);
            black_box(out.force[0])
        });
}

#[divan::bench(args = [240, 4096])]
fn idle(bencher: Bencher, taxels: usize) {
    run(bencher, taxels, false, ConditionConfig::robust());
}

#[divan::bench(args = [240, 4096])]
fn all_pressed(bencher: Bencher, taxels: usize) {
    run(bencher, taxels, true, ConditionConfig::robust());
}

#[divan::bench(args = [240])]
fn all_pressed_literal(bencher: Bencher, taxels: usize) {
    let config = ConditionConfig {
        magnitude: MagnitudeMode::LiteralSquared,
        ..ConditionConfig::robust()
    };
    run(bencher, taxels, true, config);
}
