//! Names of parts stand at their own part.

use super::*;
use ratatui::buffer::Cell;
use ratatui::style::Color;

/// A hand of 4 x 4 modules, each with a part and a place in the image.
fn hand_of(modules: &[(&str, [u16; 2])]) -> Picture {
    let side = |axis: usize| modules.iter().map(|(_, at)| at[axis] + 4).max().unwrap_or(0);
    let head = format!(
        "name = \"own\"\nbuses = [\"can0\"]\nimage = {{ width = {}, height = {} }}\n",
        side(0),
        side(1)
    );
    let modules = modules.iter().enumerate().map(|(number, (part, [x, y]))| {
        format!(
            "[[module]]\nname = \"m{number}\"\npart = \"{part}\"\nbus = \"can0\"\nboard = {number}\nprotocol = \"uskin-l2\"\nat = [{x}, {y}]\n"
        )
    });
    let layout = Layout::parse(&(head + &modules.collect::<String>()), "own.toml").unwrap();
    Picture {
        actuators: Vec::new(),
        taxels: vec![taxel(0.0); layout.len()],
        hand: Arc::new(Hand::new(layout.geometry)),
        ..picture_of("uskin-module")
    }
}

/// The characters of the raw skin's panel and of what is below, row by row; one for each column.
fn left_panel(picture: &Picture, size: (u16, u16)) -> Vec<Vec<Cell>> {
    let buffer = drawn(size, picture);
    let rows: Vec<&[Cell]> = buffer.content().chunks(usize::from(size.0)).collect();
    // The image is right of the skin, or below it.
    let title: String = rows[1].iter().map(|cell| cell.symbol()).collect();
    let width = title.find("tactile image").unwrap_or(title.len());
    rows.iter().map(|row| row[..width].to_vec()).collect()
}

/// The row and the first column of a name.
fn place_of(panel: &[Vec<Cell>], name: &str) -> Option<(usize, usize)> {
    let named: Vec<char> = name.chars().collect();
    panel.iter().enumerate().find_map(|(y, row)| {
        let letters: Vec<char> = row
            .iter()
            .filter_map(|cell| cell.symbol().chars().next())
            .collect();
        let column = letters
            .windows(named.len())
            .position(|letters| letters == named)?;
        Some((y, column))
    })
}

fn is_skin(cell: &Cell) -> bool {
    ["▀", "▄"].contains(&cell.symbol()) || matches!(cell.bg, Color::Rgb(..))
}

#[test]
fn a_part_that_is_listed_before_those_above_it_is_named_below() {
    let picture = hand_of(&[("palm", [0, 4]), ("index", [0, 0]), ("middle", [4, 0])]);
    for size in SIZES {
        let panel = left_panel(&picture, size);
        let [index, middle, palm] = ["index", "middle", "palm"].map(|name| place_of(&panel, name));
        let [Some(index), Some(middle), Some(palm)] = [index, middle, palm] else {
            panic!("{size:?}: {index:?} {middle:?} {palm:?}");
        };
        assert!(index.0 == 2 && middle.0 == 2 && index.1 < middle.1, "{size:?}");
        assert!(
            palm.0 > 2 && is_skin(&panel[palm.0 - 1][palm.1]),
            "{size:?}: {palm:?}"
        );
    }
}

#[test]
fn no_name_stands_on_the_skin_of_another_part() {
    let picture = hand_of(&[("upper", [0, 0]), ("between", [0, 4]), ("lower", [0, 8])]);
    let plain = hand_of(&[("a", [0, 0]), ("b", [0, 4]), ("c", [0, 8])]);
    for size in SIZES {
        let (panel, plain) = (left_panel(&picture, size), left_panel(&plain, size));
        let skin = |panel: &[Vec<Cell>]| panel.iter().flatten().filter(|cell| is_skin(cell)).count();
        assert_eq!(skin(&panel), skin(&plain), "{size:?}");
        assert!(place_of(&panel, "upper").is_some_and(|(y, _)| y == 2));
        assert_eq!(place_of(&panel, "between"), None, "between both there is no room");
        let (y, x) = place_of(&panel, "lower").unwrap();
        assert!(is_skin(&panel[y - 1][x]), "{size:?}: {y} {x}");
    }
}

#[test]
fn wide_letters_are_over_the_middle_of_their_part_and_meet_no_other_name() {
    let picture = hand_of(&[
        ("親指", [0, 0]),
        ("左手の人差し指の先の皮膚", [4, 0]),
        ("指", [8, 0]),
    ]);
    for size in SIZES {
        let panel = left_panel(&picture, size);
        let row = &panel[2];
        let first = |symbol: &str| row.iter().position(|other| other.symbol() == symbol);
        // A blank is behind each of them, which is its right half.
        let (thumb, other, last) = (first("親").unwrap(), first("左").unwrap(), first("指").unwrap());
        assert!(last == thumb + 2 && other >= thumb + 4, "{size:?}");
        let skin: Vec<usize> = (0..row.len()).filter(|x| is_skin(&panel[3][*x])).collect();
        let runs: Vec<&[usize]> = skin.chunk_by(|a, b| a + 1 == *b).collect();
        // Where there is no room for gaps, parts are beside each other.
        let parts = match runs[..] {
            [_, _, _] => runs,
            _ => skin.chunks(skin.len() / 3).collect(),
        };
        let middle = parts[0][parts[0].len() / 2];
        assert!(middle.abs_diff(thumb + 2) <= 1, "{size:?}: {thumb} over {middle}");
        let alone = row.iter().rposition(|cell| cell.symbol() == "指").unwrap();
        assert!(parts[2].contains(&alone), "{size:?}: {alone} in {:?}", parts[2]);
    }
}
