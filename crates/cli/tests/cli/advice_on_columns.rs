//! What is said of columns of a table that are read otherwise than they were meant.

use crate::{fails, succeeds, words};
use tempfile::TempDir;

#[test]
fn columns_of_a_table_that_are_no_taxels_are_told() {
    let dir = TempDir::new().unwrap();
    let write = |text: &str| std::fs::write(dir.path().join("in.csv"), text).unwrap();
    fn compress<'a>(options: &[&'a str]) -> Vec<&'a str> {
        [&["compress", "in.csv", "--out", "o.npz", "--rate", "30"], options].concat()
    }
    write(",timestamp,a,b,c,d\n0,1.7e9,0,0,5,0\n1,1.8e9,0,0,5,0\n");
    let (_, err) = succeeds(&dir, &compress(&["--layout", "grid:2x2"]));
    assert!(
        err.contains("in.csv: left out, since no taxels: column \"\"\n"),
        "{err}"
    );
    let err = fails(&dir, &compress(&["--layout", "grid:2x3"]), 1);
    assert!(
        err.contains("has 4 taxels (\"a\" to \"d\"), and 2 x 3 are 6"),
        "{err}"
    );
    let numbers = |count: usize| vec!["7"; count].join(",");
    write(&format!("{}\n{0}\n", numbers(48)));
    let err = fails(&dir, &compress(&["--layout", "uskin-module"]), 1);
    assert!(
        err.contains("has 48 taxels and layout uskin-module has 16, a third; say with --columns"),
        "{err}"
    );
    let names: Vec<String> = (1..=16)
        .flat_map(|taxel| ["x", "y", "z"].map(|axis| format!("txl{taxel}_{axis}")))
        .collect();
    write(&format!("{}\n{}\n", names.join(","), numbers(48)));
    let err = fails(&dir, &compress(&[]), 1);
    assert!(
        err.contains("has 16 taxels (\"txl1_x\" to \"txl16_z\") and")
            && err.contains("row by row: --layout grid:4x4"),
        "{err}"
    );
    for (layout, is_told) in [("uskin-module", true), ("grid:4x4", false)] {
        let (_, err) = succeeds(&dir, &compress(&["--layout", layout]));
        let told = "XELA's server, whose names these are, numbers taxels row by row, --layout grid:4x4";
        assert_eq!(err.contains(told), is_told, "{err}");
    }
    // Also where it is repeated, and where frames are copied as they are.
    let in_order = "whose order is a.reshape(len(a), -1, 4, 3)[:, :, [0, 2, 1, 3]].reshape(a.shape)";
    for args in [
        &compress(&["--layout", "allegro-uskin-15", "--tile"])[..],
        &[
            "convert",
            "in.csv",
            "o.npz",
            "--layout",
            "uskin-module",
            "--rate",
            "30",
        ],
        &[
            "convert",
            "in.csv",
            "o.log",
            "--layout",
            "uskin-module",
            "--rate",
            "30",
        ],
    ] {
        let (_, err) = succeeds(&dir, args);
        assert!(err.contains(in_order), "{args:?}: {err}");
    }
    let play = ["replay", "in.csv", "--to", "log:o.log", "--layout", "grid:4x4"];
    let err = fails(&dir, &play, 1);
    assert!(
        err.contains("of one 4x4 module uskin-module, and put the taxels into its order: a.reshape(len(a)"),
        "{err}"
    );
    write("0,1,2,3\n5,6,7,9\n");
    let (_, err) = succeeds(&dir, &compress(&["--layout", "grid:2x2"]));
    assert!(
        err.contains("in.csv: its first line, 0, 1, 2, .., is taken for a frame; where these are pandas' names of columns"),
        "{err}"
    );
    write("# mine\n0,1,2,3\n5,6,7,9\n");
    let (_, err) = succeeds(&dir, &compress(&["--layout", "grid:2x2"]));
    assert!(err.contains("cut it off (`tail -n +3`)"), "{err}");
    // The sum of all forces is none.
    write("fx1,fy1,fz1,fx2,fy2,fz2,gfx,gfy,gfz\n1,2,3,4,5,6,5,7,9\n");
    let err = fails(&dir, &compress(&["--layout", "grid:1x2"]), 1);
    assert!(
        err.contains("has 3 taxels (\"fx1\" to \"gfz\") and layout grid:1x2 has 2"),
        "{err}"
    );
    write("fx,fy,fz\n1,2,3\n");
    let err = fails(&dir, &compress(&["--layout", "grid:1x3"]), 1);
    assert!(
        err.contains(
            "counts x y z by the names of its columns; without its header (`tail -n +2`) all are magnitudes"
        ),
        "{err}"
    );
}

#[test]
fn a_first_column_that_may_be_time_is_told() {
    let dir = TempDir::new().unwrap();
    let table = |line: &dyn Fn(usize) -> String| {
        let lines: Vec<String> = (0..30).map(line).collect();
        std::fs::write(dir.path().join("in.csv"), lines.concat()).unwrap();
    };
    let compress = |layout| ["compress", "in.csv", "--out", "o.npz", "--layout", layout];
    let told = "its first column rises from line to line, as times do: of a .csv --time-column s";
    table(&|t| {
        format!(
            "{} {} {}\n",
            0.01 * t as f64 + 0.001 * (t % 3) as f64,
            t % 5,
            t % 7
        )
    });
    let err = fails(&dir, &compress("grid:1x2"), 1);
    assert!(err.contains(told), "{err}");
    let (_, err) = succeeds(&dir, &compress("grid:1x3"));
    assert!(err.contains(told), "{err}");
    let (_, err) = succeeds(
        &dir,
        &[&compress("grid:1x2")[..], &["--time-column", "s"]].concat(),
    );
    assert!(!err.contains("rises"), "{err}");
    // All are pressed more and more; one is, at last.
    for line in [
        &|t: usize| format!("{t} {} {}\n", 2 * t, t % 3) as String,
        &|t: usize| format!("{} {} {}\n", t * t * t * t * t, t % 5, t % 3) as String,
    ] as [&dyn Fn(usize) -> String; 2]
    {
        table(line);
        let (_, err) = succeeds(&dir, &compress("grid:1x3"));
        assert!(!err.contains("rises"), "{err}");
    }
}

#[test]
fn tables_of_another_form_are_told() {
    let dir = TempDir::new().unwrap();
    let write = |text: String| std::fs::write(dir.path().join("in.csv"), text).unwrap();
    let compress = |layout| ["compress", "in.csv", "--out", "o.npz", "--layout", layout];
    let lines = (0..36).map(|n| format!("{},{},{}\n", 0.01 * (n / 9) as f64, n % 9, n));
    write("time,taxel,value\n".to_owned() + &lines.collect::<String>());
    let told =
        "most times stand in several lines, as where there is a line for each taxel: in pandas df.pivot(";
    let err = fails(&dir, &compress("grid:3x3"), 1);
    assert!(err.contains(told), "{err}");
    let (_, err) = succeeds(&dir, &compress("grid:1x2"));
    assert!(err.contains(told), "{err}");
    write("1 2 3\n4 5 6\n".into());
    let err = fails(&dir, &compress("grid:2x3"), 1);
    assert!(
        err.contains(
            "has 3 taxels, and 2 x 3 are 6; it may be one frame of 2 lines: in numpy a[None], 1 x 2 x 3"
        ),
        "{err}"
    );
}

#[test]
fn what_is_said_of_columns_of_xela_leads_to_pictures_of_as_many_taxels() {
    let dir = TempDir::new().unwrap();
    for (taxels, layout, advice, followed) in [
        (
            240,
            "allegro-xela-18",
            "--layout grid:60x4 (modules of 4x4 below one another) or grid:40x6 (",
            "grid:60x4",
        ),
        (
            24,
            "allegro-uskin-15",
            "row by row: --layout grid:4x6\n",
            "grid:4x6",
        ),
        (
            16,
            "allegro-uskin-15",
            "row by row: --layout grid:4x4\n",
            "grid:4x4",
        ),
        (32, "allegro-uskin-15", "--layout grid:8x4 (modules", "grid:8x4"),
        // XELA's own Allegro hand: modules of 4x4, of 4x6 and of 30 taxels, which nothing in the file tells.
        (
            368,
            "allegro-xela-18",
            "--layout grid:92x4 (modules of 4x4 below one another) where all modules are of that kind; where not, as on the \
             Allegro hand of 368 taxels, a layout file says which modules they are (docs/guide.md, \"Write a layout\")\n",
            "grid:92x4",
        ),
        (
            344,
            "uskin-module",
            "row by row: a layout file says which modules they are (docs/guide.md, \"Write a layout\"), or --layout grid:HxW\n",
            "grid:86x4",
        ),
        (30, "allegro-uskin-15", "--layout grid:HxW\n", "grid:5x6"),
    ] {
        let names: Vec<String> = (1..=taxels)
            .map(|n| format!("txl{n}_x,txl{n}_y,txl{n}_z"))
            .collect();
        let line = vec!["20000,20001,20002"; taxels].join(",");
        std::fs::write(
            dir.path().join("in.csv"),
            format!("{}\n{}", names.join(","), format!("{line}\n").repeat(60)),
        )
        .unwrap();
        let compress = |layout| {
            [
                "compress", "in.csv", "--rate", "30", "--out", "o.npz", "--layout", layout,
            ]
        };
        let err = fails(&dir, &compress(layout), 1);
        assert!(err.contains(advice), "{err}");
        let (_, err) = succeeds(&dir, &compress(followed));
        assert!(!err.contains("XELA"), "{err}");
        let err = fails(&dir, &["convert", "in.csv", "o.log", "--layout", followed], 1);
        assert_eq!(err.contains("uskin-module"), taxels == 16, "{err}");
        if taxels == 24 {
            let (_, err) = succeeds(&dir, &compress("uskin-fingertip"));
            assert!(
                err.contains("numbers taxels row by row, --layout grid:4x6; uskin-fingertip"),
                "{err}"
            );
            assert!(!err.contains("order"), "{err}");
        }
    }
}

#[test]
fn rows_of_the_hand_of_a_configuration_lead_to_their_columns_also_where_the_last_taxel_is_silent() {
    let dir = TempDir::new().unwrap();
    std::fs::write(dir.path().join("hand.toml"), "layout = \"uskin-module\"\n").unwrap();
    let of_hand = [
        "compress",
        "in.csv",
        "--config",
        "hand.toml",
        "--rate",
        "30",
        "--out",
        "o.npz",
    ];
    let values = vec!["20000"; 45].join(",");
    let are_counts = "say with --columns xyz-interleaved or xyz-blocks";
    let is_timed = "say with --columns xyz-interleaved --time-column UNIT that the first is time";
    for (line, columns, wanted, or) in [
        (format!("{values},,,\n"), 48, are_counts, ""),
        (format!(",,,{values}\n"), 48, are_counts, ""),
        // Three empty cells, or two and the end of each line, as a spreadsheet may have it; the likelier is said first.
        (
            format!("7,{values},,,\n"),
            49,
            is_timed,
            "; or, of these 48 columns say with",
        ),
        (
            format!("{values},,,,\n"),
            48,
            are_counts,
            "; or, with one behind the last separator, of these 49 columns say with",
        ),
        (
            format!("7,{values},,,,\n"),
            49,
            is_timed,
            "; or, with one behind the last separator, of these 50 columns say with",
        ),
    ] {
        std::fs::write(dir.path().join("in.csv"), line.repeat(60)).unwrap();
        let err = fails(&dir, &of_hand, 1);
        let at = err
            .find(&format!("of these {columns} columns {wanted}"))
            .expect(&err);
        assert_eq!(err.contains("; or, "), !or.is_empty(), "{err}");
        assert!(err[at..].contains(or), "{err}");
        let time: &[&str] = if columns == 49 {
            &["--time-column", "ms"]
        } else {
            &[]
        };
        let followed = [&of_hand, &["--columns", "xyz-interleaved"][..], time].concat();
        succeeds(&dir, &followed);
    }
    // What was said already is not advised again.
    let values = vec!["20000"; 49].join(",");
    let lines: String = (0..60).map(|t| format!("{t},{values}\n")).collect();
    std::fs::write(dir.path().join("in.csv"), lines).unwrap();
    let timed = [
        "compress",
        "in.csv",
        "--config",
        "hand.toml",
        "--out",
        "o.npz",
        "--time-column",
        "ms",
    ];
    let err = fails(&dir, &timed, 1);
    let one = "say with --columns xyz-interleaved --joint-columns 1 that they are x y z counts and, at the end, 1 joint \
               angle; what is neither is to be cut out";
    assert!(err.contains(one) && !err.contains("--time-column"), "{err}");
    let timed_joint = [&timed[..], &["--joint-columns", "1"]].concat();
    let err = fails(&dir, &timed_joint, 1);
    assert!(
        err.contains("say with --columns xyz-interleaved or xyz-blocks that they are"),
        "{err}"
    );
    // Cells of a grid that are no taxels.
    std::fs::write(dir.path().join("in.csv"), "1,,3,4,5,6\n".repeat(9)).unwrap();
    let args = ["compress", "in.csv", "--layout", "grid:2x3", "--out", "o.npz"];
    assert!(fails(&dir, &args, 1).contains("--void nan"));
    succeeds(&dir, &[&args, &["--void", "nan"][..]].concat());
}

#[test]
fn columns_that_name_boards_are_on_their_modules() {
    let dir = TempDir::new().unwrap();
    let layout = |first: u8, second: u8| {
        let module = |name: &str, board: u8, x: u8| {
            format!(
                "[[module]]\nname = \"{name}\"\npart = \"p\"\nbus = \"can0\"\nboard = {board}\nprotocol = \"uskin-l2\"\n\
                 at = [{x}, 0]\norder = [[0, 1]]\n"
            )
        };
        let text = "name = \"two\"\nimage = { width = 4, height = 1 }\nbuses = [\"can0\"]\n";
        let text = text.to_owned() + &module("a", first, 0) + &module("b", second, 2);
        std::fs::write(dir.path().join("two.toml"), text).unwrap();
    };
    // Taxel 0 of the board that is named first is pressed, or of the other.
    let write = |boards: [u8; 2], pressed: usize| {
        let names = boards.map(|b| format!("{b}B0X,{b}B0Y,{b}B0Z,{b}B1X,{b}B1Y,{b}B1Z"));
        let mut text = format!("t_s,{}\n", names.join(","));
        for i in 0..120 {
            let mut counts = [20000 + i % 3; 12];
            counts[6 * pressed + 2] += if i < 90 { 0 } else { 900 };
            let counts: Vec<String> = counts.iter().map(i32::to_string).collect();
            text += &format!("{},{}\n", f64::from(i) / 30.0, counts.join(","));
        }
        std::fs::write(dir.path().join("in.csv"), text).unwrap();
    };
    let args = ["compress", "in.csv", "--layout", "two.toml", "--out", "o.csv"];
    let as_modules = "taken for the modules of layout two in order";
    for (wired, named, x, told) in [
        ([3, 1], [3, 1], [0, 2], None),
        ([3, 1], [1, 3], [2, 0], None),
        ([3, 1], [0, 1], [0, 2], None),
        ([1, 0], [0, 1], [0, 2], Some(as_modules)),
        ([4, 7], [1, 2], [0, 2], Some(as_modules)),
    ] {
        layout(wired[0], wired[1]);
        for pressed in [0, 1] {
            write(named, pressed);
            let (_, err) = succeeds(&dir, &args);
            let case = format!("boards {wired:?}, columns of {named:?}, the {pressed}. is pressed: {err}");
            assert_eq!(told.is_some(), err.contains(as_modules), "{case}");
            let images = std::fs::read_to_string(dir.path().join("o.csv")).unwrap();
            let grey = images.lines().last().unwrap().split(',').map(str::to_owned);
            let greys: Vec<String> = grey.collect();
            let at = greys[greys.len() - 4..].iter().position(|grey| grey != "0");
            assert_eq!(at, Some(x[pressed]), "{case}");
        }
    }
    layout(3, 1);
    write([3, 9], 0);
    let err = fails(&dir, &args, 1);
    let wanted = "columns are of boards 3, 9, and the boards of layout two are 3, 1; name them so, or by the modules in order, 0 to 1";
    assert!(err.contains(wanted), "{err}");
}

#[test]
fn columns_in_the_order_of_their_names_as_texts_are_taken_by_their_numbers() {
    let dir = TempDir::new().unwrap();
    let write = |order: &[usize]| {
        let names: Vec<String> = order.iter().map(|n| format!("s{n}")).collect();
        let pressed: Vec<&str> = order.iter().map(|n| if *n == 2 { "50" } else { "0" }).collect();
        std::fs::write(
            dir.path().join("in.csv"),
            format!("{}\n{}\n", names.join(","), pressed.join(",")),
        )
        .unwrap();
    };
    let args = words("compress in.csv --layout grid:3x4 --threshold 10 --out o.csv --rate 30");
    let told =
        "in the order of their names as texts; they are taken by the numbers in their names, s0, s1, s2, ..";
    // As they are written by who sorts texts; as they count; and as somebody has laid them out.
    for (order, place, is_told) in [
        ([0, 1, 10, 11, 2, 3, 4, 5, 6, 7, 8, 9], 2, true),
        ([0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11], 2, false),
        ([3, 2, 1, 0, 7, 6, 5, 4, 11, 10, 9, 8], 1, false),
    ] {
        write(&order);
        let (_, err) = succeeds(&dir, &args);
        assert_eq!(err.contains(told), is_told, "{err}");
        let images = std::fs::read_to_string(dir.path().join("o.csv")).unwrap();
        let greys: Vec<&str> = images.lines().last().unwrap().split(',').collect();
        let at = greys[greys.len() - 12..].iter().position(|grey| *grey != "0");
        assert_eq!(at, Some(place), "{order:?}: {images}");
    }
}

#[test]
fn columns_of_other_taxels_than_the_board_has_are_refused() {
    let dir = TempDir::new().unwrap();
    let write = |taxels: &[u32]| {
        let names: Vec<String> = (taxels.iter())
            .flat_map(|k| ["X", "Y", "Z"].map(|axis| format!("0B{k}{axis}")))
            .collect();
        let line = vec!["20000"; names.len()].join(",") + "\n";
        std::fs::write(
            dir.path().join("in.csv"),
            format!("{}\n{}", names.join(","), line.repeat(60)),
        )
        .unwrap();
    };
    let args = words("compress in.csv --rate 30 --layout uskin-module --out o.npz");
    let without = |left_out: u32, to: u32| (0..=to).filter(|k| *k != left_out).collect::<Vec<u32>>();
    write(&without(3, 16));
    let err = fails(&dir, &args, 1);
    assert!(
        err.contains("its columns of board 0 are of the taxels 0 to 2, 4 to 16, and module ")
            && err.contains(" of layout uskin-module has the taxels 0 to 15; name them so"),
        "{err}"
    );
    for taxels in [without(16, 16), without(0, 16)] {
        write(&taxels);
        succeeds(&dir, &args);
    }
}

#[test]
fn columns_that_stand_column_by_column_of_a_grid_are_taken_by_their_numbers() {
    let dir = TempDir::new().unwrap();
    let cells: Vec<(usize, usize)> = (0..12).map(|n| (n % 3, n / 3)).collect();
    let told = "in.csv: its columns stand column by column of the grid by the numbers in their names";
    for (axes, pressed, rest) in [(&[""][..], "50", "0"), (&["_x", "_y", "_z"], "29000", "20000")] {
        let names = cells
            .iter()
            .flat_map(|(r, c)| axes.iter().map(move |axis| format!("r{r}c{c}{axis}")));
        let names: Vec<String> = names.collect();
        let line = |at| -> String {
            let value =
                |cell: &(usize, usize)| vec![if Some(*cell) == at { pressed } else { rest }; axes.len()];
            cells.iter().flat_map(value).collect::<Vec<_>>().join(",") + "\n"
        };
        let text = names.join(",") + "\n" + &line(None).repeat(90) + &line(Some((0, 2))).repeat(9);
        std::fs::write(dir.path().join("in.csv"), text).unwrap();
        let args = [
            "compress", "in.csv", "--rate", "30", "--layout", "grid:3x4", "--out", "o.csv",
        ];
        let (_, err) = succeeds(&dir, &args);
        assert!(
            err.contains(told) && err.contains(r#""r0c0"#) && err.contains(r#""r0c1"#),
            "{err}"
        );
        let images = std::fs::read_to_string(dir.path().join("o.csv")).unwrap();
        let greys: Vec<&str> = images.lines().last().unwrap().split(',').collect();
        let at = greys[greys.len() - 12..].iter().position(|grey| *grey != "0");
        assert_eq!(at, Some(2), "{images}");
    }
}

#[test]
fn two_columns_of_one_name_are_said() {
    let dir = TempDir::new().unwrap();
    std::fs::write(dir.path().join("in.csv"), "a,b,b,c\n1,2,3,4\n").unwrap();
    let (_, err) = succeeds(
        &dir,
        &["compress", "in.csv", "--layout", "grid:2x2", "--out", "o.npz"],
    );
    assert!(
        err.contains(r#"in.csv: two of its columns are called "b""#),
        "{err}"
    );
}
