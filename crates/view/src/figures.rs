//! Rates and latencies of late.

use std::collections::VecDeque;

/// The rate is measured over this time; who has had no image for longer is told.
const RATE_WINDOW_NS: u64 = 1_000_000_000;
/// The latencies are those of so many images.
const RECENT_IMAGES: usize = 500;
/// Figures are made anew as often: nobody reads faster.
const FIGURES_NS: u64 = 500_000_000;

/// Rates and latencies of late.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
pub struct Figures {
    /// Images made per second.
    pub rate_hz: f64,
    /// Median age of images at their arrival, milliseconds; `None` where their clock tells none.
    pub latency_p50_ms: Option<f64>,
    /// What 99 of 100 do not exceed.
    pub latency_p99_ms: Option<f64>,
    /// The raw counts, bits per second.
    pub raw_bits_per_s: f64,
    /// What tells a display as much as its actuators can render, bits per second
    /// (docs/algorithm.md, "Figures from elsewhere").
    pub image_bits_per_s: f64,
}

/// That no more images come, where the newest came so many seconds ago.
pub(crate) fn no_image_for(age_s: Option<f64>) -> Option<String> {
    let age_s = age_s.filter(|age_s| *age_s > RATE_WINDOW_NS as f64 / 1e9)?;
    Some(format!("no image for the last {age_s:.1} s"))
}

/// When the last images came, and how old they were.
#[derive(Debug, Default)]
pub(crate) struct Arrivals {
    /// When they came, and how many had been made since the one before.
    came: VecDeque<(u64, u64)>,
    latency_ns: VecDeque<u64>,
    figures: Figures,
    figures_ns: u64,
}

impl Arrivals {
    /// An image has come, the newest of so many.
    pub(crate) fn see(&mut self, now_ns: u64, made: u64, latency_ns: u64) {
        if self.latency_ns.len() == RECENT_IMAGES {
            self.latency_ns.pop_front();
        }
        self.latency_ns.push_back(latency_ns);
        self.came.push_back((now_ns, made));
        while (self.came.front()).is_some_and(|(at, _)| now_ns.saturating_sub(*at) > RATE_WINDOW_NS) {
            self.came.pop_front();
        }
    }

    /// No more come.
    pub(crate) fn end(&mut self) {
        self.came.clear();
        self.latency_ns.clear();
        self.figures_ns = 0;
    }

    /// The figures, made anew twice a second; `tells_age` says whether latencies mean anything, and the bits are those of
    /// a raw frame and of an image.
    pub(crate) fn figures(&mut self, now_ns: u64, tells_age: bool, [raw, image]: [f64; 2]) -> Figures {
        if self.figures_ns != 0 && now_ns.saturating_sub(self.figures_ns) < FIGURES_NS {
            return self.figures;
        }
        self.figures_ns = now_ns;
        let rate_hz = self.rate_hz(now_ns);
        let mut latency_ns: Vec<u64> = self.latency_ns.iter().copied().collect();
        latency_ns.sort_unstable();
        let quantile_ms = |q: f64| {
            let place = (latency_ns.len() as f64 * q) as usize;
            let ns = latency_ns.get(place.min(latency_ns.len().saturating_sub(1)))?;
            tells_age.then_some(*ns as f64 / 1e6)
        };
        self.figures = Figures {
            rate_hz,
            latency_p50_ms: quantile_ms(0.5),
            latency_p99_ms: quantile_ms(0.99),
            raw_bits_per_s: raw * rate_hz,
            image_bits_per_s: image * rate_hz,
        };
        self.figures
    }

    /// Images per second over the last second.
    fn rate_hz(&self, now_ns: u64) -> f64 {
        let (Some((first, _)), Some((last, _))) = (self.came.front(), self.came.back()) else {
            return 0.0;
        };
        if last <= first || now_ns.saturating_sub(*last) > RATE_WINDOW_NS {
            return 0.0;
        }
        let made: u64 = self.came.iter().skip(1).map(|(_, made)| made).sum();
        made as f64 * 1e9 / (last - first) as f64
    }
}
