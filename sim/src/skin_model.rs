//! The skin itself: what every taxel reads at every instant, as a function of scene, seed and time alone.

use crate::clock::{SceneClock, Span};
use crate::contact::{Contact, Seat};
use crate::fault::{FaultKind, TaxelFault};
use crate::levels::{Character, Nature, noise};
use crate::phantom::{TAXELS, Touches};
use crate::random::{bits, happens};
use crate::scene::{Scene, SceneError};
use taxel_hand::Module;
use taxel_skin::Layout;

/// Status byte of an MLX90393 that streams without trouble (docs/protocols.md, "MLX90393 status").
const STATUS_STREAMING: u8 = 0x83;
/// Its error bit.
const STATUS_ERROR: u8 = 0x10;
/// Random numbers of glitches, one stream per taxel.
const GLITCH_STREAM: u64 = 0x676C;

/// Every taxel of a hand in a scene. It has no state: a taxel can be read at any time, in any order.
#[derive(Debug)]
pub(crate) struct SkinModel {
    seed: u64,
    noise: f64,
    clock: SceneClock,
    contacts: Vec<Contact>,
    taxels: Vec<TaxelModel>,
    touches: Option<Touches>,
}

#[derive(Debug)]
struct TaxelModel {
    character: Character,
    seats: Vec<Seat>,
    faults: Vec<(Span, TaxelFault)>,
    present: bool,
}

/// A taxel at one instant, before its board makes bits of it.
enum Sample {
    /// Its chip is not there.
    NotConnected,
    /// All it says is this.
    Dead(u16),
    Alive {
        /// x, y, z in the counts of its board, neither rounded nor limited.
        values: [f64; 3],
        /// Its chip reports an error.
        error: bool,
        /// Bits of x, y, z that turn over on the way.
        flipped: [u16; 3],
    },
}

/// A pad of the iCub's at one instant.
#[derive(Debug, Clone, Copy)]
pub(crate) enum PadReading {
    NotConnected,
    Dead(u16),
    Load {
        /// How far it is pressed, steps of eight bits, neither rounded nor limited.
        steps: f64,
        /// Its chip does not acknowledge.
        no_ack: bool,
        /// Bits that turn over on the way.
        flipped: u8,
    },
}

impl SkinModel {
    /// `natures`: of the taxels of each module.
    pub(crate) fn new(
        scene: &Scene,
        layout: &Layout,
        seed: u64,
        clock: SceneClock,
        natures: &[Nature],
    ) -> Result<Self, SceneError> {
        let present = present_modules(scene, layout)?;
        let mut taxels: Vec<TaxelModel> = layout
            .taxels
            .iter()
            .enumerate()
            .map(|(i, t)| TaxelModel {
                character: natures[usize::from(t.module)].taxel(seed, i as u16),
                seats: Vec::new(),
                faults: Vec::new(),
                present: present[t.module as usize],
            })
            .collect();
        for (number, contact) in scene.contacts.iter().enumerate() {
            for name in &contact.on {
                let modules = modules_named(scene, layout, contact.line, name)?;
                seat(layout, number, &modules, &mut taxels);
            }
        }
        for fault in &scene.faults {
            let FaultKind::Taxel(kind) = fault.kind else {
                continue;
            };
            for name in &fault.on {
                for m in modules_named(scene, layout, fault.line, name)? {
                    for (i, _) in taxels_of(layout, m)
                        .filter(|(_, k)| fault.taxels.as_ref().is_none_or(|l| l.contains(k)))
                    {
                        taxels[i].faults.push((fault.span, kind));
                    }
                }
            }
            if let Some(k) = fault.taxels.iter().flatten().find(|k| {
                !fault.on.iter().any(|name| {
                    modules_named(scene, layout, fault.line, name).is_ok_and(|l| {
                        l.iter()
                            .any(|m| taxels_of(layout, *m).any(|(_, there)| there == **k))
                    })
                })
            }) {
                return Err(SceneError::Invalid {
                    file: scene.file.clone(),
                    line: fault.line,
                    problem: format!("{} has no taxel {k}", fault.on.join(", ")),
                });
            }
        }
        Ok(Self {
            seed,
            noise: scene.boards.noise,
            clock,
            contacts: scene.contacts.clone(),
            taxels,
            touches: touches(scene, layout, seed)?,
        })
    }

    pub(crate) fn clock(&self) -> SceneClock {
        self.clock
    }

    /// Counts and status byte of a uSkin taxel read at this running time. An overloaded axis wraps
    /// modulo 2^16, it does not saturate (docs/protocols.md, "uSkin values").
    pub(crate) fn reading(&self, taxel: u16, t_ns: u64) -> ([u16; 3], u8) {
        match self.sample(taxel, t_ns) {
            Sample::NotConnected => ([0xFFFF; 3], 0xFF),
            Sample::Dead(value) => ([value; 3], 0xFF),
            Sample::Alive {
                values,
                error,
                flipped,
            } => {
                let mut counts = values.map(|v| ((v + 0.5).floor() as i64 & 0xFFFF) as u16);
                for (count, flipped) in counts.iter_mut().zip(flipped) {
                    *count ^= flipped;
                }
                (counts, STATUS_STREAMING | if error { STATUS_ERROR } else { 0 })
            }
        }
    }

    /// A pad of the iCub's, in steps of eight bits.
    pub(crate) fn pad(&self, taxel: u16, t_ns: u64) -> PadReading {
        match self.sample(taxel, t_ns) {
            Sample::NotConnected => PadReading::NotConnected,
            Sample::Dead(value) => PadReading::Dead(value),
            Sample::Alive {
                values: [_, _, z],
                error,
                flipped,
            } => PadReading::Load {
                steps: z,
                no_ack: error,
                flipped: flipped.into_iter().fold(0, |all, f| all | (f | f >> 8) as u8),
            },
        }
    }

    /// What is on a pad for its calibration, steps.
    pub(crate) fn pad_load(&self, taxel: u16, t_ns: u64) -> f64 {
        match self.sample(taxel, t_ns) {
            Sample::Alive { values, .. } => values[2],
            Sample::Dead(_) | Sample::NotConnected => 0.0,
        }
    }

    /// The value of a sensor of one axis and 16 bits, as CySkin's are. 0 and 65535 are no values (docs/protocols.md,
    /// "CySkin packets"): it saturates before them.
    pub(crate) fn one_axis(&self, taxel: u16, t_ns: u64) -> u16 {
        match self.sample(taxel, t_ns) {
            Sample::NotConnected => 0xFFFF,
            Sample::Dead(value) => value,
            Sample::Alive {
                values: [_, _, z],
                error,
                flipped,
            } => match error {
                // There is no status byte: an invalid value is what says so.
                true => 0,
                false => {
                    let all = flipped.into_iter().fold(0, |all, f| all | f);
                    (z + 0.5).clamp(1.0, 65_534.0) as u16 ^ all
                }
            },
        }
    }

    /// A taxel at this running time, before its board makes bits of it.
    fn sample(&self, taxel: u16, t_ns: u64) -> Sample {
        let model = &self.taxels[taxel as usize];
        let scene_ns = self.clock.scene_ns(t_ns);
        let active = || model.faults.iter().filter(|(span, _)| span.contains(scene_ns));
        let mut error = false;
        let mut noise_factor = self.noise;
        let mut read_ns = t_ns;
        let mut z_offset = 0.0;
        for (span, fault) in active() {
            let since = scene_ns - span.from_ns;
            match fault {
                TaxelFault::Dead { value } => return Sample::Dead(*value),
                TaxelFault::NotConnected => return Sample::NotConnected,
                TaxelFault::Stuck => read_ns = t_ns - since,
                TaxelFault::Noisy { factor } => noise_factor *= factor,
                TaxelFault::Wrapping { amplitude, period_ns } => {
                    let phase = (since % period_ns) as f64 / *period_ns as f64;
                    let triangle = if phase < 0.5 {
                        2.0 * phase
                    } else {
                        2.0 - 2.0 * phase
                    };
                    z_offset += amplitude * triangle;
                }
                TaxelFault::Drift { counts_per_s } => z_offset += counts_per_s * (since as f64 / 1e9),
                TaxelFault::Status => error = true,
                TaxelFault::Glitch { .. } => {}
            }
        }
        let moved = self.displacement(taxel, self.clock.scene_ns(read_ns));
        let values = std::array::from_fn(|axis| {
            let c = &model.character;
            let offset = if axis == 2 && read_ns == t_ns {
                z_offset * c.scale[2]
            } else {
                0.0
            };
            let noise = noise_factor * c.sd[axis] * noise(self.seed, taxel, axis, read_ns);
            c.idle[axis] + moved[axis] + offset + noise
        });
        let mut flipped = [0; 3];
        for (number, (span, fault)) in model.faults.iter().enumerate() {
            if let TaxelFault::Glitch { probability } = fault
                && span.contains(scene_ns)
            {
                let stream = GLITCH_STREAM << 32 | (number as u64) << 16 | u64::from(taxel);
                if happens(bits(self.seed, stream, t_ns), *probability) {
                    let draw = bits(self.seed, stream | 1 << 63, t_ns);
                    let bits = 1 + (draw % 255) as u16;
                    flipped[(draw >> 32) as usize % 3] ^= if draw >> 62 & 1 == 1 { bits << 8 } else { bits };
                }
            }
        }
        Sample::Alive {
            values,
            error,
            flipped,
        }
    }

    /// How far a taxel is moved from idle, decoded counts, without noise, wraps, ends of range or
    /// faults; zero where nothing touches it.
    pub(crate) fn truth_of(&self, taxel: u16, t_ns: u64) -> f64 {
        match self.taxels.get(usize::from(taxel)) {
            Some(model) if model.present => {
                let [x, y, z] = self.displacement(taxel, self.clock.scene_ns(t_ns));
                (x * x + y * y + z * z).sqrt() * model.character.decoded
            }
            _ => 0.0,
        }
    }

    /// The same for every taxel; returns how many are touched.
    pub(crate) fn truth(&self, t_ns: u64, force: &mut [f64]) -> usize {
        let mut contacts = 0;
        for (taxel, force) in (0..self.taxels.len() as u16).zip(force) {
            *force = self.truth_of(taxel, t_ns);
            contacts += usize::from(*force > 0.0);
        }
        contacts
    }

    fn displacement(&self, taxel: u16, scene_ns: u64) -> [f64; 3] {
        let model = &self.taxels[usize::from(taxel)];
        // What a phantom does to its probe is in the counts of that.
        let touched = self
            .touches
            .as_ref()
            .map_or(0.0, |touches| touches.at(taxel.into(), scene_ns));
        let mut sum = [0.0, 0.0, touched];
        for seat in &model.seats {
            let moved = self.contacts[seat.contact as usize].on_taxel(seat, scene_ns);
            for ((sum, moved), scale) in sum.iter_mut().zip(moved).zip(model.character.scale) {
                *sum += model.character.gain * scale * moved;
            }
        }
        sum
    }
}

/// What the probe feels, where the scene is a phantom: the layout is then one of seven taxels whose places are known,
/// the first in the middle.
fn touches(scene: &Scene, layout: &Layout, seed: u64) -> Result<Option<Touches>, SceneError> {
    let Some(palpation) = &scene.palpation else {
        return Ok(None);
    };
    let refuse = |found: String| SceneError::Layout {
        layout: layout.name.clone(),
        problem: format!(
            "a phantom is touched with a probe of {TAXELS} taxels whose places in mm are known, and it has {found}; take \
             cyskin-triangle"
        ),
    };
    let places = layout.taxels.iter().map(|taxel| taxel.position_mm);
    let places = places
        .collect::<Option<Vec<_>>>()
        .ok_or_else(|| refuse("taxels without a place".into()))?;
    let Ok(places) = <[_; TAXELS]>::try_from(places) else {
        return Err(refuse(format!("{} taxels", layout.taxels.len())));
    };
    let middle = places[0];
    let directions = places.map(|place| [0, 1].map(|axis| f64::from(place[axis] - middle[axis])));
    Ok(Some(Touches::new(palpation, &directions, seed)))
}

/// Which modules of the layout the scene has, by index.
pub(crate) fn present_modules(scene: &Scene, layout: &Layout) -> Result<Vec<bool>, SceneError> {
    let Some((line, names)) = &scene.modules else {
        return Ok(vec![true; layout.modules.len()]);
    };
    let mut present = vec![false; layout.modules.len()];
    for name in names {
        for m in modules_named(scene, layout, *line, name)? {
            present[m] = true;
        }
    }
    Ok(present)
}

/// The modules that a name in a scene means: one module, those of a part of the hand, or `all`.
pub(crate) fn modules_named(
    scene: &Scene,
    layout: &Layout,
    line: u32,
    name: &str,
) -> Result<Vec<usize>, SceneError> {
    let those = |wanted: &dyn Fn(&Module) -> bool| -> Vec<usize> {
        (0..layout.modules.len())
            .filter(|m| wanted(&layout.modules[*m]))
            .collect()
    };
    if name == "all" {
        return Ok(those(&|_| true));
    }
    for found in [those(&|m| m.name == name), those(&|m| m.part == name)] {
        if !found.is_empty() {
            return Ok(found);
        }
    }
    let mut known: Vec<String> = Vec::new();
    for name in layout.modules.iter().flat_map(|m| [&m.part, &m.name]) {
        if !known.contains(name) {
            known.push(name.clone());
        }
    }
    Err(SceneError::UnknownPlace {
        file: scene.file.clone(),
        line,
        place: name.into(),
        layout: layout.name.clone(),
        known,
    })
}

/// Numbers of a module's taxels in the layout, with the board's own numbers, which are a byte on CAN.
pub(crate) fn taxels_of(layout: &Layout, module: usize) -> impl Iterator<Item = (usize, u8)> {
    layout.modules[module]
        .taxel_range()
        .map(|i| (i, layout.k[i] as u8))
}

/// Places a contact on modules that form one surface.
fn seat(layout: &Layout, number: usize, modules: &[usize], models: &mut [TaxelModel]) {
    let members = || modules.iter().flat_map(|m| taxels_of(layout, *m)).map(|(i, _)| i);
    let range = |axis: fn(&taxel_hand::Taxel) -> u16| {
        let of = || members().map(|i| axis(&layout.taxels[i]));
        (of().min().unwrap_or(0), of().max().unwrap_or(0))
    };
    let ((left, right), (top, bottom)) = (range(|t| t.x), range(|t| t.y));
    let extent = [f64::from(right - left), f64::from(bottom - top)];
    for i in members() {
        let taxel = &layout.taxels[i];
        let place = [f64::from(taxel.x - left), f64::from(taxel.y - top)];
        models[i].seats.push(Seat {
            contact: number as u16,
            place,
            extent,
        });
    }
}
