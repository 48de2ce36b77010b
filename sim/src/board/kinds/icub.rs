//! The iCub's skin on MTB3 and MTB4 (docs/protocols.md, "iCub frames", "MTB commands" and "MTB4"): nothing is
//! sent before the board was configured.
//!
//! Where the sources are silent the simulated board is strict, so that a host that is good enough for it is
//! good enough: every triangle is off after power-up, and a start that comes while triangles are being
//! calibrated is lost.

use crate::board::firmware::{self, Blueprint, BoardSimulation, Effect, Firmware, Identity, Moment};
use crate::board::queue::Queue;
use crate::levels::{Axis, Levels, Nature};
use crate::random::{bell, bits};
use crate::scene::SceneError;
use crate::skin_model::{PadReading, SkinModel};
use taxel_can::CanFrame;
use taxel_skin::{ICUB_NO_ACK, ICUB_NOT_CONNECTED, IcubSetup, Wiring, icub_triangle_data};

const PADS: usize = 12;
const TRIANGLES: usize = 16;
/// How long a calibration takes: within the 500 ms that icub-main waits.
const CALIBRATION_NS: u64 = 400_000_000;
/// An MTB4 calibrates a triangle anew after this many no-acknowledge errors in a row.
const RECALIBRATES_AFTER: u8 = 5;
const SET_BRD_CFG: u8 = 0x4D;
const SET_TRIANG_CFG: u8 = 0x50;
/// Random numbers of thermal pads.
const THERMAL_STREAM: u64 = 0x7468;
/// What a thermal pad reads, and how far a minute's warmth and cold move it.
const THERMAL: [f64; 2] = [150.0, 3.0];

/// Steps of eight bits that a newton moves a pad by. No source says; it makes a firm press (6 N)
/// reach the end of the range.
const STEPS_PER_NEWTON: f64 = 40.0;
/// A pad after calibration, away from its no-load value, steps.
const PAD: Axis = Axis {
    idle: [-0.3, 0.3],
    sd: [0.1, 0.25],
};
/// Counts that the decoder makes of a step.
const COUNTS_PER_STEP: f64 = 16.0;

/// iCub boards.
pub(super) struct IcubBoards {
    mtb4: bool,
}

pub(super) const MTB3: IcubBoards = IcubBoards { mtb4: false };
pub(super) const MTB4: IcubBoards = IcubBoards { mtb4: true };

impl BoardSimulation for IcubBoards {
    fn period_ns(&self, wiring: &Wiring) -> Option<u64> {
        let setup = wiring.icub?;
        Some(u64::from(setup.period_ms.max(1)) * 1_000_000)
    }

    fn nature(&self, levels: Levels) -> Nature {
        Nature::of_one_axis(levels, PAD, STEPS_PER_NEWTON, COUNTS_PER_STEP)
    }

    fn firmware(&self, blueprint: &Blueprint<'_>) -> Result<Box<dyn Firmware>, SceneError> {
        let setup = blueprint.wiring().icub.unwrap_or_default();
        let (taxels, seed) = (blueprint.taxels(), blueprint.seed);
        Ok(Box::new(Icub::new(self.mtb4, setup, &taxels, seed)))
    }
}

#[derive(Debug)]
struct Icub {
    mtb4: bool,
    /// How the layout says it is configured; only for [`Firmware::set_up`].
    setup: IcubSetup,
    seed: u64,
    /// Taxels of the pads; `None` where a pad is none of the layout's.
    triangles: [[Option<u16>; PADS]; TRIANGLES],
    /// Triangles that are wired, a bit each.
    wired: u16,
    enabled: u16,
    noload: u8,
    skin_type: u8,
    /// What was on each pad when its triangle was calibrated, steps.
    zero: [[f64; PADS]; TRIANGLES],
    no_ack_run: [u8; TRIANGLES],
}

impl Icub {
    fn new(mtb4: bool, setup: IcubSetup, taxels: &[(u8, u16)], seed: u64) -> Self {
        let mut triangles = [[None; PADS]; TRIANGLES];
        let mut wired = 0;
        for &(k, taxel) in taxels {
            let (triangle, pad) = (usize::from(k) / PADS, usize::from(k) % PADS);
            triangles[triangle][pad] = Some(taxel);
            wired |= 1 << triangle;
        }
        let mut board = Self {
            mtb4,
            setup,
            seed,
            triangles,
            wired,
            enabled: 0,
            noload: 0,
            skin_type: 0,
            zero: [[0.0; PADS]; TRIANGLES],
            no_ack_run: [0; TRIANGLES],
        };
        board.forget();
        board
    }

    /// The triangles of a group: an MTB3 has four sensor lines, which are read at once; an MTB4 acquires all
    /// triangles before it sends any.
    fn group(&self, group: usize) -> impl Iterator<Item = usize> + use<> {
        let (enabled, mtb4) = (self.enabled, self.mtb4);
        (0..TRIANGLES).filter(move |t| enabled >> t & 1 == 1 && (mtb4 || t & 3 == group))
    }

    fn calibrate(&mut self, triangle: usize, t_ns: u64, skin: &SkinModel) {
        for (zero, taxel) in self.zero[triangle].iter_mut().zip(self.triangles[triangle]) {
            *zero = taxel.map_or(0.0, |taxel| skin.pad_load(taxel, t_ns));
        }
    }

    fn is_thermal(&self, pad: usize) -> bool {
        let setup = IcubSetup {
            skin_type: self.skin_type,
            ..self.setup
        };
        setup.may_be_thermal(pad as u8)
    }

    fn temperature(&self, place: usize, t_ns: u64) -> u8 {
        let [level, swing] = THERMAL;
        let minute = (t_ns % 60_000_000_000) as f64 / 60e9;
        let triangle = 4.0 * (minute - 0.5).abs() - 1.0;
        let noise = 0.3 * bell(bits(self.seed, THERMAL_STREAM << 16 | place as u64, t_ns));
        (level + swing * triangle + noise + 0.5) as u8
    }

    /// The two frames' data of a triangle.
    fn acquire(&mut self, triangle: usize, moment: &Moment<'_>) -> [[u8; 8]; 2] {
        if self.wired >> triangle & 1 == 0 {
            return icub_triangle_data([0xFF; PADS], 0, ICUB_NOT_CONNECTED);
        }
        let (mut pads, mut out_of_range, mut errors) = ([0; PADS], 0u16, 0);
        for (pad, value) in pads.iter_mut().enumerate() {
            let Some(taxel) = self.triangles[triangle][pad] else {
                *value = if self.is_thermal(pad) {
                    self.temperature(triangle * PADS + pad, moment.t_ns)
                } else {
                    self.noload
                };
                continue;
            };
            match moment.skin.pad(taxel, moment.t_ns) {
                PadReading::NotConnected => return icub_triangle_data([0xFF; PADS], 0, ICUB_NOT_CONNECTED),
                PadReading::Dead(counts) => {
                    *value = counts.min(255) as u8;
                    out_of_range |= 1 << pad;
                }
                PadReading::Load {
                    steps,
                    no_ack,
                    flipped,
                } => {
                    let steps = f64::from(self.noload) - (steps - self.zero[triangle][pad]) + 0.5;
                    let rounded = steps.floor();
                    if !(0.0..=255.0).contains(&rounded) {
                        out_of_range |= 1 << pad;
                    }
                    *value = rounded.clamp(0.0, 255.0) as u8 ^ flipped;
                    if no_ack {
                        errors = ICUB_NO_ACK;
                    }
                }
            }
        }
        let run = &mut self.no_ack_run[triangle];
        *run = if errors & ICUB_NO_ACK != 0 {
            run.saturating_add(1)
        } else {
            0
        };
        let data = icub_triangle_data(pads, out_of_range, errors);
        if self.mtb4 && *run == RECALIBRATES_AFTER {
            self.calibrate(triangle, moment.t_ns, moment.skin);
        }
        data
    }
}

impl Firmware for Icub {
    fn groups(&self) -> usize {
        match (self.enabled, self.mtb4) {
            (0, _) => 0,
            (_, true) => 1,
            (_, false) => 4,
        }
    }

    fn read(&mut self, group: usize, moment: &Moment<'_>, send: &mut dyn FnMut(CanFrame)) {
        let Some(address) = (moment.address)(0) else {
            return;
        };
        for triangle in self.group(group) {
            let id = 0x400 | u16::from(address & 15) << 4 | triangle as u16;
            for data in self.acquire(triangle, moment) {
                if let Ok(frame) = CanFrame::standard(id, &data) {
                    send(frame);
                }
            }
        }
    }

    /// `CAN1_send` waits for the controller, so that a board goes no faster than the bus.
    fn needs_room(&self) -> Option<usize> {
        (!self.mtb4).then_some(8)
    }

    fn identity(&self) -> Option<Identity> {
        Some(if self.mtb4 { firmware::MTB4 } else { firmware::MTB3 })
    }

    fn queue(&self) -> Queue {
        if self.mtb4 {
            Queue::ring(64)
        } else {
            Queue::stack()
        }
    }

    fn configure(&mut self, data: &[u8], t_ns: u64, skin: &SkinModel) -> Effect {
        match *data {
            // The timer's 16 bits hold 209 ms.
            [SET_BRD_CFG, skin_type, period_ms, noload] => {
                self.skin_type = skin_type & 15;
                self.noload = noload;
                self.enabled = 0;
                Effect {
                    period_ns: Some(u64::from(period_ms.clamp(1, 209)) * 1_000_000),
                    ..Effect::default()
                }
            }
            [SET_TRIANG_CFG, first, last, _shift, flags, _low, _high] => {
                let named = (0..TRIANGLES as u8).filter(|t| (first..=last).contains(t));
                let named = named.fold(0u16, |set, t| set | 1 << t);
                let on = flags & 1 == 1;
                self.enabled = if on {
                    self.enabled | named
                } else {
                    self.enabled & !named
                };
                let busy_until_ns = if self.enabled == 0 {
                    0
                } else {
                    t_ns + CALIBRATION_NS
                };
                let enabled = self.enabled;
                for triangle in (0..TRIANGLES).filter(|t| enabled >> t & 1 == 1) {
                    self.calibrate(triangle, busy_until_ns, skin);
                }
                Effect {
                    stops: true,
                    busy_until_ns,
                    ..Effect::default()
                }
            }
            _ => Effect::default(),
        }
    }

    fn forget(&mut self) {
        let usual = IcubSetup::default();
        (self.noload, self.skin_type) = (usual.noload, usual.skin_type);
        self.enabled = 0;
        self.zero = [[0.0; PADS]; TRIANGLES];
        self.no_ack_run = [0; TRIANGLES];
    }

    fn set_up(&mut self) {
        (self.noload, self.skin_type) = (self.setup.noload, self.setup.skin_type);
        self.enabled = self.wired;
    }
}
