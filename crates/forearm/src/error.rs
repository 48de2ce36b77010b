//! Why a squeeze cannot be read, or a place not be estimated.

use crate::left_out::LeftOut;
use crate::mat::TornMat;
use std::io;
use std::path::{Path, PathBuf};

/// Why a squeeze cannot be read, or a place not be estimated. Rows count from 0.
#[derive(Debug, thiserror::Error)]
pub enum ForearmError {
    /// The file cannot be opened, read or written.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// A `.mat` file that is damaged or of another kind.
    #[error("{path}: {torn}")]
    Mat {
        /// The file.
        path: PathBuf,
        /// What is wrong, and at which byte.
        torn: TornMat,
    },
    /// A readable file with something else in it.
    #[error("{path}: {what}")]
    Unfit {
        /// The file or folder.
        path: PathBuf,
        /// What it holds, and what was expected.
        what: String,
    },
    /// An `.npz` that cannot be read.
    #[error(transparent)]
    Arrays(#[from] taxel_record::RecordError),
    /// A squeeze of a file that is none.
    #[error("{at}: {source}")]
    In {
        /// The file, and the trial where it has several.
        at: String,
        /// What is wrong with it.
        source: Box<ForearmError>,
    },
    /// Columns of unequal length.
    #[error("a column has {found} samples, and there are {rows} times; every sample needs all columns")]
    Columns {
        /// Samples of the column.
        found: usize,
        /// Times.
        rows: usize,
    },
    /// Tactile images that are not one for each sample.
    #[error("{counts} tactile counts are not {rows} images of 28 x 50; give one for each sample, or none")]
    Images {
        /// Counts there are.
        counts: usize,
        /// Samples there are.
        rows: usize,
    },
    /// Times that stand still or run backwards.
    #[error(
        "row {row} is at {time_ms} ms, after one at {before_ms} ms; times must be numbers that increase (rows count from 0)"
    )]
    Time {
        /// The row.
        row: usize,
        /// Its time.
        time_ms: f64,
        /// The time before.
        before_ms: f64,
    },
    /// Times in another unit.
    #[error(
        "rows are {period_ms} ms apart (median), and a gripper takes samples every 1 to 10000 ms; are times in milliseconds? \
         Multiply seconds by 1000"
    )]
    Period {
        /// Median time from row to row.
        period_ms: f64,
    },
    /// A PWM that no motor takes.
    #[error("row {row} commands PWM {pwm}; it must be -885 to 885 (rows count from 0)")]
    Pwm {
        /// The row.
        row: usize,
        /// Its PWM.
        pwm: f64,
    },
    /// A squeeze of which too little is known.
    #[error("{samples} samples are no squeeze; it takes at least {least}")]
    TooShort {
        /// Samples there are.
        samples: usize,
        /// Fewest that say anything.
        least: usize,
    },
    /// A squeeze with another PWM profile than those of the training.
    #[error(
        "PWM rises to {peak}, and to {expected} where the model was trained; squeeze with the same profile"
    )]
    Profile {
        /// Highest PWM of the squeeze.
        peak: f64,
        /// That of the training, median.
        expected: f64,
    },
    /// A squeeze whose beginning is missing.
    #[error(
        "row 0 is at PWM {pwm}, and squeezes begin at {first_pwm} where the model was trained: it had begun before; \
         give the whole squeeze, from rest on (rows count from 0)"
    )]
    Begun {
        /// PWM of the first sample.
        pwm: f64,
        /// That of the training, median.
        first_pwm: f64,
    },
    /// A squeeze between other PWMs than those of the training.
    #[error(
        "PWM rests at {pwm} from row 0 on, and at {first_pwm} where the model was trained; squeeze with the same \
         profile (rows count from 0)"
    )]
    OtherRest {
        /// PWM of the first sample.
        pwm: f64,
        /// That of the training, median.
        first_pwm: f64,
    },
    /// A step of PWM instead of a ramp.
    #[error(
        "row {row} is at PWM {pwm}, its peak, {samples} samples after rest, and at least 5 are needed; squeeze with \
         the profile of the training (rows count from 0)"
    )]
    Jump {
        /// The row of the peak.
        row: usize,
        /// Samples since the last one at rest.
        samples: usize,
        /// PWM of that row.
        pwm: f64,
    },
    /// PWM that rises a second time.
    #[error(
        "row {row}: PWM rises again, from {low} to {pwm}; give one squeeze alone, with the profile of the training (rows count from 0)"
    )]
    Again {
        /// The row.
        row: usize,
        /// Least PWM since it turned.
        low: f64,
        /// PWM of that row.
        pwm: f64,
    },
    /// A squeeze without the samples at its peak.
    #[error(
        "row {row}: no sample for {gap_ms:.0} ms where PWM is highest, {peak}, and {expected} where the model was \
         trained; the peak is not there; squeeze again (rows count from 0)"
    )]
    PeakMissing {
        /// The row of the highest PWM.
        row: usize,
        /// Time without samples before or after it, ms.
        gap_ms: f64,
        /// Its PWM.
        peak: f64,
        /// Highest PWM of the training, median.
        expected: f64,
    },
    /// Angles that the gripper of the training does not have.
    #[error(
        "{name} is {value:.2}, and {low:.1} to {high:.1} degrees where the model was trained; is it in degrees, and of \
         the same gripper?"
    )]
    Angle {
        /// Which angle.
        name: &'static str,
        /// Its value.
        value: f64,
        /// Least that the gripper has, degrees.
        low: f64,
        /// Most that the gripper has, degrees.
        high: f64,
    },
    /// A motor's angle that hardly moves while the gripper squeezes.
    #[error(
        "{name} moves by {moved:.2} degrees in a squeeze, and within {span:.0} degrees where the model was trained; is it in \
         degrees, and of the same gripper?"
    )]
    Still {
        /// Which angle.
        name: &'static str,
        /// From its least to its most in this squeeze, degrees.
        moved: f64,
        /// From its least to its most in all squeezes of the training, degrees.
        span: f64,
    },
    /// Angles that move in another way than in the training.
    #[error(
        "the angles are {times:.0} times as far from those of the training as any of its squeezes; is it the same gripper, \
         with each angle in its column?"
    )]
    Unlike {
        /// How far, in multiples of the furthest squeeze of the training.
        times: f64,
    },
    /// Angles that are lost or stuck, and without which nothing can be said.
    #[error("{}: lost or stuck; look at the potentiometers and servos", .left_out.names().collect::<Vec<_>>().join(", "))]
    Lost {
        /// The angles.
        left_out: LeftOut,
    },
    /// A training squeeze without an angle that others have.
    #[error("{name} is lost, and other squeezes have it; take the squeeze away or make it again")]
    LostOnce {
        /// The angle.
        name: &'static str,
    },
    /// A training squeeze that was broken off.
    #[error("the squeeze breaks off at phase {reached:.2}, and ends at 2; take it away or make it again")]
    NoEnd {
        /// How far it came.
        reached: f64,
    },
    /// Squeezes that no estimator can be made of.
    #[error("no estimator can be trained: {what}")]
    Untrained {
        /// Why not, and what it takes.
        what: String,
    },
    /// A file that is no model.
    #[error("no model as `taxel forearm train` writes it: {what}")]
    Model {
        /// Why not.
        what: String,
    },
    /// A squeeze without the touch that is to be looked at.
    #[error("the squeeze has no tactile images; record the tactile finger too, or estimate from the angles")]
    NoTouch,
    /// A squeeze without touch in a session that has it.
    #[error("it has no tactile images, and others have; take it away or make it again")]
    TouchOnce,
    /// Touch that is none as in the training.
    #[error(
        "the tactile images are {times:.0} times as far from those of the training as any of its squeezes; is the array \
         connected, and mounted as it was?"
    )]
    Touch {
        /// How far, in multiples of the furthest squeeze of the training.
        times: f64,
    },
    /// Touch that is the same in all squeezes.
    #[error(
        "the tactile images of all {squeezes} squeezes are the same; is the array connected? To train from angles alone, \
         take touch away: `tactile` of an .npz, the tactile*.npy files of a folder"
    )]
    SameTouch {
        /// Squeezes of the training.
        squeezes: usize,
    },
    /// Touch that has no components.
    #[error("tactile images cannot be told apart: {0}")]
    Blind(#[from] taxel_palpation::PalpationError),
}

impl ForearmError {
    /// What a file or folder cannot be opened, read or written for.
    pub(crate) fn io(path: &Path) -> impl Fn(io::Error) -> Self + use<'_> {
        move |source| Self::Io {
            path: path.into(),
            source,
        }
    }
}
