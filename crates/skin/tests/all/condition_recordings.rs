//! Conditioning on real uSkin recordings. `cargo test -p taxel-skin --release --test
//! condition_recordings -- --nocapture` prints the tables.

use taxel_hand::{Fault, ForceFrame, Freshness, TactileFrame};
use taxel_recordings::{Counts, array, by_axis, interleaved, open};
use taxel_skin::{ConditionConfig, Conditioner, FaultRule};

/// About the rate of the recordings.
const FRAME_NS: u64 = 33_333_333;
const TAXELS: usize = 16;
const COLUMNS: usize = 3 * TAXELS;

/// Plays frames at 30 Hz; calls `each` after every frame.
fn play(
    conditioner: &mut Conditioner,
    recording: &[Counts],
    mut each: impl FnMut(usize, &Conditioner, &ForceFrame),
) {
    let (mut frame, mut out) = (TactileFrame::new(TAXELS), ForceFrame::new(TAXELS));
    frame.freshness.fill(Freshness::Fresh);
    frame.age_ns.fill(0);
    for (i, counts) in recording.iter().enumerate() {
        frame.seq = i as u64;
        frame.t_ns = (i as u64 + 1) * FRAME_NS;
        frame.counts.copy_from_slice(counts);
        conditioner.process(&frame, &mut out);
        each(i, conditioner, &out);
    }
}

fn conditioner(config: ConditionConfig) -> Conditioner {
    Conditioner::new(TAXELS, config).expect("a valid configuration")
}

/// A repaired signal, frame by column.
type Signal = Vec<[i64; COLUMNS]>;

fn as_signal(recording: &[Counts]) -> Signal {
    recording
        .iter()
        .map(|f| std::array::from_fn(|c| i64::from(f[c / 3][c % 3])))
        .collect()
}

/// Distance modulo 2^16.
fn circular(a: i64, b: i64) -> i64 {
    let d = (a - b).rem_euclid(65_536);
    d.min(65_536 - d)
}

const SPIKES: [i64; 6] = [200, 500, 1_000, 2_000, 4_000, 8_000];
/// A step beyond this is a wrap, unless the raw samples did move that far.
const JUMP: i64 = 30_000;

/// What is left to repair in a signal, and what the repair has cost.
#[derive(Debug, Default)]
struct Quality {
    /// Steps of more than [`JUMP`] counts.
    jumps: usize,
    /// Those that the motion of the raw samples modulo 2^16, over this step and the one before,
    /// does not explain.
    wraps_left: usize,
    /// Samples further than so many counts from both neighbours, on the same side.
    spikes: [usize; SPIKES.len()],
    /// Samples of the last second that lie more than half a turn off the first second.
    rests_wrong: usize,
    /// Samples that differ from raw (modulo 2^16) where raw is smooth.
    damaged: usize,
    /// Root mean square of that difference over smooth samples, counts.
    damage_rms: f64,
    /// Root mean square distance to the offline unwrapping, counts, over columns where that ends on
    /// the turn it began on.
    error_rms: f64,
}

fn median(mut values: Vec<i64>) -> i64 {
    values.sort_unstable();
    values[values.len() / 2]
}

/// The offline unwrapping by nearest steps, for columns where it ends on the turn it began on.
fn offline(raw: &Signal) -> Vec<Option<Vec<i64>>> {
    (0..COLUMNS)
        .map(|c| {
            let mut turns = Vec::with_capacity(raw.len());
            let mut value = raw[0][c];
            for row in raw {
                value += (row[c] - value + 32_768).rem_euclid(65_536) - 32_768;
                turns.push(value);
            }
            (value == raw[raw.len() - 1][c]).then_some(turns)
        })
        .collect()
}

fn quality(signal: &Signal, raw: &Signal) -> Quality {
    let mut q = Quality::default();
    let truth = offline(raw);
    let (mut smooth, mut damage, mut compared, mut error) = (0usize, 0.0, 0usize, 0.0);
    for c in 0..COLUMNS {
        for t in 1..signal.len() {
            let step = (signal[t][c] - signal[t - 1][c]).abs();
            let moved = circular(raw[t][c], raw[t - 1][c]) + circular(raw[t - 1][c], raw[t.max(2) - 2][c]);
            q.jumps += usize::from(step > JUMP);
            q.wraps_left += usize::from(step > JUMP && step > moved);
        }
        let start = median(signal[..30].iter().map(|r| r[c]).collect());
        let tail = &signal[signal.len() - 30..];
        q.rests_wrong += tail.iter().filter(|r| (r[c] - start).abs() > 32_768).count();
        for t in 1..signal.len() - 1 {
            let (a, b) = (signal[t][c] - signal[t - 1][c], signal[t][c] - signal[t + 1][c]);
            if (a > 0) == (b > 0) {
                for (n, limit) in q.spikes.iter_mut().zip(SPIKES) {
                    *n += usize::from(a.abs().min(b.abs()) > limit);
                }
            }
            let is_smooth =
                circular(raw[t][c], raw[t - 1][c]) < 200 && circular(raw[t][c], raw[t + 1][c]) < 200;
            if is_smooth {
                let off = circular(signal[t][c], raw[t][c]);
                smooth += 1;
                q.damaged += usize::from(off > 0);
                damage += (off as f64).powi(2);
            }
            if let Some(truth) = &truth[c] {
                compared += 1;
                error += ((signal[t][c] - truth[t]) as f64).powi(2);
            }
        }
    }
    q.damage_rms = (damage / smooth as f64).sqrt();
    q.error_rms = (error / compared as f64).sqrt();
    q
}

fn print_row(name: &str, q: &Quality) {
    print!(
        "{name:22} {:>7} {:>7} {:>6}",
        q.jumps, q.wraps_left, q.rests_wrong
    );
    for n in q.spikes {
        print!(" {n:>6}");
    }
    println!(" {:>8} {:>10.1} {:>10.1}", q.damaged, q.damage_rms, q.error_rms);
}

#[test]
fn wraps_and_glitches_are_repaired_as_well_as_by_the_laboratory_or_better() {
    let Some(mut npz) = open("uskin_waseda.npz") else {
        return;
    };
    println!(
        "jumps: steps over {JUMP} counts; wraps: those the raw motion of two samples does not explain; rest: samples of the"
    );
    println!(
        "last second half a turn off the first; s>N: samples over N counts from both neighbours; damaged: samples that differ"
    );
    println!(
        "from raw where raw is smooth, and by how much (rms); error rms: distance to the offline unwrapping"
    );
    print!("{:22} {:>7} {:>7} {:>6}", "", "jumps", "wraps", "rest");
    for s in SPIKES {
        print!(" {:>6}", format!("s>{s}"));
    }
    println!(" {:>8} {:>10} {:>10}", "damaged", "damage rms", "error rms");
    for name in ["debug_0B0Z", "debug_0B2Z"] {
        let raw = interleaved(&array(&mut npz, &format!("{name}_raw")));
        let processed = as_signal(&interleaved(&array(&mut npz, &format!("{name}_processed"))));
        let mut ours: Signal = Vec::new();
        let mut c = conditioner(ConditionConfig::robust());
        let mut flagged = 0;
        play(&mut c, &raw, |_, c, out| {
            ours.push(std::array::from_fn(|col| {
                i64::from(c.repaired_counts(col / 3)[col % 3])
            }));
            flagged += out.faults.iter().filter(|f| !f.is_empty()).count();
        });
        let raw = as_signal(&raw);
        let (raw_q, theirs, ours) = (
            quality(&raw, &raw),
            quality(&processed, &raw),
            quality(&ours, &raw),
        );
        print_row(&format!("{name}_raw"), &raw_q);
        print_row(&format!("{name}_processed"), &theirs);
        print_row(&format!("{name} repaired"), &ours);
        println!("  {:?}", c.counters());
        println!("  {:?}", c.report().expect("calibrated"));
        println!("  taxel-frames flagged faulty: {flagged}");

        // Not `ours <= theirs` in jumps: the laboratory's filter leaves none because it leaves no
        // force, it clamps to 2560..2815 while wrapped, whereas an impact does move more than 30000
        // counts between two samples, or three where one was held back. What is a wrap and not
        // motion must be a turn that was put right, and counted as such.
        let put_right = (c.counters().recoveries + c.counters().long_ways) as usize;
        assert!(ours.wraps_left <= theirs.wraps_left + put_right, "{name}");
        assert!(10 * ours.wraps_left <= raw_q.wraps_left, "{name}");
        assert!(ours.rests_wrong <= theirs.rests_wrong, "{name}");
        for (i, limit) in SPIKES.iter().enumerate() {
            assert!(
                ours.spikes[i] <= theirs.spikes[i],
                "{name}: spikes over {limit} counts"
            );
        }
        assert!(
            ours.damage_rms <= theirs.damage_rms && ours.damaged <= theirs.damaged,
            "{name}"
        );
        assert!(ours.error_rms <= theirs.error_rms, "{name}");
        assert_eq!(flagged, 0, "{name}: presses that wrap are no fault");
    }
}

#[test]
fn the_dead_taxel_of_log4_is_found_by_both_rules_and_it_alone() {
    let Some(mut npz) = open("uskin_waseda.npz") else {
        return;
    };
    let log4 = interleaved(&array(&mut npz, "LOG4"));

    let mut found_in = None;
    play(&mut conditioner(ConditionConfig::robust()), &log4, |i, _, out| {
        if out.faults[0].contains(Fault::Dead) {
            found_in.get_or_insert(i + 1);
        }
        assert!(
            out.faults[1..].iter().all(|f| f.is_empty()),
            "frame {i}: {:?}",
            out.faults
        );
    });
    println!(
        "LOG4: taxel 0 flagged dead in frame {found_in:?} of {}",
        log4.len()
    );
    assert_eq!(found_in, Some(3));

    let twice: Vec<Counts> = log4.iter().chain(&log4).copied().collect();
    for (rule, fault) in [
        (FaultRule::Robust, Fault::Dead),
        (FaultRule::Paper, Fault::PaperRule),
    ] {
        let mut c = conditioner(ConditionConfig {
            calibration_ms: 300,
            fault_rule: rule,
            ..ConditionConfig::robust()
        });
        play(&mut c, &twice, |_, _, _| {});
        assert!(!c.is_calibrating());
        let faulty: Vec<usize> = (0..TAXELS).filter(|n| !c.faults()[*n].is_empty()).collect();
        println!("LOG4, rule {rule:?}: faulty {faulty:?}, {:?}", c.faults()[0]);
        assert_eq!(faulty, [0], "{rule:?}");
        assert!(c.faults()[0].contains(fault));
    }
}

#[test]
fn healthy_modules_are_flagged_by_the_papers_rule_and_not_by_the_robust_one() {
    let mut recordings: Vec<(String, Vec<Counts>)> = Vec::new();
    let Some(mut npz) = open("uskin_waseda.npz") else {
        return;
    };
    for name in ["LOG6", "LOG7"] {
        recordings.push((name.into(), interleaved(&array(&mut npz, name))));
    }
    let Some(mut npz) = open("uskin_pick_and_move.npz") else {
        return;
    };
    for trial in 0..12 {
        let name = format!("trial{trial:02}");
        recordings.push((name.clone(), by_axis(&array(&mut npz, &name))));
    }
    println!(
        "taxels of 16 flagged in any frame by the robust rule, by the paper's, by the paper's two-sided; touched in calibration;"
    );
    println!(
        "median noise and threshold, counts; taxel-frames in contact, frames with contact, largest force"
    );
    println!(
        "{:8} {:>6} {:>8} {:>6} {:>10} {:>8} {:>7} {:>8} {:>10} {:>12} {:>10}",
        "",
        "frames",
        "robust",
        "paper",
        "two-sided",
        "touched",
        "noise",
        "theta",
        "contacts",
        "in contact",
        "peak"
    );
    for (name, recording) in &recordings {
        let mut c = conditioner(ConditionConfig::robust());
        let (mut flagged, mut contacts, mut felt, mut peak) = ([false; TAXELS], 0, 0, 0.0_f64);
        play(&mut c, recording, |_, _, out| {
            for (flagged, faults) in flagged.iter_mut().zip(&out.faults) {
                *flagged |= !faults.is_empty();
            }
            contacts += out.contacts();
            felt += usize::from(out.contacts() > 0);
            peak = out.force.iter().copied().fold(peak, f64::max);
        });
        let report = c.report().expect("calibrated");
        let robust = flagged.iter().filter(|f| **f).count();
        let by_paper = |two_sided| {
            let config = ConditionConfig {
                paper_two_sided: two_sided,
                ..ConditionConfig::paper()
            };
            let mut c = conditioner(config);
            play(&mut c, &recording[..3], |_, _, _| {});
            c.report().expect("calibrated").faulty_for(Fault::PaperRule)
        };
        println!(
            "{name:8} {:>6} {robust:>8} {:>6} {:>10} {:>8} {:>7.1} {:>8.1} {contacts:>10} {felt:>12} {peak:>10.0}",
            recording.len(),
            by_paper(false),
            by_paper(true),
            report.touched,
            report.noise_median_counts,
            report.threshold,
        );
        assert_eq!(robust, 0, "{name}: no healthy taxel may be flagged");
        assert!(
            by_paper(false) >= 1,
            "{name}: the rule as printed discards healthy taxels"
        );
        if name.starts_with("LOG") {
            assert_eq!(contacts, 0, "{name}: an idle hand feels nothing");
        }
    }
}
