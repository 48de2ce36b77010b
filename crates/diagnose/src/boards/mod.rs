//! What is wrong with the boards: those that are silent, or fall silent again and again.

mod sentences;
mod steadiness;

use crate::array;
use crate::malformed;
use crate::names::is_of_board;
use crate::problem::Problem;
use crate::traffic::{hub_speaks, speaks_on};
use crate::view::{BusView, Look};
use sentences::{
    foreign_bus, silent_board, silent_bus, unnamed_modules, unrecorded_board, unsteady_board, what_is_done,
};
use taxel_can::{BusState, LinkState, SourceAddress};
use taxel_skin::{BoardState, Layout};

pub(crate) use steadiness::Steadiness;

pub(crate) fn judge(look: &Look<'_>, steadiness: &mut Steadiness, found: &mut Vec<Problem>) {
    steadiness.handle(look, found);
    for (bus, view) in look.view.buses.iter().enumerate() {
        // A bus that is lost is told itself; that its boards are silent says nothing of them.
        if !is_lost(view) {
            let boards = BoardsOfBus::new(look, bus, found);
            boards.judge(steadiness, found);
        }
    }
}

/// Whether nothing can be heard on a bus.
fn is_lost(bus: &BusView) -> bool {
    bus.link != LinkState::Up || bus.counters.bus_state == BusState::BusOff
}

/// The boards of one bus that can be heard. Boards are told by their modules, of which one with a hub has several.
struct BoardsOfBus<'a> {
    look: &'a Look<'a>,
    /// Index of the bus in the layout.
    bus: usize,
    modules: Vec<usize>,
    /// Those of them whose frames come, and cannot be read.
    malformed: Vec<usize>,
    /// Whether frames of a pressure array come late.
    is_late: bool,
}

impl<'a> BoardsOfBus<'a> {
    /// `found` is what was found before, that frames are late or cannot be read among it.
    fn new(look: &'a Look<'a>, bus: usize, found: &[Problem]) -> Self {
        let wiring = look.setup.layout.wiring.iter().enumerate();
        let modules: Vec<usize> = wiring
            .filter(|(_, wiring)| wiring.protocol.has_board() && usize::from(wiring.bus) == bus)
            .map(|(module, _)| module)
            .collect();
        let malformed = modules.iter().copied();
        Self {
            look,
            bus,
            malformed: malformed
                .filter(|module| malformed::is_told(found, *module))
                .collect(),
            is_late: array::is_late(found, bus),
            modules,
        }
    }

    fn judge(&self, steadiness: &mut Steadiness, found: &mut Vec<Problem>) {
        let (layout, view) = (self.look.setup.layout, self.look.view);
        let of_all = self.of_all();
        let is_told = of_all.is_some();
        found.extend(of_all);
        let (mut silent, mut unsteady) = (Vec::new(), Vec::new());
        for module in self.modules.iter().copied() {
            if let Some(how) = steadiness.unsteady(module, view.now_ns) {
                unsteady.push((module, how));
            }
            if !is_told && self.is_quiet(module) && speaks_on(layout, view.findings, module).is_none() {
                silent.push((module, self.state(module)));
            }
        }
        for (modules, how) in by_board(layout, &unsteady, |_, _| true) {
            found.push(unsteady_board(layout, modules, how));
        }
        for (modules, state) in by_board(layout, &silent, |a, b| a == b) {
            found.push(self.silent(modules, state));
        }
    }

    fn state(&self, module: usize) -> BoardState {
        self.look.view.boards[module].state
    }

    /// Whether nothing has come of a board for so long that it is to be told.
    fn is_quiet(&self, module: usize) -> bool {
        match self.state(module) {
            _ if self.malformed.contains(&module) => false,
            BoardState::Silent => self.was_silent_long(module) && !self.is_late,
            BoardState::NeverSeen => self.look.view.boards_due,
            BoardState::Settling | BoardState::Streaming => false,
        }
    }

    /// Between the first sweeps of a board that has just come up its state says silent, too.
    fn was_silent_long(&self, module: usize) -> bool {
        let (setup, view) = (self.look.setup, self.look.view);
        let silence_ns = match setup.layout.wiring[module].array {
            Some(_) => array::SILENCE_NS.max(setup.silence_ns),
            None => setup.silence_ns,
        };
        let last_ns = view.boards[module].last_ns;
        last_ns.is_none_or(|last| view.now_ns.saturating_sub(last.max(self.look.awake_ns)) >= silence_ns)
    }

    /// Whether the hub of a module sends values of modules that the layout does not have.
    fn hub_speaks(&self, module: usize) -> bool {
        hub_speaks(self.look.setup.layout, self.look.view.findings, module)
    }

    /// Whether the hub of a module sends values of any module of the layout.
    fn hub_sends(&self, module: usize) -> bool {
        let of_hub = |m: &&usize| is_of_board(self.look.setup.layout, module, **m);
        let sends = |m: &usize| matches!(self.state(*m), BoardState::Settling | BoardState::Streaming);
        self.modules.iter().filter(of_hub).any(sends)
    }

    /// What is said of all of them together, where none of several speaks, or of one while others speak.
    fn of_all(&self) -> Option<Problem> {
        let setup = self.look.setup;
        let view = &self.look.view.buses[self.bus];
        let mut modules = self.modules.iter().copied();
        let is_foreign = view.unknown > 0 && modules.clone().all(|m| self.state(m) == BoardState::NeverSeen);
        let is_one = self.modules.len() == 1 && !is_foreign;
        if self.modules.is_empty()
            || is_one
            || !modules.clone().all(|m| self.is_quiet(m) && !self.hub_speaks(m))
        {
            return None;
        }
        if is_foreign {
            return Some(foreign_bus(self.look, self.bus));
        }
        let starting = modules
            .any(|m| setup.layout.is_started(m))
            .then_some(view.starting);
        let (name, source) = (&setup.layout.buses[self.bus], &setup.sources[self.bus]);
        Some(silent_bus(name, self.bus, source, starting))
    }

    /// What is said of one board that is silent, all of whose `modules` are in one state.
    fn silent(&self, modules: Vec<usize>, state: BoardState) -> Problem {
        let layout = self.look.setup.layout;
        let first = modules[0];
        match &self.look.setup.sources[self.bus] {
            source if layout.wiring[first].array.is_some() => array::silent(source, layout, first, state),
            _ if self.hub_speaks(first) => unnamed_modules(layout, modules, state),
            recording @ SourceAddress::Log { .. } => unrecorded_board(layout, modules, state, recording),
            _ => silent_board(layout, modules, state, self.done_about(first)),
        }
    }

    /// What is done about a board that is silent. A hub is told to start where nothing comes of it.
    fn done_about(&self, module: usize) -> &'static str {
        match self.look.setup.layout.is_started(module) {
            _ if self.hub_sends(module) => "Nothing is sent to a hub that sends values of others",
            true => what_is_done(self.look.view.buses[self.bus].starting),
            false => "Nothing is sent to it: such a board sends from power-up on",
        }
    }
}

/// The modules of one hub, of which the same is said, together: each list with what was noted of its first.
fn by_board<T: Copy>(
    layout: &Layout,
    modules: &[(usize, T)],
    same: impl Fn(&T, &T) -> bool,
) -> Vec<(Vec<usize>, T)> {
    let mut boards: Vec<(Vec<usize>, T)> = Vec::new();
    for (module, of) in modules {
        let board = (boards.iter_mut())
            .find(|(board, other)| is_of_board(layout, board[0], *module) && same(other, of));
        match board {
            Some((board, _)) => board.push(*module),
            None => boards.push((vec![*module], *of)),
        }
    }
    boards
}
