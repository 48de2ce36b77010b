//! Which interface of recorded traffic is which bus of a hand: by its name, by the boards that it carries, or as the
//! command line says.

use super::bus_orders::Orders;
use super::heard::{AsBus, Heard};
use crate::buses::traffic::{Traffic, Wanted};
use anyhow::bail;
use std::collections::BTreeSet;
use std::path::Path;
use taxel_can::id_text;
use taxel_config::Config;
use taxel_hand::{plural, shell_word};
use taxel_skin::{Layout, Readings};

/// A log of which more than one frame of so many is of nobody may be another device's.
const FOREIGN_ONE_OF: u64 = 4;
/// Ids that an error names.
const NAMED_IDS: usize = 6;
/// So many interfaces are named in an error; a whole vehicle has hundreds.
const MOST_NAMED: usize = 12;

/// What a log is to a hand.
struct Survey<'a> {
    path: &'a Path,
    /// Whether the doctor can look at it.
    scan: bool,
    layout: &'a Layout,
    heard: Vec<Heard>,
}

/// Which interface of recorded traffic feeds which bus of the layout: one name per bus.
///
/// An interface belongs to the bus of its name; a log of one interface to a hand of one bus. `pairs` (interface, bus)
/// say otherwise. Where a bus has no interface and an interface with boards of the hand no bus, names were changed on
/// the way: then the boards decide, or the log is refused. `joints` is an interface of which nothing is said. It is told
/// where the boards speak against `pairs`, where two of them send as one, and which frames are of nobody, but for the bus
/// that the configuration's joints share with the skin.
pub fn interfaces_of_buses(
    traffic: &Traffic,
    config: &Config,
    pairs: &[(String, String)],
    joints: Option<&str>,
) -> anyhow::Result<Vec<String>> {
    let layout = &config.layout;
    let mut survey = Survey {
        path: traffic.path(),
        scan: traffic.is_candump(),
        layout,
        heard: Vec::new(),
    };
    let mut readings = Readings::new();
    traffic.survey(|frame| {
        let known = survey
            .heard
            .iter()
            .position(|heard| heard.name == *frame.interface);
        let place = known.unwrap_or_else(|| {
            survey.heard.push(Heard::new(&frame.interface, layout));
            survey.heard.len() - 1
        });
        match survey.heard[place].take(frame, layout, &mut readings) {
            Wanted::Others if survey.is_settled(pairs) => Wanted::Nothing,
            wanted => wanted,
        }
    })?;
    survey.check_pairs(pairs)?;
    let mut chosen = survey.by_name(pairs);
    survey.correct_by_boards(&mut chosen, pairs)?;
    if chosen.iter().all(Option::is_none) {
        bail!(
            "{}: its interfaces ({}) are none of the buses of layout {} ({}); say which is which with \
             --interface {}={}",
            traffic.path().display(),
            survey.names(),
            layout.name,
            layout.buses.join(", "),
            survey
                .heard
                .iter()
                .map(|heard| heard.name.as_str())
                .min()
                .unwrap_or("NAME"),
            layout.buses.first().map_or("BUS", String::as_str),
        );
    }
    survey.tell_chosen_against_boards(&chosen);
    survey.refuse_other_hands(&chosen)?;
    let shared = config.joints_bus().filter(|bus| bus.shared);
    let shared = shared.map(|bus| usize::from(bus.index));
    survey.refuse_ids_by_chance(&chosen, shared)?;
    survey.tell_doubled(&chosen);
    survey.tell_left_out(&chosen, joints);
    survey.tell_foreign(&chosen, shared);
    // A name that no interface has: the bus stays silent.
    let name = |(chosen, bus): (Option<usize>, &String)| {
        chosen.map_or_else(|| bus.clone(), |place| survey.heard[place].name.clone())
    };
    Ok(chosen.into_iter().zip(&layout.buses).map(name).collect())
}

impl Survey<'_> {
    fn names(&self) -> String {
        let names = self.heard.iter().map(|heard| heard.name.as_str());
        let first: Vec<&str> = names.take(MOST_NAMED).collect();
        let first = first.join(", ");
        match self.heard.len().saturating_sub(MOST_NAMED) {
            0 => first,
            more => format!("{first} and {more} more"),
        }
    }

    fn place(&self, name: &str) -> Option<usize> {
        self.heard.iter().position(|heard| heard.name == name)
    }

    /// Whether nothing that follows can change which interface is which bus: every bus has that of its name, with boards.
    fn is_settled(&self, pairs: &[(String, String)]) -> bool {
        let is_known = |chosen: Option<usize>| chosen.is_some_and(|place| self.heard[place].is_known());
        self.check_pairs(pairs).is_ok() && self.by_name(pairs).into_iter().all(is_known)
    }

    fn check_pairs(&self, pairs: &[(String, String)]) -> anyhow::Result<()> {
        for (interface, bus) in pairs {
            if self.place(interface).is_none() {
                bail!(
                    "{}: no frame on interface {interface}; it has {}",
                    self.path.display(),
                    self.names()
                );
            }
            if !self.layout.buses.contains(bus) {
                bail!(
                    "layout {} has no bus {bus}; it has {}",
                    self.layout.name,
                    self.layout.buses.join(", ")
                );
            }
        }
        Ok(())
    }

    /// The interface of each bus, as the command line and the names have it.
    fn by_name(&self, pairs: &[(String, String)]) -> Vec<Option<usize>> {
        let of_bus = |bus: &String| {
            let paired = pairs.iter().find(|(_, b)| b == bus);
            let only = (self.heard.len() == 1 && self.layout.buses.len() == 1).then_some(0);
            match paired {
                Some((interface, _)) => self.place(interface),
                None => self.place(bus).or(only),
            }
        };
        self.layout.buses.iter().map(of_bus).collect()
    }

    /// Puts interfaces where their boards say they belong, where names do not explain the log.
    fn correct_by_boards(
        &self,
        chosen: &mut [Option<usize>],
        pairs: &[(String, String)],
    ) -> anyhow::Result<()> {
        let buses = &self.layout.buses;
        let is_paired = |bus: &String| pairs.iter().any(|(_, paired)| paired == bus);
        let open: Vec<usize> = (0..buses.len()).filter(|bus| !is_paired(&buses[*bus])).collect();
        let is_open = |place: &usize| {
            !pairs
                .iter()
                .any(|(interface, _)| *interface == self.heard[*place].name)
        };
        let mut carrying: Vec<usize> = (0..self.heard.len())
            .filter(|place| is_open(place) && self.heard[*place].carries_boards())
            .collect();
        carrying.sort_by_key(|place| &self.heard[*place].name);
        let is_empty = |bus: &usize| chosen[*bus].is_none_or(|place| !self.heard[place].carries_boards());
        let has_place = |place: &usize| open.iter().any(|bus| chosen[*bus] == Some(*place));
        if !open.iter().any(is_empty) || carrying.iter().all(has_place) {
            return Ok(());
        }
        let boards = self.boards_of_buses();
        let best = Orders::of(&carrying, &open, &|place, bus| {
            self.heard[place].misfit(bus, &boards)
        });
        let name = |place: usize| &self.heard[place].name;
        let Some(order) = best.only() else {
            bail!(
                "{}: its interfaces ({}) are not all buses of layout {} ({}), and their boards do not tell which is \
                 which; say so, such as with {}",
                self.path.display(),
                self.names(),
                self.layout.name,
                buses.join(", "),
                self.as_options(&carrying, &open)
            );
        };
        for bus in &open {
            if chosen[*bus].is_some_and(|place| carrying.contains(&place)) {
                chosen[*bus] = None;
            }
        }
        let mut said = Vec::new();
        for (place, bus) in carrying.iter().zip(order) {
            chosen[*bus] = Some(*place);
            if name(*place) != &buses[*bus] {
                said.push(format!("{} is taken for bus {}", name(*place), buses[*bus]));
            }
        }
        let why = match open.len() {
            1 => "which alone is left",
            _ => "by the boards that it carries",
        };
        remark!(
            "taxel: {}: {}, {why}; --interface NAME=BUS says otherwise",
            self.path.display(),
            said.join(", ")
        );
        Ok(())
    }

    /// Number of boards of each bus.
    fn boards_of_buses(&self) -> Vec<usize> {
        let mut boards = vec![0; self.layout.buses.len()];
        for (_, _, wiring) in self.layout.boards() {
            boards[usize::from(wiring.bus)] += 1;
        }
        boards
    }

    /// Says where interfaces go by their names or by the command line otherwise than by their boards.
    fn tell_chosen_against_boards(&self, chosen: &[Option<usize>]) {
        let mut carrying: Vec<usize> = (0..self.heard.len())
            .filter(|place| self.heard[*place].carries_boards())
            .collect();
        carrying.sort_by_key(|place| &self.heard[*place].name);
        let bus_of = |place: &usize| chosen.iter().position(|chosen| *chosen == Some(*place));
        let taken: Vec<Option<usize>> = carrying.iter().map(bus_of).collect();
        let all: Vec<usize> = (0..chosen.len()).collect();
        // As many of each: boards that are silent on the bus of the name do not speak for one that has fewer.
        let boards = vec![self.layout.boards().count(); chosen.len()];
        let best = Orders::of(&carrying, &all, &|place, bus| {
            self.heard[place].misfit(bus, &boards)
        });
        let is_taken = |order: &&[usize]| order.iter().copied().map(Some).eq(taken.iter().copied());
        if let Some(order) = best.only().filter(|order| !is_taken(order)) {
            remark!(
                "taxel: {}: the boards that the interfaces carry speak for {}",
                self.path.display(),
                self.as_options(&carrying, order)
            );
        }
    }

    /// Interfaces and their buses, as the command line names them.
    fn as_options(&self, interfaces: &[usize], buses: &[usize]) -> String {
        let option = |(place, bus): (&usize, &usize)| {
            let (name, bus) = (&self.heard[*place].name, &self.layout.buses[*bus]);
            format!("--interface {}", shell_word(format!("{name}={bus}")))
        };
        let options: Vec<String> = interfaces.iter().zip(buses).map(option).collect();
        options.join(" ")
    }

    /// Says under which boards' addresses two of them send.
    fn tell_doubled(&self, chosen: &[Option<usize>]) {
        for (bus, place) in chosen.iter().enumerate() {
            let Some(heard) = place.map(|place| &self.heard[place]) else {
                continue;
            };
            let doubled = &heard.as_bus[bus].doubled;
            let names = doubled
                .iter()
                .map(|module| self.layout.modules[usize::from(*module)].name.as_str());
            let names: Vec<&str> = names.take(MOST_NAMED).collect();
            if !names.is_empty() {
                remark!(
                    "taxel: {}: on {} two boards answer as each of {} ({}{}): their values alternate, and images of them \
                     are wrong; two buses may have been written as one",
                    self.path.display(),
                    heard.name,
                    plural(doubled.len(), "module"),
                    names.join(", "),
                    if names.len() < doubled.len() { ", .." } else { "" }
                );
            }
        }
    }

    /// Each bus that has an interface, read as that bus.
    fn used<'a>(&'a self, chosen: &'a [Option<usize>]) -> impl Iterator<Item = (usize, &'a AsBus)> {
        let used = chosen.iter().enumerate();
        used.filter_map(|(bus, place)| Some((bus, &self.heard[(*place)?].as_bus[bus])))
    }

    /// Refuses a log in which no board of the hand says anything, and others speak, or none of its frames is as it should be.
    fn refuse_other_hands(&self, chosen: &[Option<usize>]) -> anyhow::Result<()> {
        if self.used(chosen).any(|(_, bus)| !bus.modules.is_empty()) {
            return Ok(());
        }
        let foreign = self.used(chosen).flat_map(|(_, bus)| bus.foreign.iter().copied());
        let foreign: BTreeSet<u32> = foreign.collect();
        let malformed: u64 = self.used(chosen).map(|(_, bus)| bus.malformed).sum();
        let frames: u64 = chosen
            .iter()
            .flatten()
            .map(|place| self.heard[*place].frames)
            .sum();
        let first = self.used(chosen).find_map(|(_, bus)| bus.first_malformed);
        if let Some((board, frame)) = first.filter(|_| foreign.is_empty() || 2 * malformed >= frames) {
            let wiring = &self.layout.wiring[usize::from(board)];
            let whole = wiring.protocol.frame(wiring.board, 0, [0; 3], 0);
            let other_length = whole
                .map(|whole| whole.data().len())
                .filter(|bytes| *bytes != frame.data().len());
            let wanted = other_length.map_or_else(String::new, |bytes| format!(" where {bytes} belong"));
            bail!(
                "{}: no reading can be had of it: {} with ids of boards of layout {} are malformed; the first is {:03X} \
                 (module {}, {}), with {} data bytes{wanted}",
                self.path.display(),
                plural(malformed as usize, "frame"),
                self.layout.name,
                frame.id(),
                self.layout.modules[usize::from(board)].name,
                wiring.protocol.name(),
                frame.data().len(),
            );
        }
        if foreign.is_empty() {
            return Ok(());
        }
        bail!(
            "{}: none of its frames is one of a board of layout {}: {}; {} says which boards these are, and writes their \
             layout",
            self.path.display(),
            self.layout.name,
            ids_of_nobody(&foreign),
            self.scan_command()
        );
    }

    /// Refuses a log of something else, a quarter of whose frames are of nobody, where a few ids happen to be those of taxels: no
    /// module has a value of half of its own. Nothing is said of a bus with joints.
    fn refuse_ids_by_chance(
        &self,
        chosen: &[Option<usize>],
        joints_bus: Option<usize>,
    ) -> anyhow::Result<()> {
        let is_whole = chosen.iter().flatten().all(|place| self.heard[*place].is_whole());
        let has_joints = self.used(chosen).any(|(bus, _)| joints_bus == Some(bus));
        let heard = |taxel: usize| {
            let taxel = taxel as u16;
            self.used(chosen).any(|(_, bus)| bus.taxels.contains(&taxel))
        };
        let is_half_heard = self.layout.modules.iter().any(|module| {
            let taxels = module.taxel_range();
            2 * taxels.clone().filter(|taxel| heard(*taxel)).count() >= taxels.len()
        });
        let unknown: u64 = self.used(chosen).map(|(_, bus)| bus.unknown).sum();
        let frames = chosen.iter().flatten().map(|place| self.heard[*place].frames);
        let frames: u64 = frames.sum();
        if !is_whole || has_joints || is_half_heard || FOREIGN_ONE_OF * unknown <= frames {
            return Ok(());
        }
        let foreign = self.used(chosen).flat_map(|(_, bus)| bus.foreign.iter().copied());
        bail!(
            "{}: {unknown} of its {frames} frames are of no board of layout {}, {}, and {} of {} taxels have no value; {} says \
             which boards these are, and writes their layout",
            self.path.display(),
            self.layout.name,
            ids_of_nobody(&foreign.collect()),
            (0..self.layout.len()).filter(|taxel| !heard(*taxel)).count(),
            self.layout.len(),
            self.scan_command()
        );
    }

    /// Says which frames are of no board of the hand. Nothing is said of a bus with joints.
    fn tell_foreign(&self, chosen: &[Option<usize>], joints_bus: Option<usize>) {
        let skin = self.used(chosen).filter(|(bus, _)| joints_bus != Some(*bus));
        let foreign: BTreeSet<u32> = skin.flat_map(|(_, bus)| bus.foreign.iter().copied()).collect();
        if !foreign.is_empty() {
            remark!(
                "taxel: {}: not all of its frames are those of layout {}: {}, which are left out; {} says whose they are",
                self.path.display(),
                self.layout.name,
                ids_of_nobody(&foreign),
                self.scan_command()
            );
        }
    }

    /// The command that looks at whose frames these are.
    fn scan_command(&self) -> String {
        let scan = |log: &Path| {
            let source = format!("log:{}", log.display());
            format!("`taxel doctor --scan {}`", shell_word(source))
        };
        match self.scan {
            true => scan(self.path),
            false => {
                let log = self.path.with_extension("log");
                let (path, of_log) = (shell_word(self.path.display()), shell_word(log.display()));
                format!("behind `taxel convert {path} {of_log}`, {}", scan(&log))
            }
        }
    }

    /// Names what of the log is not used, and what of the hand is not in it.
    fn tell_left_out(&self, chosen: &[Option<usize>], joints: Option<&str>) {
        let path = self.path.display();
        for (bus, _) in self
            .layout
            .buses
            .iter()
            .zip(chosen)
            .filter(|(_, chosen)| chosen.is_none())
        {
            remark!("taxel: {path}: nothing for bus {bus}; its taxels will be missing");
        }
        for (place, heard) in self.heard.iter().enumerate() {
            if !chosen.contains(&Some(place)) && joints != Some(&heard.name) {
                remark!(
                    "taxel: {path}: interface {} is left out, which is none of the buses of layout {} ({}); \
                     --interface {}=BUS says which it is",
                    heard.name,
                    self.layout.name,
                    self.layout.buses.join(", "),
                    heard.name
                );
            }
        }
    }
}

/// How many ids these are, and the first of them.
fn ids_of_nobody(ids: &BTreeSet<u32>) -> String {
    let named: Vec<String> = ids.iter().take(NAMED_IDS).map(|id| id_text(*id)).collect();
    let more = if ids.len() > NAMED_IDS { ", .." } else { "" };
    format!(
        "{} of nobody ({}{more})",
        plural(ids.len(), "id"),
        named.join(", ")
    )
}
