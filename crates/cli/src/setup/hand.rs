//! Which hand it is: what was heard, the layouts that have as many boards of the same taxels, and the layout file in
//! which each module has the board that was pressed.

use super::layout_text::{LayoutText, quoted};
use crate::doctor::scan::Bus;
use anyhow::{Context, ensure};
use std::collections::BTreeMap;
use taxel_can::SourceAddress;
use taxel_skin::{Layout, Recognition};

/// The boards that were heard, as a layout whose places are guesses.
#[derive(Debug)]
pub(super) struct Heard {
    pub(super) layout: Layout,
    /// The layout as a file.
    pub(super) text: String,
    /// Where each bus of the layout is.
    pub(super) sources: Vec<SourceAddress>,
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
            sources: with_boards.map(|(bus, _)| bus.source.clone()).collect(),
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

    /// The board that a user calls `BUS/BOARD`, such as `can0/3`.
    pub(super) fn named(&self, text: &str) -> Option<usize> {
        let (bus, board) = text.rsplit_once('/')?;
        let board: u8 = board.trim().parse().ok()?;
        let mut of_bus = self.layout.wiring.iter().enumerate();
        let (module, _) =
            of_bus.find(|(_, w)| self.layout.buses[usize::from(w.bus)] == bus.trim() && w.board == board)?;
        Some(module)
    }

    /// Whether the board of this module can be that of a module of another layout: it has the same taxels.
    pub(super) fn can_be(&self, module: usize, hand: &Layout, place: usize) -> bool {
        let [own, other] = [(&self.layout, module), (hand, place)]
            .map(|(layout, module)| layout.k_of(&layout.modules[module]));
        own == other && self.layout.wiring[module].icub.is_some() == hand.wiring[place].icub.is_some()
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

    /// Whether every module of this layout can have a board of its own, and every board a module.
    pub(super) fn fits(&self, hand: &Layout) -> bool {
        let shape = |layout: &Layout| {
            let mut taxels: Vec<Vec<u16>> = layout.modules.iter().map(|m| layout.k_of(m).to_vec()).collect();
            taxels.sort();
            taxels
        };
        let is_wired = !hand.buses.is_empty() && hand.wiring.iter().all(|w| w.hub.is_none());
        is_wired && shape(hand) == shape(&self.layout)
    }

    /// For each bus of this layout the bus that was heard with the very same boards, where each has one.
    pub(super) fn same_buses(&self, hand: &Layout) -> Option<Vec<usize>> {
        let boards = |layout: &Layout, bus: usize| {
            let of_bus = layout.wiring.iter().filter(|w| usize::from(w.bus) == bus);
            let mut boards: Vec<(&str, u8)> = of_bus.map(|w| (w.protocol.name(), w.board)).collect();
            boards.sort_unstable();
            boards
        };
        let mut left: Vec<usize> = (0..self.layout.buses.len()).collect();
        let mut same = Vec::new();
        for bus in 0..hand.buses.len() {
            let wanted = boards(hand, bus);
            // A bus of the same name first: two may have the same boards.
            left.sort_by_key(|other| self.layout.buses[*other] != hand.buses[bus]);
            let at = left
                .iter()
                .position(|other| boards(&self.layout, *other) == wanted)?;
            same.push(left.remove(at));
        }
        left.is_empty().then_some(same)
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
            text.set(module, "protocol", &quoted(wiring.protocol.name()));
        }
        let mut is_placed = places.iter().map(Option::is_some);
        text.modules.retain(|_| is_placed.next().unwrap_or(false));
        let text = text.write(&format!(
            "Written by `taxel setup`: modules as in {}, each with the board that was pressed or named for it.\n{UNCHECKED}",
            hand.name
        ));
        self.check(&text, places.iter().flatten().copied())?;
        Ok(text)
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
        let written = Layout::parse(text, "the layout")?;
        let wired = |layout: &Layout, module: usize| {
            let wiring = &layout.wiring[module];
            let bus = layout.buses.get(usize::from(wiring.bus)).cloned();
            (bus, wiring.board, wiring.protocol, wiring.hub)
        };
        let wanted: Vec<_> = boards.map(|board| wired(&self.layout, board)).collect();
        let got: Vec<_> = (0..written.modules.len()).map(|m| wired(&written, m)).collect();
        ensure!(
            wanted == got,
            "the layout is written in a way in which its boards cannot be replaced: write `buses = [...]` on one line, and \
             each key of a module on its own"
        );
        Ok(())
    }
}

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

    /// The boards of a built-in hand, as if they had been heard.
    fn heard(name: &str) -> Heard {
        let layout = Layout::builtin(name).unwrap();
        Heard {
            text: Layout::builtin_text(name).unwrap().into(),
            sources: layout
                .buses
                .iter()
                .map(|bus| format!("can:{bus}").parse().unwrap())
                .collect(),
            layout,
        }
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
            .filter(|name| heard.fits(&Layout::builtin(name).unwrap()))
            .collect();
        assert_eq!(fitting, ["allegro-uskin-15"]);
        assert_eq!(heard.same_buses(&heard.layout), Some(vec![0, 1]));
        let (bus, board) = ("can1", 5);
        assert_eq!(heard.named(&format!("{bus}/{board}")), Some(13));
        assert_eq!(heard.board(13), "can1 board 5");
        for text in ["can1", "can2/5", "can1/9", "can1/x"] {
            assert_eq!(heard.named(text), None, "{text}");
        }
    }
}
