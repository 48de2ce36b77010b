//! What the method `optimal` does with real contact frames, of hands of 240 to 486 taxels.
//!
//! `cargo test -p taxel-compress --release --test recordings -- --nocapture` prints the table.

mod hands;
mod restarts;

use std::collections::HashMap;

use hands::Session;
use restarts::best_of_restarts;
use taxel_compress::Compressor;
use taxel_hand::{Actuator, Method, Profile};

/// One in so many frames is compared with the best of 64 restarts, which takes long where there are many contacts.
const EVERY: usize = if cfg!(debug_assertions) { 97 } else { 7 };
const EVERY_OF_FEW: usize = if cfg!(debug_assertions) { 13 } else { 7 };
const FEW: u16 = 64;

/// What was measured on a recording.
#[derive(Debug, Default)]
struct Measured {
    frames: usize,
    contacts: usize,
    /// Actuators that are in two images in a row.
    pairs: usize,
    /// Those more than 2 pixels apart.
    jumps: usize,
    /// Position error over the best of 64 restarts, ascending.
    ratios: Vec<f64>,
    /// Time of a frame with contact, nanoseconds, ascending.
    times_ns: Vec<u128>,
}

impl Measured {
    fn jump_fraction(&self) -> f64 {
        self.jumps as f64 / self.pairs.max(1) as f64
    }

    fn ratio(&self, share: f64) -> f64 {
        let last = self.ratios.len().saturating_sub(1);
        self.ratios
            .get((last as f64 * share) as usize)
            .copied()
            .unwrap_or(1.0)
    }

    fn ratio_mean(&self) -> f64 {
        self.ratios.iter().sum::<f64>() / self.ratios.len().max(1) as f64
    }
}

/// Squared distances of the contacts to the centroids of their actuators.
fn position_error(compressor: &Compressor) -> f64 {
    let stages = compressor.stages();
    let mut sums: HashMap<u16, [f64; 4]> = HashMap::new();
    for ([x, y], actuator) in stages.pixel.iter().zip(stages.actuator) {
        let (x, y) = (f64::from(*x), f64::from(*y));
        let [sx, sy, squares, n] = sums.entry(*actuator).or_default();
        (*sx, *sy) = (*sx + x, *sy + y);
        (*squares, *n) = (*squares + x * x + y * y, *n + 1.0);
    }
    sums.values()
        .map(|[x, y, squares, n]| squares - (x * x + y * y) / n)
        .sum()
}

fn measure(session: &Session, profile: &Profile) -> Measured {
    let mut measured = Measured::default();
    for frames in &session.sequences {
        let mut compressor = Compressor::new(profile.clone(), &session.layout).expect("a valid profile");
        let mut image = compressor.new_image();
        let mut before: Vec<Actuator> = Vec::new();
        for (number, frame) in frames.iter().enumerate() {
            let start = std::time::Instant::now();
            compressor.compress(frame, &mut image);
            let took = start.elapsed().as_nanos();
            if image.contacts > 0 {
                measured.frames += 1;
                measured.contacts += usize::from(image.contacts);
                measured.times_ns.push(took);
            }
            for a in &before {
                if let Some(b) = image.actuators.iter().find(|b| b.id == a.id) {
                    let (dx, dy) = (f64::from(a.x) - f64::from(b.x), f64::from(a.y) - f64::from(b.y));
                    measured.pairs += 1;
                    measured.jumps += usize::from(dx.hypot(dy) > 2.0);
                }
            }
            before.clone_from(&image.actuators);
            let every = if image.contacts <= FEW {
                EVERY_OF_FEW
            } else {
                EVERY
            };
            if number % every == 0 && image.contacts > profile.actuators {
                let best =
                    best_of_restarts(compressor.stages().pixel, profile.actuators.into(), number as u64);
                if best > 0.0 {
                    measured.ratios.push(position_error(&compressor) / best);
                }
            }
        }
    }
    measured.ratios.sort_by(f64::total_cmp);
    measured.times_ns.sort_unstable();
    measured
}

fn print(session: &Session, profile: &Profile, m: &Measured) {
    let time = |share: f64| m.times_ns[((m.times_ns.len() - 1) as f64 * share) as usize] as f64 / 1000.0;
    println!(
        "{:<34} K_A {:>2} {:?}: {:>5} frames, {:>5.1} contacts, jumps {:>5.2} %, position {:.4} mean {:.4} p95 ({} frames), {:.1} us p50 {:.1} p99 {:.1} p99.9",
        session.name,
        profile.actuators,
        profile.method,
        m.frames,
        m.contacts as f64 / m.frames.max(1) as f64,
        100.0 * m.jump_fraction(),
        m.ratio_mean(),
        m.ratio(0.95),
        m.ratios.len(),
        time(0.5),
        time(0.99),
        time(0.999),
    );
}

fn optimal(actuators: u16) -> Profile {
    Profile {
        method: Method::Optimal,
        actuators,
        ..Profile::default()
    }
}

/// On noise at the contact threshold, contacts come and go in most frames, and each that comes
/// takes an actuator from elsewhere: then the actuators stand where they should, and jump as often
/// as the contacts do. Elsewhere they hold still.
#[test]
fn actuators_hold_still_and_stand_where_they_should_on_real_contacts() {
    for session in hands::sessions() {
        for actuators in [16, 8] {
            let profile = optimal(actuators);
            let measured = measure(&session, &profile);
            print(&session, &profile, &measured);
            let name = session.name;
            if !session.at_the_noise {
                let allowed = if actuators == 16 { 0.03 } else { 0.05 };
                assert!(
                    measured.jump_fraction() <= allowed,
                    "{name}: {} jumps",
                    measured.jump_fraction()
                );
            }
            // Fewer frames tell nothing of a mean.
            if measured.ratios.len() < 15 {
                continue;
            }
            assert!(
                measured.ratio_mean() <= 1.03,
                "{name}: {} mean",
                measured.ratio_mean()
            );
            assert!(
                measured.ratio(0.95) <= 1.08,
                "{name}: {} p95",
                measured.ratio(0.95)
            );
        }
    }
}
