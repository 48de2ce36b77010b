//! Whether the values under a board's address are those of two boards, as far as they themselves and their times say.

/// Share of readings that swing, from which a board's values are those of two boards.
const SHARE: f64 = 0.5;
/// Windows in a row of values that swing as far each time, which are proof by themselves: 20 s. What shakes a hand, or the
/// hum of a supply, can swing with every sweep too, but beats against the clock of a board.
const LONG: u16 = 80;
/// In these the mean swing of none is this many times that of another.
const BEAT_TIMES: f64 = 2.0;
/// Of two sweeps in a row, the time to the second is less than such a part of the time of both: a board that jitters keeps
/// its period better, and two boards are in step by chance.
const UNEVEN_PART: u64 = 3;
/// Sweeps of a window, and the share of them that are uneven, from which there are two.
const LEAST_SWEEPS: u32 = 4;
const UNEVEN_SHARE: f64 = 0.75;

/// How the values of one board's taxels swing.
#[derive(Debug, Clone, Default)]
pub(super) struct Swinging {
    swings: u32,
    /// How far these went together, counts.
    swung: u64,
    /// Windows in a row in which most readings swung, and the least and the largest mean swing of these, counts.
    windows: u16,
    mean: [f64; 2],
    /// When the newest sweep came, and how long after the one before it, nanoseconds.
    sweep: Option<(u64, Option<u64>)>,
    sweeps: u32,
    uneven: u32,
}

/// What a window has shown.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub(super) struct Swung {
    /// Most readings swung.
    pub(super) is: bool,
    /// They did as only those of two boards do.
    pub(super) is_proof: bool,
}

impl Swinging {
    /// Takes how far a reading swung, counts; 0 where it did not.
    #[inline]
    pub(super) fn note(&mut self, swing: u16) {
        self.swings += u32::from(swing > 0);
        self.swung += u64::from(swing);
    }

    /// Takes the time of a reading of the board's first taxel: of a sweep.
    #[inline]
    pub(super) fn note_sweep(&mut self, now_ns: u64) {
        let since = self.sweep.map(|(last_ns, _)| now_ns.saturating_sub(last_ns));
        if let (Some(since), Some((_, Some(before)))) = (since, self.sweep) {
            self.sweeps += 1;
            self.uneven +=
                u32::from(since.min(before).saturating_mul(UNEVEN_PART) < since.saturating_add(before));
        }
        self.sweep = Some((now_ns, since));
    }

    /// Ends a window of so many readings.
    pub(super) fn end_window(&mut self, readings: u32) -> Swung {
        let is = f64::from(self.swings) >= SHARE * f64::from(readings.max(1));
        let mean = self.swung as f64 / f64::from(self.swings.max(1));
        let [least, most] = [self.mean[0].min(mean), self.mean[1].max(mean)];
        if !is {
            self.windows = 0;
        } else if self.windows > 0 && most < BEAT_TIMES * least {
            self.windows = self.windows.saturating_add(1);
            self.mean = [least, most];
        } else {
            (self.windows, self.mean) = (1, [mean; 2]);
        }
        let uneven =
            self.sweeps >= LEAST_SWEEPS && f64::from(self.uneven) >= UNEVEN_SHARE * f64::from(self.sweeps);
        (self.swings, self.swung, self.sweeps, self.uneven) = (0, 0, 0, 0);
        Swung {
            is,
            is_proof: is && (uneven || self.windows >= LONG),
        }
    }
}
