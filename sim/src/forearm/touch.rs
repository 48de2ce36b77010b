//! What the third finger feels: a rectangle of tactels under a silicone pad, with two bones above.

use super::section::{Section, along};
use crate::random::{bell, bits};

/// Rows of a tactile image, along the forearm from the wrist's side. Which way the publication's sensor lies is not said.
pub const TOUCH_ROWS: usize = 28;
/// Columns of a tactile image, across the forearm.
pub const TOUCH_COLUMNS: usize = 50;
const TACTELS: usize = TOUCH_ROWS * TOUCH_COLUMNS;
/// Between tactels, mm: 53.3 mm by 95.3 mm of a Tekscan 6077.
const PITCH_MM: f64 = 1.9;
/// From wrist to elbow, mm. An assumption: the publication's places are 1 cm apart, which would make 12 cm.
const FOREARM_MM: f64 = 240.0;
/// The pad of Ecoflex 00-30: its thickness is the publication's, its modulus an assumption.
const PAD_MM: f64 = 3.0;
const PAD_KPA: f64 = 60.0;
/// Tissue: between skin with fat and muscle, whose moduli under a finger are 26 and 62 kPa (PMC9711973).
const TISSUE_KPA: f64 = 40.0;
/// Bones at wrist and elbow, mm: radius, distance, how deep the top of each is. All are assumptions, made so that bones are
/// near the skin at the wrist and deep at the elbow, as the publication says: that images look so is no evidence.
const BONE_MM: [f64; 2] = [8.0, 7.0];
const SPACING_MM: [f64; 2] = [32.0, 26.0];
const DEPTHS_MM: [[f64; 2]; 2] = [[5.0, 18.0], [5.0, 27.0]];
/// Tissue spreads what is at a depth `z` to a bell of this standard deviation at the skin, in `z`: that of the pressure under a
/// point force (Boussinesq), by its width at half height. An assumption for anything but a half-space.
const SPREAD: f64 = 0.48;
/// What presses: the arm's weight alone, and at a PWM of 400, N. Assumptions.
const FORCE_N: [f64; 2] = [5.0, 40.0];
/// Full scale: 34 kPa (Table 1 of the publication) in eight bits.
const FULL_KPA: f64 = 34.0;
const FULL_COUNTS: f64 = 255.0;
/// Standard deviations of a tactel's gain, and of its noise in counts. Assumptions.
const GAIN: f64 = 0.03;
const NOISE: f64 = 1.0;
/// Random numbers of gains and of noise.
const GAIN_STREAM: u64 = 0x666F_7265;
const NOISE_STREAM: u64 = 0x666F_7266;

/// What the third finger feels at one place.
#[derive(Debug)]
pub(super) struct Touch {
    /// Pressure by depth at each tactel, kPa/mm; none where no arm is above.
    stiffness: Vec<f64>,
    /// How far the skin is above each tactel where the arm just touches the pad, mm.
    gaps_mm: Vec<f64>,
    gains: Vec<f64>,
    seed: u64,
}

impl Touch {
    /// `beside_mm`: by how much the arm lies beside the sensor's middle.
    pub(super) fn new(location: f64, beside_mm: f64, seed: u64) -> Self {
        let (mut stiffness, mut gaps_mm) = (Vec::with_capacity(TACTELS), Vec::with_capacity(TACTELS));
        for row in 0..TOUCH_ROWS {
            let beyond_mm = PITCH_MM * (row as f64 - 0.5 * (TOUCH_ROWS - 1) as f64);
            let location = location + beyond_mm / FOREARM_MM;
            let section = Section::at(location);
            let across: [f64; TOUCH_COLUMNS] =
                std::array::from_fn(|c| PITCH_MM * (c as f64 - 0.5 * (TOUCH_COLUMNS - 1) as f64) - beside_mm);
            for (stiff, v) in stiffness_of_row(&section, location, &across)
                .into_iter()
                .zip(across)
            {
                let share = v / section.wide_mm;
                let is_above = share.abs() < 1.0;
                stiffness.push(if is_above { stiff } else { 0.0 });
                gaps_mm.push(section.high_mm * (1.0 - (1.0 - share * share).max(0.0).sqrt()));
            }
        }
        let gain = |tactel: u64| 1.0 + GAIN * bell(bits(seed, GAIN_STREAM, tactel));
        Self {
            stiffness,
            gaps_mm,
            gains: (0..TACTELS as u64).map(gain).collect(),
            seed,
        }
    }

    /// Pressure on each tactel, kPa, by how hard the fingers press: 1 is a PWM of 400.
    ///
    /// `p = k max(d - gap, 0)`, with the depth `d` at which the pressures add up to the force.
    pub(super) fn pressures_kpa(&self, pressed: f64) -> Vec<f64> {
        let force_n = FORCE_N[0] + (FORCE_N[1] - FORCE_N[0]) * pressed;
        let wanted = 1000.0 * force_n / (PITCH_MM * PITCH_MM);
        let tactels = || self.stiffness.iter().zip(&self.gaps_mm);
        // The force grows with depth, faster and faster: from where all is touched, Newton's steps come down to the depth
        // and never pass it.
        let all: f64 = tactels().map(|(k, _)| k).sum();
        let mut depth_mm = self.gaps_mm.iter().fold(0.0, |a: f64, b| a.max(*b)) + wanted / all;
        for _ in 0..TACTELS {
            let (mut force, mut slope) = (-wanted, 0.0);
            for (k, gap_mm) in tactels().filter(|(_, gap_mm)| **gap_mm < depth_mm) {
                force += k * (depth_mm - gap_mm);
                slope += k;
            }
            let step = force / slope;
            depth_mm -= step;
            if step <= 1e-9 * depth_mm {
                break;
            }
        }
        tactels()
            .map(|(k, gap_mm)| k * (depth_mm - gap_mm).max(0.0))
            .collect()
    }

    /// A tactile image, counts from 0 to 255. `frame` gives it noise of its own.
    pub(super) fn counts(&self, pressures_kpa: &[f64], frame: u64) -> Vec<u16> {
        let count = |tactel: usize| {
            let noise = NOISE * bell(bits(self.seed ^ frame, NOISE_STREAM, tactel as u64));
            let felt = FULL_COUNTS * self.gains[tactel] * pressures_kpa[tactel] / FULL_KPA;
            (felt + noise).round().clamp(0.0, FULL_COUNTS) as u16
        };
        (0..TACTELS).map(count).collect()
    }
}

/// Pressure by depth in a row across the forearm, kPa/mm: pad and tissue one on the other, `1 / (h_p / E_p + t / E_t)`,
/// with tissue up to the first bone, or to the other side.
fn stiffness_of_row(section: &Section, location: f64, across: &[f64; TOUCH_COLUMNS]) -> [f64; TOUCH_COLUMNS] {
    let stiff = |tissue_mm: f64| 1.0 / (PAD_MM / PAD_KPA + tissue_mm / TISSUE_KPA);
    let soft = stiff(2.0 * section.high_mm);
    let radius = along(BONE_MM, location);
    let half_spacing = 0.5 * along(SPACING_MM, location);
    let mut row = [soft; TOUCH_COLUMNS];
    for (side, depths) in [-1.0, 1.0].into_iter().zip(DEPTHS_MM) {
        // Beyond the wrist a bone would come out of the skin.
        let depth = along(depths, location).max(1.0);
        let centre = side * half_spacing;
        let above_soft: [f64; TOUCH_COLUMNS] = std::array::from_fn(|c| {
            let beside = across[c] - centre;
            let top = radius * radius - beside * beside;
            if top <= 0.0 {
                return 0.0;
            }
            stiff(depth + radius - top.sqrt()) - soft
        });
        let spread = SPREAD * depth;
        let weight = |v: f64, u: f64| {
            let far = (v - u) / spread;
            (-0.5 * far * far).exp()
        };
        for (felt, v) in row.iter_mut().zip(across) {
            let weights: f64 = across.iter().map(|u| weight(*v, *u)).sum();
            let bone: f64 = across
                .iter()
                .zip(above_soft)
                .map(|(u, above)| above * weight(*v, *u))
                .sum();
            *felt += bone / weights;
        }
    }
    row
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pressures across the forearm in the sensor's middle row.
    fn across(location: f64) -> Vec<f64> {
        let pressures = Touch::new(location, 0.0, 1).pressures_kpa(1.0);
        pressures[14 * TOUCH_COLUMNS..][..TOUCH_COLUMNS].to_vec()
    }

    fn peaks(row: &[f64]) -> usize {
        let is_peak = |w: &&[f64]| w[1] > w[0] && w[1] >= w[2];
        row.windows(3).filter(is_peak).count()
    }

    #[test]
    fn both_bones_are_felt_at_the_wrist_and_one_hump_at_the_elbow() {
        assert_eq!((peaks(&across(0.0)), peaks(&across(1.0))), (2, 1));
    }

    #[test]
    fn pressures_add_up_to_the_force_that_presses() {
        for location in [-0.02, 0.0, 0.5, 1.02] {
            let touch = Touch::new(location, 1.5, 1);
            for (pressed, force_n) in [(0.0, 5.0), (0.5, 22.5), (1.0, 40.0), (2.0, 75.0)] {
                let pressures = touch.pressures_kpa(pressed);
                let sum = pressures.iter().sum::<f64>() * PITCH_MM * PITCH_MM / 1000.0;
                assert!((sum - force_n).abs() < 1e-6, "{location} {pressed}: {sum} N");
                assert!(pressures.iter().all(|p| *p >= 0.0));
            }
        }
    }

    #[test]
    fn an_image_is_noise_beside_the_arm_and_never_above_full_scale() {
        let touch = Touch::new(0.0, 0.0, 7);
        let image = touch.counts(&touch.pressures_kpa(10.0), 3);
        assert_eq!(image.len(), TACTELS);
        assert!(image.iter().all(|count| *count <= 255) && image.contains(&255));
        let edge = (0..TOUCH_ROWS).map(|row| image[row * TOUCH_COLUMNS]);
        assert!(edge.clone().all(|count| count <= 4), "no arm is above the edge");
        assert_ne!(image, touch.counts(&touch.pressures_kpa(10.0), 4));
        assert_eq!(
            image,
            Touch::new(0.0, 0.0, 7).counts(&touch.pressures_kpa(10.0), 3)
        );
    }
}
