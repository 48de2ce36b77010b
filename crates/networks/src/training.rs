//! Training, epoch by epoch, so that it can be stopped after any and go on to the same bits.

use crate::adam::{Moments, descend};
use crate::error::NetworksError;
use crate::examples::Examples;
use crate::network::{Form, Kind, Layer, Network};
use std::time::Instant;
use taxel_cluster::Random;

/// Examples that a step of Adam is made from. The article does not say; it is that of the laboratory's earlier code.
pub const BATCH: usize = 16;

/// Mean squared errors of an epoch, in fractions of the forearm squared.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Losses {
    /// Of the training examples, each before the step that it was part of.
    pub training: f64,
    /// Of the validation examples after the epoch; nothing where there are none. No choice is made by it.
    pub validation: Option<f64>,
}

/// A network and how far it is trained.
#[derive(Debug, Clone)]
pub struct Training {
    pub(crate) kind: Kind,
    pub(crate) form: Form,
    pub(crate) seed: u64,
    pub(crate) rate: f64,
    pub(crate) network: Network,
    pub(crate) moments: Vec<Moments>,
    /// Steps of Adam so far.
    pub(crate) steps: u64,
    /// Time spent on training so far.
    pub(crate) seconds: f64,
    pub(crate) losses: Vec<Losses>,
}

impl Training {
    /// A network of the article that has learned nothing yet, for examples like these.
    ///
    /// # Errors
    /// Memory that is exhausted.
    pub fn new(kind: Kind, examples: &Examples, seed: u64) -> Result<Self, NetworksError> {
        Self::of_layers(kind, kind.layers(), examples.form(), kind.rate(), seed)
    }

    pub(crate) fn of_layers(
        kind: Kind,
        layers: Vec<Layer>,
        form: Form,
        rate: f64,
        seed: u64,
    ) -> Result<Self, NetworksError> {
        let network = Network::new(layers, form, seed)?;
        let none = |(_, var): &(String, candle_core::Var)| Moments::none(var.elem_count());
        let moments = network.parameters().iter().map(none).collect();
        Ok(Self {
            kind,
            form,
            seed,
            rate,
            network,
            moments,
            steps: 0,
            seconds: 0.0,
            losses: Vec::new(),
        })
    }

    /// Which network.
    pub fn kind(&self) -> Kind {
        self.kind
    }

    /// Epochs so far.
    pub fn epochs(&self) -> usize {
        self.losses.len()
    }

    /// The losses of every epoch so far.
    pub fn losses(&self) -> &[Losses] {
        &self.losses
    }

    /// Time spent on them, s.
    pub fn seconds(&self) -> f64 {
        self.seconds
    }

    /// Weights of the network.
    pub fn weights(&self) -> usize {
        self.network
            .parameters()
            .iter()
            .map(|(_, var)| var.elem_count())
            .sum()
    }

    /// One epoch: all training examples once, in batches and an order of this epoch's own.
    ///
    /// # Errors
    /// Memory that is exhausted. The epoch then counts as not made, but weights may have moved.
    pub fn epoch(&mut self, training: &Examples, validation: &Examples) -> Result<Losses, NetworksError> {
        let begun = Instant::now();
        let mut order: Vec<usize> = (0..training.len()).collect();
        Random::for_purpose(self.seed, 1 + self.losses.len() as u64).shuffle(&mut order);
        let mut squares = 0.0;
        for batch in order.chunks(BATCH) {
            let batch = training.select(batch)?;
            squares += self.step(&batch)? * batch.len() as f64;
        }
        let validation = match validation.len() {
            0 => None,
            n => {
                let estimates = self.estimate(validation)?;
                let errors = estimates
                    .iter()
                    .zip(validation.places())
                    .map(|(e, p)| f64::from(e - p).powi(2));
                Some(errors.sum::<f64>() / n as f64)
            }
        };
        let losses = Losses {
            training: squares / training.len().max(1) as f64,
            validation,
        };
        self.losses.push(losses);
        self.seconds += begun.elapsed().as_secs_f64();
        Ok(losses)
    }

    /// One step of Adam; the loss before it.
    fn step(&mut self, batch: &Examples) -> Result<f64, NetworksError> {
        let places = candle_core::Tensor::new(batch.places(), &candle_core::Device::Cpu)?;
        let loss = (self.network.forward(&batch.sequence()?)? - places)?
            .sqr()?
            .mean_all()?;
        let gradients = loss.backward()?;
        self.steps += 1;
        for ((_, parameter), moments) in self.network.parameters().iter().zip(&mut self.moments) {
            if let Some(gradient) = gradients.get(parameter) {
                descend(parameter, gradient, moments, self.rate, self.steps)?;
            }
        }
        Ok(f64::from(loss.to_scalar::<f32>()?))
    }

    /// Where the network places examples, as fractions of the forearm. They may lie outside 0 to 1.
    ///
    /// # Errors
    /// Memory that is exhausted.
    pub fn estimate(&self, examples: &Examples) -> Result<Vec<f32>, NetworksError> {
        let all: Vec<usize> = (0..examples.len()).collect();
        let at_once = if self.kind == Kind::Tactile {
            BATCH
        } else {
            8 * BATCH
        };
        let mut estimates = Vec::with_capacity(all.len());
        for part in all.chunks(at_once) {
            let sequence = examples.select(part)?.sequence()?;
            estimates.extend(self.network.forward(&sequence)?.to_vec1::<f32>()?);
        }
        Ok(estimates)
    }
}
