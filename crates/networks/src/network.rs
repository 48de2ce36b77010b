//! The three networks, layer by layer (section 4.1 and Figure 6 of the article).

use crate::initial::{glorot_uniform, orthogonal};
use crate::recurrence::{Gate, Recurrence};
use crate::window::Window;
use candle_core::{DType, Device, Result, Tensor, Var};
use taxel_cluster::Random;

/// What the long short-term memory takes for time, of which the article says nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Reading {
    /// Samples one after another, of four angles each.
    Time,
    /// Angles one after another, of all samples each: what the code of the laboratory's article before this one does
    /// (github.com/fpastorm/LSTM-Haptic-Fusion, LSTM-Kinesthetic.ipynb: `input_shape=(4,41)`).
    Transposed,
}

/// Which network.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// LSTM 1000, 500 and 100, dense 1: from the angles of the fingers.
    Kinesthetic(Reading),
    /// ConvLSTM 16 of 5 x 3, convolution 32 of 2 x 2, dense 64 and 1: from tactile images.
    Tactile,
    /// Dense 128, 64, 32 and 1: from the estimates of the other two.
    Fusion,
}

impl std::fmt::Display for Reading {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(match self {
            Reading::Time => "time",
            Reading::Transposed => "transposed",
        })
    }
}

impl std::fmt::Display for Kind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Kind::Kinesthetic(reading) => write!(f, "kinesthetic-{reading}"),
            Kind::Tactile => f.pad("tactile"),
            Kind::Fusion => f.pad("fusion"),
        }
    }
}

impl Kind {
    /// Epochs of the article.
    pub fn epochs(self) -> usize {
        match self {
            Kind::Kinesthetic(_) => 2000,
            Kind::Tactile => 500,
            Kind::Fusion => 2500,
        }
    }

    /// Adam's rate of the article.
    pub fn rate(self) -> f64 {
        match self {
            Kind::Kinesthetic(_) => 1e-5,
            Kind::Tactile => 8e-4,
            Kind::Fusion => 1e-6,
        }
    }

    pub(crate) fn layers(self) -> Vec<Layer> {
        let dense = |units| Layer::Dense { units, relu: true };
        let last = Layer::Dense {
            units: 1,
            relu: false,
        };
        let lstm = |units, sequence| Layer::Recurrent {
            units,
            window: Window::PIXEL,
            gate: Gate::Sigmoid,
            sequence,
        };
        match self {
            Kind::Kinesthetic(_) => vec![
                lstm(1000, true),
                lstm(500, true),
                lstm(100, false),
                Layer::Flatten,
                last,
            ],
            Kind::Tactile => vec![
                Layer::Recurrent {
                    units: 16,
                    window: Window { rows: 5, columns: 3 },
                    gate: Gate::HardSigmoid,
                    sequence: false,
                },
                Layer::Convolution {
                    units: 32,
                    window: Window { rows: 2, columns: 2 },
                },
                Layer::Flatten,
                dense(64),
                last,
            ],
            Kind::Fusion => vec![Layer::Flatten, dense(128), dense(64), dense(32), last],
        }
    }
}

/// What one example is made of: steps, and rows, columns and channels of each step's image. A step of angles is an image
/// of one pixel with a channel for each.
pub(crate) type Form = [usize; 4];

/// A layer. Sequences are (steps, count, rows, columns, channels), images lack the steps, what is flat is (count, values).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Layer {
    /// Long short-term memory; gives the outputs of all steps if `sequence`, of the last if not.
    Recurrent {
        units: usize,
        window: Window,
        gate: Gate,
        sequence: bool,
    },
    /// A convolution with max(0, x) behind it.
    Convolution { units: usize, window: Window },
    /// Images, or sequences of one step, to values.
    Flatten,
    /// Every value to every unit, with max(0, x) behind it if `relu`.
    Dense { units: usize, relu: bool },
}

/// Layers with their weights.
#[derive(Debug, Clone)]
pub(crate) struct Network {
    layers: Vec<Layer>,
    /// Names and weights, in the order of the layers: kernel, recurrent kernel where there is one, bias.
    parameters: Vec<(String, Var)>,
}

impl Network {
    /// A network for examples of a form, with weights as Keras draws them first.
    pub(crate) fn new(layers: Vec<Layer>, form: Form, seed: u64) -> Result<Self> {
        let mut random = Random::for_purpose(seed, 0);
        let mut parameters = Vec::new();
        let [_, mut rows, mut columns, mut channels] = form;
        for (n, layer) in layers.iter().enumerate() {
            let mut add = |name, tensor: Tensor| -> Result<()> {
                parameters.push((format!("{n}.{name}"), Var::from_tensor(&tensor)?));
                Ok(())
            };
            let bias = |units: usize, forget: std::ops::Range<usize>| {
                let bias: Vec<f32> = (0..units)
                    .map(|unit| f32::from(u8::from(forget.contains(&unit))))
                    .collect();
                Tensor::from_vec(bias, units, &Device::Cpu)
            };
            match *layer {
                Layer::Recurrent { units, window, .. } => {
                    let places = window.places();
                    add(
                        "kernel",
                        glorot_uniform(&mut random, places * channels, 4 * units, places)?,
                    )?;
                    add("recurrent", orthogonal(&mut random, places * units, 4 * units)?)?;
                    add("bias", bias(4 * units, units..2 * units)?)?;
                    channels = units;
                }
                Layer::Convolution { units, window } => {
                    let places = window.places();
                    add(
                        "kernel",
                        glorot_uniform(&mut random, places * channels, units, places)?,
                    )?;
                    add("bias", bias(units, 0..0)?)?;
                    channels = units;
                }
                Layer::Flatten => [rows, columns, channels] = [1, 1, rows * columns * channels],
                Layer::Dense { units, .. } => {
                    add("kernel", glorot_uniform(&mut random, channels, units, 1)?)?;
                    add("bias", bias(units, 0..0)?)?;
                    channels = units;
                }
            }
        }
        Ok(Self { layers, parameters })
    }

    pub(crate) fn parameters(&self) -> &[(String, Var)] {
        &self.parameters
    }

    /// What the network makes of a sequence (steps, count, rows, columns, channels): a value for each of `count`.
    pub(crate) fn forward(&self, sequence: &Tensor) -> Result<Tensor> {
        let mut parameters = self.parameters.iter().map(|(_, var)| var.as_tensor());
        let mut next = || {
            parameters
                .next()
                .ok_or_else(|| candle_core::Error::msg("a layer without weights"))
        };
        let mut x = sequence.clone();
        for layer in &self.layers {
            x = match *layer {
                Layer::Recurrent {
                    window,
                    gate,
                    sequence,
                    ..
                } => {
                    let (steps, count, rows, columns, channels) = x.dims5()?;
                    let images = x.reshape((steps * count, rows, columns, channels))?;
                    let inputs = window.apply(&images, next()?)?;
                    let recurrent = next()?;
                    let inputs = inputs
                        .broadcast_add(next()?)?
                        .reshape((steps, count, rows, columns, ()))?;
                    let outputs = Recurrence::apply(window, gate, &inputs, recurrent)?;
                    if sequence {
                        outputs.contiguous()?
                    } else {
                        outputs.narrow(0, steps - 1, 1)?.squeeze(0)?.contiguous()?
                    }
                }
                Layer::Convolution { window, .. } => {
                    window.apply(&x, next()?)?.broadcast_add(next()?)?.relu()?
                }
                Layer::Flatten if x.rank() == 5 => x.squeeze(0)?.flatten_from(1)?,
                Layer::Flatten => x.flatten_from(1)?,
                Layer::Dense { relu, .. } => {
                    let sums = x.matmul(next()?)?.broadcast_add(next()?)?;
                    if relu { sums.relu()? } else { sums }
                }
            };
        }
        x.to_dtype(DType::F32)?.squeeze(1)
    }
}
