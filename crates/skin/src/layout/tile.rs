//! One module's tile: the order of its taxels, its rotation, and its place on the hand.

use super::error::{LayoutError, LayoutProblem};
use super::source::{FileModule, Source};
use super::wiring::Wiring;
use crate::protocol::Order;
use std::ops::Range;
use taxel_hand::Whole;
use toml::Spanned;

/// Cell of an `order` table where the module has no taxel.
const NO_CELL: i64 = -1;

/// A taxel on its module's tile before the tile is placed.
pub(crate) struct Cell {
    pub(crate) k: u16,
    pub(crate) row: usize,
    pub(crate) column: usize,
}

/// Rows and columns of the module's tile, and its taxels in ascending `k`.
pub(crate) fn check_order(
    source: &Source<'_>,
    module: &FileModule,
    wiring: &Wiring,
    module_span: &Range<usize>,
) -> Result<([usize; 2], Vec<Cell>), LayoutError> {
    let (protocol, icub) = (wiring.protocol, wiring.icub.as_ref());
    let name = || module.name.clone();
    if let Some(size) = wiring.array {
        return match &module.order {
            None => Ok(cells_of_array(size)),
            Some(order) => source.refuse(
                &order.span(),
                LayoutProblem::Key {
                    module: name(),
                    protocol,
                    problem: "has its taxels row by row, and no use for the key `order`".into(),
                },
            ),
        };
    }
    let Some(order) = &module.order else {
        return match protocol.0.default_order() {
            Some(order) => Ok(cells_of(&order)),
            None => source.refuse(
                module_span,
                LayoutProblem::OrderNeeded {
                    module: name(),
                    protocol,
                },
            ),
        };
    };
    let rows = order.get_ref();
    let columns = rows.first().map_or(0, |row| row.get_ref().len());
    let mut cells = cells_in(source, module, wiring, rows, columns)?;
    if cells.is_empty() {
        return source.refuse(&order.span(), LayoutProblem::OrderEmpty { module: name() });
    }
    // Of equal ones the first of the file stays the first.
    cells.sort_by_key(|c| c.k);
    if let Some([first, again]) = cells.windows(2).find(|pair| pair[0].k == pair[1].k) {
        let problem = LayoutProblem::OrderRepeats {
            module: name(),
            k: again.k,
            first_row: first.row,
            row: again.row,
        };
        return source.refuse(&rows[again.row].span(), problem);
    }
    // Who leaves a cell out may well mean taxel 0.
    let counts_from_1 =
        cells.iter().zip(1..).all(|(cell, k)| cell.k == k) && cells.len() == rows.len() * columns;
    if counts_from_1 && cells.len() > 1 && !protocol.0.is_temperature(0, icub) {
        let problem = LayoutProblem::OrderFromOne {
            module: name(),
            taxels: cells.len(),
        };
        return source.refuse(&order.span(), problem);
    }
    Ok(([rows.len(), columns], cells))
}

/// The taxels of an `order` of a file, row by row.
fn cells_in(
    source: &Source<'_>,
    module: &FileModule,
    wiring: &Wiring,
    rows: &[Spanned<Vec<i64>>],
    columns: usize,
) -> Result<Vec<Cell>, LayoutError> {
    let (protocol, icub) = (wiring.protocol, wiring.icub.as_ref());
    let name = || module.name.clone();
    let mut cells: Vec<Cell> = Vec::new();
    for (row, cells_of_row) in rows.iter().enumerate() {
        let span = cells_of_row.span();
        let cells_of_row = cells_of_row.get_ref();
        if cells_of_row.len() != columns {
            let problem = LayoutProblem::OrderNotRectangular {
                module: name(),
                row,
                columns: cells_of_row.len(),
                expected: columns,
            };
            return source.refuse(&span, problem);
        }
        for (column, &k) in cells_of_row.iter().enumerate() {
            if k == NO_CELL {
                continue;
            }
            if k < 0 || k >= protocol.taxel_numbers() as i64 {
                return source.refuse(
                    &span,
                    LayoutProblem::OrderOutOfRange {
                        module: name(),
                        k,
                        protocol,
                    },
                );
            }
            let k = k as u16;
            if protocol.0.is_temperature(k, icub) {
                return source.refuse(&span, LayoutProblem::NotATaxel { module: name(), k });
            }
            cells.push(Cell { k, row, column });
        }
    }
    Ok(cells)
}

/// Rows and columns of an order that a protocol assumes, and its taxels in ascending `k`.
fn cells_of(order: &Order) -> ([usize; 2], Vec<Cell>) {
    let of_row = |(row, cells): (usize, &Vec<i16>)| {
        let cells = cells.iter().enumerate();
        let cells = cells.filter_map(|(column, k)| Some((column, u16::try_from(*k).ok()?)));
        cells
            .map(|(column, k)| Cell { k, row, column })
            .collect::<Vec<_>>()
    };
    let mut cells: Vec<Cell> = order.iter().enumerate().flat_map(of_row).collect();
    cells.sort_by_key(|cell| cell.k);
    ([order.len(), order.first().map_or(0, Vec::len)], cells)
}

/// The same of an array whose taxels are numbered row by row.
fn cells_of_array([rows, columns]: [u16; 2]) -> ([usize; 2], Vec<Cell>) {
    let columns = usize::from(columns);
    let cell = |k: u16| Cell {
        k,
        row: usize::from(k) / columns,
        column: usize::from(k) % columns,
    };
    let cells = (0..rows * columns as u16).map(cell).collect();
    ([rows.into(), columns], cells)
}

/// Quarter turns, clockwise.
pub(crate) fn check_rotation(source: &Source<'_>, module: &FileModule) -> Result<u8, LayoutError> {
    let Some(rotation) = &module.rotation else {
        return Ok(0);
    };
    match *rotation.get_ref() {
        degrees @ (0 | 90 | 180 | 270) => Ok((degrees / 90) as u8),
        degrees => {
            let problem = LayoutProblem::Rotation {
                module: module.name.clone(),
                degrees,
            };
            source.refuse(&rotation.span(), problem)
        }
    }
}

/// Where a cell lands when its tile is turned clockwise by this many quarters: `(row, column)` from
/// the tile's new top left.
pub(crate) fn turn(row: usize, column: usize, rows: usize, columns: usize, quarters: u8) -> (usize, usize) {
    match quarters {
        0 => (row, column),
        1 => (column, rows - 1 - row),
        2 => (rows - 1 - row, columns - 1 - column),
        _ => (columns - 1 - column, row),
    }
}

/// The position of each of `cells` on the hand.
pub(crate) fn check_positions(
    source: &Source<'_>,
    module: &FileModule,
    cells: &[Cell],
) -> Result<Vec<Option<[f32; 3]>>, LayoutError> {
    let positions = match (&module.positions_mm, &module.pitch_mm, &module.origin_mm) {
        (Some(list), ..) => listed(module, list, cells.len()),
        (None, Some(pitch), Some(origin)) => in_a_grid(module, pitch, origin, cells),
        (None, pitch, origin) => {
            let axes = module.axes.as_ref().map(Spanned::span);
            let given = (pitch.as_ref().map(Spanned::span))
                .or(origin.as_ref().map(Spanned::span))
                .or(axes);
            match given {
                Some(span) => Err((span, "positions need both pitch_mm and origin_mm".into())),
                None => Ok(vec![None; cells.len()]),
            }
        }
    };
    positions.or_else(|(span, why)| {
        let module = module.name.clone();
        source.refuse(&span, LayoutProblem::Positions { module, why })
    })
}

/// Positions, or what is wrong with them, and where.
type Positions = Result<Vec<Option<[f32; 3]>>, (Range<usize>, String)>;

fn listed(module: &FileModule, list: &Spanned<Whole<Vec<[f64; 3]>>>, taxels: usize) -> Positions {
    let refuse = |why: String| Err((list.span(), why));
    let list = &list.get_ref().0;
    if module.pitch_mm.is_some() || module.origin_mm.is_some() || module.axes.is_some() {
        return refuse("give either positions_mm or pitch_mm, origin_mm and axes, not both".into());
    }
    if list.len() != taxels {
        return refuse(format!(
            "positions_mm has {} places for {taxels} taxels",
            list.len()
        ));
    }
    if let Some(index) = list.iter().position(|place| !is_near(place)) {
        return refuse(format!("place {index} of positions_mm is not within 1e6 mm"));
    }
    Ok(list.iter().map(|place| Some(place.map(|v| v as f32))).collect())
}

fn in_a_grid(
    module: &FileModule,
    pitch: &Spanned<f64>,
    origin: &Spanned<Whole<[f64; 3]>>,
    cells: &[Cell],
) -> Positions {
    let p = *pitch.get_ref();
    if !(p > 0.0 && p <= 1000.0) {
        return Err((
            pitch.span(),
            format!("pitch_mm = {p} is not above 0 and up to 1000"),
        ));
    }
    if !is_near(&origin.get_ref().0) {
        return Err((origin.span(), "origin_mm is not within 1e6 mm".into()));
    }
    let axes = match &module.axes {
        None => [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        Some(axes) => {
            let [a, b] = axes.get_ref().0;
            let dot = |u: [f64; 3], v: [f64; 3]| u[0] * v[0] + u[1] * v[1] + u[2] * v[2];
            let near = |value: f64, expected: f64| (value - expected).abs() <= 0.02;
            if !(near(dot(a, a), 1.0) && near(dot(b, b), 1.0) && near(dot(a, b), 0.0)) {
                let why = "axes must be two unit vectors at right angles: along a row, and from row to row";
                return Err((axes.span(), why.into()));
            }
            [a, b]
        }
    };
    let position = |cell: &Cell| {
        let place = |i: usize| {
            origin.get_ref().0[i] + p * (cell.column as f64 * axes[0][i] + cell.row as f64 * axes[1][i])
        };
        Some([place(0) as f32, place(1) as f32, place(2) as f32])
    };
    Ok(cells.iter().map(position).collect())
}

fn is_near(place: &[f64; 3]) -> bool {
    place.iter().all(|v| v.is_finite() && v.abs() <= 1e6)
}
