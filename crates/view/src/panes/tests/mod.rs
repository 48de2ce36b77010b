mod names;
mod told;

use super::*;
use crate::figures::Figures;
use crate::flat::Hand;
use crate::picture::{Joint, TaxelNow, Trace};
use ratatui::buffer::Buffer;
use std::sync::Arc;
use taxel_hand::{Fault, Freshness};
use taxel_skin::Layout;
use taxel_wire::status::ProblemStatus;
use taxel_wire::{RawTaxel, WireActuator};

const SIZES: [(u16, u16); 3] = [(80, 24), (120, 40), (200, 60)];

fn taxel(force: f32) -> TaxelNow {
    TaxelNow {
        raw: RawTaxel {
            counts: [1000, 2000, 3000],
            faults: 0,
            force,
            age_us: 4200,
            freshness: Freshness::Fresh,
            status: 0,
            contact: force > 0.0,
            repaired: false,
        },
        press: Some([0.0, 0.0, force]),
    }
}

/// A hand of this layout whose first taxel is pressed, with an actuator on it.
fn picture_of(name: &str) -> Picture {
    let hand = Layout::builtin(name).unwrap().geometry;
    let mut taxels = vec![taxel(0.0); hand.len()];
    taxels[0] = taxel(100.0);
    let (x, y) = (hand.taxels[0].x, hand.taxels[0].y);
    Picture {
        hand: Arc::new(Hand::new(hand)),
        taxels,
        actuators: vec![WireActuator {
            id: 0,
            x,
            y,
            level: 8,
            force: 100.0,
        }],
        joints: Vec::new(),
        scale: 100.0,
        held: false,
        threshold: 10.0,
        unit: "counts".into(),
        levels: 8,
        max_actuators: 16,
        method: "paper".into(),
        figures: Figures {
            rate_hz: 50.0,
            latency_p50_ms: Some(0.25),
            latency_p99_ms: Some(0.5),
            raw_bits_per_s: 576e3,
            image_bits_per_s: 8.8e3,
        },
        contacts: 1,
        missing: 1,
        faulty: 1,
        skipped: Some(0),
        calibrating: false,
        paused: false,
        gone: None,
        age_s: Some(0.02),
        note: None,
        problems: Some(Vec::new()),
        recorded: false,
        traces: Vec::new(),
        cursor: Some(0),
    }
}

fn picture() -> Picture {
    let joints = ["index", "middle", "ring", "thumb"].iter().flat_map(|finger| {
        (0..4).map(move |joint| Joint {
            name: format!("{finger} {joint}"),
            angle_rad: Some(0.5 * joint as f32),
        })
    });
    Picture {
        joints: joints.collect(),
        ..picture_of("allegro-uskin-15")
    }
}

fn heading() -> Heading {
    Heading {
        name: "scene ball-grasp".into(),
        detail: "1.5 of 10.0 s".into(),
        about: "a ball".into(),
    }
}

fn drawn_with(size: (u16, u16), picture: &Picture, screen: &Screen, palette: Palette) -> Buffer {
    let area = Rect::new(0, 0, size.0, size.1);
    let mut buffer = Buffer::empty(area);
    draw(&mut buffer, area, picture, screen, &heading(), palette, false);
    buffer
}

fn drawn(size: (u16, u16), picture: &Picture) -> Buffer {
    drawn_with(size, picture, &Screen::new(), Palette::True)
}

fn text(buffer: &Buffer) -> String {
    let rows = buffer.content().chunks(usize::from(buffer.area.width));
    rows.map(|row| row.iter().map(|c| c.symbol()).collect::<String>() + "\n")
        .collect()
}

#[test]
fn everything_is_there_on_a_small_and_on_a_large_terminal() {
    for size in SIZES {
        let text = text(&drawn(size, &picture()));
        for part in [
            "raw: 240 taxels",
            "tactile image: 16 actuators",
            "index",
            "thumb",
            "scene ball-grasp 1.5 of 10.0 s  a ball",
            "50.0 Hz",
            "p50 0.25 p99 0.50 ms",
            "level, 1 to 8",
            "576 → 8.8 kbit/s 65:1",
            "missing 1",
            "faulty 1",
            "index tip 0: force 100, in contact; counts 1000 2000 3000,",
            "4 ms old",
            " paper ",
            "? keys  q quit",
        ] {
            assert!(text.contains(part), "{size:?} lacks {part:?}:\n{text}");
        }
    }
}

#[test]
fn every_taxel_of_every_built_in_hand_is_drawn_once_and_nothing_is_cut_off() {
    for name in Layout::builtin_names() {
        let picture = picture_of(name);
        for (width, height) in SIZES {
            let area = Rect::new(0, 1, width, height - 1 - LINES);
            let Arrangement {
                raster,
                panels,
                lower,
            } = Arrangement::of(&picture, area);
            // 1,400 tactels and as many pixels beside them are more than the half blocks of the least terminal.
            let too_many = picture.hand.len() > 1000 && (width, height) == (80, 24);
            assert_eq!(raster.is_crowded(), too_many, "{name} {width}x{height}");
            let mut blocks = vec![0; picture.hand.len()];
            for y in 0..raster.height {
                for x in 0..raster.width {
                    if let Some(taxel) = raster.taxel_at(x, y) {
                        blocks[taxel] += 1;
                    }
                }
            }
            assert!(
                too_many || blocks.iter().all(|blocks| *blocks > 0),
                "{name} {width}x{height}: {blocks:?}"
            );
            for panel in panels {
                assert!(panel.width >= raster.width && panel.height >= HEAD + raster.rows());
                assert_eq!(panel.intersection(area), panel, "{name} {width}x{height}");
            }
            assert_eq!(
                panels[0].intersection(panels[1]).area(),
                0,
                "{name} {width}x{height}"
            );
            if let Some(lower) = lower {
                assert_eq!(lower.intersection(area), lower, "{name} {width}x{height}");
                assert_eq!(lower.intersection(panels[1]).area(), 0, "{name} {width}x{height}");
            }
            let text = text(&drawn((width, height), &picture));
            for part in crate::flat::parts(&picture.hand) {
                let name = &part.name[..part.name.len().min(3)];
                assert!(text.matches(name).count() >= 2, "{name} {width}x{height}\n{text}");
            }
        }
    }
}

#[test]
fn a_small_skin_and_what_is_below_it_take_a_large_terminal() {
    for name in ["uskin-module", "uskin-fingertip", "cpm-finger", "cyskin-triangle"] {
        for (width, height) in [(120, 40), (200, 60)] {
            let area = Rect::new(0, 1, width, height - 1 - LINES);
            let Arrangement { raster, lower, .. } = Arrangement::of(&picture_of(name), area);
            let lower = lower.unwrap();
            assert_eq!(lower.bottom(), area.bottom(), "{name} {width}x{height}");
            assert!(lower.height >= LEAST_LOWER, "{name} {width}x{height}: {lower:?}");
            let wide = raster.width >= area.width / 2 - 10;
            assert!(
                wide || raster.rows() >= area.height / 2,
                "{name} {width}x{height}: {} columns, {} rows",
                raster.width,
                raster.rows()
            );
        }
    }
}

#[test]
fn an_array_keeps_its_shape_where_there_is_room() {
    for size in SIZES.into_iter().skip(1) {
        let area = Rect::new(0, 1, size.0, size.1 - 1 - LINES);
        let raster = Arrangement::of(&picture_of("tekscan-6077"), area).raster;
        let shape = f32::from(raster.width) / f32::from(raster.height);
        assert!((shape / (50.0 / 28.0) - 1.0).abs() < 0.05, "{size:?}: {shape}");
    }
}

#[test]
fn a_hand_of_a_thousand_modules_shows_its_strongest_taxels() {
    let hand = Layout::resolve("grid:128x125").unwrap().geometry;
    let mut picture = picture_of("uskin-module");
    picture.taxels = vec![taxel(0.0); hand.len()];
    picture.taxels[7777] = taxel(100.0);
    picture.hand = Arc::new(Hand::new(hand));
    let buffer = drawn((80, 24), &picture);
    let brightest = Palette::True.force(1.0, 0);
    let lit = buffer
        .content()
        .iter()
        .filter(|cell| cell.bg == brightest || cell.fg == brightest);
    // Once in the skin, once under the actuator, and in the legend.
    assert!(lit.count() >= 3, "{}", text(&buffer));
}

#[test]
fn a_terminal_that_is_too_small_says_so_instead_of_breaking() {
    for size in [(30, 40), (80, 10), (1, 1)] {
        let text = text(&drawn(size, &picture()));
        assert!(size.0 < 30 || text.contains("needed"), "{text}");
    }
    let picture = picture();
    for width in (40..90).step_by(3) {
        for height in 14..45 {
            drawn((width, height), &picture);
        }
    }
}

#[test]
fn where_there_is_no_room_figures_are_left_out_and_none_is_cut() {
    let picture = Picture {
        cursor: Some(0),
        figures: Figures {
            rate_hz: 30.0,
            latency_p50_ms: Some(0.12),
            latency_p99_ms: Some(0.34),
            raw_bits_per_s: 345_600.0,
            image_bits_per_s: 12_300.0,
        },
        ..picture()
    };
    let lines = |width| {
        let text = text(&drawn((width, 14), &picture));
        let lines: Vec<String> = text.lines().map(|line| line.trim_end().to_owned()).collect();
        lines[lines.len() - 4..].to_vec()
    };
    let whole = lines(160).concat();
    let word = |word: &str| word.trim_end_matches([',', ';']).to_owned();
    let words = |line: &str| line.split_whitespace().map(word).collect::<Vec<_>>();
    let known = words(&lines(160).join(" "));
    for width in 40..160 {
        for line in lines(width) {
            for word in words(&line) {
                assert!(known.contains(&word), "{word} at {width}: {line}\n{whole}");
            }
        }
    }
    assert!(lines(40)[0].ends_with("actuators"), "{:?}", lines(40));
}

#[test]
fn force_has_the_same_colour_in_both_panels_and_the_actuator_its_level() {
    let buffer = drawn((80, 24), &picture());
    let brightest = Palette::True.force(1.0, 0);
    let lit: Vec<_> = (0..20u16)
        .flat_map(|y| (0..80u16).map(move |x| (x, y)))
        .filter(|(x, y)| buffer[(*x, *y)].bg == brightest)
        .collect();
    assert_eq!(
        lit.len(),
        4,
        "two columns in each panel: {lit:?}\n{}",
        text(&buffer)
    );
    let symbols: String = lit.iter().map(|(x, y)| buffer[(*x, *y)].symbol()).collect();
    assert_eq!(symbols.trim(), "8");
}

#[test]
fn broken_taxels_are_marked_and_told_in_words() {
    let mut picture = picture();
    picture.taxels[20].raw.faults = Fault::Dead as u16;
    picture.taxels[21].raw.freshness = Freshness::Missing;
    picture.cursor = Some(20);
    let text = text(&drawn((80, 24), &picture));
    let panels: String = text.lines().take(19).skip(3).collect();
    assert_eq!(panels.matches('?').count(), 1, "{text}");
    assert_eq!(panels.matches('x').count(), 1, "{text}");
    assert!(
        text.contains("index distal 4: dead, it reads 0 or 65535 on every axis; counts 1000 2000 3000"),
        "{text}"
    );
}

#[test]
fn skin_that_is_pulled_aside_has_arrows_until_they_are_switched_off() {
    let mut picture = picture();
    for (taxel, press) in [
        (0, [80.0, 0.0, 60.0]),
        (5, [0.0, -50.0, 50.0]),
        (10, [5.0, 0.0, 90.0]),
    ] {
        picture.taxels[taxel] = self::taxel(100.0);
        picture.taxels[taxel].press = Some(press);
    }
    let mut screen = Screen::new();
    let shown = text(&drawn_with((80, 24), &picture, &screen, Palette::True));
    let panels: String = shown.lines().take(19).skip(3).collect();
    for (arrow, count) in [("→", 1), ("↑", 1), ("↓", 0)] {
        assert_eq!(panels.matches(arrow).count(), count, "{arrow}\n{shown}");
    }
    screen.no_arrows = true;
    let shown = text(&drawn_with((80, 24), &picture, &screen, Palette::True));
    assert!(!shown.contains('↑'), "{shown}");
}

#[test]
fn a_terminal_without_colour_shows_shades() {
    let mut picture = picture();
    picture.taxels[20].raw.faults = Fault::Stuck as u16;
    for size in SIZES {
        let buffer = drawn_with(size, &picture, &Screen::new(), Palette::Shades);
        let text = text(&buffer);
        assert!(
            text.contains('█') && text.contains('·') && text.contains('x'),
            "{text}"
        );
        let coloured = |cell: &&ratatui::buffer::Cell| {
            cell.fg != ratatui::style::Color::Reset || cell.bg != ratatui::style::Color::Reset
        };
        assert_eq!(buffer.content().iter().filter(coloured).count(), 0, "{text}");
    }
}

#[test]
fn joints_are_bars_under_their_fingers_and_degrees_where_there_is_room() {
    let mut picture = picture();
    picture.joints[6].angle_rad = None;
    for (size, degrees) in [((80, 24), false), ((120, 40), true), ((200, 60), true)] {
        let text = text(&drawn(size, &picture));
        assert_eq!(text.matches("▁▃▅█").count(), 3, "{size:?}:\n{text}");
        assert_eq!(text.matches("▁▃?█").count(), 1, "{size:?}:\n{text}");
        let rows = text.matches("  0°  29°  57°  86°").count();
        assert_eq!(rows, if degrees { 3 } else { 0 }, "{size:?}:\n{text}");
        assert_eq!(text.contains("  0°  29°    ?  86°"), degrees, "{size:?}:\n{text}");
    }
    picture.joints.clear();
    let text = text(&drawn((120, 40), &picture));
    assert!(!text.contains('°') && !text.contains('▁'), "{text}");
}

#[test]
fn bars_of_joints_leave_the_names_of_parts_below_others_alone() {
    for name in Layout::builtin_names() {
        let mut picture = picture_of(name);
        let parts: Vec<String> = (crate::flat::parts(&picture.hand).iter())
            .map(|part| part.name.to_owned())
            .collect();
        let joints = parts.iter().flat_map(|part| {
            (0..3).map(move |joint| Joint {
                name: format!("{part} {joint}"),
                angle_rad: Some(0.0),
            })
        });
        picture.joints = joints.collect();
        for size in SIZES {
            let text = text(&drawn(size, &picture));
            // Above or below the skin, and as often at the image; degrees are behind names of their own.
            for part in &parts {
                let name = &part[..part.len().min(3)];
                assert!(text.matches(name).count() >= 2, "{name} {size:?}\n{text}");
            }
            let bars = text.lines().find(|line| line.contains('▁')).unwrap();
            assert_eq!(
                bars.matches("▁▁▁").count(),
                parts.len(),
                "{name} {size:?}\n{text}"
            );
            assert!(!bars.chars().any(char::is_alphabetic), "{name} {size:?}\n{text}");
        }
    }
}

#[test]
fn names_side_by_side_have_a_blank_between_them() {
    for name in Layout::builtin_names() {
        let picture = picture_of(name);
        let parts = crate::flat::parts(&picture.hand);
        let known: Vec<&str> = parts.iter().flat_map(|part| part.name.split(' ')).collect();
        for (width, height) in (40..90).flat_map(|width| [14, 20, 26].map(|height| (width, height))) {
            let text = text(&drawn((width, height), &picture));
            for word in text.lines().nth(2).unwrap().split_whitespace() {
                let is_known = known.iter().any(|known| known.starts_with(word));
                assert!(is_known, "{word} {name} {width}x{height}\n{text}");
            }
        }
    }
}

#[test]
fn on_a_narrow_terminal_keys_are_listed_before_digits_and_colours_are_explained() {
    for (size, others) in [
        ((80, 24), ["force 0", "digits"].as_slice()),
        ((60, 20), &["force 0"]),
        ((40, 14), &[]),
    ] {
        let shown = text(&drawn(size, &picture()));
        let last = shown.lines().last().unwrap().trim_end();
        assert!(last.ends_with("? keys  q quit"), "{shown}");
        for part in ["force 0", "digits"] {
            assert_eq!(last.contains(part), others.contains(&part), "{part}\n{shown}");
        }
    }
}

#[test]
fn every_key_is_listed_or_it_is_said_that_there_are_more() {
    let mut screen = Screen::new();
    screen.help = true;
    let shown = |size| text(&drawn_with(size, &picture(), &screen, Palette::True));
    let [daemon, _, both] = crate::keys::KEYS;
    for size in [(80, 24), (80, 20)] {
        let shown = shown(size);
        for (key, what) in daemon.iter().chain(both) {
            assert!(shown.contains(&format!("{key:8}{what}")), "{key}\n{shown}");
        }
        assert!(!shown.contains("more on"), "{shown}");
    }
    let shown = shown((40, 14));
    let listed = daemon.iter().chain(both);
    let listed = listed.filter(|(key, _)| shown.contains(&format!("│ {key:8}")));
    assert_eq!(listed.count(), 10, "{shown}");
    assert!(shown.contains(" 6 more on a terminal of 20 rows "), "{shown}");
    assert!(shown.contains("arrows  look at a taxel; Esc: at…"), "{shown}");
}

#[test]
fn an_extra_pane_has_its_room() {
    for (size, fits) in [((80, 24), true), ((120, 40), true), ((50, 24), false)] {
        let area = Rect::new(0, 0, size.0, size.1);
        let mut buffer = Buffer::empty(area);
        let picture = picture_of("cyskin-triangle");
        let extra = draw(
            &mut buffer,
            area,
            &picture,
            &Screen::new(),
            &heading(),
            Palette::True,
            true,
        );
        assert_eq!(extra.is_some(), fits, "{size:?}");
        if let Some(extra) = extra {
            let blank = extra.positions().all(|at| buffer[at].symbol() == " ");
            assert!(blank, "{}", text(&buffer));
        }
    }
}
