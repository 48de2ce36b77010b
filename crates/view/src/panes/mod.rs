//! The panes of a picture, and where each is.

mod hand;
mod help;
pub(crate) mod joints;
mod lines;
mod problems;
mod traces;

use crate::colour::Palette;
use crate::flat::parts;
use crate::paint::{text, text_width};
use crate::picture::Picture;
use crate::raster::{Raster, Room, Size};
use crate::screen::{Right, Screen};
use ratatui::buffer::Buffer;
use ratatui::layout::{Margin, Position, Rect};
use ratatui::style::{Modifier, Style};
use taxel_hand::plural;

/// Lines below the panels.
const LINES: u16 = 4;
/// A panel's title and the names of the hand's parts.
const HEAD: u16 = 2;
/// Rows that force over time and problems need below the panels.
const LEAST_LOWER: u16 = 6;
/// Rows that are enough for them.
const ENOUGH_LOWER: u16 = 14;
/// Sides, half blocks, of taxels that are large enough not to grow at their cost: at that of the least, and of enough.
const LARGE: f32 = 3.0;
const VERY_LARGE: f32 = 8.0;
/// Columns of an extra pane at the right.
const LEAST_EXTRA: u16 = 24;
/// The smallest terminal that is drawn on.
const LEAST: (u16, u16) = (40, 14);

/// The line above the panels.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Heading {
    /// What is seen: a scene, a daemon, a recording.
    pub name: String,
    /// How far it is, or what it is.
    pub detail: String,
    /// A sentence about it, where there is room and nothing more important.
    pub about: String,
}

/// Draws a picture into the whole of `area`: the skin and its tactile image, what was chosen beside and below them.
///
/// Where `extra` is set, columns at the right are left for one more pane of the caller, and returned if the terminal
/// is wide enough.
pub fn draw(
    buffer: &mut Buffer,
    area: Rect,
    picture: &Picture,
    screen: &Screen,
    heading: &Heading,
    palette: Palette,
    extra: bool,
) -> Option<Rect> {
    if area.width < LEAST.0 || area.height < LEAST.1 {
        let words = format!(
            "The terminal has {}x{} characters; {}x{} are needed. q quits.",
            area.width, area.height, LEAST.0, LEAST.1
        );
        let rows = words.as_bytes().chunks(usize::from(area.width.max(1)));
        for (y, row) in (area.top()..area.bottom()).zip(rows) {
            let row = String::from_utf8_lossy(row);
            text(buffer, Rect { y, height: 1, ..area }, &row, Style::new());
        }
        return None;
    }
    let top = Rect { height: 1, ..area };
    lines::heading(buffer, top, picture, heading, palette);
    let below = Rect {
        y: area.bottom() - LINES,
        height: LINES,
        ..area
    };
    let middle = Rect {
        y: area.y + 1,
        height: area.height - 1 - LINES,
        ..area
    };
    let names: Vec<&str> = parts(&picture.hand).iter().map(|part| part.name).collect();
    let lines = Rect {
        width: joints::draw_degrees(buffer, below, picture, &names, palette),
        ..below
    };
    lines::draw(buffer, lines, picture, screen, palette);
    lines::draw_said(buffer, below, picture, heading, palette);
    let extra_width = 2 * middle.width / 5;
    let extra = (extra && extra_width >= LEAST_EXTRA).then_some(Rect {
        x: middle.right() - extra_width,
        width: extra_width,
        ..middle
    });
    let panels = Rect {
        width: middle.width - extra.map_or(0, |extra| extra.width),
        ..middle
    };
    draw_panels(buffer, panels, picture, screen, palette);
    if screen.help {
        let below_heading = Rect {
            height: area.height - 1,
            ..middle
        };
        help::draw(buffer, below_heading.inner(Margin::new(2, 0)), screen, palette);
    }
    extra
}

/// Where the panels are.
struct Arrangement {
    raster: Raster,
    /// The skin; then the tactile image, or what was chosen instead.
    panels: [Rect; 2],
    lower: Option<Rect>,
}

impl Arrangement {
    /// Side by side, or one above the other where taxels are larger so; with a lower pane where that costs them
    /// nothing.
    fn of(picture: &Picture, area: Rect) -> Self {
        let (names, bars) = (names_below(picture), bars_below(picture));
        let fit = |stacked: bool, height: u16| {
            let (width, rows) = match stacked {
                false => ((area.width - 2) / 2, height.saturating_sub(HEAD + names + bars)),
                true => (
                    area.width - 2,
                    (height.saturating_sub(bars) / 2).saturating_sub(HEAD + names),
                ),
            };
            let room = Room {
                width: width.saturating_sub(1),
                height: 2 * rows.max(1),
            };
            Raster::fit(&picture.hand.flat, room)
        };
        let best = |height: u16| {
            let ((beside, beside_size), (stacked, stacked_size)) = (fit(false, height), fit(true, height));
            match stacked_size.side > beside_size.side {
                true => (true, stacked, stacked_size),
                false => (false, beside, beside_size),
            }
        };
        let (mut stacked, mut raster, size) = best(area.height);
        for (lower, large) in [
            (LEAST_LOWER, LARGE.min(size.side.floor())),
            (ENOUGH_LOWER, VERY_LARGE),
        ] {
            if area.height > lower + HEAD + names + bars + 1 {
                let (small_stacked, small, small_size): (bool, Raster, Size) = best(area.height - lower);
                if small_size.side >= large {
                    (stacked, raster) = (small_stacked, small);
                }
            }
        }
        let rows = raster.rows() + HEAD + names + bars;
        let half = (area.width - 2) / 2;
        let panels = match stacked {
            false => [1, area.width - half].map(|x| Rect {
                x: area.x + x,
                y: area.y,
                width: half,
                height: rows.min(area.height),
            }),
            true => [0, rows].map(|y| Rect {
                x: area.x + 1,
                y: area.y + y,
                width: area.width - 2,
                height: rows.min(area.height.saturating_sub(y)),
            }),
        };
        let used = panels[1].bottom() - area.y;
        let left = area.height.saturating_sub(used);
        let lower = (left >= LEAST_LOWER).then_some(Rect {
            y: area.y + used,
            height: left,
            ..area
        });
        Self {
            raster,
            panels,
            lower,
        }
    }
}

fn draw_panels(buffer: &mut Buffer, area: Rect, picture: &Picture, screen: &Screen, palette: Palette) {
    let arrangement = Arrangement::of(picture, area);
    let Arrangement {
        raster,
        panels,
        lower,
    } = &arrangement;
    let title = format!("raw: {}", plural(picture.hand.len(), "taxel"));
    let origin = panel(buffer, panels[0], &title, picture, raster, palette);
    hand::skin(buffer, origin, raster, picture, screen, palette);
    draw_bars(buffer, origin, picture, raster, palette);
    let right = match (screen.right, lower) {
        // They are below already.
        (Right::Traces | Right::Problems, Some(_)) => Right::Image,
        (right, _) => right,
    };
    match right {
        Right::Image => {
            let title = format!("tactile image: {}", plural(picture.max_actuators, "actuator"));
            let origin = panel(buffer, panels[1], &title, picture, raster, palette);
            hand::image(buffer, origin, raster, picture, palette);
        }
        Right::Traces => traces::draw(buffer, panels[1], picture, palette),
        Right::Problems => problems::draw(buffer, panels[1], picture, palette),
    }
    if let Some(lower) = lower {
        let lower = lower.inner(Margin::new(1, 0));
        let left = Rect {
            width: lower.width / 2,
            ..lower
        };
        let right = Rect {
            x: left.right() + 2,
            width: lower.width - left.width - 2,
            ..lower
        };
        traces::draw(buffer, left, picture, palette);
        problems::draw(buffer, right, picture, palette);
    }
}

/// A panel's title and the names of the hand's parts; returns where the taxels begin.
fn panel(
    buffer: &mut Buffer,
    area: Rect,
    words: &str,
    picture: &Picture,
    raster: &Raster,
    palette: Palette,
) -> Position {
    let title = Rect { height: 1, ..area };
    let x = area.x + area.width.saturating_sub(raster.width) / 2;
    let begins = x
        .min(area.right().saturating_sub(text_width(words) as u16))
        .max(area.x);
    let title = Rect {
        x: begins,
        width: area.right() - begins,
        ..title
    };
    text(buffer, title, words, Style::new().add_modifier(Modifier::BOLD));
    let origin = Position::new(x, area.y + HEAD);
    let dim = Style::new().fg(palette.rgb(138, 138, 138));
    // Above their taxels; those that something else is above already, below; none where there is no room for it.
    let end = area.bottom().min(origin.y + raster.rows() + names_below(picture));
    let parts = parts(&picture.hand);
    let mut placed: Vec<(&str, Rect)> = (parts.iter())
        .map(|part| (part.name, raster.around(&part.taxels, origin)))
        .collect();
    placed.sort_by_key(|(_, place)| (place.x, place.y));
    let mut taken: Vec<Rect> = Vec::new();
    for (name, place) in placed {
        let above = Rect {
            y: origin.y,
            height: place.y - origin.y,
            ..place
        };
        let rows = match raster.covers(above, origin) {
            false => [place.y - 1, place.bottom()],
            true => [place.bottom(), place.y - 1],
        };
        let rows = rows.into_iter().filter(|y| (area.y + 1..end).contains(y));
        let spots = rows.filter_map(|y| spot(name, place, y, &taken));
        let mut free = spots.filter(|spot| !raster.covers(*spot, origin));
        if let Some(spot) = free.next() {
            text(buffer, spot.intersection(area), name, dim);
            taken.push(spot);
        }
    }
    origin
}

/// Where in row `y` the name of a part at `place` stands; none where another name does.
fn spot(name: &str, place: Rect, y: u16, taken: &[Rect]) -> Option<Rect> {
    let width = (text_width(name) as u16).min(place.width.max(3));
    let mut spot = Rect {
        x: place.x + place.width.saturating_sub(width) / 2,
        y,
        width,
        height: 1,
    };
    // A blank between two names is worth the last letter.
    if taken.iter().any(|other| other.y == y && other.right() == spot.x) {
        spot.x += 1;
        spot.width = width.min(place.right().saturating_sub(spot.x));
    }
    (spot.width > 0 && !taken.iter().any(|other| other.intersects(spot))).then_some(spot)
}

/// Rows below the taxels for the names of parts that are below others.
fn names_below(picture: &Picture) -> u16 {
    let flat = &picture.hand.flat;
    let places = [&flat.across[0].places, &flat.down[0][0].places];
    // From the first taxel to the last one, across and down.
    let reaches: Vec<[(f32, f32); 2]> = (parts(&picture.hand).iter())
        .map(|part| {
            places.map(|places| {
                let places = || part.taxels.iter().map(|taxel| places[*taxel]);
                (
                    places().fold(f32::INFINITY, f32::min),
                    places().fold(0.0, f32::max),
                )
            })
        })
        .collect();
    let is_below = |[across, down]: &[(f32, f32); 2]| {
        let is_above = |[other, top]: &[(f32, f32); 2]| {
            other.0 < across.1 + 1.0 && across.0 < other.1 + 1.0 && top.0 < down.0
        };
        down.0 > 2.0 && reaches.iter().any(is_above)
    };
    u16::from(reaches.iter().any(is_below))
}

/// Rows below these for the joints' bars.
fn bars_below(picture: &Picture) -> u16 {
    u16::from(!picture.joints.is_empty())
}

/// The joints' bars below the parts of the hand that they move.
fn draw_bars(buffer: &mut Buffer, origin: Position, picture: &Picture, raster: &Raster, palette: Palette) {
    if bars_below(picture) == 0 {
        return;
    }
    for part in parts(&picture.hand) {
        let below = Rect {
            y: origin.y + raster.rows() + names_below(picture),
            height: 1,
            ..raster.around(&part.taxels, origin)
        };
        joints::draw_bars(buffer, below, picture, part.name, palette);
    }
}

#[cfg(test)]
mod tests;
