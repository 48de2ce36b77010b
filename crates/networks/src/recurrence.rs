//! Long short-term memory (Hochreiter and Schmidhuber 1997, with the forget gate of Gers et al. 2000) as Keras has it, over
//! images (Shi et al. 2015). A plain one is that over images of one pixel.

use crate::window::{Window, floats, product};
use candle_core::{CpuStorage, CustomOp2, Layout, Result, Shape, Tensor};

/// What a gate does to what it is given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Gate {
    /// 1 / (1 + exp(-x)): of Keras's `LSTM`.
    Sigmoid,
    /// 0.2 x + 0.5 within 0 to 1: of the `ConvLSTM2D` of Keras 2.
    HardSigmoid,
}

impl Gate {
    fn open(self, x: f32) -> f32 {
        match self {
            Gate::Sigmoid => 1.0 / (1.0 + (-x).exp()),
            Gate::HardSigmoid => (0.2 * x + 0.5).clamp(0.0, 1.0),
        }
    }

    /// The slope where the gate is `open`.
    fn slope(self, open: f32) -> f32 {
        match self {
            Gate::Sigmoid => open * (1.0 - open),
            Gate::HardSigmoid if open > 0.0 && open < 1.0 => 0.2,
            Gate::HardSigmoid => 0.0,
        }
    }
}

/// What the op gives for each unit, one after another: its output, cell, gates of input and forgetting, what is put in,
/// and the gate of output. Only outputs may be used further; the others are kept for the way back.
const KEPT: usize = 6;

/// The steps of a recurrent layer. In: what each step's input comes to (steps, count, rows, columns, 4 x units; gates of
/// input and forgetting, what is put in, gate of output), and the recurrent kernel (places x units, 4 x units).
#[derive(Debug, Clone, Copy)]
pub(crate) struct Recurrence {
    window: Window,
    gate: Gate,
}

impl Recurrence {
    /// The outputs of all steps: (steps, count, rows, columns, units).
    pub(crate) fn apply(window: Window, gate: Gate, inputs: &Tensor, kernel: &Tensor) -> Result<Tensor> {
        let units = kernel.dim(1)? / 4;
        let kept = inputs.contiguous()?.apply_op2(kernel, Self { window, gate })?;
        kept.narrow(4, 0, units)
    }

    fn patches(&self, outputs: &[f32], [_, count, rows, columns, units]: [usize; 5]) -> Vec<f32> {
        if self.window == Window::PIXEL {
            return outputs.to_vec();
        }
        self.window.patches(outputs, [count, rows, columns, units])
    }

    fn overlap(&self, patches: Vec<f32>, [_, count, rows, columns, units]: [usize; 5]) -> Vec<f32> {
        if self.window == Window::PIXEL {
            return patches;
        }
        self.window.overlap(&patches, [count, rows, columns, units])
    }
}

impl CustomOp2 for Recurrence {
    fn name(&self) -> &'static str {
        "recurrence"
    }

    fn cpu_fwd(
        &self,
        inputs: &CpuStorage,
        at: &Layout,
        kernel: &CpuStorage,
        kernel_at: &Layout,
    ) -> Result<(CpuStorage, Shape)> {
        let (steps, count, rows, columns, width) = at.shape().dims5()?;
        let units = width / 4;
        let dims = [steps, count, rows, columns, units];
        let pixels = count * rows * columns;
        let inputs = floats(inputs, at)?;
        let mut kept = vec![0.0; steps * pixels * KEPT * units];
        let mut outputs = vec![0.0; pixels * units];
        let mut cells = vec![0.0; pixels * units];
        for (step, kept) in kept.chunks_exact_mut((pixels * KEPT * units).max(1)).enumerate() {
            let mut sums = inputs[step * pixels * width..][..pixels * width].to_vec();
            if step > 0 {
                let (recurrent, _) = product(self.patches(&outputs, dims), pixels, kernel, kernel_at)?;
                let recurrent = recurrent.as_slice::<f32>()?;
                sums.iter_mut()
                    .zip(recurrent)
                    .for_each(|(sum, part)| *sum += part);
            }
            for pixel in 0..pixels {
                let sums = &sums[pixel * width..][..width];
                let kept = &mut kept[pixel * KEPT * units..][..KEPT * units];
                let (output, cell) = (
                    &mut outputs[pixel * units..][..units],
                    &mut cells[pixel * units..][..units],
                );
                for unit in 0..units {
                    let [i, f, o] = [0, 1, 3].map(|gate| self.gate.open(sums[gate * units + unit]));
                    let put_in = sums[2 * units + unit].tanh();
                    cell[unit] = f * cell[unit] + i * put_in;
                    output[unit] = o * cell[unit].tanh();
                    for (part, value) in [output[unit], cell[unit], i, f, put_in, o]
                        .into_iter()
                        .enumerate()
                    {
                        kept[part * units + unit] = value;
                    }
                }
            }
        }
        Ok((
            CpuStorage::F32(kept),
            Shape::from((steps, count, rows, columns, KEPT * units)),
        ))
    }

    fn bwd(
        &self,
        inputs: &Tensor,
        kernel: &Tensor,
        kept: &Tensor,
        gradient: &Tensor,
    ) -> Result<(Option<Tensor>, Option<Tensor>)> {
        let (steps, count, rows, columns, width) = inputs.dims5()?;
        let units = width / 4;
        let dims = [steps, count, rows, columns, units];
        let pixels = count * rows * columns;
        let device = inputs.device();
        let kept = kept.flatten_all()?.to_vec1::<f32>()?;
        let gradient = gradient.narrow(4, 0, units)?.flatten_all()?.to_vec1::<f32>()?;
        let of = |step: usize, pixel: usize| &kept[(step * pixels + pixel) * KEPT * units..][..KEPT * units];

        let mut of_inputs = vec![0.0; steps * pixels * width];
        let mut of_cells = vec![0.0; pixels * units];
        let mut of_outputs = vec![0.0; pixels * units];
        for step in (0..steps).rev() {
            let sums = &mut of_inputs[step * pixels * width..][..pixels * width];
            let direct = &gradient[step * pixels * units..][..pixels * units];
            for pixel in 0..pixels {
                let now = of(step, pixel);
                let sums = &mut sums[pixel * width..][..width];
                for unit in 0..units {
                    let [cell, i, f, put_in, o] = [1, 2, 3, 4, 5].map(|part| now[part * units + unit]);
                    let before = if step > 0 {
                        of(step - 1, pixel)[units + unit]
                    } else {
                        0.0
                    };
                    let at = pixel * units + unit;
                    let squashed = cell.tanh();
                    let of_output = of_outputs[at] + direct[at];
                    let of_cell = of_cells[at] + of_output * o * (1.0 - squashed * squashed);
                    sums[unit] = of_cell * put_in * self.gate.slope(i);
                    sums[units + unit] = of_cell * before * self.gate.slope(f);
                    sums[2 * units + unit] = of_cell * i * (1.0 - put_in * put_in);
                    sums[3 * units + unit] = of_output * squashed * self.gate.slope(o);
                    of_cells[at] = of_cell * f;
                }
            }
            if step > 0 {
                let sums = Tensor::from_slice(sums, (pixels, width), device)?;
                let patches = sums.matmul(&kernel.t()?)?.flatten_all()?.to_vec1()?;
                of_outputs = self.overlap(patches, dims);
            }
        }

        // All steps in one product where there are no patches, which would not fit into memory.
        let at_once = if self.window == Window::PIXEL {
            steps.saturating_sub(1).max(1)
        } else {
            1
        };
        let mut of_kernel = kernel.zeros_like()?;
        for first in (1..steps).step_by(at_once) {
            let last = (first + at_once).min(steps);
            let mut patches = Vec::new();
            for step in first..last {
                let outputs: Vec<f32> = (0..pixels)
                    .flat_map(|pixel| &of(step - 1, pixel)[..units])
                    .copied()
                    .collect();
                patches.extend(self.patches(&outputs, dims));
            }
            let patches = Tensor::from_vec(patches, ((last - first) * pixels, kernel.dim(0)?), device)?;
            let sums = &of_inputs[first * pixels * width..last * pixels * width];
            let sums = Tensor::from_slice(sums, ((last - first) * pixels, width), device)?;
            of_kernel = (of_kernel + patches.t()?.matmul(&sums)?)?;
        }
        Ok((
            Some(Tensor::from_vec(of_inputs, inputs.shape(), device)?),
            Some(of_kernel),
        ))
    }
}
