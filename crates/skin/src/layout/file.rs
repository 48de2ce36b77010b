//! The layout file: its TOML shape, and every check between the text and a [`Layout`].

use super::board::accept_board;
use super::error::{LayoutError, LayoutProblem};
use super::pose::check_place;
use super::source::{Accepted, FileModule, Head, Source, Table};
use super::tile::{check_order, check_positions, check_rotation, turn};
use super::wiring::{Layout, Wiring};
use crate::protocol::Protocol;
use crate::protocol::cyskin::file::FileCyskin;
use serde::Deserialize;
use std::ops::Range;
use taxel_hand::{FromMap, Geometry, MAX_MODULES, MAX_PIXELS, MAX_TAXELS, Module, Taxel, plain_words};
use toml::Spanned;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FileLayout {
    name: Spanned<String>,
    image: Table<FileImage>,
    #[serde(default)]
    buses: Vec<Spanned<String>>,
    cyskin: Option<Table<FileCyskin>>,
    module: Vec<Table<FileModule>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FileImage {
    width: i64,
    height: i64,
}

/// See [`Layout::parse`].
pub(crate) fn parse(text: &str, file: &str) -> Result<Layout, LayoutError> {
    let source = Source::new(file, text);
    let parsed: FileLayout = toml::from_str(text).or_else(|e| {
        let span = e.span().unwrap_or(0..0);
        let line = text.lines().nth(source.line(&span) - 1).unwrap_or_default();
        let why = match line.trim_start().starts_with("[module]") {
            true => "write [[module]], with two brackets, once for each module".into(),
            false => plain_words(e.message()),
        };
        source.refuse(&span, LayoutProblem::Syntax(why))
    })?;

    let image = &parsed.image;
    let [width, height] = check_image(&source, image)?;
    source.name(&parsed.name.span(), "the layout's name", parsed.name.get_ref())?;
    let buses = check_buses(&source, &parsed)?;
    let at_first = parsed.module.first().map_or(0..0, Spanned::span);
    source.range(
        &at_first,
        "the number of modules",
        parsed.module.len() as i64,
        [1, MAX_MODULES as i64],
    )?;

    let cyskin = match parsed.cyskin {
        None => None,
        Some(table) => {
            let span = table.span();
            let FromMap(table) = table.into_inner();
            let setup = table.check(&buses);
            Some(setup.or_else(|why| source.refuse(&span, LayoutProblem::Cyskin(why)))?)
        }
    };
    let head = Head {
        size: [width, height],
        buses,
        cyskin,
    };
    let mut accepted = Accepted::default();
    for module in &parsed.module {
        accept_module(&source, module, &head, &mut accepted)?;
    }
    let Accepted {
        modules,
        wiring,
        taxels,
        k,
        ..
    } = accepted;
    let name = parsed.name;
    let geometry = Geometry::new(name.get_ref(), head.size, modules, taxels)
        .or_else(|error| source.refuse(&name.span(), LayoutProblem::Syntax(error.to_string())))?;
    Ok(Layout {
        geometry,
        buses: head.buses,
        wiring,
        k,
        cyskin: head.cyskin,
    })
}

fn check_image(source: &Source<'_>, image: &Table<FileImage>) -> Result<[u16; 2], LayoutError> {
    let span = image.span();
    let FromMap(FileImage { width, height }) = *image.get_ref();
    source.range(&span, "image.width", width, [1, u16::MAX as i64])?;
    source.range(&span, "image.height", height, [1, u16::MAX as i64])?;
    if (width * height) as usize > MAX_PIXELS {
        return source.refuse(&span, LayoutProblem::TooManyPixels { width, height });
    }
    Ok([width as u16, height as u16])
}

fn check_buses(source: &Source<'_>, parsed: &FileLayout) -> Result<Vec<String>, LayoutError> {
    let mut buses: Vec<String> = Vec::new();
    for bus in &parsed.buses {
        let name = bus.get_ref().clone();
        source.name(&bus.span(), "bus", &name)?;
        if buses.contains(&name) {
            let problem = LayoutProblem::BadName {
                what: "bus",
                name,
                why: "used twice",
            };
            return source.refuse(&bus.span(), problem);
        }
        buses.push(name);
    }
    let span = parsed.buses.last().map_or(0..0, Spanned::span);
    let needed = parsed.module.iter().any(|module| {
        let protocol = Protocol::from_name(module.get_ref().0.protocol.get_ref());
        protocol.is_none_or(Protocol::has_board)
    });
    source.range(
        &span,
        "the number of buses",
        buses.len() as i64,
        [needed as i64, u8::MAX as i64],
    )?;
    Ok(buses)
}

fn accept_module(
    source: &Source<'_>,
    module: &Table<FileModule>,
    head: &Head,
    accepted: &mut Accepted,
) -> Result<(), LayoutError> {
    let span = module.span();
    let FromMap(module) = module.get_ref();
    let name = || module.name.clone();
    source.name(&span, "module", &module.name)?;
    source.name(&span, "part", &module.part)?;
    if accepted.modules.iter().any(|m| m.name == module.name) {
        return source.refuse(
            &span,
            LayoutProblem::BadName {
                what: "module",
                name: name(),
                why: "used twice",
            },
        );
    }

    let (wiring, board_span) = accept_board(source, module, &span, head, accepted)?;
    let ([rows, columns], cells) = check_order(source, module, &wiring, &span)?;
    let first_taxel = accepted.taxels.len();
    let taxels = first_taxel + cells.len();
    if taxels > MAX_TAXELS {
        let problem = LayoutProblem::TooManyTaxels {
            module: name(),
            taxels,
        };
        return source.refuse(&span, problem);
    }
    let rotation = check_rotation(source, module)?;
    let positions = check_positions(source, module, &cells)?;
    let (pose, joint) = check_place(module.pose.as_ref(), module.joint.as_ref())
        .or_else(|(span, why)| source.refuse(&span, LayoutProblem::Place { module: name(), why }))?;

    let place = Place {
        source,
        module,
        wiring: &wiring,
        board_span,
        head,
    };
    for (cell, position_mm) in cells.iter().zip(positions) {
        let (row, column) = turn(cell.row, cell.column, rows, columns, rotation);
        let (x, y) = place.free_pixel(cell.k, row, column, accepted)?;
        let id = place.free_id(cell.k, accepted)?;
        let taxel = accepted.taxels.len();
        accepted.pixels.insert((x, y), taxel);
        accepted.ids.extend(id.map(|id| (id, taxel)));
        accepted.k.push(cell.k);
        accepted.taxels.push(Taxel {
            module: accepted.modules.len() as u16,
            x,
            y,
            position_mm,
        });
    }
    accepted.spans.push(span);
    accepted.wiring.push(wiring);
    accepted.modules.push(Module {
        name: name(),
        part: module.part.clone(),
        first_taxel: first_taxel as u16,
        taxels: cells.len() as u16,
        pose,
        joint,
    });
    Ok(())
}

/// Where the taxels of a module are to be: in the image, and among the ids of a bus.
struct Place<'a> {
    source: &'a Source<'a>,
    module: &'a FileModule,
    wiring: &'a Wiring,
    board_span: Range<usize>,
    head: &'a Head,
}

impl Place<'_> {
    /// The pixel of a taxel, which must be in the image and nobody's.
    fn free_pixel(
        &self,
        k: u16,
        row: usize,
        column: usize,
        accepted: &Accepted,
    ) -> Result<(u16, u16), LayoutError> {
        let module = self.module.name.clone();
        let [left, top] = self.module.at.get_ref().0;
        let [width, height] = self.head.size;
        let (x, y) = (left.saturating_add(column as i64), top.saturating_add(row as i64));
        let is_inside = (0..width.into()).contains(&x) && (0..height.into()).contains(&y);
        let pixel = (x as u16, y as u16);
        let problem = match accepted.pixels.get(&pixel) {
            _ if !is_inside => LayoutProblem::OutsideImage {
                module,
                k,
                x,
                y,
                width,
                height,
            },
            Some(&other) => {
                let (other, other_k, other_line) = accepted.describe(other, self.source);
                LayoutProblem::Overlap {
                    module,
                    k,
                    x: pixel.0,
                    y: pixel.1,
                    other,
                    other_k,
                    other_line,
                }
            }
            None => return Ok(pixel),
        };
        self.source.refuse(&self.module.at.span(), problem)
    }

    /// The bus and id of a taxel's frames, where they have one of their own, which must be no other module's.
    fn free_id(&self, k: u16, accepted: &Accepted) -> Result<Option<(u8, u16)>, LayoutError> {
        let Wiring {
            bus, board, protocol, ..
        } = *self.wiring;
        let Some(id) = protocol.frame_id(board, k) else {
            return Ok(None);
        };
        let of_another =
            |taxel: &&usize| usize::from(accepted.taxels[**taxel].module) < accepted.modules.len();
        let Some(&other) = accepted.ids.get(&(bus, id)).filter(of_another) else {
            return Ok(Some((bus, id)));
        };
        let (other, other_k, other_line) = accepted.describe(other, self.source);
        let problem = LayoutProblem::SameCanId {
            module: self.module.name.clone(),
            k,
            bus: self.head.buses[bus as usize].clone(),
            id,
            other,
            other_k,
            other_line,
        };
        self.source.refuse(&self.board_span, problem)
    }
}
