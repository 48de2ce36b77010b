//! Boards as people find them.

use taxel_skin::Layout;

/// Modules that are named; further ones are counted.
const NAMED: usize = 3;

/// A board (module index) as people find it: `index tip (can0 board 3)`, `palm (can0 hub left, board 3)`.
pub fn board_name(layout: &Layout, module: usize) -> String {
    let (name, wiring) = (&layout.modules[module].name, &layout.wiring[module]);
    let hub = hub_of(layout, module).map_or_else(String::new, |hub| format!("hub {hub}, "));
    let bus = &layout.buses[usize::from(wiring.bus)];
    let place = format!("{bus} {hub}board {}", wiring.board);
    match *name == place {
        true => place,
        false => format!("{name} ({place})"),
    }
}

/// What is plugged into a bus with a module: its hub, or its board.
pub(crate) fn plug_name(layout: &Layout, module: usize) -> String {
    match hub_of(layout, module) {
        Some(hub) => format!(
            "hub {hub} ({})",
            layout.buses[usize::from(layout.wiring[module].bus)]
        ),
        None => board_name(layout, module),
    }
}

/// Modules of one board: `index tip (can0 board 3)`; `hub left (can0) with all its modules (palm,
/// heel, wrist and 4 more)`; `a part of hub left (can0), 2 of its 7 modules (palm, heel),`.
pub(crate) fn modules_name(layout: &Layout, modules: &[usize]) -> String {
    let hub = layout.wiring[modules[0]].hub;
    if hub.is_none() || modules.len() == 1 {
        return board_name(layout, modules[0]);
    }
    let list = some_of(modules, |module| layout.modules[module].name.clone());
    let hub_name = plug_name(layout, modules[0]);
    let (some, all) = (
        modules.len(),
        layout.wiring.iter().filter(|m| m.hub == hub).count(),
    );
    if some == all {
        format!("{hub_name} with all its modules ({list})")
    } else {
        format!("a part of {hub_name}, {some} of its {all} modules ({list}),")
    }
}

/// The first of several modules in words, and how many more there are.
pub(crate) fn some_of(modules: &[usize], words: impl Fn(usize) -> String) -> String {
    let named: Vec<String> = modules.iter().take(NAMED).map(|m| words(*m)).collect();
    match modules.len().saturating_sub(NAMED) {
        0 => named.join(", "),
        more => format!("{} and {more} more", named.join(", ")),
    }
}

fn hub_of(layout: &Layout, module: usize) -> Option<&str> {
    let hub = layout.wiring[module].hub?;
    Some(&layout.cyskin.as_ref()?.hubs.get(usize::from(hub))?.name)
}

/// Whether two modules are on one board: on one hub, or the same.
pub(crate) fn is_of_board(layout: &Layout, module: usize, other: usize) -> bool {
    let hub = |module: usize| layout.wiring[module].hub;
    module == other || (hub(module).is_some() && hub(module) == hub(other))
}
