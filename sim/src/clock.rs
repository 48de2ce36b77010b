//! A scene's time: keyframes, spans, and what happens when the scene is played again and again.

/// Values over time, joined by straight lines; constant before the first and after the last keyframe.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Keyframes<const N: usize> {
    frames: Vec<(u64, [f64; N])>,
}

impl<const N: usize> Keyframes<N> {
    /// Keyframes in rising order of time, at least one.
    pub(crate) fn new(frames: Vec<(u64, [f64; N])>) -> Self {
        debug_assert!(!frames.is_empty() && frames.windows(2).all(|w| w[0].0 < w[1].0));
        Self { frames }
    }

    /// The value at a time of the scene.
    pub(crate) fn at(&self, scene_ns: u64) -> [f64; N] {
        let after = self.frames.partition_point(|(t, _)| *t <= scene_ns);
        if after == 0 {
            return self.frames[0].1;
        }
        let (t0, v0) = &self.frames[after - 1];
        let Some((t1, v1)) = self.frames.get(after) else {
            return *v0;
        };
        let part = (scene_ns - t0) as f64 / (t1 - t0) as f64;
        std::array::from_fn(|i| v0[i] + (v1[i] - v0[i]) * part)
    }
}

/// A stretch of scene time, `from` included, `to` excluded, nanoseconds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Span {
    pub(crate) from_ns: u64,
    pub(crate) to_ns: u64,
}

impl Span {
    /// The stretch of a scene between two optional times, seconds.
    pub(crate) fn of_seconds(from: Option<f64>, to: Option<f64>, length_ns: u64) -> Result<Self, String> {
        let end = length_ns as f64 / 1e9;
        let (from, to) = (from.unwrap_or(0.0), to.unwrap_or(end));
        if !(from >= 0.0 && from < to && to <= end) {
            return Err(format!(
                "from {from} s to {to} s is not a stretch of a scene of {end} s"
            ));
        }
        Ok(Self {
            from_ns: ns_of_seconds(from),
            to_ns: ns_of_seconds(to),
        })
    }

    pub(crate) fn contains(self, scene_ns: u64) -> bool {
        (self.from_ns..self.to_ns).contains(&scene_ns)
    }
}

/// Maps running time, which starts at 0 and never turns back, to scene time.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SceneClock {
    pub(crate) length_ns: u64,
    pub(crate) looping: bool,
}

impl SceneClock {
    /// The scene's time at a running time; at the end of a scene played once, it stays there.
    pub(crate) fn scene_ns(self, t_ns: u64) -> u64 {
        if self.looping {
            t_ns % self.length_ns
        } else {
            t_ns.min(self.length_ns)
        }
    }

    /// Whether a scene played once is over.
    pub(crate) fn is_over(self, t_ns: u64) -> bool {
        !self.looping && t_ns >= self.length_ns
    }

    /// The next running time after `after_ns` at which one of the spans begins or ends.
    pub(crate) fn next_edge(self, spans: impl Iterator<Item = Span>, after_ns: u64) -> Option<u64> {
        let round = self.round_ns(after_ns);
        spans
            .flat_map(|s| [s.from_ns, s.to_ns])
            .filter_map(|edge| self.first_after(round, edge, after_ns))
            .min()
    }

    /// The next running time after `after_ns` of something that happens every `period_ns` during a span,
    /// beginning with the span.
    pub(crate) fn next_periodic(self, span: Span, period_ns: u64, after_ns: u64) -> Option<u64> {
        let round = self.round_ns(after_ns);
        let within = after_ns - round;
        if within >= span.from_ns {
            let next = span.from_ns + ((within - span.from_ns) / period_ns + 1) * period_ns;
            if next < span.to_ns {
                return Some(round + next);
            }
        }
        self.first_after(round, span.from_ns, after_ns)
    }

    /// Where the round of the loop began that `t_ns` is in.
    fn round_ns(self, t_ns: u64) -> u64 {
        if self.looping {
            t_ns - t_ns % self.length_ns
        } else {
            0
        }
    }

    fn first_after(self, round_ns: u64, scene_ns: u64, after_ns: u64) -> Option<u64> {
        let here = round_ns + scene_ns;
        if here > after_ns {
            Some(here)
        } else if self.looping {
            Some(here + self.length_ns)
        } else {
            None
        }
    }
}

/// Seconds as whole nanoseconds. The caller has checked that they are finite, not negative and
/// below a century.
pub(crate) fn ns_of_seconds(seconds: f64) -> u64 {
    (seconds * 1e9 + 0.5) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keyframes_are_joined_by_lines_and_hold_at_the_ends() {
        let k = Keyframes::new(vec![(100, [1.0, 0.0]), (200, [3.0, -2.0]), (300, [3.0, 0.0])]);
        for (t, v) in [
            (0, [1.0, 0.0]),
            (100, [1.0, 0.0]),
            (150, [2.0, -1.0]),
            (200, [3.0, -2.0]),
            (250, [3.0, -1.0]),
            (999, [3.0, 0.0]),
        ] {
            assert_eq!(k.at(t), v, "at {t}");
        }
    }

    #[test]
    fn edges_come_in_order_and_repeat_in_a_loop() {
        let spans = [
            Span {
                from_ns: 10,
                to_ns: 30,
            },
            Span {
                from_ns: 20,
                to_ns: 100,
            },
        ];
        let once = SceneClock {
            length_ns: 100,
            looping: false,
        };
        let again = SceneClock {
            length_ns: 100,
            looping: true,
        };
        let edges = |clock: SceneClock, n: usize| {
            let mut t = 0;
            let mut list = Vec::new();
            while list.len() < n {
                let Some(next) = clock.next_edge(spans.iter().copied(), t) else {
                    break;
                };
                list.push(next);
                t = next;
            }
            list
        };
        assert_eq!(edges(once, 9), [10, 20, 30, 100]);
        assert_eq!(edges(again, 7), [10, 20, 30, 100, 110, 120, 130]);
    }

    #[test]
    fn periodic_events_stay_in_their_span() {
        let span = Span {
            from_ns: 10,
            to_ns: 31,
        };
        let clock = SceneClock {
            length_ns: 50,
            looping: true,
        };
        let mut t = 0;
        let mut list = Vec::new();
        for _ in 0..6 {
            t = clock.next_periodic(span, 10, t).unwrap();
            list.push(t);
        }
        assert_eq!(list, [10, 20, 30, 60, 70, 80]);
    }
}
