//! The layout file that recognised buses propose, with comments on what is guessed in it.

use super::found::Recognition;
use crate::layout::Layout;
use crate::protocol::Order;
use crate::protocol::cyskin::recognise::CyskinGuess;
use crate::protocol::cyskin::setup::{ByteOrder, Checksum, HubIds};
use crate::protocol::recognised::RecognisedBoard;
use std::collections::BTreeSet;
use std::fmt::Write;
use std::sync::LazyLock;
use taxel_hand::plural;

/// Widest image that tiles are laid out in, pixels; a tile that is wider has its own row.
const WIDTH: usize = 64;

/// The built-in hands that have boards.
static BUILTIN: LazyLock<Vec<(&str, Layout)>> = LazyLock::new(|| {
    let hands = Layout::builtin_names().filter_map(|name| Some((name, Layout::builtin(name)?)));
    hands.filter(|(_, layout)| !layout.buses.is_empty()).collect()
});

impl Recognition {
    /// The text of a layout file for what was recognised, which [`Layout::parse`] accepts as it is;
    /// `None` where no board was recognised. `buses` are the names of the buses.
    ///
    /// Buses without boards are left out of the file.
    pub fn layout_file(&self, name: &str, buses: &[&str]) -> Option<String> {
        let named: Vec<(&str, &[RecognisedBoard])> = self
            .buses
            .iter()
            .enumerate()
            .map(|(i, bus)| (buses.get(i).copied().unwrap_or("bus"), &bus.boards[..]))
            .filter(|(_, boards)| !boards.is_empty())
            .collect();
        if named.is_empty() {
            return None;
        }
        let mut modules = String::new();
        let mut tiles = Tiles::default();
        for (bus, boards) in &named {
            tiles.next_row();
            for board in *boards {
                let order = board.protocol.0.proposed_order(&board.taxels);
                let at = tiles.place(&order);
                write_module(&mut modules, bus, board, &order, at);
            }
        }
        let mut text = self.head(name, &named, tiles.size());
        text += &modules;
        Some(text)
    }

    /// The built-in hand with the same boards on as many buses, if there is one, and how many of its taxels are silent; its
    /// places are better than guesses.
    pub fn builtin(&self) -> Option<(&'static str, usize)> {
        let silent = |layout: &Layout| {
            let buses = self.buses.iter().filter(|bus| !bus.boards.is_empty()).count();
            let of_hand = [layout.buses.len(), layout.modules.len()];
            let wired = self
                .wired_as(layout, &[])
                .filter(|_| of_hand == [buses, self.boards().count()])?;
            let mut silent = 0;
            for module in 0..layout.modules.len() {
                let fit = self
                    .boards()
                    .nth(self.board_of(layout, module, &wired)?)?
                    .fit(layout, module)?;
                silent += (fit.unread == 0).then_some(fit.silent.len())?;
            }
            Some(silent)
        };
        let hands = BUILTIN
            .iter()
            .filter_map(|(name, layout)| Some((*name, silent(layout)?)));
        hands.min_by_key(|(_, silent)| *silent)
    }

    fn head(&self, name: &str, named: &[(&str, &[RecognisedBoard])], [width, height]: [usize; 2]) -> String {
        let mut text = String::from(
            "# Proposed by `taxel doctor --scan` from the traffic of the buses.\n#\n\
             # KNOWN: bus, board, protocol and taxel numbers of each module, as they were heard.\n\
             # GUESSED, since no frame tells: where a module sits (`at`, `rotation`), how its taxels are arranged\n\
             # (`order`), and what belongs together (`part`: each board is a part of its own; actuators of different\n\
             # parts are not neighbours). Press one taxel after the other with `taxel watch` open, and correct them.\n\
             # Positions in millimetres (`pitch_mm`, `origin_mm`) are left out.\n",
        );
        if let Some((builtin, silent)) = self.builtin() {
            let but = match silent {
                0 => String::new(),
                silent => format!(", but for {} that no frame was heard of", plural(silent, "taxel")),
            };
            let said = format!(
                "These are the boards of the built-in hand {builtin}{but}: if it is one, `layout = \"{builtin}\"` places them."
            );
            let _ = writeln!(text, "#\n# {}", wrap(&said, 110).join("\n# "));
        }
        for (bus, doubts) in self.buses.iter().zip(bus_names(self, named)) {
            for doubt in &bus.doubts {
                for (i, line) in wrap(doubt, 100).iter().enumerate() {
                    let head = if i == 0 {
                        format!("#\n# DOUBT, {doubts}: ")
                    } else {
                        "# ".into()
                    };
                    let _ = writeln!(text, "{head}{line}");
                }
            }
        }
        let names: Vec<String> = named.iter().map(|(bus, _)| quoted(bus)).collect();
        let _ = write!(
            text,
            "name = {}\nimage = {{ width = {width}, height = {height} }}\nbuses = [{}]\n",
            quoted(name),
            names.join(", ")
        );
        if let Some(guess) = &self.cyskin {
            write_cyskin(&mut text, guess, named);
        }
        text
    }
}

/// The name of each bus, boards or not.
fn bus_names<'a>(found: &Recognition, named: &[(&'a str, &[RecognisedBoard])]) -> Vec<&'a str> {
    let mut names = named.iter().map(|(name, _)| *name);
    found
        .buses
        .iter()
        .map(|bus| match bus.boards.is_empty() {
            true => "a bus without boards",
            false => names.next().unwrap_or("bus"),
        })
        .collect()
}

/// A text as a TOML string.
fn quoted(text: &str) -> String {
    toml::Value::from(text).to_string()
}

fn wrap(text: &str, width: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        let line = lines.last_mut().expect("one line at least");
        if !line.is_empty() && line.len() + 1 + word.len() > width {
            lines.push(word.to_string());
        } else {
            if !line.is_empty() {
                line.push(' ');
            }
            line.push_str(word);
        }
    }
    lines
}

fn hub_name(bus: &str, address: u32) -> String {
    format!("{bus} hub {address:#x}")
}

fn write_cyskin(text: &mut String, guess: &CyskinGuess, named: &[(&str, &[RecognisedBoard])]) {
    let byte_order = match guess.byte_order {
        ByteOrder::Big => "big",
        ByteOrder::Little => "little",
    };
    let checksum = match guess.checksum {
        Checksum::Sum => "sum",
        Checksum::SumToZero => "sum-to-zero",
        Checksum::InvertedSum => "inverted-sum",
        Checksum::Xor => "xor",
        Checksum::Crc8Ff => "crc8-ff",
        Checksum::Crc8 => "crc8",
        Checksum::Unchecked => "unchecked",
    };
    let (ids, known) = match guess.ids {
        HubIds::Standard => (
            "standard",
            "As the packets have it. Hubs are started as Genoa's library does; write `start = []` for such that send\n# by themselves.",
        ),
        HubIds::Extended => ("extended", "Not public: as the packets have it."),
    };
    let _ = write!(
        text,
        "\n# {known}\n[cyskin]\nids = \"{ids}\"\nbyte_order = \"{byte_order}\"\nchecksum = \"{checksum}\"\n\
         sequence_bytes_above = {}\nsensors_per_module = {}\n",
        guess.sequence_bytes_above, guess.sensors_per_module
    );
    for (bus, boards) in named {
        let hubs: BTreeSet<u32> = boards.iter().filter_map(|b| b.hub).collect();
        for address in hubs {
            let _ = write!(
                text,
                "[[cyskin.hub]]\nname = {}\nbus = {}\naddress = {address:#x}\n",
                quoted(&hub_name(bus, address)),
                quoted(bus)
            );
        }
    }
}

fn write_module(text: &mut String, bus: &str, board: &RecognisedBoard, order: &Order, [x, y]: [usize; 2]) {
    let name = match board.hub {
        Some(hub) => format!("{} module {}", hub_name(bus, hub), board.board),
        None => format!("{bus} {} {}", board.protocol.board_word(), board.board),
    };
    let rate = board
        .rate_hz
        .map_or(String::new(), |hz| format!(", {hz:.1} sweeps/s"));
    let _ = write!(
        text,
        "\n# {} taxels{rate}\n[[module]]\nname = {}\npart = {}\nbus = {}\nboard = {}\nprotocol = \"{}\"\n",
        board.taxels.len(),
        quoted(&name),
        quoted(&name),
        quoted(bus),
        board.board,
        board.protocol.name()
    );
    if let Some(hub) = board.hub {
        let _ = writeln!(text, "hub = {}", quoted(&hub_name(bus, hub)));
    }
    let _ = writeln!(text, "at = [{x}, {y}]    # guessed\norder = [    # guessed");
    for row in order {
        let row: Vec<String> = row.iter().map(|k| format!("{k:2}")).collect();
        let _ = writeln!(text, "  [{}],", row.join(", "));
    }
    text.push_str("]\n");
}

/// Tiles side by side, in rows.
#[derive(Default)]
struct Tiles {
    x: usize,
    y: usize,
    row: usize,
    width: usize,
}

impl Tiles {
    fn next_row(&mut self) {
        self.y += self.row;
        (self.x, self.row) = (0, 0);
    }

    fn place(&mut self, order: &Order) -> [usize; 2] {
        let (rows, columns) = (order.len(), order.first().map_or(0, Vec::len));
        if self.x > 0 && self.x + columns > WIDTH {
            self.next_row();
        }
        let at = [self.x, self.y];
        self.x += columns;
        self.row = self.row.max(rows);
        self.width = self.width.max(self.x);
        at
    }

    fn size(&self) -> [usize; 2] {
        [self.width.max(1), (self.y + self.row).max(1)]
    }
}
