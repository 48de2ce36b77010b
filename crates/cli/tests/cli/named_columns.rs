//! Columns of a csv that are taken, or refused, by what their names say.

use crate::{fails, succeeds};
use std::fs;
use tempfile::TempDir;

/// The cell of the last image that is not dark.
fn shown_at(dir: &TempDir, cells: usize) -> Option<usize> {
    let images = fs::read_to_string(dir.path().join("o.csv")).unwrap();
    let greys: Vec<&str> = images.lines().last().unwrap().split(',').collect();
    greys[greys.len() - cells..].iter().position(|grey| *grey != "0")
}

#[test]
fn boards_in_names_are_looked_at_also_where_a_module_has_none() {
    let dir = TempDir::new().unwrap();
    let layout = |first: u8, second: u8| {
        let module = |name: &str, board: &str, protocol: &str, x: u8| {
            format!(
                "[[module]]\nname = \"{name}\"\npart = \"p\"\n{board}protocol = \"{protocol}\"\nat = [{x}, 0]\n\
                 order = [[0, 1]]\n"
            )
        };
        let wired = |board: u8| format!("bus = \"can0\"\nboard = {board}\n");
        let text = "name = \"three\"\nimage = { width = 6, height = 1 }\nbuses = [\"can0\"]\n".to_owned()
            + &module("a", &wired(first), "uskin-l2", 0)
            + &module("off", "", "offline", 2)
            + &module("b", &wired(second), "uskin-l2", 4);
        fs::write(dir.path().join("three.toml"), text).unwrap();
    };
    // Taxel 0 of one of the boards is pressed.
    let write = |boards: [u8; 3], pressed: usize| {
        let names = boards.map(|b| format!("{b}B0X,{b}B0Y,{b}B0Z,{b}B1X,{b}B1Y,{b}B1Z"));
        let mut text = format!("t_s,{}\n", names.join(","));
        for i in 0..120 {
            let mut counts = [20000 + i % 3; 18];
            counts[6 * pressed + 2] += if i < 90 { 0 } else { 900 };
            let counts: Vec<String> = counts.iter().map(i32::to_string).collect();
            text += &format!("{},{}\n", f64::from(i) / 30.0, counts.join(","));
        }
        fs::write(dir.path().join("in.csv"), text).unwrap();
    };
    let args = ["compress", "in.csv", "--layout", "three.toml", "--out", "o.csv"];
    let as_modules = Some("taken for the modules of layout three in order");
    for (wired, named, x, told) in [
        ([5, 1], [0, 1, 2], [0, 2, 4], None),
        ([5, 1], [1, 2, 3], [0, 2, 4], as_modules),
        ([1, 0], [0, 1, 2], [0, 2, 4], as_modules),
        (
            [5, 1],
            [5, 9, 1],
            [0, 2, 4],
            Some("and 9 for module off, which has no board"),
        ),
        (
            [2, 1],
            [1, 2, 3],
            [4, 0, 2],
            Some("and 3 for module off, which has no board"),
        ),
    ] {
        layout(wired[0], wired[1]);
        for (pressed, x) in x.into_iter().enumerate() {
            write(named, pressed);
            let (_, err) = succeeds(&dir, &args);
            let case = format!("boards {wired:?}, columns of {named:?}, the {pressed}. is pressed: {err}");
            assert_eq!(told.is_some(), err.contains("the boards in the names"), "{case}");
            assert!(err.contains(told.unwrap_or_default()), "{case}");
            assert_eq!(shown_at(&dir, 6), Some(x), "{case}");
        }
    }
    layout(5, 1);
    write([7, 8, 9], 0);
    let err = fails(&dir, &args, 1);
    let wanted = "columns are of boards 7, 8, 9, and the boards of layout three are 5, 1 (any others for off, without a board); \
                  name them so, or by the modules in order, 0 to 2";
    assert!(err.contains(wanted), "{err}");
}

#[test]
fn magnitudes_whose_numbers_descend_are_taken_by_them_as_counts_are() {
    let dir = TempDir::new().unwrap();
    let args = [
        "compress", "in.csv", "--rate", "30", "--layout", "grid:3x4", "--out", "o.csv",
    ];
    for (axes, pressed, rest) in [(&[""][..], "50", "0"), (&["_x", "_y", "_z"], "29000", "20000")] {
        let taxels = || (0..12).rev();
        let names: Vec<String> = taxels()
            .flat_map(|n| axes.iter().map(move |axis| format!("s{n}{axis}")))
            .collect();
        let line = |at| -> String {
            let cells = taxels().flat_map(|n| vec![if Some(n) == at { pressed } else { rest }; axes.len()]);
            cells.collect::<Vec<_>>().join(",") + "\n"
        };
        let text = names.join(",") + "\n" + &line(None).repeat(90) + &line(Some(2)).repeat(9);
        fs::write(dir.path().join("in.csv"), text).unwrap();
        let (_, err) = succeeds(&dir, &args);
        let told = "its columns stand in the order of descending numbers; they are taken by the numbers in their names, s0, s1, s2";
        assert_eq!(err.contains(told), axes.len() == 1, "{err}");
        assert_eq!(shown_at(&dir, 12), Some(2));
    }
}
