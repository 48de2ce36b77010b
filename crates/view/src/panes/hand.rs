//! The skin as it feels, and the tactile image made of it.

use super::traces::COLOURS;
use crate::colour::Palette;
use crate::paint::{Ink, paint};
use crate::picture::{Condition, Picture};
use crate::raster::Raster;
use crate::screen::Screen;
use ratatui::buffer::Buffer;
use ratatui::layout::Position;
use ratatui::style::Color;
use taxel_hand::Geometry;

/// The grey of a taxel that feels nothing: modules differ from their neighbours.
fn idle(hand: &Geometry, taxel: usize) -> u8 {
    let module = hand.module_of(taxel);
    let before = (hand.modules.iter()).take_while(|m| m.first_taxel != module.first_taxel);
    match before.filter(|m| m.part == module.part).count() % 2 {
        0 => 32,
        _ => 50,
    }
}

pub(super) fn skin(
    buffer: &mut Buffer,
    origin: Position,
    raster: &Raster,
    picture: &Picture,
    screen: &Screen,
    palette: Palette,
) {
    let idles: Vec<u8> = (0..picture.hand.len())
        .map(|taxel| idle(&picture.hand, taxel))
        .collect();
    paint(buffer, origin, raster, palette, &|taxel| {
        let now = picture.taxels.get(taxel);
        let mut ink = match now.map(|now| now.condition()) {
            Some(Condition::Force(force)) => {
                // Noise would be sent over the line for nothing.
                let felt = if force < 0.5 * picture.threshold {
                    0.0
                } else {
                    force
                };
                let share = felt / picture.scale;
                let arrow = now
                    .filter(|_| !screen.no_arrows)
                    .and_then(|now| now.shear(picture.threshold));
                Ink {
                    share,
                    colour: palette.force(share, idles[taxel]),
                    letter: arrow
                        .and_then(|arrow| arrow.chars().next())
                        .map(|arrow| (arrow, palette.ink(share))),
                }
            }
            Some(Condition::Faulty) => Ink {
                share: -1.0,
                colour: palette.rgb(95, 0, 0),
                letter: Some(('x', palette.rgb(255, 95, 95))),
            },
            Some(Condition::Missing) => Ink {
                share: -2.0,
                colour: palette.rgb(0, 0, 95),
                letter: Some(('?', palette.rgb(135, 135, 255))),
            },
            None => Ink {
                share: 0.0,
                colour: palette.force(0.0, idles[taxel]),
                letter: None,
            },
        };
        if let Some(place) = screen.chosen.iter().position(|chosen| *chosen == taxel) {
            let [r, g, b] = COLOURS[place % COLOURS.len()];
            mark(
                &mut ink,
                char::from(b'a' + place as u8),
                palette.rgb(r, g, b),
                raster,
                palette,
            );
        }
        if screen.cursor == Some(taxel) {
            mark(&mut ink, '◆', palette.rgb(0, 255, 255), raster, palette);
        }
        ink
    });
}

/// A letter on a taxel; where there is no room for one, the taxel has its colour.
fn mark(ink: &mut Ink, letter: char, colour: Color, raster: &Raster, palette: Palette) {
    if !raster.has_letters() && palette != Palette::Shades {
        ink.colour = colour;
    } else {
        let bright = ink.share > 0.3 && palette != Palette::Shades;
        ink.letter = Some((letter, if bright { palette.ink(1.0) } else { colour }));
    }
}

pub(super) fn image(
    buffer: &mut Buffer,
    origin: Position,
    raster: &Raster,
    picture: &Picture,
    palette: Palette,
) {
    let mut pressed = vec![None; picture.hand.len()];
    for actuator in &picture.actuators {
        // An actuator of a display at fixed places may stand beside the skin.
        if let Some(taxel) = picture.hand.taxel_at(actuator.x, actuator.y) {
            pressed[taxel] = Some(actuator);
        }
    }
    paint(buffer, origin, raster, palette, &|taxel| match pressed[taxel] {
        Some(actuator) => {
            let share = f64::from(actuator.force) / picture.scale;
            let digit = match actuator.level {
                level @ 0..=9 => char::from(b'0' + level as u8),
                // As in hexadecimal, and on.
                level @ 10..=35 => char::from(b'a' + (level - 10) as u8),
                _ => '+',
            };
            Ink {
                share,
                colour: palette.force(share, idle(&picture.hand, taxel)),
                letter: Some((digit, palette.ink(share))),
            }
        }
        None => Ink {
            share: 0.0,
            colour: palette.force(0.0, idle(&picture.hand, taxel)),
            letter: None,
        },
    });
}
