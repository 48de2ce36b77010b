//! A soft layer on a hard ground, what is embedded in it, and a flat probe that is pressed into it; in closed form.
//!
//! Millimetres, newtons and megapascals; the layer is incompressible. Sources:
//!
//! - displacements and strains under a point load on a half-space: Boussinesq 1885 (Johnson, "Contact Mechanics", 1985,
//!   section 3.2), for a Poisson's ratio of 1/2;
//! - finite thickness: the settlement of the half-space between surface and ground (Steinbrenner 1934);
//! - patches under a rigid punch: Love 1929, each as a circle of its area;
//! - an inclusion: the stresslet of a sphere in a strained medium (Eshelby 1957, incompressible; for a rigid one
//!   Einstein's 5 mu V), brought back to the surface by reciprocity (Betti).

use std::f64::consts::PI;

/// Young's modulus of the layer: Ecoflex 00-10 has 55 kPa at 100 % strain (its maker's data sheet).
const YOUNG_MPA: f64 = 0.05;
/// Thickness of the layer (section 3.1 of the publication).
pub(super) const THICKNESS_MM: f64 = 40.0;
/// Young's modulus of a bead: printed PLA. A finite number, so that a bead is never stiffer than what it is made of.
const BEAD_YOUNG_MPA: f64 = 2000.0;
/// Stiffness of the pad on the probe, MPa/mm. An assumption.
const PAD_MPA_PER_MM: f64 = 0.03;
/// Patches are the points of a hexagonal lattice of this pitch within this radius: a probe of 6 mm. An assumption.
pub(super) const PITCH_MM: f64 = 1.75;
const RADIUS_MM: f64 = 6.1;
/// The probe's face is that of a ball of this radius. An assumption.
const CURVATURE_MM: f64 = 60.0;
/// What an inclusion adds to itself through the probe is at most this share: beyond, the series of reflections that the
/// stresslet begins has no sum.
const MOST_REFLECTED: f64 = 0.6;

/// `3 / (4 pi E)`: what all fields are multiples of.
const C: f64 = 3.0 / (4.0 * PI * YOUNG_MPA);

/// A bead in the layer.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bead {
    pub(super) radius_mm: f64,
    /// Its centre: x, y, and below the undeformed surface.
    pub(super) centre_mm: [f64; 3],
}

/// The probe's face as patches.
#[derive(Debug)]
pub(super) struct Face {
    pub(super) patches: Vec<[f64; 2]>,
    /// Area of each, mm^2.
    area: f64,
}

/// How the probe lies in the layer.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pose {
    /// Where the middle of its face is.
    pub(super) place_mm: [f64; 2],
    /// How deep that is.
    pub(super) depth_mm: f64,
    /// How far it is turned about y, rad.
    pub(super) angle: f64,
}

impl Face {
    pub(super) fn new() -> Self {
        let reach = (RADIUS_MM / PITCH_MM).ceil() as i32 * 2;
        let lattice =
            (-reach..=reach).flat_map(|b| (-reach..=reach).map(move |a| (f64::from(a), f64::from(b))));
        let place = |(a, b): (f64, f64)| [PITCH_MM * (a + b / 2.0), PITCH_MM * b * 0.75f64.sqrt()];
        let mut patches: Vec<[f64; 2]> = lattice.map(place).collect();
        patches.retain(|[x, y]| x * x + y * y <= RADIUS_MM * RADIUS_MM);
        Self {
            patches,
            area: PITCH_MM * PITCH_MM * 0.75f64.sqrt(),
        }
    }

    /// How far each patch is pressed in, mm.
    pub(super) fn indentation(&self, pose: &Pose) -> Vec<f64> {
        let pressed =
            |[x, y]: &[f64; 2]| pose.depth_mm + x * pose.angle.sin() - (x * x + y * y) / (2.0 * CURVATURE_MM);
        self.patches.iter().map(|patch| pressed(patch).max(0.0)).collect()
    }

    /// Pressures of forces, kPa; the probe does not pull.
    pub(super) fn pressures_kpa(&self, forces: &[f64]) -> Vec<f64> {
        forces
            .iter()
            .map(|force| 1000.0 * (force / self.area).max(0.0))
            .collect()
    }

    /// Force on each patch per displacement of each, N/mm, where the layer is so thick.
    pub(super) fn stiffness(&self, thickness_mm: f64) -> Square {
        let own_radius = (self.area / PI).sqrt();
        let pad = 1.0 / (PAD_MPA_PER_MM * self.area);
        let n = self.patches.len();
        let mut compliance = Square {
            n,
            values: vec![0.0; n * n],
        };
        for (i, a) in self.patches.iter().enumerate() {
            for (j, b) in self.patches.iter().enumerate() {
                let r = (a[0] - b[0]).hypot(a[1] - b[1]);
                let at_surface = if i == j { 2.0 * C / own_radius + pad } else { C / r };
                compliance.values[i * n + j] = at_surface - settlement(r, thickness_mm);
            }
        }
        compliance.inverse()
    }

    /// Forces on the patches, N, at an indentation, with beads where they are now: those near count with what they
    /// reflect, those further off without. `depth_mm` is where the face is.
    pub(super) fn forces(
        &self,
        stiffness: &Square,
        indentation: &[f64],
        pose: &Pose,
        beads: &[Bead],
    ) -> Vec<f64> {
        let mut forces = stiffness.times(indentation);
        let mut beyond = vec![0.0; forces.len()];
        let plain = forces.clone();
        for bead in beads {
            let strains: Vec<[f64; 6]> = self
                .patches
                .iter()
                .map(|patch| strain(pose, patch, bead))
                .collect();
            let moment = moment(bead.radius_mm);
            let mut felt = [0.0; 6];
            for (strain, force) in strains.iter().zip(&plain) {
                (0..6).for_each(|k| felt[k] += strain[k] * force);
            }
            let off = (bead.centre_mm[0] - pose.place_mm[0]).hypot(bead.centre_mm[1] - pose.place_mm[1]);
            if off > 2.0 * RADIUS_MM {
                let dot = |strain: &[f64; 6]| (0..6).map(|k| strain[k] * felt[k]).sum::<f64>();
                beyond
                    .iter_mut()
                    .zip(&strains)
                    .for_each(|(sum, strain)| *sum += moment * dot(strain));
                continue;
            }
            // K' = K + K e (1 / M - e' K e / 2)^-1 e' K.
            let carried = stiffness.times_rows(&strains);
            let mut system = Square {
                n: 6,
                values: vec![0.0; 36],
            };
            for (strain, carried) in strains.iter().zip(&carried) {
                for (row, strain) in system.values.chunks_exact_mut(6).zip(strain) {
                    row.iter_mut()
                        .zip(carried)
                        .for_each(|(sum, carried)| *sum -= strain * carried / 2.0);
                }
            }
            let reflected = -(0..6).map(|k| system.values[k * 7]).sum::<f64>() * moment;
            let held = (MOST_REFLECTED / reflected.max(MOST_REFLECTED)) * moment;
            system.values.iter_mut().for_each(|x| *x *= held);
            (0..6).for_each(|k| system.values[k * 7] += 1.0);
            let answer = system.inverse().times(&felt);
            for (force, carried) in forces.iter_mut().zip(&carried) {
                *force += moment * (0..6).map(|k| carried[k] * answer[k]).sum::<f64>();
            }
        }
        forces
            .iter_mut()
            .zip(stiffness.times(&beyond))
            .for_each(|(force, more)| *force += more);
        forces
    }

    /// How far forces on the patches push a point down that is `below_mm` below the face, mm.
    pub(super) fn pushed(&self, forces: &[f64], pose: &Pose, [x, y]: [f64; 2], below_mm: f64) -> f64 {
        let each = self.patches.iter().zip(forces);
        each.map(|(patch, force)| {
            let r = (x - pose.place_mm[0] - patch[0]).hypot(y - pose.place_mm[1] - patch[1]);
            force * settlement(r, below_mm)
        })
        .sum()
    }
}

/// How far a newton pushes a point down that is `r` beside and `z` below it, mm.
fn settlement(r: f64, z: f64) -> f64 {
    let distance = r.hypot(z);
    C * (1.0 / distance + z * z / distance.powi(3))
}

/// Strain at a bead's centre per newton on a patch: `C z (R^2 delta_ij - 3 x_i x_j) / R^5`, which has no trace, as the
/// six numbers xx, yy, zz, and sqrt(2) times xy, yz, zx.
fn strain(pose: &Pose, patch: &[f64; 2], bead: &Bead) -> [f64; 6] {
    let [x, y] = [0, 1].map(|i| bead.centre_mm[i] - pose.place_mm[i] - patch[i]);
    let z = bead.centre_mm[2];
    let squared = x * x + y * y + z * z;
    let factor = C * z / (squared * squared * squared.sqrt());
    let root = 2.0f64.sqrt();
    [
        factor * (squared - 3.0 * x * x),
        factor * (squared - 3.0 * y * y),
        factor * (squared - 3.0 * z * z),
        -3.0 * factor * root * x * y,
        -3.0 * factor * root * y * z,
        -3.0 * factor * root * z * x,
    ]
}

/// Stresslet of a bead per strain, N mm: `5 mu V k`, `k = (mu_i - mu) / (mu_i + 1.5 mu)`.
fn moment(radius_mm: f64) -> f64 {
    let (layer, bead) = (YOUNG_MPA / 3.0, BEAD_YOUNG_MPA / 3.0);
    let volume = 4.0 / 3.0 * PI * radius_mm.powi(3);
    5.0 * layer * volume * (bead - layer) / (bead + 1.5 * layer)
}

/// A square matrix, row after row.
#[derive(Debug, Clone)]
pub(super) struct Square {
    n: usize,
    values: Vec<f64>,
}

impl Square {
    fn times(&self, vector: &[f64]) -> Vec<f64> {
        let dot = |row: &[f64]| row.iter().zip(vector).map(|(a, b)| a * b).sum();
        self.values.chunks_exact(self.n).map(dot).collect()
    }

    fn times_rows(&self, rows: &[[f64; 6]]) -> Vec<[f64; 6]> {
        let row = |row: &[f64]| {
            let mut sums = [0.0; 6];
            for (a, b) in row.iter().zip(rows) {
                (0..6).for_each(|k| sums[k] += a * b[k]);
            }
            sums
        };
        self.values.chunks_exact(self.n).map(row).collect()
    }

    /// By Gauss and Jordan, without pivots: for positive definite matrices.
    fn inverse(mut self) -> Self {
        let n = self.n;
        for k in 0..n {
            let pivot = 1.0 / self.values[k * n + k];
            self.values[k * n + k] = 1.0;
            self.values[k * n..][..n].iter_mut().for_each(|x| *x *= pivot);
            let row = self.values[k * n..][..n].to_vec();
            for i in (0..n).filter(|i| *i != k) {
                let factor = std::mem::replace(&mut self.values[i * n + k], 0.0);
                self.values[i * n..][..n]
                    .iter_mut()
                    .zip(&row)
                    .for_each(|(x, r)| *x -= factor * r);
            }
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn force(thickness_mm: f64, beads: &[Bead]) -> f64 {
        let face = Face::new();
        let pose = Pose {
            place_mm: [0.0; 2],
            depth_mm: 1.0,
            angle: 0.0,
        };
        let flat = vec![1.0; face.patches.len()];
        face.forces(&face.stiffness(thickness_mm), &flat, &pose, beads)
            .iter()
            .sum()
    }

    #[test]
    fn a_thick_layer_is_a_half_space_under_a_punch() {
        // 8/3 E a for a punch (Sneddon 1965, incompressible) of the area of the patches, in series with its pad.
        let face = Face::new();
        let area = face.area * face.patches.len() as f64;
        let punch = 8.0 / 3.0 * YOUNG_MPA * (area / PI).sqrt();
        let expected = 1.0 / (1.0 / punch + 1.0 / (PAD_MPA_PER_MM * area));
        let found = force(1e6, &[]);
        assert!(
            (found / expected - 1.0).abs() < 0.05,
            "{found} N/mm, not {expected}"
        );
        assert!(force(THICKNESS_MM, &[]) > 1.1 * found);
    }

    #[test]
    fn an_inclusion_is_felt_the_more_the_larger_and_the_nearer_it_is() {
        let plain = force(THICKNESS_MM, &[]);
        let stiffer = |radius_mm: f64, depth_mm: f64, aside: f64| {
            let centre_mm = [aside, 0.0, depth_mm + radius_mm];
            force(THICKNESS_MM, &[Bead { radius_mm, centre_mm }]) / plain
        };
        let [small_deep, small, deep, big] =
            [(3.5, 15.0), (3.5, 5.0), (10.0, 15.0), (10.0, 5.0)].map(|(r, z)| stiffer(r, z, 0.0));
        assert!(
            1.001 < small_deep && small_deep < small && small < deep && deep < big && big < 2.5,
            "{small_deep} {small} {deep} {big}"
        );
        let neighbour = stiffer(10.0, 5.0, 40.0);
        assert!(1.0 < neighbour && neighbour < 1.05, "{neighbour}");
    }

    #[test]
    fn an_inverse_times_its_matrix_changes_nothing() {
        let matrix = Square {
            n: 3,
            values: vec![4.0, 1.0, 0.5, 1.0, 3.0, 0.2, 0.5, 0.2, 2.0],
        };
        let there = matrix.times(&[1.0, -2.0, 3.0]);
        let back = matrix.inverse().times(&there);
        assert!(
            back.iter()
                .zip([1.0, -2.0, 3.0])
                .all(|(a, b)| (a - b).abs() < 1e-12),
            "{back:?}"
        );
    }
}
