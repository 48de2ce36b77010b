//! What networks are fed, from squeezes.

use crate::error::NetworksError;
use crate::network::{Form, Kind, Reading};
use candle_core::{Device, Tensor};
use taxel_forearm::{FINGERS, Session, Squeeze, TACTILE_COLUMNS, TACTILE_ROWS};

/// Tactile counts are divided by this, as in the code of the laboratory's article before this one.
const FULL_COUNT: f32 = 255.0;

/// Examples: what is felt, and where.
///
/// Angles are in degrees as they are, which is what the laboratory's earlier code does too. Places are fractions of the
/// forearm, not percent: with Adam's rate of 1e-5 and 2000 epochs of 19 batches no weight moves further than about 0.4,
/// so a last neuron over 100 values from -1 to 1 could not learn to say 100.
#[derive(Debug, Clone)]
pub struct Examples {
    /// (count, steps, rows, columns, channels).
    inputs: Tensor,
    /// From 0 (wrist) to 1 (elbow).
    places: Vec<f32>,
}

impl Examples {
    /// Examples of the network `kind` from all squeezes of a session, in its order.
    ///
    /// # Errors
    /// Squeezes of unequal length, an angle that is not a number, no touch where images are asked for; a network that is
    /// not fed squeezes.
    pub fn of_session(session: &Session, kind: Kind) -> Result<Self, NetworksError> {
        let unfit = |what: String| NetworksError::Session {
            session: session.name.clone(),
            what,
        };
        let samples = session.trials.first().map_or(0, |trial| trial.squeeze.len());
        if samples == 0 {
            return Err(unfit("no squeeze in it to learn from".into()));
        }
        let mut values = Vec::new();
        for trial in &session.trials {
            let squeeze = &trial.squeeze;
            if squeeze.len() != samples {
                let (found, name) = (squeeze.len(), trial.name());
                let what = format!(
                    "{name} has {found} samples and the first {samples}; networks need as many of each"
                );
                return Err(unfit(what));
            }
            let before = values.len();
            match kind {
                Kind::Kinesthetic(reading) => push_angles(squeeze, reading, &mut values),
                Kind::Tactile => match &squeeze.tactile {
                    Some(counts) => values.extend(counts.iter().map(|count| f32::from(*count) / FULL_COUNT)),
                    None => {
                        return Err(unfit(format!(
                            "{} has no touch, which the tactile network needs",
                            trial.name()
                        )));
                    }
                },
                Kind::Fusion => {
                    return Err(unfit("the fusion network is fed estimates, not squeezes".into()));
                }
            }
            if values[before..].iter().any(|value| !value.is_finite()) {
                return Err(unfit(format!(
                    "{} has an angle that is not a number; leave it out",
                    trial.name()
                )));
            }
        }
        let form = match kind {
            Kind::Kinesthetic(Reading::Time) => [samples, 1, 1, 2 * FINGERS],
            Kind::Kinesthetic(Reading::Transposed) => [2 * FINGERS, 1, 1, samples],
            _ => [samples, TACTILE_ROWS, TACTILE_COLUMNS, 1],
        };
        let places = session
            .trials
            .iter()
            .map(|trial| trial.location_percent as f32 / 100.0)
            .collect();
        Self::new(values, form, places)
    }

    /// Examples of the fusion network: what the others made of the same squeezes, fractions of the forearm.
    ///
    /// # Errors
    /// Memory that is exhausted.
    pub fn of_estimates(estimates: &[[f32; 2]], places: Vec<f32>) -> Result<Self, NetworksError> {
        Self::new(estimates.as_flattened().to_vec(), [1, 1, 1, 2], places)
    }

    pub(crate) fn new(values: Vec<f32>, form: Form, places: Vec<f32>) -> Result<Self, NetworksError> {
        let [steps, rows, columns, channels] = form;
        let shape = (places.len(), steps, rows, columns, channels);
        Ok(Self {
            inputs: Tensor::from_vec(values, shape, &Device::Cpu)?,
            places,
        })
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.places.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.places.is_empty()
    }

    /// Where each was felt, from 0 (wrist) to 1 (elbow).
    pub fn places(&self) -> &[f32] {
        &self.places
    }

    /// Some of them, by their numbers.
    ///
    /// # Errors
    /// A number that is none of theirs.
    pub fn select(&self, which: &[usize]) -> Result<Self, NetworksError> {
        let numbers: Vec<u32> = which.iter().map(|n| *n as u32).collect();
        let numbers = Tensor::new(numbers, &Device::Cpu)?;
        Ok(Self {
            inputs: self.inputs.index_select(&numbers, 0)?,
            places: which.iter().map(|n| self.places[*n]).collect(),
        })
    }

    pub(crate) fn form(&self) -> Form {
        let dims = self.inputs.dims();
        [dims[1], dims[2], dims[3], dims[4]]
    }

    /// A sequence (steps, count, rows, columns, channels).
    pub(crate) fn sequence(&self) -> candle_core::Result<Tensor> {
        self.inputs.transpose(0, 1)?.contiguous()
    }

    /// A number that others than these hardly have: FNV-1a of all values.
    pub(crate) fn fingerprint(&self) -> candle_core::Result<u64> {
        let values = self.inputs.flatten_all()?.to_vec1::<f32>()?;
        let bytes = values
            .iter()
            .chain(&self.places)
            .flat_map(|value| value.to_le_bytes());
        Ok(bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
        }))
    }
}

/// The angles of a squeeze in the article's order: motors, then the joints between the phalanges.
fn push_angles(squeeze: &Squeeze, reading: Reading, values: &mut Vec<f32>) {
    let [a, p] = [&squeeze.theta_a_deg, &squeeze.theta_p_deg];
    let angles = [&a[0], &a[1], &p[0], &p[1]];
    match reading {
        Reading::Transposed => values.extend(
            angles
                .iter()
                .flat_map(|angle| angle.iter().map(|deg| *deg as f32)),
        ),
        Reading::Time => {
            let sample = |row: usize| angles.map(|angle| angle[row] as f32);
            values.extend((0..squeeze.len()).flat_map(sample));
        }
    }
}
