//! What counts go up and down by, where that is more than one: the steps of a converter of few bits whose values stand to
//! the left in sixteen, or of values that a program has scaled. The counts themselves say it: all are multiples of it.

/// Shortest step that is looked for, counts: shorter ones are within the least threshold of the presets.
const LEAST: u32 = 4;
/// Longest step that is looked for, counts: a longer change that is taken back at once is a glitch to the presets.
const MOST: u32 = 200;
/// Fewest taxels that show a step, each at times of its own.
const WITNESSES: u32 = 3;

/// What the samples of one axis show of its step.
#[derive(Debug, Default, Clone, Copy)]
pub(super) struct AxisSteps {
    /// Greatest number of which all samples are multiples, 0 where all are 0. Below [`LEAST`] it is not followed.
    divisor: u32,
    /// Least change from one sample to the next, 0 where there was none.
    change: u32,
    /// Sum of the numbers of the samples that changed: the same where several axes changed at once only.
    times: u32,
}

impl AxisSteps {
    /// Takes sample `number`, and one before it.
    #[inline]
    pub(super) fn take(&mut self, count: i32, last: i32, number: u32) {
        if (1..LEAST).contains(&self.divisor) {
            return;
        }
        self.divisor = greatest_divisor(count.unsigned_abs(), self.divisor);
        let change = count.abs_diff(last);
        if change > 0 {
            self.change = if self.change > 0 {
                self.change.min(change)
            } else {
                change
            };
            self.times = self.times.wrapping_add(number);
        }
    }
}

/// The steps that the counts of a hand go in.
#[derive(Debug, Clone)]
pub(super) struct HandSteps {
    /// By step and axis, the times at which taxels have shown it, modulo 64.
    shown: Vec<[u64; 3]>,
}

impl HandSteps {
    pub(super) fn new() -> Self {
        Self {
            shown: vec![[0; 3]; MOST as usize + 1],
        }
    }

    /// Finds them. A taxel shows a step on an axis where it has changed by just that, and has multiples of it alone. A
    /// touch or a glitch that does so by chance moves one taxel, or several at the same times.
    pub(super) fn find<'a>(&mut self, taxels: impl Iterator<Item = &'a [AxisSteps; 3]>) {
        self.shown.fill([0; 3]);
        for axes in taxels {
            for (a, axis) in axes.iter().enumerate() {
                if axis.change == axis.divisor && (LEAST..=MOST).contains(&axis.change) {
                    self.shown[axis.change as usize][a] |= 1 << (axis.times % 64);
                }
            }
        }
    }

    /// The step of one taxel's axis `a`, counts: the longest of its hand of which all its samples are multiples, or 1.
    pub(super) fn of(&self, axis: &AxisSteps, a: usize) -> u32 {
        (LEAST..=MOST.min(axis.divisor))
            .rev()
            .find(|step| {
                let shown = self.shown[*step as usize][a].count_ones();
                shown >= WITNESSES && axis.divisor.is_multiple_of(*step)
            })
            .unwrap_or(1)
    }
}

/// The greatest common divisor; the other number where one is 0.
fn greatest_divisor(mut a: u32, mut b: u32) -> u32 {
    while b != 0 {
        (a, b) = (b, a % b);
    }
    a
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
        let mut hand = HandSteps::new();
        hand.find(axes.iter());
        axes.map(|axis| hand.of(&axis[2], 2))
    }

    #[test]
    fn three_taxels_show_a_step_at_three_times() {
        let (a, b, c): (&[i32], &[i32], &[i32]) =
            (&[160, 176, 176, 176], &[320, 320, 304, 304], &[48, 48, 48, 64]);
        assert_eq!(steps_of([a, b, c]), [16; 3]);
        assert_eq!(steps_of([a, b]), [1; 2]);
        assert_eq!(steps_of([a, a, b]), [1; 3]);
        // What has not changed, or by more, goes in it where all of its counts are multiples; finer taxels do not.
        assert_eq!(
            steps_of([a, b, c, &[640], &[640, 672], &[648], &[160, 176, 177], &[0, 0]]),
            [16, 16, 16, 16, 16, 1, 1, 1]
        );
        // Below 0, as counts that were unwrapped are, they are multiples too.
        assert_eq!(steps_of([a, b, c, &[-16, 0, -16]]), [16; 4]);
    }

    #[test]
    fn what_is_out_of_range_or_changes_by_several_steps_at_once_shows_none() {
        let off = |at: usize, by: i32| (0..9).map(|i| 160 + by * i32::from(i == at)).collect::<Vec<_>>();
        for (by, found) in [(3, 1), (4, 4), (16, 16), (48, 1), (160, 160), (272, 1)] {
            let steps = steps_of([&off(1, by), &off(2, by), &off(3, by)]);
            assert_eq!(steps, [found; 3], "{by}");
        }
        let zero = |at: usize| (0..9).map(|i| 201 * i32::from(i == at)).collect::<Vec<_>>();
        assert_eq!(steps_of([&zero(1), &zero(2), &zero(3)]), [1; 3]);
    }
}
