//! Hands of any size, pressed all over: for measuring how cost grows.

use crate::sequence::Sequence;
use taxel_hand::ForceFrame;
use taxel_skin::{Layout, LayoutError};

/// `frames` frames of a skin of `width` by `height` taxels, all in contact: a few smooth presses
/// wander over it on a light grip, and every force has noise of a few counts in steps of 1/16, so
/// that values hardly repeat. The same arguments give the same frames.
///
/// # Errors
///
/// A size that is no layout.
pub fn synthetic(width: u16, height: u16, frames: usize) -> Result<Sequence, LayoutError> {
    let layout = Layout::grid(width, height)?;
    let (w, h) = (f64::from(width), f64::from(height));
    let mut state = 0x2545_F491_4F6C_DD1Du64;
    let mut noise = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state % 128) as f64 / 16.0
    };
    let force = (0..frames).map(|t| {
        let mut frame = ForceFrame::new(layout.len());
        frame.t_ns = t as u64 * 10_000_000;
        frame.contact.fill(true);
        let presses = [0.0, 1.7, 3.1, 4.6].map(|phase: f64| {
            let turn = phase + t as f64 * 0.02;
            let middle = [w * (0.5 + 0.4 * turn.sin()), h * (0.5 + 0.4 * (1.3 * turn).cos())];
            (middle, 400.0 + 900.0 * phase)
        });
        let reach = (w * h).sqrt() * 0.2;
        for (force, taxel) in frame.force.iter_mut().zip(&layout.taxels) {
            *force = 20.0 + noise();
            for ([x, y], height) in presses {
                let (dx, dy) = (f64::from(taxel.x) - x, f64::from(taxel.y) - y);
                let off = (dx * dx + dy * dy) / (reach * reach);
                *force += height / (1.0 + off * off);
            }
        }
        frame
    });
    Ok(Sequence {
        force: force.collect(),
        tactile: Vec::new(),
        conditioning: None,
        layout,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_taxel_is_pressed_and_forces_hardly_repeat() {
        let sequence = synthetic(16, 15, 3).unwrap();
        assert_eq!(sequence.len(), 3);
        for frame in &sequence.force {
            assert_eq!(frame.contacts(), 240);
            let mut bits: Vec<u64> = frame.force.iter().map(|f| f.to_bits()).collect();
            bits.sort_unstable();
            bits.dedup();
            assert!(
                bits.len() > 200 && frame.force.iter().all(|f| *f >= 20.0),
                "{}",
                bits.len()
            );
        }
        assert_ne!(sequence.force[0].force, sequence.force[1].force);
        assert_eq!(sequence.force, synthetic(16, 15, 3).unwrap().force);
    }
}
