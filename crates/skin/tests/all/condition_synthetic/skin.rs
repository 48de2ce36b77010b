//! A skin to condition: idle levels and noise as recorded hands have them, and whatever a test does to it.

use taxel_hand::{ForceFrame, Freshness, TactileFrame};
use taxel_skin::{ConditionConfig, Conditioner};

pub(crate) const MS: u64 = 1_000_000;

/// A conditioner with its frames, at one rate.
pub(crate) struct Skin {
    pub(crate) conditioner: Conditioner,
    pub(crate) frame: TactileFrame,
    pub(crate) out: ForceFrame,
    /// True counts without noise; may leave 0..65535, and then wrap.
    pub(crate) truth: Vec<[i32; 3]>,
    /// Peak noise per axis and taxel, counts.
    pub(crate) noise: Vec<[i32; 3]>,
    pub(crate) interval_ns: u64,
    seed: u64,
}

impl Skin {
    pub(crate) fn new(taxels: usize, rate_hz: u64, config: ConditionConfig) -> Self {
        let mut frame = TactileFrame::new(taxels);
        frame.freshness.fill(Freshness::Fresh);
        frame.age_ns.fill(0);
        Self {
            conditioner: Conditioner::new(taxels, config).expect("a valid configuration"),
            frame,
            out: ForceFrame::new(taxels),
            truth: (0..taxels as i32)
                .map(|n| [32_700 + 3 * n, 32_600 - 5 * n, 12_500 + 11 * n])
                .collect(),
            noise: vec![[4, 7, 30]; taxels],
            interval_ns: 1_000 * MS / rate_hz,
            seed: 1,
        }
    }

    fn random(&mut self, peak: i32) -> i32 {
        self.seed = self
            .seed
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.seed >> 33) as i32 % (2 * peak + 1) - peak
    }

    /// One frame of noise on the truth, changed by `spoil` before it goes in.
    pub(crate) fn step_with(&mut self, spoil: impl FnOnce(&mut TactileFrame)) -> &ForceFrame {
        self.frame.seq += 1;
        self.frame.t_ns += self.interval_ns;
        for n in 0..self.truth.len() {
            for axis in 0..3 {
                let noise = self.random(self.noise[n][axis]);
                self.frame.counts[n][axis] = (self.truth[n][axis] + noise) as u16;
            }
        }
        spoil(&mut self.frame);
        self.conditioner.process(&self.frame, &mut self.out);
        &self.out
    }

    pub(crate) fn step(&mut self) -> &ForceFrame {
        self.step_with(|_| {})
    }

    pub(crate) fn run_ms(&mut self, ms: u64) {
        for _ in 0..(ms * MS).div_ceil(self.interval_ns) {
            self.step();
        }
    }

    /// Runs until calibration has ended; not longer than 30 s.
    pub(crate) fn calibrate(&mut self) {
        let end_ns = self.frame.t_ns + 30_000 * MS;
        while self.frame.t_ns < end_ns {
            self.step();
            if !self.conditioner.is_calibrating() {
                return;
            }
        }
        panic!(
            "still calibrating after 30 s, progress {}",
            self.conditioner.calibration_progress()
        );
    }
}

pub(crate) fn robust(taxels: usize) -> Skin {
    Skin::new(taxels, 100, ConditionConfig::robust())
}

pub(crate) fn calibrated(taxels: usize) -> Skin {
    let mut skin = robust(taxels);
    skin.calibrate();
    skin
}

pub(crate) fn press(skin: &mut Skin, taxel: usize, counts: i32) {
    skin.truth[taxel][0] += counts / 3;
    skin.truth[taxel][1] += counts / 3;
    skin.truth[taxel][2] -= counts;
}
