//! A CySkin hub with its modules (docs/protocols.md, "CySkin"), which speaks as Genoa's own library has it or as the
//! layout file says. It starts when it has heard every packet of the layout's `start`, in that order, with any period.

use super::one_axis_nature;
use crate::board::firmware::{Blueprint, BoardSimulation, Effect, Firmware, Moment};
use crate::board::queue::Queue;
use crate::levels::{Levels, Nature};
use crate::random::{bell, bits};
use crate::scene::SceneError;
use crate::skin_model::taxels_of;
use taxel_can::CanFrame;
use taxel_skin::{CyskinPacketError, CyskinSetup, HubIds, cyskin_frames};

const SENSOR_DATA: u8 = 0x43;
const AUTO_SYNC_PERIOD: u8 = 0x38;
/// Data bytes of a packet at most, unless a module has more: longer ones the library was not seen to take.
const PACKET_BYTES: usize = 40;
/// Random numbers of the temperatures.
const TEMPERATURE_STREAM: u64 = 0x7465;

pub(super) struct Cyskin;

impl BoardSimulation for Cyskin {
    fn usual_hz(&self) -> u32 {
        // docs/protocols.md, "CySkin packets": cycles of 50 ms.
        20
    }

    fn nature(&self, levels: Levels) -> Nature {
        one_axis_nature(levels)
    }

    fn firmware(&self, blueprint: &Blueprint<'_>) -> Result<Box<dyn Firmware>, SceneError> {
        let (layout, wiring) = (blueprint.layout, blueprint.wiring());
        let (Some(setup), Some(hub)) = (&layout.cyskin, wiring.hub) else {
            return Err(blueprint.refuse(blueprint.modules[0], "it has no board"));
        };
        let mut modules = Vec::new();
        for (index, &m) in blueprint.modules.iter().enumerate() {
            let mut taxels = [None; 12];
            for (i, k) in taxels_of(layout, m) {
                if k >= setup.sensors_per_module {
                    let problem = format!(
                        "it has sensor {k}, and hubs send {} values of a module",
                        setup.sensors_per_module
                    );
                    return Err(blueprint.refuse(m, &problem));
                }
                taxels[usize::from(k)] = Some(i as u16);
            }
            modules.push(HubModule {
                index,
                taxels,
                number: layout.wiring[m].board,
            });
        }
        let of_layout = &setup.hubs[usize::from(hub)];
        let hub = Hub::new(setup, of_layout.address, modules, blueprint.seed);
        match hub {
            Ok(hub) => Ok(Box::new(hub)),
            Err(e) => Err(SceneError::Layout {
                layout: layout.name.clone(),
                problem: format!("hub `{}`: {e}", of_layout.name),
            }),
        }
    }
}

#[derive(Debug)]
struct Hub {
    setup: CyskinSetup,
    address: u32,
    seed: u64,
    /// In the order of their numbers; the index is that of the module among the board's.
    modules: Vec<HubModule>,
    start: Dialogue,
    stop: Dialogue,
}

#[derive(Debug)]
struct HubModule {
    /// Place of the module among the modules of the board.
    index: usize,
    /// Taxel of each sensor.
    taxels: [Option<u16>; 12],
    /// Its number on the hub.
    number: u8,
}

/// Frames that have to be heard one after another.
#[derive(Debug)]
struct Dialogue {
    setup: CyskinSetup,
    frames: Vec<CanFrame>,
    heard: usize,
}

impl Dialogue {
    /// Whether this frame completes it.
    fn is_completed_by(&mut self, frame: &CanFrame) -> bool {
        let is = |own: &CanFrame| same_packet(&self.setup, own, frame);
        if self.frames.get(self.heard).is_some_and(is) {
            self.heard += 1;
        } else {
            self.heard = usize::from(self.frames.first().is_some_and(is));
        }
        let complete = !self.frames.is_empty() && self.heard == self.frames.len();
        if complete {
            self.heard = 0;
        }
        complete
    }
}

/// Whether it is the packet that is waited for, to whatever hub; a period may be any.
fn same_packet(setup: &CyskinSetup, own: &CanFrame, heard: &CanFrame) -> bool {
    let place = |frame: &CanFrame| frame.id() & !setup.ids.everybody();
    let same_data = own.data() == heard.data() || (period_ns(setup, own) > 0 && period_ns(setup, heard) > 0);
    same_data && own.data().len() == heard.data().len() && place(own) == place(heard)
}

/// The period that a whole packet sets: two bytes of milliseconds, the most significant first, or one; 0 if it
/// sets none.
fn period_ns(setup: &CyskinSetup, frame: &CanFrame) -> u64 {
    let Some((checksum, packet)) = frame.data().split_last() else {
        return 0;
    };
    let period_ms = match *packet {
        _ if setup.checksum.of(packet) != Some(*checksum) => 0,
        [AUTO_SYNC_PERIOD, 1, period_ms] => u64::from(period_ms),
        [AUTO_SYNC_PERIOD, 2, high, low] => u64::from(u16::from_be_bytes([high, low])),
        _ => 0,
    };
    period_ms * 1_000_000
}

impl Hub {
    /// Refuses a setup with which no packet can be made.
    fn new(
        setup: &CyskinSetup,
        address: u32,
        mut modules: Vec<HubModule>,
        seed: u64,
    ) -> Result<Self, CyskinPacketError> {
        cyskin_frames(setup, address, SENSOR_DATA, &[])?;
        let dialogue = |packets: &[taxel_skin::CyskinPacket]| -> Result<Dialogue, CyskinPacketError> {
            let mut frames = Vec::new();
            for packet in packets {
                frames.extend(cyskin_frames(setup, address, packet.command, &packet.data)?);
            }
            Ok(Dialogue {
                setup: setup.clone(),
                frames,
                heard: 0,
            })
        };
        modules.sort_by_key(|m| m.number);
        Ok(Self {
            start: dialogue(&setup.start)?,
            stop: dialogue(&setup.stop)?,
            setup: setup.clone(),
            address,
            seed,
            modules,
        })
    }

    /// The values of a module, all of them but those beyond `sensors_per_module`: sensor 0 is the
    /// temperature, and sensors that are cut off read 0.
    fn values(&self, module: &HubModule, moment: &Moment<'_>) -> impl Iterator<Item = [u8; 2]> {
        let sensors = usize::from(self.setup.sensors_per_module);
        module.taxels[..sensors]
            .iter()
            .enumerate()
            .map(|(sensor, taxel)| {
                let value = match taxel {
                    _ if moment.booting => 0,
                    Some(taxel) => moment.skin.one_axis(*taxel, moment.t_ns),
                    None if sensor == 0 => {
                        let stream = TEMPERATURE_STREAM << 16 | module.index as u64;
                        (12_000.0 + 4.0 * bell(bits(self.seed, stream, moment.t_ns))) as u16
                    }
                    None => 0,
                };
                match self.setup.byte_order {
                    taxel_skin::ByteOrder::Big => value.to_be_bytes(),
                    taxel_skin::ByteOrder::Little => value.to_le_bytes(),
                }
            })
    }

    fn send_packet(&self, data: &[u8], send: &mut dyn FnMut(CanFrame)) {
        if let Ok(frames) = cyskin_frames(&self.setup, self.address, SENSOR_DATA, data) {
            frames.into_iter().for_each(send);
        }
    }
}

impl Firmware for Hub {
    fn groups(&self) -> usize {
        1
    }

    fn read(&mut self, _group: usize, moment: &Moment<'_>, send: &mut dyn FnMut(CanFrame)) {
        let mut data: Vec<u8> = Vec::new();
        let most = PACKET_BYTES - 2 * usize::from(self.setup.sensors_per_module);
        let mut next = None;
        for module in &self.modules {
            let Some(number) = (moment.address)(module.index) else {
                continue;
            };
            if next != Some(number) || data.len() > most {
                if !data.is_empty() {
                    self.send_packet(&data, send);
                }
                data.clear();
                data.extend([number, 0]);
            }
            data.extend(self.values(module, moment).flatten());
            next = number.checked_add(1);
        }
        if !data.is_empty() {
            self.send_packet(&data, send);
        }
    }

    /// A sweep of 248 modules fits in.
    fn queue(&self) -> Queue {
        Queue::ring(1024)
    }

    fn handle_frame(&mut self, frame: &CanFrame) -> Effect {
        let ids = self.setup.ids;
        let to = frame.id() & ids.everybody();
        let is_packet = frame.is_extended() == (ids == HubIds::Extended);
        if !is_packet || (to != self.address && to != ids.everybody()) {
            return Effect::default();
        }
        let period_ns = Some(period_ns(&self.setup, frame)).filter(|period_ns| *period_ns > 0);
        Effect {
            starts: self.start.is_completed_by(frame),
            stops: self.stop.is_completed_by(frame),
            period_ns,
            busy_until_ns: 0,
        }
    }

    fn forget(&mut self) {
        (self.start.heard, self.stop.heard) = (0, 0);
    }

    fn starts_itself(&self) -> bool {
        self.start.frames.is_empty()
    }
}
