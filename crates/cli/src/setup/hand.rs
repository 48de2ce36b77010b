//! Which hand it is: what was heard, the layouts that have as many boards of the same taxels, and the layout file in
//! which each module has the board that was pressed.

use super::layout_text::{LayoutText, quoted};
use crate::doctor::scan::Bus;
use anyhow::{Context, ensure};
use std::collections::BTreeMap;
use taxel_can::SourceAddress;
use taxel_skin::{CyskinHub, Fit, Layout, RecognisedBoard, Recognition};

/// The boards that were heard, as a layout whose places are guesses.
#[derive(Debug)]
pub(super) struct Heard {
    pub(super) layout: Layout,
    /// The layout as a file.
    pub(super) text: String,
    /// Where each bus of the layout is.
    pub(super) sources: Vec<SourceAddress>,
    /// What was recognised on these buses: the boards are those of the layout's modules, one behind the other.
    found: Recognition,
}

impl Heard {
    /// `None` where no board was recognised.
    pub(super) fn new(buses: &[Bus], found: &Recognition, name: &str) -> anyhow::Result<Option<Self>> {
        let names: Vec<&str> = buses.iter().map(|bus| bus.name.as_str()).collect();
        let Some(text) = found.layout_file(name, &names) else {
            return Ok(None);
        };
        let with_boards = buses
            .iter()
            .zip(&found.buses)
            .filter(|(_, f)| !f.boards.is_empty());
        Ok(Some(Self {
            layout: Layout::parse(&text, "the boards that were heard")?,
            text,
            sources: with_boards.clone().map(|(bus, _)| bus.source.clone()).collect(),
            found: Recognition {
                buses: with_boards.map(|(_, found)| found.clone()).collect(),
                cyskin: found.cyskin,
            },
        }))
    }

    /// A board as it is called here: `can0 board 3`.
    pub(super) fn board(&self, module: usize) -> String {
        let wiring = &self.layout.wiring[module];
        let bus = &self.layout.buses[usize::from(wiring.bus)];
        match (wiring.hub, &self.layout.cyskin) {
            (Some(hub), Some(setup)) => {
                let hub = &setup.hubs[usize::from(hub)].name;
                format!("{hub} module {}", wiring.board)
            }
            _ => format!("{bus} board {}", wiring.board),
        }
    }

    /// What a user calls a board: `can0/3`, or `can0/0x21/3` on a hub.
    pub(super) fn address(&self, module: usize) -> String {
        let wiring = &self.layout.wiring[module];
        let bus = &self.layout.buses[usize::from(wiring.bus)];
        match self.recognised(module).hub {
            Some(hub) => format!("{bus}/{hub:#x}/{}", wiring.board),
            None => format!("{bus}/{}", wiring.board),
        }
    }

    /// The board that a user calls so.
    pub(super) fn named(&self, text: &str) -> Option<usize> {
        let text: String = text.split_whitespace().collect();
        (0..self.layout.modules.len()).find(|module| self.address(*module).eq_ignore_ascii_case(&text))
    }

    fn recognised(&self, module: usize) -> &RecognisedBoard {
        let mut boards = self.found.boards();
        boards
            .nth(module)
            .expect("a board for each module that was heard")
    }

    /// How a board fits a module of another layout.
    pub(super) fn fit(&self, module: usize, hand: &Layout, place: usize) -> Option<Fit> {
        self.recognised(module).fit(hand, place)
    }

    /// Whether the board that is pressed can be that of a module of another layout: it fits, and is not taxel by taxel that of
    /// another module. A hub says nothing of that, since it sends as many values for each of its modules.
    pub(super) fn can_be(&self, module: usize, hand: &Layout, place: usize) -> bool {
        let is_whole = |fit: &Fit| fit.unread == 0 && fit.silent.is_empty();
        let is_others = || {
            let mut places = 0..hand.modules.len();
            self.layout.wiring[module].hub.is_none()
                && places.any(|other| self.fit(module, hand, other).as_ref().is_some_and(is_whole))
        };
        let fit = self.fit(module, hand, place);
        fit.is_some_and(|fit| is_whole(&fit) || !is_others())
    }

    /// Why a board cannot be that of a module of another layout.
    pub(super) fn misfit(&self, module: usize, hand: &Layout, place: usize) -> String {
        let [own, other] = [&self.layout.modules[module], &hand.modules[place]];
        let (called, name) = (self.board(module), &other.name);
        match own.taxels == other.taxels {
            true => format!(
                "{called}, whose {} taxels are others than those of the {name}",
                own.taxels
            ),
            false => format!(
                "{called}, whose {} taxels are not the {} of the {name}",
                own.taxels, other.taxels
            ),
        }
    }

    /// Where every module of this layout can have a board of its own, every board a module, and each taxel that is sent is in
    /// it: how many taxels are silent.
    pub(super) fn fits(&self, hand: &Layout) -> Option<usize> {
        let is_wired = !hand.buses.is_empty() && hand.wiring.iter().all(|w| w.hub.is_none());
        if !is_wired || hand.modules.len() != self.layout.modules.len() {
            return None;
        }
        let mut left: Vec<usize> = (0..hand.modules.len()).collect();
        let mut silent = 0;
        for board in 0..self.layout.modules.len() {
            let fits = left.iter().enumerate().filter_map(|(at, place)| {
                let fit = self.fit(board, hand, *place).filter(|fit| fit.unread == 0)?;
                Some((fit.silent.len(), at))
            });
            let (least, at) = fits.min()?;
            left.remove(at);
            silent += least;
        }
        Some(silent)
    }

    /// For each bus of this layout the bus that was heard with its boards at their addresses, where each has one.
    pub(super) fn wired_as(&self, hand: &Layout) -> Option<Vec<usize>> {
        self.found.wired_as(hand, &self.layout.buses)
    }

    /// The boards of the modules of a layout on such buses.
    pub(super) fn places(&self, hand: &Layout, buses: &[usize]) -> Vec<Option<usize>> {
        let modules = 0..hand.modules.len();
        modules
            .map(|module| self.found.board_of(hand, module, buses))
            .collect()
    }

    /// Why the boards are not wired as this layout has them, by its first module that has none at its address.
    pub(super) fn miswired(&self, hand: &Layout) -> String {
        for (place, module) in hand.modules.iter().enumerate() {
            let boards = || (0..self.layout.modules.len()).filter(|b| self.recognised(*b).is_at(hand, place));
            if boards().any(|board| self.fit(board, hand, place).is_some()) {
                continue;
            }
            return match boards().next() {
                Some(board) => format!(
                    "at the address of the {} is {}",
                    module.name,
                    self.misfit(board, hand, place)
                ),
                None => format!("no board was heard at the address of the {}", module.name),
            };
        }
        "its boards were heard on other buses".into()
    }

    /// The file of `hand` with these boards for its modules; a module without one is left out.
    pub(super) fn placed(
        &self,
        hand: &Layout,
        hand_text: &str,
        places: &[Option<usize>],
        name: &str,
    ) -> anyhow::Result<String> {
        let mut text = LayoutText::parse(hand_text, hand.modules.len())?;
        let buses: Vec<String> = self.layout.buses.iter().map(|bus| quoted(bus)).collect();
        text.set_head("name", &quoted(name));
        text.set_head("buses", &format!("[{}]", buses.join(", ")));
        for (module, place) in places.iter().enumerate() {
            let Some(place) = place else { continue };
            let wiring = &self.layout.wiring[*place];
            text.set(module, "bus", &buses[usize::from(wiring.bus)]);
            text.set(module, "board", &wiring.board.to_string());
            let or_protocol = self.recognised(*place).or_protocol;
            if or_protocol != Some(hand.wiring[module].protocol) {
                text.set(module, "protocol", &quoted(wiring.protocol.name()));
            }
            if let Some(hub) = self.hub(*place) {
                text.set(module, "hub", &quoted(&hub.name));
            }
        }
        self.set_hubs(&mut text, places);
        let mut is_placed = places.iter().map(Option::is_some);
        text.modules.retain(|_| is_placed.next().unwrap_or(false));
        let text = text.write(&format!(
            "Written by `taxel setup`: modules as in {}, each with the board that was pressed or named for it.\n{UNCHECKED}",
            hand.name
        ));
        self.check(&text, places.iter().flatten().copied())?;
        Ok(text)
    }

    /// The hub of the board of a module.
    fn hub(&self, module: usize) -> Option<&CyskinHub> {
        let hub = self.layout.wiring[module].hub?;
        self.layout.cyskin.as_ref()?.hubs.get(usize::from(hub))
    }

    /// Writes the hubs of these boards in place of the others'.
    fn set_hubs(&self, text: &mut LayoutText, places: &[Option<usize>]) {
        text.remove_tables(HUB);
        let mut hubs: Vec<&CyskinHub> = places
            .iter()
            .flatten()
            .filter_map(|place| self.hub(*place))
            .collect();
        hubs.sort_by_key(|hub| (hub.bus, hub.address));
        hubs.dedup();
        for hub in hubs {
            let bus = quoted(&self.layout.buses[usize::from(hub.bus)]);
            text.tables.push(format!(
                "[[{HUB}]]\nname = {}\nbus = {bus}\naddress = {:#x}\n",
                quoted(&hub.name),
                hub.address
            ));
        }
    }

    /// A file of modules that were named: each part of the hand is a column, its modules one below the other as they
    /// were pressed. Boards without a name come behind, each a part of its own.
    pub(super) fn named_hand(&self, names: &[(usize, String)], name: &str) -> anyhow::Result<String> {
        let own = &self.layout;
        let mut text = LayoutText::parse(&self.text, own.modules.len())?;
        let unnamed = (0..own.modules.len()).filter(|m| names.iter().all(|(named, _)| named != m));
        let mut order: Vec<usize> = names.iter().map(|(module, _)| *module).collect();
        order.extend(unnamed);
        // Of each part: where its column begins, how wide it is, and where its next module goes.
        let mut columns: BTreeMap<String, [u16; 3]> = BTreeMap::new();
        let (mut width, mut height) = (0, 0);
        for module in order.iter().copied() {
            let called = names
                .iter()
                .find(|(named, _)| *named == module)
                .map(|(_, n)| n.as_str());
            let called = called.unwrap_or(&own.modules[module].name);
            let part = match names.iter().any(|(named, _)| *named == module) {
                true => called.split_whitespace().next().unwrap_or(called),
                false => called,
            };
            let pixels = &own.taxels[own.modules[module].taxel_range()];
            let span = |of: fn(&taxel_hand::Taxel) -> u16| {
                let least = pixels.iter().map(of).min().unwrap_or(0);
                pixels.iter().map(of).max().unwrap_or(0) - least + 1
            };
            let [w, h] = [span(|t| t.x), span(|t| t.y)];
            let column = columns.entry(part.into()).or_insert([width, 0, 0]);
            // A wider module below a narrow one needs room that the next column does not leave.
            if column[1] < w && column[0] + column[1] < width {
                *column = [width, 0, column[2]];
            }
            column[1] = column[1].max(w);
            text.set(module, "name", &quoted(called));
            text.set(module, "part", &quoted(part));
            text.set(module, "at", &format!("[{}, {}]", column[0], column[2]));
            column[2] += h;
            width = width.max(column[0] + column[1]);
            height = height.max(column[2]);
        }
        text.set_head("name", &quoted(name));
        text.set_head("image", &format!("{{ width = {width}, height = {height} }}"));
        text.modules = order.iter().map(|module| text.modules[*module].clone()).collect();
        let text = text.write(&format!(
            "Written by `taxel setup` from the boards that were heard.\n{UNCHECKED}"
        ));
        self.check(&text, order.into_iter())?;
        Ok(text)
    }

    /// Whether a file reads back as a layout with these boards, one behind the other.
    fn check(&self, text: &str, boards: impl Iterator<Item = usize>) -> anyhow::Result<()> {
        let written = Layout::parse(text, "the layout").context(UNREPLACED)?;
        for (place, board) in boards.enumerate() {
            let bus_of = |layout: &Layout, module: usize| {
                let bus = usize::from(layout.wiring.get(module)?.bus);
                layout.buses.get(bus).cloned()
            };
            let is_its = bus_of(&self.layout, board) == bus_of(&written, place);
            ensure!(
                is_its && self.recognised(board).is_at(&written, place),
                UNREPLACED
            );
        }
        let of_packets = |layout: &Layout| layout.cyskin.as_ref().map(|c| (c.ids, c.sensors_per_module));
        let (heard, said) = (of_packets(&self.layout), of_packets(&written));
        ensure!(
            said.is_none() || heard == said,
            "[cyskin] of the layout has other `ids` or `sensors_per_module` than the packets that were heard, under which its \
             modules were counted: `taxel doctor --scan` proposes a table of them"
        );
        Ok(())
    }
}

/// The table of a hub.
const HUB: &str = "cyskin.hub";

const UNREPLACED: &str = "\
the layout is written in a way in which its boards cannot be replaced: write `buses = [...]` on one line, each key of a \
module on its own, and each hub as a table [[cyskin.hub]]";

const UNCHECKED: &str = "\
NOT CHECKED: `order` and `rotation`, how the taxels lie within a module. Press one corner after the other with
`taxel view` open, and correct them. `taxel layouts allegro-uskin-15 --file` explains every key.";

/// A layout that a user names, and its text.
pub(super) fn resolve(name: &str) -> anyhow::Result<(Layout, String)> {
    let layout = Layout::resolve(name)?;
    let text = match Layout::builtin_text(name) {
        Some(text) => text.to_owned(),
        None => std::fs::read_to_string(name).with_context(|| {
            format!("{name}: modules are placed in a built-in hand or a layout file (`taxel layouts`)")
        })?,
    };
    Ok((layout, text))
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_skin::RecognisedBus;

    /// The boards of a built-in hand, as if they had been heard.
    fn heard(name: &str) -> Heard {
        heard_of(Layout::builtin_text(name).unwrap())
    }

    /// The same of the hand of a file.
    fn heard_of(text: &str) -> Heard {
        let layout = Layout::parse(text, "heard.toml").unwrap();
        let sources = layout
            .buses
            .iter()
            .map(|bus| format!("can:{bus}").parse().unwrap());
        Heard {
            text: text.into(),
            sources: sources.collect(),
            found: recognition(&layout),
            layout,
        }
    }

    /// The boards of a layout, each of whose taxels was heard.
    fn recognition(layout: &Layout) -> Recognition {
        let mut found = Recognition {
            buses: vec![RecognisedBus::default(); layout.buses.len()],
            cyskin: None,
        };
        for (_, module, wiring) in layout.boards() {
            let hub = wiring
                .hub
                .map(|hub| layout.cyskin.as_ref().unwrap().hubs[usize::from(hub)].address);
            found.buses[usize::from(wiring.bus)].boards.push(RecognisedBoard {
                protocol: wiring.protocol,
                or_protocol: None,
                board: wiring.board,
                hub,
                taxels: layout.k_of(module).iter().map(|k| *k as u8).collect(),
                rate_hz: None,
            });
        }
        found
    }

    #[test]
    fn modules_get_the_boards_they_were_given_and_keep_their_places() {
        for name in ["allegro-uskin-15", "allegro-xela-18", "uskin-fingertip"] {
            let (heard, hand) = (heard(name), Layout::builtin(name).unwrap());
            let last = hand.modules.len() - 1;
            // The first two boards with the same taxels change places, and the last module is left out.
            let other = (1..last).find(|m| heard.can_be(*m, &hand, 0));
            let mut places: Vec<Option<usize>> = (0..last).map(Some).chain([None]).collect();
            if let Some(other) = other {
                places.swap(0, other);
            }
            let text = heard
                .placed(&hand, Layout::builtin_text(name).unwrap(), &places, "mine")
                .unwrap();
            let written = Layout::parse(&text, "mine.toml").unwrap();
            assert_eq!(written.modules.len(), last);
            assert_eq!(written.taxels[..], hand.taxels[..written.len()], "{name}");
            for (module, place) in places.iter().flatten().enumerate() {
                assert_eq!(written.wiring[module], hand.wiring[*place], "{name}");
            }
        }
    }

    #[test]
    fn named_modules_are_columns_of_their_parts_in_the_order_of_their_names() {
        let heard = heard("allegro-uskin-15");
        let named =
            [(9, "pointer tip"), (2, "pointer root"), (14, "big tip")].map(|(m, n)| (m, n.to_owned()));
        let text = heard.named_hand(&named, "mine").unwrap();
        let written = Layout::parse(&text, "mine.toml").unwrap();
        let place = |module: usize| {
            let taxels = &written.taxels[written.modules[module].taxel_range()];
            let least = |of: fn(&taxel_hand::Taxel) -> u16| taxels.iter().map(of).min().unwrap();
            (least(|t| t.x), least(|t| t.y))
        };
        let names: Vec<&str> = written.modules[..4].iter().map(|m| m.name.as_str()).collect();
        assert_eq!(names, ["pointer tip", "pointer root", "big tip", "index tip"]);
        assert_eq!([0, 1, 2, 3].map(place), [(0, 0), (0, 4), (4, 0), (8, 0)]);
    }

    #[test]
    fn a_board_that_cannot_be_a_module_is_told_with_its_taxels_and_those_of_the_module() {
        let (heard, hand) = (heard("uskin-module"), Layout::builtin("icub-forearm").unwrap());
        assert!(!heard.can_be(0, &hand, 0));
        assert_eq!(
            heard.misfit(0, &hand, 0),
            "can0 board 1, whose 16 taxels are not the 80 of the forearm strip"
        );
    }

    #[test]
    fn a_hand_fits_by_its_taxels_and_is_the_same_by_its_addresses() {
        let heard = heard("allegro-uskin-15");
        let fitting: Vec<&str> = Layout::builtin_names()
            .filter(|name| heard.fits(&Layout::builtin(name).unwrap()) == Some(0))
            .collect();
        assert_eq!(fitting, ["allegro-uskin-15"]);
        assert_eq!(heard.wired_as(&heard.layout), Some(vec![0, 1]));
        let (bus, board) = ("can1", 5);
        assert_eq!(heard.named(&format!("{bus}/{board}")), Some(13));
        assert_eq!(heard.board(13), "can1 board 5");
        for text in ["can1", "can2/5", "can1/9", "can1/x"] {
            assert_eq!(heard.named(text), None, "{text}");
        }
    }

    /// A hub with three modules of so many taxels each, as its layout file says it: the table of the hub stands last.
    fn hub(bus: &str, address: u8, taxels: [u8; 3]) -> String {
        let mut text = format!("name = \"h\"\nimage = {{ width = 11, height = 3 }}\nbuses = [\"{bus}\"]\n");
        for (module, taxels) in taxels.into_iter().enumerate() {
            let order: Vec<u8> = (1..=taxels).collect();
            text += &format!(
                "\n[[module]]\nname = \"m{module}\"\npart = \"p\"\nbus = \"{bus}\"\nboard = {module}\nprotocol = \"cyskin\"\n\
                 hub = \"palm's\"\nat = [0, {module}]\norder = [{order:?}]\n"
            );
        }
        text + &format!(
            "\n[[cyskin.hub]]\nname = \"palm's\"\nbus = \"{bus}\"\naddress = {address}\n\n[cyskin]\nperiod_ms = 20\n"
        )
    }

    #[test]
    fn modules_of_hubs_get_the_hubs_that_were_heard_and_keep_how_they_are_driven() {
        let heard = heard_of(&hub("can0", 0x21, [11; 3]).replace("palm's", "can0 hub 0x21"));
        let text = hub("skin", 0x33, [7, 5, 3]);
        let hand = Layout::parse(&text, "hub.toml").unwrap();
        assert!((0..9).all(|n| heard.can_be(n / 3, &hand, n % 3)));
        let places = [Some(2), None, Some(0)];
        let text = heard.placed(&hand, &text, &places, "mine").unwrap();
        let written = Layout::parse(&text, "mine.toml").unwrap();
        assert_eq!(written.buses, ["can0"]);
        assert_eq!(
            written.modules.iter().map(|m| m.taxels).collect::<Vec<_>>(),
            [7, 3]
        );
        assert_eq!(written.wiring.iter().map(|w| w.board).collect::<Vec<_>>(), [2, 0]);
        let setup = written.cyskin.unwrap();
        assert_eq!(
            (&setup.hubs, setup.period_ms),
            (&heard.layout.cyskin.as_ref().unwrap().hubs, 20)
        );
        assert_eq!(heard.named("can0/0X21/2"), Some(2));
        assert_eq!(heard.named("can0/2"), None);
        // Modules are counted otherwise there.
        let other = hub("skin", 0x33, [7, 5, 3]) + "sensors_per_module = 8\n";
        let error = heard.placed(&hand, &other, &places, "mine").unwrap_err();
        assert!(error.to_string().contains("sensors_per_module"), "{error}");
    }

    #[test]
    fn the_board_of_another_module_is_not_taken_for_one_of_which_it_has_all_taxels() {
        let heard = heard("allegro-xela-18");
        let hand = &heard.layout;
        let taxels = |module: usize| hand.modules[module].taxels;
        for (board, place) in (0..18).flat_map(|board| (0..18).map(move |place| (board, place))) {
            assert_eq!(
                heard.can_be(board, hand, place),
                taxels(board) == taxels(place),
                "{board} {place}"
            );
        }
    }
}
