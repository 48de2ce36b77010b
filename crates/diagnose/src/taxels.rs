//! Modules of which a good part is out of use though their boards speak.

use crate::kind::Kind;
use crate::malformed;
use crate::names::board_name;
use crate::problem::{Place, Problem};
use crate::view::Look;
use taxel_hand::{Fault, Faults, Module};
use taxel_skin::BoardState;

/// A module is broken when more than one in so many of its taxels is.
const SHARE: usize = 4;
/// So long it is broken before that is told, and whole before that is over, nanoseconds: sweeps may lack taxels now and then.
const LASTS_NS: u64 = 1_000_000_000;
/// Why a taxel feels nothing. Noise and wraps pass, and the publication's rule finds some in every hand.
const FEELS_NOTHING: [Fault; 4] = [Fault::Dead, Fault::Stuck, Fault::Status, Fault::Missing];

/// Whether so many taxels are so great a part of a module that it is the module that is broken.
pub fn is_broken(taxels: usize, module: &Module) -> bool {
    SHARE * taxels > usize::from(module.taxels)
}

/// Whether so many taxels of a module feel nothing that this is a problem of its own, [`Kind::TaxelsOutOfUse`].
pub fn feels_little(faults: &[Faults], module: &Module) -> bool {
    let feels_nothing =
        |of: &&Faults| !of.contains(Fault::Masked) && FEELS_NOTHING.iter().any(|fault| of.contains(*fault));
    let taxels = faults.get(module.taxel_range()).unwrap_or_default();
    is_broken(taxels.iter().filter(feels_nothing).count(), module)
}

/// Which modules are broken for long enough to be told.
#[derive(Debug, Default)]
pub(crate) struct Broken(Vec<Lasting>);

/// A condition that counts once it has lasted, and until it has not for as long.
#[derive(Debug, Default, Clone, Copy)]
struct Lasting {
    is: bool,
    /// Since when it is otherwise.
    otherwise_ns: Option<u64>,
}

impl Lasting {
    fn update(&mut self, now: bool, now_ns: u64) -> bool {
        if now == self.is {
            self.otherwise_ns = None;
        } else if now_ns.saturating_sub(*self.otherwise_ns.get_or_insert(now_ns)) >= LASTS_NS {
            *self = Self {
                is: now,
                otherwise_ns: None,
            };
        }
        self.is
    }
}

impl Broken {
    pub(crate) fn judge(&mut self, look: &Look<'_>, found: &mut Vec<Problem>) {
        let (layout, view) = (look.setup.layout, look.view);
        self.0.resize(layout.modules.len(), Lasting::default());
        for (index, module) in layout.modules.iter().enumerate() {
            // Of any other board something else is told, and nobody knows what its taxels do.
            if view.boards[index].state != BoardState::Streaming || malformed::is_told(found, index) {
                self.0[index].otherwise_ns = None;
                continue;
            }
            let is_broken = feels_little(view.faults, module);
            if self.0[index].update(is_broken, view.now_ns) {
                let faults = view.faults.get(module.taxel_range()).unwrap_or_default();
                let of = |fault: &Fault| {
                    let taxels = faults.iter().filter(|of| of.contains(*fault)).count();
                    (taxels > 0).then(|| format!("{taxels} {}", fault.name()))
                };
                let reasons: Vec<String> = FEELS_NOTHING.iter().filter_map(of).collect();
                let name = board_name(layout, index);
                found.push(Problem::new(
                    Kind::TaxelsOutOfUse,
                    Place::Module(index),
                    format!("{name}: of its {} taxels {}", module.taxels, reasons.join(", ")),
                    "check the module, its cable and its supply; `taxel doctor` names the taxels. The others feel on",
                    format!("{name}: its taxels are in use again"),
                ));
            }
        }
    }
}
