//! Touches side by side.

use crate::SequenceError;

/// What steps are counted along.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Alignment {
    /// How far the probe is below the surface, mm.
    Depth,
    /// How far the probe is turned, degrees.
    Angle,
    /// Time since the touch began, s.
    Time,
}

impl Alignment {
    /// What steps are measured in.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Depth => "mm",
            Self::Angle => "degrees",
            Self::Time => "s",
        }
    }
}

impl std::fmt::Display for Alignment {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(match self {
            Alignment::Depth => "depth",
            Alignment::Angle => "angle",
            Alignment::Time => "time",
        })
    }
}

/// Frames of one touch.
#[derive(Debug, Clone, PartialEq)]
pub struct Touch {
    /// What errors call it.
    pub name: String,
    /// Where on the motion each frame was taken: mm, degrees or s.
    pub at: Vec<f64>,
    /// Taxels of a frame.
    pub taxels: usize,
    /// Signed counts above baseline, frame after frame.
    pub values: Vec<f64>,
}

/// Touches on the same steps.
#[derive(Debug, Clone, PartialEq)]
pub struct Aligned {
    /// What the steps are counted along.
    pub along: Alignment,
    /// Where the first step is.
    pub first: f64,
    /// From one step to the next.
    pub step: f64,
    /// Steps of each touch.
    pub steps: usize,
    /// Taxels of a frame.
    pub taxels: usize,
    /// Frames outside the steps that all touches have, and so left out.
    pub left_out: usize,
    /// `steps * taxels` features of each touch, touch after touch; a step's taxels are neighbours.
    pub values: Vec<f64>,
}

impl Aligned {
    /// Features of a touch.
    pub fn features(&self) -> usize {
        self.steps * self.taxels
    }

    /// The features of touch `index`.
    ///
    /// # Panics
    /// If there are not so many.
    pub fn row(&self, index: usize) -> &[f64] {
        &self.values[index * self.features()..][..self.features()]
    }
}

/// Puts touches on the steps that all of them have: multiples of `step` from where the last begins to where the first
/// ends. Frames within half a step of a step are averaged; touches may have any number of them.
///
/// # Errors
/// No touch; touches of different probes; places that are not finite or a step that is not above 0; no step in common;
/// a step among them at which a touch has no frame.
pub fn align(touches: &[Touch], along: Alignment, step: f64) -> Result<Aligned, SequenceError> {
    let Some(one) = touches.first() else {
        return Err(SequenceError::NoTouch);
    };
    let mut range = (one, i64::MIN, one, i64::MAX);
    for touch in touches {
        let (first, last) = check(touch, along, step)?;
        if first > range.1 {
            (range.0, range.1) = (touch, first);
        }
        if last < range.3 {
            (range.2, range.3) = (touch, last);
        }
    }
    let (begins, first, ends, last) = range;
    if first > last {
        return Err(SequenceError::NothingCommon {
            begins: begins.name.clone(),
            ends: ends.name.clone(),
            along,
            first: first as f64 * step,
            last: last as f64 * step,
        });
    }
    let mut aligned = Aligned {
        along,
        first: first as f64 * step,
        step,
        steps: (last - first + 1) as usize,
        taxels: one.taxels,
        left_out: 0,
        values: Vec::new(),
    };
    for touch in touches {
        let (row, left_out) = aligned.place(touch)?;
        aligned.values.extend(row);
        aligned.left_out += left_out;
    }
    Ok(aligned)
}

/// The smallest whole multiple of `step` that is as long as the longest way between two frames of a touch that follow each
/// other, but for a hundredth of `step`: with it every touch has a frame at every step between its first and its last.
///
/// # Errors
/// As [`align`]. Whether all touches have a step in common is not asked.
pub fn sure_step(touches: &[Touch], along: Alignment, step: f64) -> Result<f64, SequenceError> {
    let mut longest = step;
    for touch in touches {
        check(touch, along, step)?;
        let ways = touch.at.windows(2).map(|pair| (pair[1] - pair[0]).abs());
        longest = ways.fold(longest, f64::max);
    }
    // Where one frame of a timer is lost, the way is about two of its steps, now more and now less. Whether two are
    // enough is seen; one more always is.
    let times = (longest / step - 0.01).ceil();
    let holds = |step: f64| touches.iter().all(|touch| has_every_step(touch, step));
    Ok(if holds(times * step) { times } else { times + 1.0 } * step)
}

/// Whether a touch has a frame at every step from its first to its last.
fn has_every_step(touch: &Touch, step: f64) -> bool {
    let numbers = || {
        touch
            .at
            .windows(2)
            .map(|pair| [number(pair[0], step), number(pair[1], step)])
    };
    numbers().all(|[before, after]| before.abs_diff(after) <= 1)
}

impl Aligned {
    /// Puts another touch on the same steps: its features, and how many of its frames are outside of them.
    ///
    /// # Errors
    /// A touch of another probe, places that are not finite, a step at which it has no frame.
    pub fn place(&self, touch: &Touch) -> Result<(Vec<f64>, usize), SequenceError> {
        let (along, taxels, step) = (self.along, self.taxels, self.step);
        check(touch, along, step)?;
        if touch.taxels != taxels {
            return Err(SequenceError::Taxels {
                touch: touch.name.clone(),
                found: touch.taxels,
                expected: taxels,
            });
        }
        let first = number(self.first, step);
        let (mut row, mut counts, mut left_out) = (vec![0.0; self.features()], vec![0.0; self.steps], 0);
        for (at, frame) in touch.at.iter().zip(touch.values.chunks_exact(taxels)) {
            let number = number(*at, step) - first;
            let Some(count) = usize::try_from(number).ok().and_then(|n| counts.get_mut(n)) else {
                left_out += 1;
                continue;
            };
            *count += 1.0;
            let sums = &mut row[number as usize * taxels..][..taxels];
            sums.iter_mut().zip(frame).for_each(|(sum, x)| *sum += x);
        }
        for (n, (sums, count)) in row.chunks_exact_mut(taxels).zip(&counts).enumerate() {
            if *count == 0.0 {
                return Err(SequenceError::StepMissing {
                    touch: touch.name.clone(),
                    along,
                    at: (first + n as i64) as f64 * step,
                });
            }
            sums.iter_mut().for_each(|sum| *sum /= count);
        }
        Ok((row, left_out))
    }
}

/// Which step a place belongs to.
fn number(at: f64, step: f64) -> i64 {
    (at / step).round() as i64
}

/// The first and last step of a touch.
fn check(touch: &Touch, along: Alignment, step: f64) -> Result<(i64, i64), SequenceError> {
    let places = touch.at.len();
    if places == 0 || touch.taxels == 0 || touch.values.len() != places * touch.taxels {
        return Err(SequenceError::Shape {
            touch: touch.name.clone(),
            places,
            values: touch.values.len(),
            taxels: touch.taxels,
        });
    }
    // Numbers of steps beyond a million are no motion, and would be memory without end.
    let countable = |at: &f64| step > 0.0 && (at / step).abs() < 1e6;
    if let Some(at) = touch.at.iter().find(|at| !countable(at)) {
        return Err(SequenceError::Place {
            touch: touch.name.clone(),
            along,
            at: *at,
            step,
        });
    }
    let numbers = touch.at.iter().map(|at| number(*at, step));
    Ok(numbers.fold((i64::MAX, i64::MIN), |(first, last), n| {
        (first.min(n), last.max(n))
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn touch(name: &str, at: &[f64]) -> Touch {
        let values = at.iter().flat_map(|at| [*at, -at]).collect();
        let (name, at) = (name.into(), at.to_vec());
        Touch {
            name,
            at,
            taxels: 2,
            values,
        }
    }

    #[test]
    fn touches_of_unequal_length_keep_the_steps_that_all_have() {
        let touches = [
            touch("long", &[0.0, 0.5, 1.0, 1.5, 2.0]),
            touch("backwards", &[1.5, 1.0, 0.5]),
            touch("finer", &[0.4, 0.6, 0.9, 1.1, 1.4, 1.6, 1.9]),
        ];
        let aligned = align(&touches, Alignment::Depth, 0.5).unwrap();
        assert_eq!((aligned.first, aligned.steps, aligned.left_out), (0.5, 3, 3));
        for row in 0..3 {
            let expected = [0.5, -0.5, 1.0, -1.0, 1.5, -1.5];
            let off = aligned.row(row).iter().zip(expected).map(|(a, b)| (a - b).abs());
            assert!(off.fold(0.0, f64::max) < 1e-12, "{:?}", aligned.row(row));
        }
    }

    #[test]
    fn angles_count_from_below_zero() {
        let turn = |by: f64| touch("turn", &[-2.0 * by, -by, 0.0, by]);
        let aligned = align(&[turn(1.0), turn(1.0)], Alignment::Angle, 1.0).unwrap();
        assert_eq!((aligned.first, aligned.steps), (-2.0, 4));
    }

    #[test]
    fn a_sure_step_is_the_smallest_multiple_that_no_touch_can_lack() {
        let even = || touch("even", &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
        for (others, step) in [
            (vec![], 1.0),
            (vec![touch("late", &[0.0, 1.0, 2.9, 4.0, 5.0])], 2.0),
            (vec![touch("lost", &[0.0, 1.0, 3.0, 4.0, 5.0])], 2.0),
            (
                vec![touch("lost, and a little more", &[0.0, 1.0, 3.001, 4.0, 5.0])],
                2.0,
            ),
            (vec![touch("lost, the other way", &[5.0, 4.0, 2.0, 1.0])], 2.0),
            (vec![touch("long lost", &[0.0, 1.0, 4.6, 5.0])], 4.0),
            (vec![touch("one frame", &[2.0])], 1.0),
        ] {
            let touches = [vec![even()], others].concat();
            let name = &touches.last().unwrap().name;
            assert_eq!(sure_step(&touches, Alignment::Time, 1.0), Ok(step), "{name}");
            align(&touches, Alignment::Time, step).expect(name);
        }
        // A quarter of a step off, a border lies in the middle of the hole.
        let touches = [touch("off", &[0.25, 0.5, 1.0, 2.5, 2.75])];
        let step = sure_step(&touches, Alignment::Time, 0.25).unwrap();
        assert!(step >= 1.5 && has_every_step(&touches[0], step), "{step}");
        assert!(sure_step(&[touch("lost", &[f64::NAN])], Alignment::Time, 1.0).is_err());
        assert!(sure_step(&[even()], Alignment::Time, 0.0).is_err());
    }

    #[test]
    fn what_cannot_be_aligned_is_named() {
        let whole = || touch("whole", &[0.0, 1.0, 2.0]);
        let short = Touch {
            values: vec![1.0],
            ..whole()
        };
        let narrow = Touch {
            taxels: 1,
            values: vec![0.0; 3],
            ..touch("narrow", &[0.0, 1.0, 2.0])
        };
        for (touches, step, words) in [
            (vec![], 1.0, "there is no touch"),
            (
                vec![whole(), touch("holed", &[0.0, 2.0])],
                1.0,
                "touch holed: no frame at depth 1;",
            ),
            (
                vec![whole(), touch("deep", &[3.0, 4.0])],
                1.0,
                "touches deep and whole have no depth in common",
            ),
            (
                vec![whole(), narrow],
                1.0,
                "touch narrow has 1 taxels, and 2 were expected",
            ),
            (vec![short], 1.0, "touch whole: 3 places and 1 values"),
            (
                vec![whole(), touch("lost", &[0.0, f64::NAN])],
                1.0,
                "touch lost: its depth NaN",
            ),
            (vec![whole()], 0.0, "a step of 0"),
            (vec![whole()], 1e-9, "touch whole: its depth 1 is not"),
        ] {
            let error = align(&touches, Alignment::Depth, step).unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
        }
    }
}
