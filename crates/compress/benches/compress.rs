//! Cost of a tick: `cargo bench -p taxel-compress`.

use divan::Bencher;
use taxel_compress::Compressor;
use taxel_hand::{ForceFrame, Method, Profile};
use taxel_skin::Layout;

fn main() {
    divan::main();
}

/// Heavy-tailed forces, as contacts have them, the first `contacts` taxels in contact.
fn frame(taxels: usize, contacts: usize) -> ForceFrame {
    let mut frame = ForceFrame::new(taxels);
    let mut state = 1u64;
    for n in 0..contacts {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        let uniform = (state >> 11) as f64 / (1u64 << 53) as f64;
        frame.force[n] = 50.0 + 500.0 * (1.0 / (1.0 - 0.99 * uniform) - 1.0);
        frame.contact[n] = true;
    }
    frame
}

#[divan::bench(args = [16, 100, 240])]
fn paper(bencher: Bencher, contacts: usize) {
    let layout = Layout::grid(16, 16).expect("a grid that fits");
    let profile = Profile {
        method: Method::Paper,
        ..Profile::default()
    };
    let mut compressor = Compressor::new(profile, &layout).expect("a valid profile");
    let mut image = compressor.new_image();
    let frame = frame(layout.taxels.len(), contacts);
    bencher.bench_local(|| compressor.compress(divan::black_box(&frame), &mut image));
}

/// Frames that differ by noise and by taxels that come and go, as those of a live hand do.
#[divan::bench(args = [16, 100, 240])]
fn optimal(bencher: Bencher, contacts: usize) {
    let layout = Layout::grid(16, 16).expect("a grid that fits");
    let profile = Profile {
        method: Method::Optimal,
        ..Profile::default()
    };
    let mut compressor = Compressor::new(profile, &layout).expect("a valid profile");
    let mut image = compressor.new_image();
    let mut frames = vec![frame(layout.taxels.len(), contacts); 32];
    let mut state = 7u64;
    let mut random = || {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (state >> 40) as usize
    };
    for frame in &mut frames {
        for force in frame.force.iter_mut().filter(|force| **force > 0.0) {
            *force += (random() % 64) as f64 / 8.0;
        }
        for _ in 0..2 {
            let lost = random() % contacts;
            frame.contact[lost] = false;
        }
    }
    let mut next = 0;
    bencher.bench_local(|| {
        next = (next + 1) % frames.len();
        compressor.compress(divan::black_box(&frames[next]), &mut image);
    });
}
