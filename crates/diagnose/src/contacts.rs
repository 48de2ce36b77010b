//! Contacts that may be none: of a hand that moved, or was loud, while its baseline was measured, or that go on without a change.

use crate::kind::Kind;
use crate::names::some_of;
use crate::problem::{Place, Problem};
use crate::view::Look;
use taxel_skin::Movement;

/// What moved while the baseline was measured, and what follows from it.
fn moved(movement: Movement) -> Option<String> {
    Some(match movement {
        Movement::None => return None,
        Movement::Taxels(1) => "a taxel moved, or was touched, while its baseline was measured: it may show contacts that are none, \
                                or miss some"
            .into(),
        Movement::Taxels(count) => format!(
            "{count} taxels moved, or were touched, while their baseline was measured: they may show contacts that are none, or \
             miss some"
        ),
        Movement::Noise => "most taxels were out of use as noisy when the time in which the baseline was measured ended: the \
                            contact threshold is of that noise, and lighter touches are missed"
            .into(),
        Movement::InOneHalf => "the hand moved, or was touched, while its baseline was measured: it rests as in the quieter half of \
                                that time, and may show contacts that are none, or miss some"
            .into(),
        Movement::InBothHalves => "the hand moved, or was touched, in both halves of the time in which its baseline was measured: \
                                   the contact threshold is of that movement, and lighter touches are missed"
            .into(),
    })
}

pub(crate) fn judge(look: &Look<'_>, found: &mut Vec<Problem>) {
    if let Some(moved) = moved(look.view.moved) {
        found.push(Problem::new(
            Kind::BaselineMoved,
            Place::Skin,
            moved,
            "`taxel rezero` when nothing touches the hand and it is still",
            "the baseline was measured of a hand that is still",
        ));
    }
    let layout = look.setup.layout;
    let unchanging = |module: usize| {
        let taxels = layout.modules[module].taxel_range();
        look.view.unchanging[taxels].iter().filter(|u| **u).count()
    };
    let modules: Vec<usize> = (0..layout.modules.len()).filter(|m| unchanging(*m) > 0).collect();
    if modules.is_empty() {
        return;
    }
    let list = some_of(&modules, |module| {
        let (name, taxels) = (&layout.modules[module].name, layout.modules[module].taxels);
        format!("{name}: {} of {taxels}", unchanging(module))
    });
    found.push(Problem {
        modules,
        ..Problem::new(
            Kind::ContactUnchanging,
            Place::Skin,
            format!("taxels in contact without a change for two minutes ({list})"),
            "Something rests on them, or their baseline has drifted: `taxel rezero` when nothing touches the hand",
            "no contact lasts without a change any more",
        )
    });
}
