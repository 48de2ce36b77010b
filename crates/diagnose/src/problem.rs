//! One thing that is wrong.

use crate::kind::{Kind, Severity};
use taxel_skin::Layout;

/// Whose problem it is. A kind and a place tell two problems apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Place {
    /// The daemon itself.
    Daemon,
    /// A bus, by its index in the layout.
    Bus(usize),
    /// The board of a module, by its index in the layout.
    Module(usize),
    /// A CySkin hub, by its index in the layout.
    Hub(u8),
    /// The skin as a whole.
    Skin,
    /// The joints as a whole: the servos' port, an Allegro hand.
    Joints,
    /// A joint, by its index; of an Allegro hand, the first of a finger.
    Joint(usize),
    /// Something on a bus that is not of the hand: an identifier, an address, another bus.
    Stranger(usize, u32),
}

/// One thing that is wrong.
#[derive(Debug, Clone, PartialEq)]
pub struct Problem {
    /// What kind of problem.
    pub kind: Kind,
    /// Whose.
    pub place: Place,
    /// The modules (indices) whose board it is about; several for a hub, or for the skin.
    pub modules: Vec<usize>,
    /// What is wrong.
    pub found: String,
    /// What to do, and what goes on meanwhile; may be empty.
    pub advice: String,
    /// What is right again when it is over.
    pub over: String,
}

impl Problem {
    pub(crate) fn new(
        kind: Kind,
        place: Place,
        found: impl Into<String>,
        advice: impl Into<String>,
        over: impl Into<String>,
    ) -> Self {
        let modules = match place {
            Place::Module(module) => vec![module],
            _ => Vec::new(),
        };
        Self {
            kind,
            place,
            modules,
            found: found.into(),
            advice: advice.into(),
            over: over.into(),
        }
    }

    /// How much it matters.
    pub fn severity(&self) -> Severity {
        self.kind.severity()
    }

    /// What is wrong and what to do.
    pub fn sentence(&self) -> String {
        let Self { found, advice, .. } = self;
        match advice.chars().next() {
            None => found.clone(),
            Some(first) if first.is_uppercase() => format!("{found}. {advice}"),
            Some(_) => format!("{found}; {advice}"),
        }
    }

    /// Whether this and another are one problem, perhaps in other figures.
    pub fn is_same(&self, other: &Self) -> bool {
        (self.kind, self.place) == (other.kind, other.place)
    }

    /// Whether it is a problem of this bus, board or joint.
    pub fn is_of(&self, place: Place) -> bool {
        match (self.place, place) {
            (Place::Stranger(own, _), Place::Bus(bus)) => own == bus,
            (_, Place::Module(module)) => self.modules.contains(&module),
            (own, asked) => own == asked,
        }
    }

    /// The bus it is on (index), of several that of its first module; `None` for joints and the daemon itself.
    pub fn bus(&self, layout: &Layout) -> Option<usize> {
        match self.place {
            Place::Bus(bus) | Place::Stranger(bus, _) => Some(bus),
            _ => Some(usize::from(layout.wiring[*self.modules.first()?].bus)),
        }
    }
}

/// The place of the board of a module: a hub is one board.
pub(crate) fn place_of_board(layout: &Layout, module: usize) -> Place {
    (layout.wiring[module].hub).map_or(Place::Module(module), Place::Hub)
}

/// A problem of these modules of one board.
pub(crate) fn of_board(
    layout: &Layout,
    kind: Kind,
    modules: Vec<usize>,
    found: String,
    advice: String,
    over: String,
) -> Problem {
    let place = place_of_board(layout, modules[0]);
    Problem {
        modules,
        ..Problem::new(kind, place, found, advice, over)
    }
}
