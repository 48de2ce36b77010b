//! `taxel layouts`: the hands that are built in, and what any layout looks like.

use crate::offered::offering;
use crate::piped_file::layout_parser;
use anyhow::Context;
use serde_json::json;
use std::fmt::Write as _;
use taxel_skin::{Layout, Protocol, Wiring};
use taxel_view::outline;
use taxeld::stdout;

/// Columns of a drawing.
const COLUMNS: u16 = 78;

/// List the built-in hands, or draw one, a letter for each taxel.
///
/// A drawing is the hand laid flat, by the positions of the layout, or by its image where it has none; gaps between
/// its parts are narrower than they are.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  taxel layouts
  taxel layouts icub-forearm
  taxel layouts my-hand.toml
  taxel layouts uskin-module --file > mine.toml     to start a layout of one's own")]
pub(crate) struct Args {
    /// A built-in hand, grid:HxW, or a layout file, - for stdin
    #[arg(value_name = "NAME", value_parser = offering(Layout::builtin_names(), layout_parser()), hide_possible_values = true)]
    name: Option<String>,
    /// Print the layout file of a built-in hand
    #[arg(long, requires = "name", conflicts_with = "json")]
    file: bool,
    /// JSON
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let text = match (&args.name, args.json) {
        (None, false) => list(&builtin()),
        (None, true) => {
            let hands: Vec<_> = builtin().iter().map(in_json).collect();
            serde_json::Value::from(hands).to_string() + "\n"
        }
        (Some(name), _) if args.file => Layout::builtin_text(name)
            .with_context(|| format!("{name} is not built in; `taxel layouts` lists those that are"))?
            .to_owned(),
        (Some(name), true) => in_json(&Layout::resolve(name)?).to_string() + "\n",
        (Some(name), false) => drawing(&Layout::resolve(name)?),
    };
    stdout::print(&text)
}

fn builtin() -> Vec<Layout> {
    Layout::builtin_names().filter_map(Layout::builtin).collect()
}

/// The protocols of the hand's boards, each once.
fn protocols(layout: &Layout) -> Vec<String> {
    let mut names: Vec<String> = layout
        .wiring
        .iter()
        .map(|wiring| wiring.protocol.name().to_owned())
        .collect();
    names.dedup();
    names
}

fn list(layouts: &[Layout]) -> String {
    let mut text = format!(
        "{:18} {:>6} {:>8} {:>6} {:>6}  {}\n",
        "layout", "taxels", "modules", "buses", "image", "boards"
    );
    for layout in layouts {
        let _ = writeln!(
            text,
            "{:18} {:>6} {:>8} {:>6} {:>6}  {}",
            layout.name,
            layout.len(),
            layout.modules.len(),
            layout.buses.len(),
            format!("{}x{}", layout.height, layout.width),
            protocols(layout).join(", "),
        );
    }
    text
}

fn drawing(layout: &Layout) -> String {
    let mut text = list(std::slice::from_ref(layout)) + "\n" + &outline(layout, COLUMNS) + "\n";
    for (number, (module, wiring)) in layout.modules.iter().zip(&layout.wiring).enumerate() {
        let bus = bus_of(layout, wiring);
        let at = bus.map_or(String::new(), |bus| format!("{bus}, board {}", wiring.board));
        let _ = writeln!(
            text,
            "{}  {:20} {:>4} taxels  {:12} {at}",
            taxel_view::letter(number),
            module.name,
            module.taxels,
            module.part,
        );
    }
    text
}

/// The bus of a module's board; a module of an array in a file has neither.
fn bus_of<'a>(layout: &'a Layout, wiring: &Wiring) -> Option<&'a String> {
    let bus = layout.buses.get(usize::from(wiring.bus));
    bus.filter(|_| wiring.protocol != Protocol::OFFLINE)
}

fn in_json(layout: &Layout) -> serde_json::Value {
    let modules = layout.modules.iter().zip(&layout.wiring).map(|(module, wiring)| {
        json!({
            "name": module.name,
            "part": module.part,
            "first_taxel": module.first_taxel,
            "taxels": module.taxels,
            "bus": bus_of(layout, wiring),
            "board": wiring.board,
            "protocol": wiring.protocol.name(),
        })
    });
    json!({
        "name": layout.name,
        "taxels": layout.len(),
        "width": layout.width,
        "height": layout.height,
        "buses": layout.buses,
        "modules": modules.collect::<Vec<_>>(),
    })
}
