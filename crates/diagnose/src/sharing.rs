//! A bus that another program reads as well: another taxeld of this machine, or whoever tells its boards what to do.

use crate::kind::Kind;
use crate::problem::{Place, Problem};
use crate::view::{Look, Starting};
use taxel_can::SourceAddress;
use taxel_hand::plural;

/// Who starts boards that then send by themselves is heard once. It is over when nothing more was heard for this long,
/// nanoseconds.
const QUIET_NS: u64 = 600_000_000_000;

/// What was heard of other programs, by bus.
#[derive(Debug, Default)]
pub(crate) struct Sharing {
    heard: Vec<Heard>,
}

#[derive(Debug, Default, Clone, Copy)]
struct Heard {
    /// Commands so far.
    commands: u64,
    /// When the last of them came, nanoseconds.
    at_ns: Option<u64>,
}

impl Sharing {
    pub(crate) fn judge(&mut self, look: &Look<'_>, found: &mut Vec<Problem>) {
        self.heard.resize(look.view.buses.len(), Heard::default());
        for (index, heard) in self.heard.iter_mut().enumerate() {
            let (bus, address) = (&look.view.buses[index], &look.setup.sources[index]);
            let is_live = matches!(address, SourceAddress::Can { .. } | SourceAddress::Udp { .. });
            // Nobody else is on it, or another program is to start its boards.
            if !is_live || bus.starting == Starting::ByOthers {
                continue;
            }
            if bus.obeyed > heard.commands {
                heard.at_ns = Some(look.view.now_ns);
            }
            heard.commands = bus.obeyed;
        }
        for index in 0..self.heard.len() {
            let other = look
                .view
                .daemon
                .other_daemons
                .get(index)
                .and_then(Option::as_deref);
            found.extend(match other {
                Some(process) => Some(read_twice(look, index, process)),
                None => self.commanded(look, index),
            });
        }
    }

    /// A bus whose boards somebody else tells what to do.
    fn commanded(&self, look: &Look<'_>, index: usize) -> Option<Problem> {
        let Heard { commands, at_ns } = self.heard[index];
        at_ns.filter(|at_ns| look.view.now_ns.saturating_sub(*at_ns) < QUIET_NS)?;
        let name = &look.setup.layout.buses[index];
        let commands = plural(commands, "command");
        Some(Problem::new(
            Kind::BusShared,
            Place::Bus(index),
            format!(
                "{name}: another program on the bus tells its boards what to do: {commands} to start, stop or set up boards \
                 came that were not sent from here"
            ),
            "end it: another taxeld or a reader of one's own, perhaps on another machine; or have it alone start the boards \
             (`mode = \"passive\"` in [boards]). Recordings that are played onto the bus may have such commands, too",
            format!("{name}: no command of another program came for ten minutes"),
        ))
    }
}

/// A bus that another daemon of this machine reads.
fn read_twice(look: &Look<'_>, index: usize, process: &str) -> Problem {
    let (name, source) = (&look.setup.layout.buses[index], &look.setup.sources[index]);
    Problem::new(
        Kind::BusShared,
        Place::Bus(index),
        format!("{name}: another taxeld on this machine reads {source} as well: {process}"),
        "where they are two hands, one of them feels what the other touches: correct `source` in its configuration. One hand \
         needs one taxeld, however many displays it has",
        format!("{name}: no other taxeld on this machine reads {source} any more"),
    )
}
