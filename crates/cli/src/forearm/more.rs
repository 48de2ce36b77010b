//! What `taxel forearm eval` judges beside the protocol.

use super::disturbed;
use super::judge::{Judgement, judge_all, leave_places_out, train};
use taxel_forearm::{Kinesthetic, Session, Split, Tried};

/// What the choice of least value is taken by.
type Score = fn(&Tried) -> f64;

/// Other ways to choose, to see what the choice is worth.
const OTHER_PROCEDURES: [(&str, Score); 5] = [
    ("chosen with repetitions left out alone", |t| t.repetitions_out),
    ("chosen with a place left out alone", |t| t.place_out),
    ("10 phases, first sample to last, 3 components", |t| fixed(t, 3)),
    ("10 phases, first sample to last, 4 components", |t| fixed(t, 4)),
    ("10 phases, first sample to last, 5 components", |t| fixed(t, 5)),
];

fn fixed(tried: &Tried, components: usize) -> f64 {
    let choice = tried.choice;
    f64::from(u8::from(
        (choice.points, choice.from, choice.to, choice.components) != (10, 0, 47, components),
    ))
}

/// Disturbed and early estimates, places left out, and other ways to choose.
pub(super) struct More {
    pub(super) disturbed: Vec<(String, Judgement)>,
    /// After this share of a squeeze's time.
    pub(super) early: Vec<(f64, Judgement)>,
    pub(super) places_left_out: Judgement,
    pub(super) procedures: Vec<(String, Judgement)>,
}

impl More {
    pub(super) fn of(session: &Session, splits: &[Split], models: &[Kinesthetic]) -> anyhow::Result<Self> {
        Ok(Self {
            disturbed: disturbed::disturbances(session, splits, models),
            early: disturbed::by_share(session, splits, models),
            places_left_out: leave_places_out(session, Kinesthetic::train)?,
            procedures: other_procedures(session, splits)?,
        })
    }
}

fn other_procedures(session: &Session, splits: &[Split]) -> anyhow::Result<Vec<(String, Judgement)>> {
    let mut rows = Vec::new();
    for (name, score) in OTHER_PROCEDURES {
        let trained = train(session, splits, |trials| Kinesthetic::train_by(trials, score))?;
        rows.push((
            name.to_owned(),
            judge_all(session, splits, &trained.estimators, None),
        ));
    }
    Ok(rows)
}
