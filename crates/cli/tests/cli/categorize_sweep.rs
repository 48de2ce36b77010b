//! `taxel categorize --sweep`: every motion judged, and its figures.

use crate::succeeds;

#[test]
fn a_sweep_judges_every_motion_and_draws_what_it_can() {
    let dir = tempfile::tempdir().unwrap();
    let rows = ["Ph-2,vertical,6.5,0", "Ph-2,vertical,7.5,0", "Ph-2,rotary,6.5,16"];
    let rows = rows.map(|row| format!("{row},,,sim:phantom-2,\n")).concat();
    let manifest = format!("phantom,motion,depth,radius,area,label,file,time\n{rows}");
    std::fs::write(dir.path().join("sweep.csv"), manifest).unwrap();
    let (out, _) = succeeds(&dir, &["categorize", "--sweep", "sweep.csv", "--figures", "out"]);
    assert!(out.starts_with("3 motions, 3 of them proved"), "{out}");
    assert!(out.contains("rank-1"), "{out}");
    for figure in 6..=17 {
        for ending in ["svg", "csv"] {
            let path = dir.path().join(format!("out/figure-{figure:02}.{ending}"));
            // Figure 17 needs an order that holds, which so shallow touches may not have.
            assert!(path.exists() || figure == 17, "{}", path.display());
        }
    }
    let numbers = std::fs::read_to_string(dir.path().join("out/sweep.csv")).unwrap();
    assert_eq!(numbers.lines().count(), 1 + 3 * 3, "{numbers}");
}

#[test]
fn figures_of_other_classes_have_their_names_and_nothing_of_the_publications() {
    let dir = tempfile::tempdir().unwrap();
    let touch = |n: usize, class: usize| {
        let shape = |step: usize, taxel: usize| step * (1 + (taxel + class) % 3) * 10 + (n * 7 + taxel) % 5;
        let line = |step| {
            (0..4)
                .map(|t| shape(step, t).to_string())
                .collect::<Vec<_>>()
                .join(",")
                + "\n"
        };
        let text: String = (1..=12).map(line).collect();
        std::fs::write(dir.path().join(format!("t{n}.csv")), text).unwrap();
        format!("wood,vertical,6,0,{n},class {class},t{n}.csv\n")
    };
    let rows: String = (0..12).map(|n| touch(n, n % 3)).collect();
    let manifest = format!("phantom,motion,depth,radius,area,label,file\n{rows}");
    std::fs::write(dir.path().join("own.csv"), manifest).unwrap();
    let (out, _) = succeeds(&dir, &["categorize", "--sweep", "own.csv", "--figures", "own"]);
    assert!(out.contains("K = 3") && !out.contains("rank"), "{out}");
    let series = |figure: &str| {
        let text = std::fs::read_to_string(dir.path().join("own").join(figure)).unwrap();
        let names = text
            .lines()
            .skip(1)
            .map(|line| line.rsplit(',').nth(5).unwrap().to_owned());
        let mut names: Vec<String> = names.collect();
        names.dedup();
        names
    };
    assert_eq!(series("figure-07.csv"), ["12 areas", "3 areas"]);
    assert_eq!(series("figure-14.csv"), ["class 0", "class 1", "class 2"]);
    for figure in ["06", "09", "10", "12", "16", "17"] {
        let path = dir.path().join(format!("own/figure-{figure}.svg"));
        assert!(!path.exists(), "{figure}");
    }
}
