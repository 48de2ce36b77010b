//! `taxel eval --scaling`: what compression costs on skins of every size.

use super::learned;
use anyhow::Context;
use taxel_compress::Compressor;
use taxel_eval::{Method, ScalingReport, synthetic, time};
use taxel_playback::progress::Progress;

/// Width and height of the skins of `--scaling`; a layout has no more than 65,535 taxels.
const SHAPES: [[u16; 2]; 7] = [
    [4, 4],
    [8, 8],
    [16, 16],
    [32, 32],
    [64, 64],
    [128, 128],
    [256, 255],
];
const SCALING_FRAMES: usize = 120;
const SCALING_PASSES: usize = 5;

/// Times both stages on hands of every size.
pub(super) fn scaling(methods: &[Method]) -> anyhow::Result<Vec<ScalingReport>> {
    let progress = Progress::new(SHAPES.len() as u64, "sizes");
    let of_shape = |[width, height]: [u16; 2]| -> anyhow::Result<ScalingReport> {
        let sequence = synthetic(width, height, SCALING_FRAMES)?;
        let methods = learned(methods, &sequence);
        for Method { name, profile, .. } in &methods {
            Compressor::new(profile.clone(), &sequence.layout)
                .with_context(|| format!("--scaling: `{name}` on a made-up skin of {height} x {width}"))?;
        }
        let timings = time(&sequence, &methods, SCALING_PASSES, None, || ());
        progress.advance(1);
        Ok(ScalingReport {
            taxels: sequence.layout.len(),
            methods: (methods.iter().zip(&timings))
                .map(|(method, timings)| (method.name.clone(), timings.least_compress_us()))
                .collect(),
        })
    };
    SHAPES.into_iter().map(of_shape).collect()
}
