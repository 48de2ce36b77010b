//! Which boards a bus of a layout has.

use super::ModuleOfBoard;
use super::cpm_finger::Finger;
use super::cyskin::{Hub, HubModule};
use super::firmware::Firmware;
use super::icub::Icub;
use super::uskin::Uskin;
use crate::clock::Span;
use crate::fault::BoardFault;
use crate::scene::{Scene, SceneError};
use crate::skin_model::taxels_of;
use taxel_hand::Module;
use taxel_skin::{CyskinSetup, Layout, Protocol};

/// What a board is made from.
pub(crate) struct Plan {
    pub(super) number: u64,
    pub(super) modules: Vec<ModuleOfBoard>,
    pub(super) firmware: Box<dyn Firmware>,
    pub(super) period_ns: u64,
}

/// The boards of one bus whose modules are there. `faults` gives those of a module, by index.
pub(crate) fn plans(
    scene: &Scene,
    layout: &Layout,
    seed: u64,
    bus: u8,
    present: &[bool],
    mut faults: impl FnMut(usize) -> Result<Vec<(Span, BoardFault)>, SceneError>,
) -> Result<Vec<Plan>, SceneError> {
    let mut plans = Vec::new();
    let mut hubs_done = Vec::new();
    for (m, (module, wiring)) in layout.modules.iter().zip(&layout.wiring).enumerate() {
        if wiring.bus != bus || !present[m] {
            continue;
        }
        let period_ns = 1_000_000_000 / u64::from(scene.boards.rate_of(wiring.protocol));
        let taxels: Vec<(u8, u16)> = taxels_of(layout, m).map(|(i, k)| (k, i as u16)).collect();
        let mut plan = Plan {
            number: m as u64,
            modules: vec![ModuleOfBoard {
                address: wiring.board,
                faults: faults(m)?,
            }],
            period_ns,
            firmware: match (wiring.protocol, wiring.icub, &layout.cyskin, wiring.hub) {
                (Protocol::UskinL1 | Protocol::UskinL2 | Protocol::UskinL3, ..) => {
                    Box::new(Uskin::new(wiring.protocol, &taxels, scene.boards.boot_replies))
                }
                (Protocol::IcubMtb3 | Protocol::IcubMtb4, Some(setup), ..) => {
                    Box::new(Icub::new(wiring.protocol, setup, &taxels, seed))
                }
                (Protocol::CpmFinger, ..) => Box::new(Finger::new(&taxels)),
                (Protocol::Cyskin, _, Some(setup), Some(hub)) => {
                    if !hubs_done.contains(&hub) {
                        hubs_done.push(hub);
                        plans.push(plan_of_hub(
                            layout,
                            seed,
                            present,
                            (setup, hub),
                            period_ns,
                            &mut faults,
                        )?);
                    }
                    continue;
                }
                _ => return Err(not_simulated(layout, module, "it has no board")),
            },
        };
        if let Some(setup) = wiring.icub {
            plan.period_ns = u64::from(setup.period_ms.max(1)) * 1_000_000;
        }
        plans.push(plan);
    }
    Ok(plans)
}

fn plan_of_hub(
    layout: &Layout,
    seed: u64,
    present: &[bool],
    (setup, hub): (&CyskinSetup, u8),
    period_ns: u64,
    faults: &mut impl FnMut(usize) -> Result<Vec<(Span, BoardFault)>, SceneError>,
) -> Result<Plan, SceneError> {
    let of_hub = |m: &usize| {
        let wiring = &layout.wiring[*m];
        wiring.protocol == Protocol::Cyskin && wiring.hub == Some(hub) && present[*m]
    };
    let numbers: Vec<usize> = (0..layout.modules.len()).filter(of_hub).collect();
    let mut on_hub = Vec::new();
    let mut modules = Vec::new();
    for (index, &m) in numbers.iter().enumerate() {
        let address = layout.wiring[m].board;
        let mut taxels = [None; 12];
        for (i, k) in taxels_of(layout, m) {
            if k >= setup.sensors_per_module {
                let problem = format!(
                    "it has sensor {k}, and hubs send {} values of a module",
                    setup.sensors_per_module
                );
                return Err(not_simulated(layout, &layout.modules[m], &problem));
            }
            taxels[usize::from(k)] = Some(i as u16);
        }
        on_hub.push(HubModule {
            index,
            taxels,
            number: address,
        });
        modules.push(ModuleOfBoard {
            address,
            faults: faults(m)?,
        });
    }
    let address = setup.hubs[usize::from(hub)].address;
    let number = numbers.first().map_or(0, |m| *m as u64);
    let firmware = Hub::new(setup, address, on_hub, seed).map_err(|e| SceneError::Layout {
        layout: layout.name.clone(),
        problem: format!("hub `{}`: {e}", setup.hubs[usize::from(hub)].name),
    })?;
    Ok(Plan {
        number,
        modules,
        firmware: Box::new(firmware),
        period_ns,
    })
}

fn not_simulated(layout: &Layout, module: &Module, why: &str) -> SceneError {
    SceneError::Layout {
        layout: layout.name.clone(),
        problem: format!("`{}`: {why}", module.name),
    }
}
