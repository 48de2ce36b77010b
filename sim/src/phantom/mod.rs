//! A phantom to palpate: a soft layer with beads in it, and a probe of seven taxels that touches its sixteen areas one
//! after another (Scimeca, Maiolino and Iida, "Motor-Induced Structuring of Tactile Sensory Information for Category
//! Formation in Robotics Palpation", section 3). What is made here is synthetic: it is no evidence about tissue.

mod layer;

use crate::random::{bell, bits};
use layer::{Bead, Face, PITCH_MM, Pose, Square, THICKNESS_MM};
use serde::{Deserialize, Deserializer};
use taxel_hand::WholeList;
use taxel_sequence::{Mark, Motion};

/// Taxels of the probe: one in the middle and six around it.
pub(crate) const TAXELS: usize = 7;
/// Areas lie on a grid of four by four, so far from each other.
const GRID: usize = 4;
const GRID_MM: f64 = 40.0;
/// How long the probe rests on each step; a sensor of 20 Hz makes two images of it.
const STEP_NS: u64 = 100_000_000;
/// Nothing touches the probe so long at first, for its calibration, then so long above each area.
const LEAD_NS: u64 = 4_000_000_000;
const ABOVE_NS: u64 = 1_000_000_000;
/// A rotary motion stays at its first angle so long before it begins.
const SETTLE_NS: u64 = 500_000_000;
/// Taxels around the middle one are so far from it. An assumption, as are all numbers below: no response of this sensor
/// is public.
const RING_MM: f64 = 2.0 * PITCH_MM;
/// Counts at a pressure `p` are `COUNTS * p / (p + HALF_KPA)`, up to a pressure of `FULL_KPA`.
const COUNTS: f64 = 12_000.0;
const HALF_KPA: f64 = 50.0;
const FULL_KPA: f64 = 100.0;
/// Standard deviations of where the robot puts the probe, beside and below, and of the gain of a taxel.
const PLACE_MM: f64 = 0.7;
const HEIGHT_MM: f64 = 0.2;
const GAIN: f64 = 0.015;
/// Random numbers of touches and of gains.
const TOUCH_STREAM: u64 = 0x7061_6C70;
const GAIN_STREAM: u64 = 0x7061_6C71;

/// What is in an area (section 3.1 of the publication), by how deep its top is and how large it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
pub(crate) enum Inclusion {
    /// Nothing.
    #[serde(rename = "NA")]
    None,
    /// 7 mm at 5 mm.
    #[serde(rename = "SS")]
    SmallShallow,
    /// 20 mm at 5 mm.
    #[serde(rename = "BS")]
    BigShallow,
    /// 7 mm at 15 mm.
    #[serde(rename = "SD")]
    SmallDeep,
    /// 20 mm at 15 mm.
    #[serde(rename = "BD")]
    BigDeep,
}

impl Inclusion {
    fn name(self) -> &'static str {
        match self {
            Inclusion::None => "NA",
            Inclusion::SmallShallow => "SS",
            Inclusion::BigShallow => "BS",
            Inclusion::SmallDeep => "SD",
            Inclusion::BigDeep => "BD",
        }
    }

    /// Diameter and depth of the top, mm.
    fn size_mm(self) -> Option<[f64; 2]> {
        match self {
            Inclusion::None => None,
            Inclusion::SmallShallow => Some([7.0, 5.0]),
            Inclusion::BigShallow => Some([20.0, 5.0]),
            Inclusion::SmallDeep => Some([7.0, 15.0]),
            Inclusion::BigDeep => Some([20.0, 15.0]),
        }
    }
}

impl<'de> WholeList<'de> for Inclusion {
    fn read<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Self::deserialize(deserializer)
    }
}

/// The keys of `[palpation]` in a scene file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PalpationToml {
    #[serde(deserialize_with = "WholeList::read")]
    areas: [[Inclusion; GRID]; GRID],
    depth_mm: f64,
    #[serde(default)]
    radius_mm: f64,
}

/// A phantom and how it is touched: every area once, row after row.
#[derive(Debug, Clone, PartialEq)]
pub struct Palpation {
    pub(crate) areas: [[Inclusion; GRID]; GRID],
    pub(crate) motion: Motion,
}

impl PalpationToml {
    pub(crate) fn check(self) -> Result<Palpation, String> {
        let motion = Motion::new(self.depth_mm, self.radius_mm).map_err(|e| e.to_string())?;
        Ok(Palpation {
            areas: self.areas,
            motion,
        })
    }
}

impl Palpation {
    /// The motion of every touch.
    pub fn motion(&self) -> Motion {
        self.motion
    }

    /// What is in each area: `NA`, `SS`, `BS`, `SD` or `BD` (section 3.1 of the publication).
    pub fn classes(&self) -> Vec<&'static str> {
        self.areas.iter().flatten().map(|area| area.name()).collect()
    }

    /// What the robot says, in the time of the scene: `touch AREA CLASS` where a touch begins, areas from 0, and `away`
    /// where it ends. Between them the probe is [`Palpation::step_ns`] on each step.
    pub fn marks(&self) -> Vec<Mark> {
        let mark = |t_ns, text| Mark { t_ns, text };
        let classes = self.classes().into_iter().enumerate();
        classes
            .flat_map(|(area, class)| {
                let (from_ns, to_ns) = self.touch_ns(area);
                [
                    mark(from_ns, format!("touch {area} {class}")),
                    mark(to_ns, "away".into()),
                ]
            })
            .collect()
    }

    /// How long the probe rests on each step, ns.
    pub fn step_ns(&self) -> u64 {
        STEP_NS
    }

    pub(crate) fn length_ns(&self) -> u64 {
        self.touch_ns(GRID * GRID - 1).1 + ABOVE_NS
    }

    /// From when to when an area is touched.
    fn touch_ns(&self, area: usize) -> (u64, u64) {
        let touch_ns = self.motion.steps() as u64 * STEP_NS;
        let settle_ns = if self.motion.is_rotary() { SETTLE_NS } else { 0 };
        let from_ns = LEAD_NS + (ABOVE_NS + settle_ns) * (area as u64 + 1) + touch_ns * area as u64;
        (from_ns, from_ns + touch_ns)
    }
}

/// What every taxel of the probe feels at every step of every touch.
#[derive(Debug)]
pub(crate) struct Touches {
    palpation: Palpation,
    /// Counts above idle: by area, then step.
    counts: Vec<Vec<[f64; TAXELS]>>,
}

impl Touches {
    /// `directions`: where each taxel is, from the middle of the probe, in any length; the one in the middle has none.
    pub(crate) fn new(palpation: &Palpation, directions: &[[f64; 2]; TAXELS], seed: u64) -> Self {
        let face = Face::new();
        let motion = palpation.motion;
        let places = directions.map(|[x, y]| {
            let length = x.hypot(y);
            if length > 0.0 {
                [x / length * RING_MM, y / length * RING_MM]
            } else {
                [0.0; 2]
            }
        });
        let under = places.map(|place| {
            let near = |patch: &[f64; 2]| (patch[0] - place[0]).hypot(patch[1] - place[1]) < 1.01 * PITCH_MM;
            (0..face.patches.len())
                .filter(|i| near(&face.patches[*i]))
                .collect::<Vec<_>>()
        });
        let press = Press::new(&face, motion);
        let gain = |taxel: usize| 1.0 + GAIN * bell(bits(seed, GAIN_STREAM, taxel as u64));
        let counts = |pressures: &[f64]| -> [f64; TAXELS] {
            std::array::from_fn(|taxel| {
                let patches = &under[taxel];
                let mean = patches.iter().map(|i| pressures[*i]).sum::<f64>() / patches.len() as f64;
                let felt = mean.min(FULL_KPA);
                gain(taxel) * COUNTS * felt / (felt + HALF_KPA)
            })
        };
        let stream = TOUCH_STREAM ^ motion.depth_mm.to_bits() ^ motion.radius_mm.to_bits().rotate_left(17);
        let touch = |area: usize| {
            let draw = |what: u64| bell(bits(seed, stream, (area as u64) << 8 | what));
            let [row, column] = [area / GRID, area % GRID].map(|n| n as f64 * GRID_MM);
            let pose = Pose {
                place_mm: [column + PLACE_MM * draw(0), row + PLACE_MM * draw(1)],
                depth_mm: HEIGHT_MM * draw(2),
                angle: 0.0,
            };
            let beads = beads_about(palpation, [column, row]);
            press
                .touch(pose, &beads)
                .iter()
                .map(|pressures| counts(pressures))
                .collect()
        };
        Self {
            palpation: palpation.clone(),
            counts: (0..GRID * GRID).map(touch).collect(),
        }
    }

    /// Counts above idle of a taxel at a time of the scene.
    pub(crate) fn at(&self, taxel: usize, scene_ns: u64) -> f64 {
        let settle_ns = if self.palpation.motion.is_rotary() {
            SETTLE_NS
        } else {
            0
        };
        let (first_ns, _) = self.palpation.touch_ns(0);
        let period_ns = self.palpation.touch_ns(1).0 - first_ns;
        let Some(since_ns) = (scene_ns + settle_ns).checked_sub(first_ns) else {
            return 0.0;
        };
        let Some(steps) = self.counts.get((since_ns / period_ns) as usize) else {
            return 0.0;
        };
        let step = (since_ns % period_ns).saturating_sub(settle_ns) / STEP_NS;
        steps.get(step as usize).map_or(0.0, |counts| counts[taxel])
    }
}

/// Beads in an area and in those beside it.
fn beads_about(palpation: &Palpation, [x, y]: [f64; 2]) -> Vec<Bead> {
    let areas = palpation.areas.iter().flatten().enumerate();
    let mut beads: Vec<Bead> = areas
        .filter_map(|(area, inclusion)| {
            let [diameter, top] = inclusion.size_mm()?;
            let [row, column] = [area / GRID, area % GRID].map(|n| n as f64 * GRID_MM);
            Some(Bead {
                radius_mm: diameter / 2.0,
                centre_mm: [column, row, top + diameter / 2.0],
            })
        })
        .collect();
    beads.retain(|bead| {
        (bead.centre_mm[0] - x).abs() < 1.5 * GRID_MM && (bead.centre_mm[1] - y).abs() < 1.5 * GRID_MM
    });
    beads
}

/// A motion of the probe, with the stiffness of the layer at every step down.
struct Press<'a> {
    face: &'a Face,
    motion: Motion,
    down: Motion,
    stiffness: Vec<Square>,
}

impl<'a> Press<'a> {
    fn new(face: &'a Face, motion: Motion) -> Self {
        let down = Motion {
            radius_mm: 0.0,
            ..motion
        };
        // In the middle of each step: what is left of the layer.
        let at = |n: usize| face.stiffness(THICKNESS_MM - down.at(n) + down.step() / 2.0);
        Self {
            face,
            motion,
            down,
            stiffness: (0..down.steps()).map(at).collect(),
        }
    }

    /// Pressures on all patches at every step, kPa. `pose` is where the probe is when it should be on the surface.
    fn touch(&self, pose: Pose, beads: &[Bead]) -> Vec<Vec<f64>> {
        let steps = self.descend(pose, beads);
        if !self.motion.is_rotary() {
            return steps
                .into_iter()
                .map(|(forces, _)| self.face.pressures_kpa(&forces))
                .collect();
        }
        // A turned probe is pressed at once, through the layer and past the beads as they are half way down.
        let half = steps.len() / 2;
        let (stiffness, beads) = (&self.stiffness[half], &steps[half].1);
        let turn = |n: usize| {
            let (angle, r) = (self.motion.at(n).to_radians(), self.motion.radius_mm);
            let turned = Pose {
                place_mm: [pose.place_mm[0] + r * angle.sin(), pose.place_mm[1]],
                depth_mm: pose.depth_mm + self.motion.depth_mm - r * (1.0 - angle.cos()),
                angle,
            };
            let forces = self
                .face
                .forces(stiffness, &self.face.indentation(&turned), &turned, beads);
            self.face.pressures_kpa(&forces)
        };
        (0..self.motion.steps()).map(turn).collect()
    }

    /// Straight down, step by step: forces, and where the beads are, their depth below the face.
    fn descend(&self, surface: Pose, beads: &[Bead]) -> Vec<(Vec<f64>, Vec<Bead>)> {
        let mut beads = beads.to_vec();
        let mut total = vec![0.0; self.face.patches.len()];
        let mut before = self.face.indentation(&surface);
        let mut down = |n: usize| {
            let pose = Pose {
                depth_mm: surface.depth_mm + self.down.at(n),
                ..surface
            };
            let now = self.face.indentation(&pose);
            let further: Vec<f64> = now
                .iter()
                .zip(&before)
                .map(|(now, before)| now - before)
                .collect();
            let forces = self.face.forces(&self.stiffness[n], &further, &pose, &beads);
            for bead in &mut beads {
                let [x, y, below] = bead.centre_mm;
                // A bead gives way before the face; it is never in it.
                let nearer = self.down.step() - self.face.pushed(&forces, &pose, [x, y], below);
                bead.centre_mm[2] = (below - nearer.max(0.0)).max(bead.radius_mm);
            }
            total
                .iter_mut()
                .zip(&forces)
                .for_each(|(total, force)| *total += force);
            before = now;
            (total.clone(), beads.clone())
        };
        (0..self.down.steps()).map(&mut down).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DIRECTIONS: [[f64; 2]; TAXELS] = [
        [0.0, 0.0],
        [1.0, 0.0],
        [0.5, 0.866],
        [-0.5, 0.866],
        [-1.0, 0.0],
        [-0.5, -0.866],
        [0.5, -0.866],
    ];

    fn palpation(depth_mm: f64, radius_mm: f64) -> Palpation {
        use Inclusion::{BigDeep, BigShallow, None, SmallDeep, SmallShallow};
        Palpation {
            areas: [
                [None, BigShallow, None, None],
                [None; 4],
                [SmallShallow, None, None, BigDeep],
                [None, SmallDeep, None, None],
            ],
            motion: Motion::new(depth_mm, radius_mm).unwrap(),
        }
    }

    #[test]
    fn deeper_is_more_and_full_scale_is_the_end() {
        let touches = Touches::new(&palpation(20.5, 0.0), &DIRECTIONS, 1);
        for steps in &touches.counts {
            assert_eq!(steps.len(), 41);
            for taxel in 0..TAXELS {
                let rising = steps.windows(2).all(|pair| pair[1][taxel] >= pair[0][taxel]);
                assert!(rising && steps[40][taxel] < 1.1 * COUNTS * FULL_KPA / (FULL_KPA + HALF_KPA));
            }
        }
        let middle = |area: usize| touches.counts[area][20][0];
        assert!(
            middle(1) > 1.02 * middle(5),
            "a big shallow one is felt: {} and {}",
            middle(1),
            middle(5)
        );
    }

    #[test]
    fn a_touch_is_felt_between_its_marks_and_a_turn_already_before() {
        for radius_mm in [0.0, 12.0] {
            let palpation = palpation(6.5, radius_mm);
            let touches = Touches::new(&palpation, &DIRECTIONS, 1);
            let marks = palpation.marks();
            assert_eq!(marks.len(), 32);
            for (area, pair) in marks.chunks_exact(2).enumerate() {
                let (from_ns, to_ns) = (pair[0].t_ns, pair[1].t_ns);
                let last = palpation.motion.steps() - 1;
                assert_eq!(touches.at(0, from_ns), touches.counts[area][0][0]);
                assert_eq!(touches.at(3, to_ns - 1), touches.counts[area][last][3]);
                assert_eq!(touches.at(0, to_ns), 0.0);
                assert_eq!(touches.at(0, from_ns - 1) > 0.0, radius_mm > 0.0);
            }
            assert_eq!(touches.at(0, palpation.length_ns()), 0.0);
        }
    }

    #[test]
    fn a_turned_probe_is_pressed_on_the_side_that_it_is_turned_to() {
        let touches = Touches::new(&palpation(8.5, 10.0), &DIRECTIONS, 1);
        let steps = &touches.counts[6];
        let (first, last) = (steps[0], steps[60]);
        assert!(first[1] > first[4] && last[4] > last[1], "{first:?} {last:?}");
    }
}
