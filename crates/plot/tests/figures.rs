//! What a figure promises to those who look at it and to those who read its numbers.

use std::collections::BTreeSet;
use taxel_plot::{Axis, Chart, Picture, PlotError, Sheet};

fn chart() -> Chart {
    Chart::new("A & B", Axis::new("time, s"), Axis::new("force"))
}

#[test]
fn the_same_sheet_is_the_same_bytes() {
    let sheet = || {
        Sheet::new("t")
            .chart(chart().line("a", [(0.0, 1.0), (1.0, 2.0)]))
            .svg()
    };
    assert_eq!(sheet().unwrap(), sheet().unwrap());
}

#[test]
fn a_figure_has_a_dark_side_and_says_names_as_they_are() {
    let chart = chart()
        .line("<felt>", [(0.0, 1.0), (1.0, 2.0)])
        .line("shown", [(0.0, 2.0)]);
    let svg = Sheet::new("").chart(chart).svg().unwrap();
    for part in [
        "prefers-color-scheme:dark",
        "A &amp; B",
        "&lt;felt&gt;",
        "shown",
        "time, s",
    ] {
        assert!(svg.contains(part), "{part}\n{svg}");
    }
    assert!(svg.ends_with("</svg>\n"));
}

#[test]
fn a_name_has_one_colour_on_the_whole_sheet() {
    let one = |name: &str| chart().line(name, [(0.0, 0.0), (1.0, 1.0)]);
    let svg = Sheet::new("")
        .chart(one("a"))
        .chart(one("b"))
        .chart(one("a"))
        .svg()
        .unwrap();
    let colour = |panel: usize| {
        let line = svg
            .lines()
            .filter(|l| l.starts_with("<polyline") && l.contains("stroke-width=\"7\""));
        let line = line.collect::<Vec<_>>()[panel].to_owned();
        line.split("stroke=\"").nth(1).unwrap()[..7].to_owned()
    };
    assert_eq!(colour(0), colour(2));
    assert_ne!(colour(0), colour(1));
}

#[test]
fn a_gap_is_drawn_as_a_gap() {
    let points = [(0.0, 1.0), (1.0, 1.0), (2.0, f64::NAN), (3.0, 1.0), (4.0, 1.0)];
    let svg = Sheet::new("").chart(chart().line("a", points)).svg().unwrap();
    assert_eq!(svg.matches("stroke-width=\"7\"").count(), 2);
}

#[test]
fn steps_hold_each_value_until_the_next_and_are_numbered_as_they_were_given() {
    let points = [(0.0, 0.0), (1.0, 1.0), (2.0, 1.0)];
    let sheet = Sheet::new("").chart(chart().steps("a", points));
    let svg = sheet.svg().unwrap();
    let line = svg.lines().find(|l| l.contains("stroke-width=\"7\"")).unwrap();
    let places = line.split("points=\"").nth(1).unwrap().split('"').next().unwrap();
    let places: Vec<(i32, i32)> = places
        .split_whitespace()
        .map(|place| place.split_once(',').unwrap())
        .map(|(x, y)| (x.parse().unwrap(), y.parse().unwrap()))
        .collect();
    let [a, held, b, c] = places[..] else {
        panic!("{places:?}")
    };
    assert!(held == (b.0, a.1) && b.1 == c.1 && b.1 < a.1, "{places:?}");
    let rows = sheet
        .csv()
        .lines()
        .filter(|row| row.starts_with("A & B,line,a,"))
        .count();
    assert_eq!(rows, points.len());
}

#[test]
fn titles_and_captions_stay_within_their_panel() {
    let long = "optimal: middle proximal disengages (13.72 s)";
    let picture = || Picture::grey(long, 4, [0; 16]).caption(long);
    let svg = Sheet::new(long.repeat(2))
        .columns(3)
        .panel_size(140, 120)
        .picture(picture())
        .picture(picture())
        .chart(Chart::new(long, Axis::new(""), Axis::new("")))
        .svg()
        .unwrap();
    let texts = svg.split("<text").skip(1);
    let mut widest: f64 = 0.0;
    for text in texts.filter(|text| text.contains("optimal")) {
        let size = text
            .split("font-size=\"")
            .nth(1)
            .unwrap()
            .split('"')
            .next()
            .unwrap();
        let words = text.split('>').nth(1).unwrap().split('<').next().unwrap().trim();
        // Figures are drawn four times as large.
        let width = 0.56 * size.parse::<f64>().unwrap() / 4.0 * words.chars().count() as f64;
        assert!(width <= if words.len() > 60 { 460.0 } else { 141.0 }, "{text}");
        widest = widest.max(width);
    }
    assert!(widest > 100.0);
}

#[test]
fn every_kind_of_mark_survives_data_that_nothing_can_be_drawn_of() {
    for values in [
        vec![],
        vec![f64::NAN],
        vec![f64::INFINITY, -1.0],
        vec![0.0; 3],
        vec![1e300, -1e300],
    ] {
        for axis in [Axis::new(""), Axis::new("").log(), Axis::of_names("", ["a"])] {
            let points = || values.iter().map(|v| (*v, *v));
            let chart = Chart::new("", axis.clone(), Axis::new("").log())
                .line("a", points())
                .steps("a", points())
                .points("b", points())
                .ellipse("b", points())
                .band("a", values.iter().map(|v| (*v, *v, *v)))
                .bars("c", values.iter().copied())
                .boxes("d", [values.clone()])
                .at_y("y", -1.0);
            let sheet = Sheet::new("")
                .chart(chart)
                .picture(Picture::heat("h", 1, [f64::NAN]));
            let svg = sheet.svg().unwrap();
            assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
            assert!(sheet.csv().lines().count() >= 2);
        }
    }
}

#[test]
fn all_numbers_are_beside_the_figure_as_they_were_given() {
    let names = Axis::of_names("", ["index", "thumb"]);
    let sheet = Sheet::new("")
        .chart(
            chart()
                .line("felt", [(0.1, 1.0 / 3.0), (0.2, f64::NAN)])
                .at_y("engaging", 0.1),
        )
        .chart(
            Chart::new("", names, Axis::new(""))
                .bars_within("n", [(1.0, 0.5, 2.0)])
                .boxes("b", [vec![], vec![4.0]]),
        )
        .picture(Picture::rgb("p", 2, [Some([255, 0, 1]), None]))
        .picture(
            Picture::rgb("q", 2, [Some([255, 0, 1]), None])
                .numbers("x", [Some(-0.5), None])
                .numbers("y", [Some(2.0), None]),
        );
    assert_eq!(
        sheet.csv(),
        "panel,kind,series,x,y,low,high,value\n\
         A & B,line,felt,0.1,0.3333333333333333,,,\n\
         A & B,line,felt,0.2,,,,\n\
         A & B,threshold,engaging,,0.1,,,\n\
         2,bar,n,index,1,0.5,2,\n\
         2,sample,b,thumb,4,,,\n\
         p,cell,,0,0,,,#FF0001\n\
         p,cell,,1,0,,,\n\
         q,cell,x,0,0,,,-0.5\n\
         q,cell,x,1,0,,,\n\
         q,cell,y,0,0,,,2\n\
         q,cell,y,1,0,,,\n"
    );
}

#[test]
fn what_cannot_be_drawn_is_refused_by_name() {
    let odd = Sheet::new("").picture(Picture::grey("thumb", 4, [0; 7])).svg();
    assert_eq!(
        odd.unwrap_err().to_string(),
        "picture \"thumb\": 7 cells are no rows of 4; give whole rows"
    );
    assert!(matches!(Sheet::new("f").svg(), Err(PlotError::Empty { title }) if title == "f"));
}

#[test]
fn a_tactile_image_costs_what_is_lit() {
    let mut pixels = [0; 256];
    pixels[17] = 255;
    let svg = Sheet::new("")
        .picture(Picture::grey("", 16, pixels))
        .svg()
        .unwrap();
    assert_eq!(
        svg.matches("<rect").count(),
        3,
        "paper, black, one actuator: {svg}"
    );
}

/// Top, width and height of each frame around the cells of a picture, pixels.
fn frames(svg: &str) -> Vec<(f64, f64, f64)> {
    let lines = svg.lines().filter(|line| line.starts_with("<polyline"));
    let corners = lines.filter_map(|line| {
        let places = line.split("points=\"").nth(1)?.split('"').next()?;
        let places: Vec<(f64, f64)> = places
            .split_whitespace()
            .filter_map(|place| place.split_once(','))
            .filter_map(|(x, y)| Some((x.parse().ok()?, y.parse().ok()?)))
            .collect();
        let [from, _, to, _, again] = places[..] else {
            return None;
        };
        // Figures are drawn four times as large.
        (from == again).then_some((from.1 / 4.0, (to.0 - from.0) / 4.0, (to.1 - from.1) / 4.0))
    });
    corners.collect()
}

/// Width and height of the whole sheet, pixels.
fn size(svg: &str) -> (f64, f64) {
    let side = |name: &str| -> f64 {
        let value = svg.split(&format!("{name}=\"")).nth(1).unwrap();
        value.split('"').next().unwrap().parse().unwrap()
    };
    (side("width"), side("height"))
}

#[test]
fn cells_are_large_enough_to_see_in_skins_of_any_shape() {
    for (height, width) in [
        (1, 64),
        (64, 1),
        (4, 4),
        (16, 16),
        (50, 28),
        (128, 128),
        (1, 256),
        (3, 200),
        (256, 2),
    ] {
        let sheet = Sheet::new("t").columns(3).panel_size(250, 280);
        let picture = || Picture::grey("engages", width, vec![0; width * height]).caption("strongest 5");
        let svg = (0..6)
            .fold(sheet, |sheet, _| sheet.picture(picture()))
            .svg()
            .unwrap();
        let frames = frames(&svg);
        assert_eq!(frames.len(), 6, "{height} x {width}");
        for (_, w, h) in &frames {
            let cell = (w / width as f64, h / height as f64);
            assert!(cell.0 >= 3.0 && cell.1 >= 3.0, "{height} x {width}: {cell:?}");
            assert!(*w >= 20.0 && *h >= 20.0, "{height} x {width}: {w} x {h}");
        }
        let (wide, high) = size(&svg);
        assert!(wide <= 1300.0, "{height} x {width}: {wide}");
        // Nothing is left empty: a title and a caption are 42 pixels, a gap 12, the sheet's title 38.
        let tops: BTreeSet<i64> = frames.iter().map(|(top, ..)| *top as i64).collect();
        assert!([2, 6].contains(&tops.len()), "{height} x {width}: rows are whole");
        let wanted = 38.0 + tops.len() as f64 * (frames[0].2 + 42.0 + 12.0);
        assert!(
            (high - wanted).abs() <= 1.0,
            "{height} x {width}: {high}, not {wanted}"
        );
    }
}

#[test]
fn a_cell_without_a_colour_is_hatched_and_neither_the_page_nor_a_colour() {
    let cells = |empty: &[usize]| {
        let empty = empty.to_vec();
        let cells = (0..4).map(move |n| (!empty.contains(&n)).then_some([0, 0, 0]));
        Sheet::new("").picture(Picture::rgb("", 2, cells)).svg().unwrap()
    };
    let hatches = |svg: &str| {
        svg.lines()
            .filter(|line| line.starts_with("<polyline") && line.matches(',').count() == 2)
            .count()
    };
    let painted = |svg: &str| svg.matches("fill=\"#000000\"").count();
    let grounds = |svg: &str| {
        svg.lines()
            .filter(|line| line.starts_with("<rect") && line.contains("\"#E2D2B0\""))
            .count()
    };
    // Neighbours in a row are one rectangle; neighbours up to the right are one line.
    for (empty, lines, rectangles, empty_rectangles) in [
        (&[][..], 0, 2, 0),
        (&[3], 1, 2, 1),
        (&[1, 2], 1, 2, 2),
        (&[0, 1], 2, 1, 1),
        (&[0, 3], 2, 2, 2),
    ] {
        let svg = cells(empty);
        assert_eq!(
            (hatches(&svg), painted(&svg), grounds(&svg)),
            (lines, rectangles, empty_rectangles),
            "{empty:?}\n{svg}"
        );
    }
}

#[test]
fn names_of_a_chart_stay_within_it() {
    let long = "force of the strongest taxel of the whole hand above its own baseline, counts";
    let chart = Chart::new("", Axis::new(long), Axis::new(long))
        .line(long, [(0.0, 0.0), (1.0, 1.0)])
        .line("other", [(0.0, 1.0), (1.0, 0.0)])
        .at_y("a threshold at the top", 1.0);
    let svg = Sheet::new("").panel_size(240, 200).chart(chart).svg().unwrap();
    let number = |text: &str, name: &str| -> f64 {
        let value = text.split(&format!(" {name}=\"")).nth(1).unwrap();
        value.split('"').next().unwrap().parse::<f64>().unwrap() / 4.0
    };
    let mut seen = 0;
    for text in svg.split("<text").skip(1) {
        let words = text.split('>').nth(1).unwrap().split('<').next().unwrap().trim();
        let length = 0.56 * number(text, "font-size") * words.chars().count() as f64;
        let (x, y) = (number(text, "x"), number(text, "y"));
        let before = match text {
            _ if text.contains("text-anchor=\"end\"") => length,
            _ if text.contains("text-anchor=\"middle\"") => length / 2.0,
            _ => 0.0,
        };
        let (along, side) = if text.contains("rotate(") {
            (y, 224.0)
        } else {
            (x, 264.0)
        };
        let (from, to) = if text.contains("rotate(") {
            (along - (length - before), along + before)
        } else {
            (along - before, along + length - before)
        };
        assert!(from >= 0.0 && to <= side, "{words}: {from} to {to} of {side}");
        seen += 1;
    }
    assert!(seen > 8, "{svg}");
}
