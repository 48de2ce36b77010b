//! Boards for layouts that have none, so that a scene can be played on them.

use crate::scene::SceneError;
use taxel_skin::{ByteOrder, Checksum, CyskinHub, CyskinPacket, CyskinSetup, IcubSetup, Layout, Protocol};

/// Pads of a triangle that are taxels.
const TAXEL_PADS: [u8; 10] = [0, 1, 2, 3, 4, 5, 7, 8, 9, 11];
/// Taxels of an iCub board.
const ICUB_TAXELS: usize = 160;
/// Sensors of a CySkin module besides the temperature.
const CYSKIN_TAXELS: u16 = 11;
/// Modules of a hub.
const HUB_MODULES: usize = 248;
/// Boards of a bus.
const BUS_BOARDS: usize = 14;

/// The layout, with simulated boards under its arrays that have none (`protocol = "offline"`): modules of a CySkin hub,
/// where no array has more than 11 taxels, and iCub MTB4s otherwise. Places, names and taxel numbers stay; buses
/// `sim0`, `sim1` ... are added. A layout all of whose modules have boards comes back as it is.
///
/// What such boards are and how they speak is the simulation's own affair: no real hand is wired so.
/// [`SceneError::Layout`] where an array has more than 160 taxels.
pub fn with_stand_in_boards(layout: &Layout) -> Result<Layout, SceneError> {
    let offline = |m: &usize| layout.modules[*m].protocol == Protocol::Offline;
    let arrays: Vec<usize> = (0..layout.modules.len()).filter(offline).collect();
    if let Some(&m) = arrays
        .iter()
        .find(|m| usize::from(layout.modules[**m].taxels) > ICUB_TAXELS)
    {
        return Err(SceneError::Layout {
            layout: layout.name.clone(),
            problem: format!(
                "`{}` has no board, and {} taxels are more than the {ICUB_TAXELS} of a simulated one; name a layout with \
                 boards",
                layout.modules[m].name, layout.modules[m].taxels
            ),
        });
    }
    let mut wired = layout.clone();
    let as_cyskin = layout.cyskin.is_none()
        && arrays.len() <= HUB_MODULES
        && arrays.iter().all(|m| layout.modules[*m].taxels <= CYSKIN_TAXELS);
    for (place, &m) in arrays.iter().enumerate() {
        let on_bus = if as_cyskin { HUB_MODULES } else { BUS_BOARDS };
        let bus = layout.buses.len() + place / on_bus;
        if bus == wired.buses.len() {
            wired.buses.push(format!("sim{}", place / on_bus));
        }
        let module = &mut wired.modules[m];
        module.bus = bus as u8;
        if as_cyskin {
            module.protocol = Protocol::Cyskin;
            module.board = place as u8;
            module.hub = Some(0);
        } else {
            module.protocol = Protocol::IcubMtb4;
            module.board = (place % on_bus) as u8 + 1;
            module.icub = Some(IcubSetup::default());
        }
        let first = usize::from(module.first_taxel);
        let taxels = &mut wired.taxels[first..first + usize::from(module.taxels)];
        for (i, taxel) in (0..).zip(taxels) {
            taxel.k = if as_cyskin {
                i + 1
            } else {
                i / 10 * 12 + TAXEL_PADS[usize::from(i % 10)]
            };
        }
    }
    if as_cyskin && !arrays.is_empty() {
        wired.cyskin = Some(stand_in_hub(layout.buses.len() as u8));
    }
    Ok(wired)
}

fn stand_in_hub(bus: u8) -> CyskinSetup {
    let packet = |command, data: &[u8]| CyskinPacket {
        command,
        data: data.to_vec(),
        pause_ms: 10,
    };
    CyskinSetup {
        byte_order: ByteOrder::Big,
        checksum: Checksum::Sum,
        sequence_bytes_above: 5,
        sensors_per_module: 12,
        timeout_ms: 50,
        hubs: vec![CyskinHub {
            name: "simulated hub".into(),
            bus,
            address: 1,
        }],
        start: vec![packet(0x38, &[50]), packet(0x37, &[1])],
        stop: vec![packet(0x37, &[0])],
    }
}
