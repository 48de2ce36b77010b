//! Estimates of squeezes that something happened to, and of squeezes that are not over.

use super::judge::{Judgement, judge_all};
use taxel_forearm::{Disturbance, Kinesthetic, Session, Split, Squeeze};
use taxel_playback::progress::Progress;

const DISTURBANCES: [Disturbance; 16] = [
    Disturbance::Missing(0.3),
    Disturbance::Gap(1000.0),
    Disturbance::Gap(2000.0),
    Disturbance::Noise(0.5),
    Disturbance::Noise(1.0),
    Disturbance::Faster(2),
    Disturbance::Slower(2),
    Disturbance::Zero(1.0),
    Disturbance::Glitch,
    Disturbance::PotentiometerStuck,
    Disturbance::PotentiometerSticks,
    Disturbance::PotentiometerStuckNoisy,
    Disturbance::PotentiometerElsewhere,
    Disturbance::PotentiometerFloats,
    Disturbance::PotentiometerLost,
    Disturbance::PotentiometerDead,
];

/// Shares of a squeeze's time after which it is asked for an estimate.
pub(super) const SHARES: [f64; 12] = [0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9];

pub(super) fn disturbances(
    session: &Session,
    splits: &[Split],
    models: &[Kinesthetic],
) -> Vec<(String, Judgement)> {
    let progress = Progress::new(DISTURBANCES.len() as u64, "disturbances");
    let mut rows = Vec::new();
    for what in DISTURBANCES {
        let change = |squeeze: &Squeeze, seed: u64| what.apply(squeeze, seed);
        rows.push((
            what.to_string(),
            judge_all(session, splits, models, Some(&change)),
        ));
        progress.advance(1);
    }
    rows
}

/// Outcomes after each of `SHARES`.
pub(super) fn by_share(session: &Session, splits: &[Split], models: &[Kinesthetic]) -> Vec<(f64, Judgement)> {
    let after = |share: f64| {
        let change = |squeeze: &Squeeze, _: u64| {
            let end = share * squeeze.time_ms.last().copied().unwrap_or(0.0);
            squeeze.filtered(|row| squeeze.time_ms[row] <= end)
        };
        (share, judge_all(session, splits, models, Some(&change)))
    };
    SHARES.into_iter().map(after).collect()
}
