//! What counts go up and down by at least, where that is more than a few: the steps of a converter of few bits, or of values
//! that a program has scaled. An offset is no matter, and rounding makes a step longer or shorter by one.

/// Shortest step that is looked for, counts: shorter ones are within the least threshold of the presets.
const LEAST: u32 = 4;
/// Longest step that is looked for, counts.
const MOST: u32 = 1024;
/// How often an axis that shows a step has changed against the change before, at least: noise on the edge of a step does so
/// at every change, a touch or a glitch once, two of them three times.
const REVERSALS: u32 = 4;
/// Fewest axes that show a step, each at times of its own; one is enough where there are fewer than three taxels.
const WITNESSES: u32 = 2;

/// What the samples of one axis show of its step.
#[derive(Debug, Default, Clone, Copy)]
pub(super) struct AxisSteps {
    /// Least change from one sample to the next, 0 where there was none.
    least: u32,
    reversals: u32,
    rises: bool,
    /// Sum of the numbers of the samples that changed: the same where several axes changed at once only.
    times: u32,
}

impl AxisSteps {
    /// Takes sample `number`, and one before it.
    #[inline]
    pub(super) fn take(&mut self, count: i32, last: i32, number: u32) {
        let change = count.abs_diff(last);
        if change > 0 {
            let (is_first, rises) = (self.least == 0, count > last);
            self.least = if is_first { change } else { self.least.min(change) };
            self.reversals = self
                .reversals
                .saturating_add((!is_first && rises != self.rises).into());
            self.rises = rises;
            self.times = self.times.wrapping_add(number);
        }
    }
}

/// The steps that the counts of a hand go in.
#[derive(Debug, Clone)]
pub(super) struct HandSteps {
    /// By step, the times at which axes have shown it, modulo 64.
    shown: Vec<u64>,
    witnesses: u32,
}

impl HandSteps {
    pub(super) fn new(taxels: usize) -> Self {
        Self {
            shown: vec![0; MOST as usize + 1],
            witnesses: if taxels < 3 { 1 } else { WITNESSES },
        }
    }

    /// Finds them. An axis shows the least change that it has made. Those of touches and glitches differ, or happen at the
    /// same times; those of noise are far within it.
    pub(super) fn find<'a>(&mut self, taxels: impl Iterator<Item = &'a [AxisSteps; 3]>) {
        self.shown.fill(0);
        for axis in taxels.flatten() {
            if axis.reversals >= REVERSALS && (LEAST..=MOST).contains(&axis.least) {
                self.shown[axis.least as usize] |= 1 << (axis.times % 64);
            }
        }
    }

    /// The step of an axis, counts: the longest of its hand that is no longer than its least change, but for rounding, or 1.
    pub(super) fn of(&self, axis: &AxisSteps) -> u32 {
        let shown = |step: u32| self.shown[step as usize];
        (LEAST..=MOST.min(axis.least + 1))
            .rev()
            .find(|step| shown(*step) > 0 && (shown(*step) | shown(step - 1)).count_ones() >= self.witnesses)
            .unwrap_or(1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The step of each of these taxels' z axis.
    fn steps_of<const T: usize>(taxels: [&[i32]; T]) -> [u32; T] {
        let mut axes = [[AxisSteps::default(); 3]; T];
        for (axis, samples) in axes.iter_mut().zip(taxels) {
            let mut last = samples[0];
            for (number, count) in samples.iter().enumerate() {
                axis[2].take(*count, last, number as u32);
                last = *count;
            }
        }
        let mut hand = HandSteps::new(T);
        hand.find(axes.iter());
        axes.map(|axis| hand.of(&axis[2]))
    }

    #[test]
    fn two_axes_show_a_step_at_two_times() {
        let (a, b, c): (&[i32], &[i32], &[i32]) = (
            &[165, 181, 165, 181, 165, 181],
            &[325, 309, 325, 325, 309, 325, 309],
            &[7, 7, 7],
        );
        assert_eq!(steps_of([a, b, c]), [16, 16, 1]);
        // At the same times, twice and back, or in one direction.
        assert_eq!(steps_of([a, a, c]), [1; 3]);
        assert_eq!(steps_of([a, &[320, 336, 320, 320, 336, 320], c]), [1; 3]);
        assert_eq!(
            steps_of([a, &[160, 176, 192, 208, 224, 208, 192, 176], c]),
            [1; 3]
        );
        // One is enough where there are hardly any, if not for twice and back.
        assert_eq!(steps_of([a, c]), [16, 1]);
        assert_eq!(steps_of([&[160, 176, 160, 160, 176, 160]]), [1]);
        // What goes by several steps has that of the others too; what is finer does not.
        assert_eq!(
            steps_of([a, b, &[640, 672, 640], &[160, 176, 177], &[-16, 0]]),
            [16, 16, 16, 1, 16]
        );
    }

    #[test]
    fn rounding_makes_a_step_longer_or_shorter_by_one() {
        let scaled = |k: [i32; 7]| k.map(|k| (f64::from(k) * 12.5).round() as i32);
        let taxels = [
            scaled([3, 4, 3, 4, 4, 3, 4]),
            scaled([10, 9, 10, 10, 9, 10, 9]),
            scaled([8, 9, 8, 9, 8, 9, 9]),
        ];
        assert_eq!(steps_of([&taxels[0], &taxels[1], &taxels[2]]), [13; 3]);
    }

    #[test]
    fn what_is_out_of_range_is_no_step() {
        for (by, found) in [(3, 1), (4, 4), (200, 200), (1024, 1024), (1025, 1), (65_535, 1)] {
            let taxels = [[0, by, 0, by, 0, by], [0, by, by, by, by, by]];
            let steps = steps_of([&taxels[0], &[by, 0, by, by, 0, by, 0], &taxels[1]]);
            assert_eq!(steps, [found; 3], "{by}");
        }
    }
}
