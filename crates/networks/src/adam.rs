//! Adam (Kingma and Ba 2015) as Keras 2 has it. candle's own hides its moments, so that training could not be resumed.

use candle_core::{CpuStorage, InplaceOp2, Layout, Result, Tensor, Var};
use std::cell::RefCell;

const BETA_1: f64 = 0.9;
const BETA_2: f64 = 0.999;
/// Keras's; it stands beside the root of the second moment before that is corrected.
const EPSILON: f32 = 1e-7;

/// Running means of a parameter's gradients and of their squares.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Moments {
    pub(crate) first: Vec<f32>,
    pub(crate) second: Vec<f32>,
}

impl Moments {
    pub(crate) fn none(len: usize) -> Self {
        Self {
            first: vec![0.0; len],
            second: vec![0.0; len],
        }
    }
}

/// Moves a parameter against its gradient; `step` counts from 1.
pub(crate) fn descend(
    parameter: &Var,
    gradient: &Tensor,
    moments: &mut Moments,
    rate: f64,
    step: u64,
) -> Result<()> {
    let steps = step as f64;
    let rate = rate * (1.0 - BETA_2.powf(steps)).sqrt() / (1.0 - BETA_1.powf(steps));
    let descent = Descent {
        rate: rate as f32,
        moments: RefCell::new(moments),
    };
    parameter
        .as_tensor()
        .inplace_op2(&gradient.contiguous()?, &descent)
}

struct Descent<'a> {
    rate: f32,
    moments: RefCell<&'a mut Moments>,
}

impl InplaceOp2 for Descent<'_> {
    fn name(&self) -> &'static str {
        "adam"
    }

    fn cpu_fwd(
        &self,
        parameter: &mut CpuStorage,
        at: &Layout,
        gradient: &CpuStorage,
        gradient_at: &Layout,
    ) -> Result<()> {
        let gradient = crate::window::floats(gradient, gradient_at)?;
        let (CpuStorage::F32(parameter), Some((from, to))) = (parameter, at.contiguous_offsets()) else {
            candle_core::bail!("a parameter must be contiguous");
        };
        let mut moments = self.moments.borrow_mut();
        let Moments { first, second } = &mut **moments;
        let (keep, keep_squares) = (BETA_1 as f32, BETA_2 as f32);
        let parameter = parameter[from..to].iter_mut().zip(gradient);
        for ((p, g), (m, v)) in parameter.zip(first.iter_mut().zip(second)) {
            *m = keep * *m + (1.0 - keep) * g;
            *v = keep_squares * *v + (1.0 - keep_squares) * g * g;
            *p -= self.rate * *m / (v.sqrt() + EPSILON);
        }
        Ok(())
    }
}
