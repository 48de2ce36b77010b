//! Recordings as the hands they would come from, conditioned into forces and contacts.

use ndarray::Array2;
use taxel_hand::{ForceFrame, Freshness, TactileFrame};
use taxel_recordings::{Counts, Npz, array, by_axis, interleaved, open, schunk_grasps};
use taxel_skin::{ConditionConfig, Conditioner, Layout};

/// Force frames of a hand, in sequences that begin without contact.
pub(crate) struct Session {
    pub(crate) name: &'static str,
    /// Whether many contacts come and go with the noise of the sensor.
    pub(crate) at_the_noise: bool,
    pub(crate) layout: Layout,
    pub(crate) sequences: Vec<Vec<ForceFrame>>,
}

/// Every recording on this machine.
pub(crate) fn sessions() -> Vec<Session> {
    let mut sessions = vec![synthetic()];
    if let Some(mut npz) = open("uskin_waseda.npz") {
        sessions.extend(waseda(&mut npz));
    }
    if let Some(mut npz) = open("uskin_pick_and_move.npz") {
        sessions.push(pick_and_move(&mut npz));
    }
    if let Some(grasps) = schunk_grasps() {
        let grasps: Vec<_> = grasps.into_iter().map(|(_, grasp)| grasp).collect();
        sessions.extend(schunk(&grasps));
    }
    sessions
}

/// What one module of 16 taxels feels, from the calibration on; force and contact by the module's
/// own taxel number.
type Felt = Vec<[(f64, bool); 16]>;

/// Conditions the counts of one module, at about the recordings' rate.
fn feel(counts: &[Counts]) -> Felt {
    let mut conditioner = Conditioner::new(16, ConditionConfig::robust()).expect("a valid configuration");
    let (mut frame, mut out) = (TactileFrame::new(16), ForceFrame::new(16));
    frame.freshness.fill(Freshness::Fresh);
    frame.age_ns.fill(0);
    let mut felt = Vec::new();
    for counts in counts {
        frame.t_ns += 33_333_333;
        frame.counts.copy_from_slice(counts);
        conditioner.process(&frame, &mut out);
        if !out.calibrating {
            felt.push(std::array::from_fn(|n| {
                (out.force[n], out.contact[n] && out.faults[n].is_empty())
            }));
        }
    }
    felt
}

/// A hand whose modules feel what was recorded, each from its own time on (around to the beginning again).
fn hand(name: &'static str, modules: &[(&Felt, usize)]) -> Session {
    let layout = Layout::builtin("allegro-uskin-15").expect("built in");
    let length = modules.iter().map(|(felt, _)| felt.len()).min().unwrap_or(0);
    let frame = |t: usize| {
        let mut frame = ForceFrame::new(layout.len());
        for (n, taxel) in layout.taxels.iter().enumerate() {
            let (felt, shift) = modules[usize::from(taxel.module)];
            let (force, contact) = felt[(t + shift) % felt.len()][usize::from(layout.k[n])];
            (frame.force[n], frame.contact[n]) = (force, contact);
        }
        frame
    };
    let sequences = vec![(0..length).map(frame).collect()];
    Session {
        name,
        at_the_noise: false,
        layout,
        sequences,
    }
}

fn waseda(npz: &mut Npz) -> Vec<Session> {
    let [a, b] = ["debug_0B0Z_raw", "debug_0B2Z_raw"].map(|name| feel(&interleaved(&array(npz, name))));
    let shifted: Vec<_> = (0..15)
        .map(|m| (if m % 2 == 0 { &a } else { &b }, m * 131))
        .collect();
    vec![
        hand("Waseda, shifted in time", &shifted),
        hand("Waseda, one on all modules", &[(&b, 0); 15]),
    ]
}

fn pick_and_move(npz: &mut Npz) -> Session {
    let trials: Vec<_> = (0..12)
        .map(|n| feel(&by_axis(&array(npz, &format!("trial{n:02}")))))
        .collect();
    let modules: Vec<_> = (0..15).map(|m| (&trials[m % 12], 40 * m)).collect();
    hand("pick and move", &modules)
}

/// Magnitudes above idle with a threshold and hysteresis, and raw values above a threshold without.
fn schunk(grasps: &[Array2<u16>]) -> Vec<Session> {
    // Fingers side by side, each a proximal array of 14 x 6 below a distal one of 13 x 6.
    let starts = [0, 84, 162, 246, 324, 408];
    let side_by_side: Vec<Option<usize>> = (0..28 * 18)
        .map(|pixel| {
            let (x, y) = (pixel % 18, pixel / 18);
            let (of, row) = (2 * (x / 6) + y / 14, y % 14);
            (of % 2 == 0 || row < 13).then(|| starts[of] + 6 * row + x % 6)
        })
        .collect();
    let three = side_by_side[..14 * 18].to_vec();
    let session = |name, pixels: &[Option<usize>], threshold: f64, release: f64, above_idle: bool| Session {
        name,
        at_the_noise: threshold < 100.0 && pixels.len() > three.len(),
        layout: Layout::grid(18, (pixels.len() / 18) as u16).expect("a grid that fits"),
        sequences: (grasps.iter())
            .map(|grasp| threshold_frames(grasp, pixels, threshold, release, above_idle))
            .collect(),
    };
    let whole: Vec<Option<usize>> = (0..486).map(Some).collect();
    vec![
        session("Schunk, 3 arrays, idle + 10", &three, 10.0, 0.8, true),
        session("Schunk, 6 arrays, idle + 10", &side_by_side, 10.0, 0.8, true),
        session(
            "Schunk, 6 arrays, idle + 6 at once",
            &side_by_side,
            6.0,
            1.0,
            true,
        ),
        session("Schunk as 27 x 18, above 150", &whole, 150.0, 1.0, false),
        session("Schunk as 27 x 18, above 40", &whole, 40.0, 1.0, false),
    ]
}

fn threshold_frames(
    grasp: &Array2<u16>,
    pixels: &[Option<usize>],
    threshold: f64,
    release: f64,
    above_idle: bool,
) -> Vec<ForceFrame> {
    let idle: Vec<f64> = (0..grasp.ncols())
        .map(|column| {
            let mut first: Vec<u16> = grasp.column(column).iter().take(9).copied().collect();
            first.sort_unstable();
            if above_idle {
                f64::from(first[first.len() / 2])
            } else {
                0.0
            }
        })
        .collect();
    let mut contact = vec![false; pixels.len()];
    (grasp.rows().into_iter())
        .map(|row| {
            let mut frame = ForceFrame::new(pixels.len());
            for (n, column) in pixels.iter().enumerate().filter_map(|(n, c)| c.map(|c| (n, c))) {
                let force = (f64::from(row[column]) - idle[column]).max(0.0);
                contact[n] = force
                    > if contact[n] {
                        release * threshold
                    } else {
                        threshold
                    };
                (frame.force[n], frame.contact[n]) = (force, contact[n]);
            }
            frame
        })
        .collect()
}

/// Round contacts that wander, swell and fade over a hand of 16 x 15 taxels, with noise around the threshold.
fn synthetic() -> Session {
    let mut state = 3u64;
    let mut uniform = move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    let mut sequences = Vec::new();
    for _ in 0..30 {
        let touches: Vec<[f64; 6]> = (0..2 + (uniform() * 5.0) as usize)
            .map(|_| {
                let mut way = || (uniform() + uniform() + uniform() - 1.5) * 0.3;
                let (vx, vy) = (way(), way());
                [
                    16.0 * uniform(),
                    16.0 * uniform(),
                    vx,
                    vy,
                    1.5 + 3.0 * uniform(),
                    300.0 + 3000.0 * uniform() * uniform(),
                ]
            })
            .collect();
        let mut frames = Vec::new();
        for t in 0..60 {
            let time = f64::from(t);
            let swell = (std::f64::consts::PI * (time + 1.0) / 61.0).sin();
            let mut frame = ForceFrame::new(240);
            for n in 0..240 {
                let (x, y) = ((n % 16) as f64, (n / 16) as f64);
                let press = |[px, py, vx, vy, r, force]: &[f64; 6]| {
                    let (dx, dy) = (x - px - vx * time, y - py - vy * time);
                    force * swell * (-(dx * dx + dy * dy) / (2.0 * r * r)).exp()
                };
                frame.force[n] = touches.iter().map(press).sum::<f64>() + 30.0 * uniform();
                frame.contact[n] = frame.force[n] > 60.0;
            }
            frames.push(frame);
        }
        sequences.push(frames);
    }
    Session {
        name: "synthetic",
        at_the_noise: false,
        layout: Layout::grid(16, 15).expect("a grid that fits"),
        sequences,
    }
}
