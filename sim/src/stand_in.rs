//! Boards for layouts that have none, so that a scene can be played on them.

use crate::scene::SceneError;
use std::fmt::Write;
use taxel_skin::{CyskinHub, CyskinSetup, IcubSetup, Layout, Protocol, Wiring};

/// Pads of a triangle that are taxels.
const TAXEL_PADS: [u8; 10] = [0, 1, 2, 3, 4, 5, 7, 8, 9, 11];
/// Taxels of an iCub board.
const ICUB_TAXELS: usize = 160;
/// Of simulated hubs, ms: the layout's default.
const PERIOD_MS: u16 = 50;
/// Sensors of a CySkin module besides the temperature.
const CYSKIN_TAXELS: u16 = 11;
/// Modules of a hub.
const HUB_MODULES: usize = 248;
/// Boards of a bus.
const BUS_BOARDS: usize = 14;

/// The layout, with simulated boards under its arrays that have none (`protocol = "offline"`):
/// modules of a CySkin hub, where no array has more than 11 taxels, and iCub MTB4s otherwise.
/// Places, names and taxel numbers stay; buses `sim0`, `sim1` ... are added. A layout all of whose
/// modules have boards comes back as it is.
///
/// What such boards are and how they speak is the simulation's own affair: no real hand is wired so.
/// [`SceneError::Layout`] where an array has more than 160 taxels.
pub fn with_stand_in_boards(layout: &Layout) -> Result<Layout, SceneError> {
    let offline = |m: &usize| !layout.wiring[*m].protocol.has_board();
    let arrays: Vec<usize> = (0..layout.modules.len()).filter(offline).collect();
    if let Some(&m) = arrays
        .iter()
        .find(|m| usize::from(layout.modules[**m].taxels) > ICUB_TAXELS)
    {
        return Err(SceneError::Layout {
            layout: layout.name.clone(),
            problem: format!(
                "`{}` has no board, and {} taxels are more than the {ICUB_TAXELS} of a simulated one; name a layout with \
                 boards, or make it a pressure array: `protocol = \"pressure-array\"`, rows and columns \
                 (docs/hardware.md)",
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
        wired.wiring[m] = Wiring {
            bus: bus as u8,
            board: if as_cyskin {
                place as u8
            } else {
                (place % on_bus) as u8 + 1
            },
            protocol: if as_cyskin {
                Protocol::CYSKIN
            } else {
                Protocol::ICUB_MTB4
            },
            icub: (!as_cyskin).then(IcubSetup::default),
            hub: as_cyskin.then_some(0),
            array: None,
        };
        let taxels = &mut wired.k[layout.modules[m].taxel_range()];
        for (i, k) in (0..).zip(taxels) {
            *k = if as_cyskin {
                i + 1
            } else {
                i / 10 * 12 + u16::from(TAXEL_PADS[usize::from(i % 10)])
            };
        }
    }
    if as_cyskin && !arrays.is_empty() {
        wired.cyskin = Some(stand_in_hub(layout.buses.len() as u8));
    }
    Ok(wired)
}

/// The layout file of [`with_stand_in_boards`], for a daemon at the other end of a bus:
/// [`Layout::parse`] makes the same layout of it, so that what is simulated and what is read fit.
/// For layouts without a board of their own.
pub fn stand_in_layout_file(layout: &Layout) -> Result<String, SceneError> {
    let wired = with_stand_in_boards(layout)?;
    let name = &wired.name;
    let mut text = format!(
        "# {name} with the simulated boards of taxel sim; no real hand is wired so.\nname = {name:?}\n\
         image = {{ width = {}, height = {} }}\nbuses = {:?}\n",
        wired.width, wired.height, wired.buses
    );
    if let Some(setup) = &wired.cyskin {
        for hub in &setup.hubs {
            let bus = &wired.buses[usize::from(hub.bus)];
            let _ = write!(
                text,
                "\n[[cyskin.hub]]\nname = {:?}\nbus = {bus:?}\naddress = {}\n",
                hub.name, hub.address
            );
        }
    }
    for (_, module, wiring) in wired.boards() {
        let taxels = &wired.taxels[module.taxel_range()];
        let range = |axis: fn(&taxel_hand::Taxel) -> u16| {
            let least = taxels.iter().map(axis).min().unwrap_or(0);
            (
                least,
                usize::from(taxels.iter().map(axis).max().unwrap_or(0) - least) + 1,
            )
        };
        let ((x0, width), (y0, height)) = (range(|t| t.x), range(|t| t.y));
        let mut order = vec![vec![-1; width]; height];
        for (taxel, k) in taxels.iter().zip(wired.k_of(module)) {
            order[usize::from(taxel.y - y0)][usize::from(taxel.x - x0)] = *k as i16;
        }
        let _ = write!(
            text,
            "\n[[module]]\nname = {:?}\npart = {:?}\nbus = {:?}\nboard = {}\nprotocol = {:?}\nat = [{x0}, {y0}]\norder = {order:?}\n",
            module.name,
            module.part,
            wired.buses[usize::from(wiring.bus)],
            wiring.board,
            wiring.protocol.name()
        );
        if let (Some(hub), Some(setup)) = (wiring.hub, &wired.cyskin) {
            let _ = writeln!(text, "hub = {:?}", setup.hubs[usize::from(hub)].name);
        }
        let places: Option<Vec<[f32; 3]>> = taxels.iter().map(|t| t.position_mm).collect();
        if let Some(places) = places {
            let _ = writeln!(text, "positions_mm = {places:?}");
        }
    }
    Ok(text)
}

fn stand_in_hub(bus: u8) -> CyskinSetup {
    let hub = CyskinHub {
        name: "simulated hub".into(),
        bus,
        address: 1,
    };
    CyskinSetup::of_library(PERIOD_MS, vec![hub])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_file_of_a_stand_in_is_the_stand_in() {
        for name in ["schunk-sdh", "cyskin-triangle", "grid:9x12"] {
            let layout = Layout::resolve(name).unwrap();
            let text = stand_in_layout_file(&layout).unwrap();
            let parsed = Layout::parse(&text, "x.toml").unwrap_or_else(|e| panic!("{e}\n{text}"));
            assert_eq!(parsed, with_stand_in_boards(&layout).unwrap(), "{text}");
        }
    }

    #[test]
    fn a_hand_with_boards_stays_as_it_is_and_a_great_array_is_refused() {
        let hand = Layout::builtin("icub-forearm").unwrap();
        assert_eq!(with_stand_in_boards(&hand).unwrap(), hand);
        let error = with_stand_in_boards(&Layout::grid(40, 40).unwrap()).unwrap_err();
        assert!(
            error.to_string().contains("1600 taxels are more than the 160")
                && error.to_string().contains("pressure-array"),
            "{error}"
        );
    }
}
