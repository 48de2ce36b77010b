//! A hand whose noise is normally distributed, and not bounded as that of [`Skin`].

use super::skin::Skin;
use taxel_skin::ConditionConfig;

pub(super) const TAXELS: usize = 16;

/// Normally distributed, with a mean of 0 and a variance of 1.
pub(super) struct Normal {
    pub(super) seed: u64,
}

impl Normal {
    pub(super) fn next(&mut self) -> f64 {
        let mut uniform = || {
            self.seed = self
                .seed
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            ((self.seed >> 33) as f64 + 0.5) / (1u64 << 31) as f64
        };
        let (length, turn) = ((-2.0 * uniform().ln()).sqrt(), uniform());
        length * (std::f64::consts::TAU * turn).cos()
    }
}

/// A hand with normally distributed noise, which is so many counts on an axis of a taxel at a time, and keeps the share
/// `inertia` of itself from sample to sample. It has been calibrated.
pub(super) struct NoisyHand<S: Fn(usize, f64) -> f64> {
    pub(super) hand: Skin,
    sigma: S,
    inertia: f64,
    normal: Normal,
    noise: Vec<[f64; 3]>,
    t: f64,
}

impl<S: Fn(usize, f64) -> f64> NoisyHand<S> {
    pub(super) fn calibrated(rate_hz: u64, inertia: f64, sigma: S) -> Self {
        Self::calibrated_of(11, rate_hz, inertia, sigma)
    }

    /// ... with other noise for each seed.
    pub(super) fn calibrated_of(seed: u64, rate_hz: u64, inertia: f64, sigma: S) -> Self {
        let mut noisy = Self {
            hand: Skin::new(TAXELS, rate_hz, ConditionConfig::robust()),
            sigma,
            inertia,
            normal: Normal { seed },
            noise: vec![[0.0; 3]; TAXELS],
            t: 0.0,
        };
        noisy.hand.noise.fill([0; 3]);
        while noisy.hand.conditioner.is_calibrating() {
            noisy.step();
        }
        noisy
    }

    pub(super) fn step(&mut self) {
        for (n, noise) in self.noise.iter_mut().enumerate() {
            let fresh = (self.sigma)(n, self.t) * (1.0 - self.inertia * self.inertia).sqrt();
            *noise = noise.map(|noise| self.inertia * noise + fresh * self.normal.next());
        }
        let noise = &self.noise;
        self.hand.step_with(|frame| {
            for (counts, noise) in frame.counts.iter_mut().zip(noise) {
                for (count, noise) in counts.iter_mut().zip(noise) {
                    *count = (f64::from(*count) + noise).round() as u16;
                }
            }
        });
        self.t += self.hand.interval_ns as f64 * 1e-9;
    }

    /// Which share of so many frames has contacts.
    pub(super) fn share_in_contact(&mut self, frames: u32) -> f64 {
        let mut with = 0;
        for _ in 0..frames {
            self.step();
            with += u32::from(self.hand.out.contacts() > 0);
        }
        f64::from(with) / f64::from(frames)
    }
}
