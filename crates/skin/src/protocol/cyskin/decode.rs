//! One hub: its packets, and the values in them.

use super::packet::{Assembly, Rules, Step, modules_of_values};
use super::setup::{ByteOrder, CyskinSetup, HubIds, MODULES, SENSOR_DATA, SENSORS};
use crate::reading::{Readings, STATUS_ERROR, TaxelReading};

const NOBODY: u16 = u16::MAX;

/// A module in the layout.
#[derive(Debug, Clone)]
struct HubModule {
    board: u16,
    /// Taxel of each sensor.
    taxels: [u16; SENSORS as usize],
    temperature: Option<u16>,
}

/// A hub of the layout, on the bus of its decoder.
#[derive(Debug, Clone)]
pub(crate) struct Hub {
    pub(crate) address: u32,
    pub(crate) ids: HubIds,
    /// Module index of its first module, to which malformed packets are counted.
    pub(crate) first_board: u16,
    assembly: Assembly,
    rules: Rules,
    byte_order: ByteOrder,
    sensors_per_module: u8,
    /// Place in `modules` by number on the hub, or [`NOBODY`].
    numbers: [u16; MODULES as usize],
    modules: Vec<HubModule>,
}

/// What a frame of a hub was.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum HubFrameKind {
    /// The last frame of a packet with values of modules in the layout.
    Values,
    /// The last frame of a packet with values of modules that the layout does not have on this hub.
    OfNobody,
    /// A frame of a packet that is not complete yet.
    Partial,
    /// The last frame of a packet that carries something else.
    Other,
    Malformed,
}

impl Hub {
    pub(crate) fn new(setup: &CyskinSetup, address: u32) -> Self {
        Self {
            address,
            ids: setup.ids,
            first_board: NOBODY,
            assembly: Assembly::new(),
            rules: Rules {
                checksum: setup.checksum,
                sequence_bytes_above: setup.sequence_bytes_above,
                timeout_ns: setup.timeout_ms * 1_000_000,
            },
            byte_order: setup.byte_order,
            sensors_per_module: setup.sensors_per_module,
            numbers: [NOBODY; MODULES as usize],
            modules: Vec::new(),
        }
    }

    /// Makes sensor `k` of module `number` taxel `taxel` of the layout.
    pub(crate) fn add_taxel(&mut self, board: u16, number: u8, k: u8, taxel: u16) {
        let place = &mut self.numbers[usize::from(number)];
        if *place == NOBODY {
            *place = self.modules.len() as u16;
            self.modules.push(HubModule {
                board,
                taxels: [NOBODY; SENSORS as usize],
                temperature: None,
            });
        }
        self.modules[usize::from(*place)].taxels[usize::from(k)] = taxel;
        self.first_board = self.first_board.min(board);
    }

    /// Raw temperature of a module (index in the layout), sensor 0.
    pub(crate) fn temperature(&self, board: u16) -> Option<u16> {
        self.modules.iter().find(|m| m.board == board)?.temperature
    }

    /// Takes the data of a frame with this hub's address, at this place of its packet, and adds its
    /// values. Also returns whether a packet under way had to be given up.
    #[inline]
    pub(crate) fn handle_frame(
        &mut self,
        place: u32,
        data: &[u8],
        t_ns: u64,
        readings: &mut Readings,
    ) -> (HubFrameKind, bool) {
        let (step, lost) = self.assembly.handle_frame(place, data, t_ns, &self.rules);
        let heard = match step {
            Step::Partial => HubFrameKind::Partial,
            Step::Malformed => HubFrameKind::Malformed,
            Step::Complete(len) => self.packet(len, readings),
        };
        (heard, lost)
    }

    fn packet(&mut self, len: usize, readings: &mut Readings) -> HubFrameKind {
        let Self {
            assembly,
            byte_order,
            sensors_per_module,
            numbers,
            modules,
            ..
        } = self;
        let [command, _, data @ .., _] = assembly.bytes(len) else {
            return HubFrameKind::Malformed;
        };
        if *command != SENSOR_DATA {
            return HubFrameKind::Other;
        }
        let [module, sensor, values @ ..] = data else {
            return HubFrameKind::Malformed;
        };
        let span = modules_of_values([*module, *sensor], values.len() / 2, *sensors_per_module);
        let Some(span) = span.filter(|_| values.len() % 2 == 0) else {
            return HubFrameKind::Malformed;
        };
        if numbers[span].iter().all(|place| *place == NOBODY) {
            return HubFrameKind::OfNobody;
        }
        let (mut module, mut sensor) = (usize::from(*module), *sensor);
        for bytes in values.chunks_exact(2) {
            let bytes = [bytes[0], bytes[1]];
            let value = match byte_order {
                ByteOrder::Big => u16::from_be_bytes(bytes),
                ByteOrder::Little => u16::from_le_bytes(bytes),
            };
            if let Some(of_layout) = modules.get_mut(usize::from(numbers[module])) {
                let taxel = of_layout.taxels[usize::from(sensor)];
                if sensor == 0 {
                    of_layout.temperature = Some(value);
                }
                if taxel != NOBODY {
                    readings.push(TaxelReading {
                        taxel,
                        counts: [0, 0, value],
                        status: status(value),
                    });
                }
            }
            sensor += 1;
            if sensor == *sensors_per_module {
                (sensor, module) = (0, module + 1);
            }
        }
        HubFrameKind::Values
    }
}

/// 0 and 0xFFFF are no values (docs/protocols.md, "CySkin packets").
fn status(value: u16) -> u8 {
    if value == 0 || value == u16::MAX {
        STATUS_ERROR
    } else {
        0
    }
}
