//! Estimators that need touch, by the publication's protocol.

use super::judge::{Judgement, judge_all, judge_fused, train, trials};
use std::time::Instant;
use taxel_forearm::{Disturbance, Fused, Fusion, Kinesthetic, Session, Split, Squeeze, Tactile};

/// Gains of an array, in multiples of that of the training.
const GAINS: [f64; 6] = [0.6, 0.8, 0.9, 1.1, 1.2, 1.5];

/// What people are told that [`WithTouch::fused_unseen`] is.
pub(super) const FUSED_UNSEEN: &str = "fused by intervals, of squeezes that nothing was trained on";

/// What became of the estimators that need touch, and how long their training took, s.
pub(super) struct WithTouch {
    pub(super) tactile: (Judgement, f64),
    pub(super) fused: (Judgement, f64),
    /// The same two estimators weighed by their intervals and judged as each of them is, on squeezes that nothing of it was
    /// trained on.
    pub(super) fused_unseen: (Judgement, f64),
    /// Both senses together where the array has another gain.
    pub(super) gains: Vec<(String, Judgement)>,
}

impl WithTouch {
    /// Trains and judges beside estimators from angles, with arrays of other gains where that is wanted.
    pub(super) fn of(
        session: &Session,
        splits: &[Split],
        angles: &[Kinesthetic],
        with_gains: bool,
    ) -> anyhow::Result<Self> {
        let tactile = train(session, splits, Tactile::train)?;
        let judgement = judge_all(session, splits, &tactile.estimators, None);
        let began = Instant::now();
        let mut fused = Vec::new();
        for ((kinesthetic, tactile), split) in angles.iter().zip(tactile.estimators).zip(splits) {
            // Where no touch can be judged, both are as far off as they say.
            let fusion = Fusion::train(kinesthetic, &tactile, &trials(session, &split.fusion_train))
                .unwrap_or_else(|_| Fusion::by_intervals());
            let kinesthetic = kinesthetic.clone();
            fused.push(Fused {
                kinesthetic,
                tactile,
                fusion,
            });
        }
        let took = began.elapsed();
        let by_intervals: Vec<Fused> = (fused.iter().cloned())
            .map(|of| Fused {
                fusion: Fusion::by_intervals(),
                ..of
            })
            .collect();
        let mut gains = Vec::new();
        for gain in GAINS.into_iter().filter(|_| with_gains) {
            let change = |squeeze: &Squeeze, seed| Disturbance::Gain(gain).apply(squeeze, seed);
            let judgement = judge_fused(session, splits, &fused, Some(&change));
            gains.push((format!("fused, {}", Disturbance::Gain(gain)), judgement));
        }
        Ok(Self {
            tactile: (judgement, tactile.took.as_secs_f64()),
            fused: (judge_fused(session, splits, &fused, None), took.as_secs_f64()),
            fused_unseen: (judge_all(session, splits, &by_intervals, None), 0.0),
            gains,
        })
    }

    pub(super) fn parts(&self) -> [(&'static str, &(Judgement, f64)); 2] {
        [("tactile", &self.tactile), ("fused", &self.fused)]
    }
}
