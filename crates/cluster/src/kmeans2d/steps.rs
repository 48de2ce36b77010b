//! Numbers in steps of eight, which a vector unit takes at once.

/// Points, or clusters, side by side in one step.
pub(super) const LANES: usize = 8;

/// The lesser of two numbers, as a vector unit has it in one instruction.
#[inline(always)]
pub(super) fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// Fills steps with values, the last one up with copies of the last value.
pub(super) fn fill_steps(steps: &mut Vec<[f32; LANES]>, values: &[f64]) {
    steps.clear();
    steps.extend(values.chunks(LANES).map(|chunk| {
        let mut step = [chunk[chunk.len() - 1] as f32; LANES];
        for (to, from) in step.iter_mut().zip(chunk) {
            *to = *from as f32;
        }
        step
    }));
}

/// Squared distance of two places.
pub(super) fn squared(a: [f32; 2], b: [f32; 2]) -> f32 {
    let (dx, dy) = (a[0] - b[0], a[1] - b[1]);
    dx * dx + dy * dy
}
