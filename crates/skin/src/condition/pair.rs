//! The publication's first two frames, `rho_0` and `rho_1`: its baseline, its fault rule and its
//! threshold come from them.

/// Frames to wait for one in which every taxel speaks before `rho_0` is taken with what there is.
const PATIENCE_FRAMES: u32 = 10;

/// The first two frames after the start or a re-zero.
#[derive(Debug, Clone)]
pub(super) struct FirstPair {
    /// Raw counts of `rho_0`.
    pub(super) zero_raw: Vec<[u16; 3]>,
    /// Its repaired counts.
    pub(super) zero: Vec<[i32; 3]>,
    /// Which taxels `rho_0` has.
    pub(super) present: Vec<bool>,
    /// Repaired counts of `rho_1`; those of `rho_0` where it has none.
    pub(super) one: Vec<[i32; 3]>,
    waited: u32,
    stage: Stage,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stage {
    Zero,
    One,
    Done,
}

impl FirstPair {
    pub(super) fn new(taxels: usize) -> Self {
        Self {
            zero_raw: vec![[0; 3]; taxels],
            zero: vec![[0; 3]; taxels],
            present: vec![false; taxels],
            one: vec![[0; 3]; taxels],
            waited: 0,
            stage: Stage::Zero,
        }
    }

    pub(super) fn restart(&mut self) {
        (self.waited, self.stage) = (0, Stage::Zero);
    }

    pub(super) fn is_done(&self) -> bool {
        self.stage == Stage::Done
    }

    /// Takes a frame with new samples: raw and repaired counts of each taxel, `None` where it has no value.
    pub(super) fn take(&mut self, taxel: impl Fn(usize) -> Option<([u16; 3], [i32; 3])>) {
        let taxels = self.zero.len();
        match self.stage {
            Stage::Zero => {
                self.waited += 1;
                if self.waited < PATIENCE_FRAMES && (0..taxels).any(|n| taxel(n).is_none()) {
                    return;
                }
                for n in 0..taxels {
                    let value = taxel(n);
                    self.present[n] = value.is_some();
                    (self.zero_raw[n], self.zero[n]) = value.unwrap_or_default();
                }
                self.stage = Stage::One;
            }
            Stage::One => {
                for n in 0..taxels {
                    self.one[n] = taxel(n).map_or(self.zero[n], |(_, counts)| counts);
                }
                self.stage = Stage::Done;
            }
            Stage::Done => {}
        }
    }
}
