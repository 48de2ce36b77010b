//! Counts of three axes, from whatever skin and in whatever file.

use crate::{fails, succeeds, words};
use ndarray::{Array1, Array3, Array4, s};
use ndarray_npy::{NpzReader, NpzWriter, write_npy};
use std::fs::{File, read_to_string, write};
use taxel_skin::Layout;
use tempfile::TempDir;

/// When the recording begins, and how long a frame takes, nanoseconds.
const BEGINS_NS: u64 = 266_594_555;
const PERIOD_NS: u64 = 33_333_333;
/// Time of a frame on a bus.
const FRAME_NS: u64 = 125_000;

/// A module of 4 x 4 that is still and is pressed from the third frame on, one taxel after the other.
pub(crate) fn counts() -> Array3<f32> {
    Array3::from_shape_fn((20, 16, 3), |(t, taxel, axis)| {
        let press = if t > 1 && axis == 2 && taxel <= t {
            300 * taxel
        } else {
            0
        };
        (20_000 + (t * 7 + taxel * 5) % 4 + press) as f32
    })
}

pub(crate) fn times() -> Array1<u64> {
    (0..20).map(|t| BEGINS_NS + t * PERIOD_NS).collect()
}

pub(crate) fn write_npz(dir: &TempDir, name: &str, counts: &Array3<f32>, times: &Array1<u64>) {
    let mut npz = NpzWriter::new(File::create(dir.path().join(name)).unwrap());
    npz.add_array("counts", counts).unwrap();
    npz.add_array("t_ns", times).unwrap();
    npz.finish().unwrap();
}

/// What `taxel compress` makes by the publication's method: images, their times, and taxels missing.
fn compressed(dir: &TempDir, input: &str, layout: &str, more: &[&str]) -> (Array3<u8>, Vec<u64>, Vec<u16>) {
    let args = [
        "compress", input, "--layout", layout, "--method", "paper", "--out", "out.npz",
    ];
    succeeds(dir, &[&args[..], more].concat());
    let mut npz = NpzReader::new(File::open(dir.path().join("out.npz")).unwrap()).unwrap();
    let times: Array1<u64> = npz.by_name("t_ns").unwrap();
    let missing: Array1<u16> = npz.by_name("missing").unwrap();
    (npz.by_name("images").unwrap(), times.to_vec(), missing.to_vec())
}

#[test]
fn a_skin_without_buses_is_conditioned_as_one_with_boards() {
    let dir = TempDir::new().unwrap();
    write_npz(&dir, "module.npz", &counts(), &times());
    let boards = Layout::builtin_text("uskin-module").unwrap();
    let offline = boards
        .replace("uskin-l1", "offline")
        .lines()
        .filter(|line| !line.starts_with("bus") && !line.starts_with("board"))
        .map(|line| format!("{line}\n"))
        .collect::<String>()
        + "order = [[0, 1, 2, 3], [4, 5, 6, 7], [8, 9, 10, 11], [12, 13, 14, 15]]\n";
    let of_boards = Layout::builtin("uskin-module").unwrap();
    let offline_layout = Layout::parse(&offline, "offline.toml").unwrap();
    write(dir.path().join("offline.toml"), offline).unwrap();

    let with_boards = compressed(&dir, "module.npz", "uskin-module", &[]);
    let without = compressed(&dir, "module.npz", "offline.toml", &[]);
    assert_eq!(with_boards.1, times().to_vec());
    assert_eq!((&without.1, &without.2), (&with_boards.1, &vec![0; 20]));
    for (image, boards) in without.0.outer_iter().zip(with_boards.0.outer_iter()) {
        let grey = |layout: &Layout, image: &ndarray::ArrayView2<'_, u8>| -> Vec<u8> {
            let taxels = layout.taxels.iter();
            taxels
                .map(|taxel| image[[taxel.y.into(), taxel.x.into()]])
                .collect()
        };
        assert_eq!(grey(&offline_layout, &image), grey(&of_boards, &boards));
    }
    assert!(without.0.iter().any(|pixel| *pixel > 0));
    assert_eq!(compressed(&dir, "module.npz", "grid:4x4", &[]), without);

    let small = ["--restarts", "2", "--passes", "1", "--method", "paper", "--json"];
    let eval = ["eval", "module.npz", "--layout", "grid:4x4"];
    let (out, _) = succeeds(&dir, &[&eval[..], &small].concat());
    let judged: serde_json::Value = serde_json::from_str(&out).unwrap();
    assert_eq!((&judged["frames"], &judged["taxels"]), (&20.into(), &16.into()));
    // Times of figures are from the beginning, though the other recording has those of a wall clock.
    write_npz(
        &dir,
        "late.npz",
        &counts(),
        &times().mapv(|t| t + 1_700_000_000_000_000_000),
    );
    let of_figures = ["late.npz", "module.npz"].map(|input| {
        let layout = ["--layout", "grid:4x4", "--method", "paper", "--out", "figures"];
        succeeds(&dir, &[&["figures", input], &layout[..]].concat());
        let file = format!("figures/{}", input.replace(".npz", "-time.csv"));
        read_to_string(dir.path().join(file)).unwrap()
    });
    assert!(of_figures[0] == of_figures[1], "other times");
    assert!(dir.path().join("figures/module-frame.svg").exists());

    let err = fails(
        &dir,
        &["compress", "module.npz", "--layout", "grid:3x5", "--out", "a.npz"],
        1,
    );
    assert!(err.contains("16 taxels and layout grid:3x5 has 15"), "{err}");
    let err = fails(
        &dir,
        &words("replay module.npz --layout grid:4x4 --to log:a.log"),
        1,
    );
    assert!(err.contains("name the layout of a hand with boards"), "{err}");
}

#[test]
fn counts_that_no_can_frame_carries_one_by_one_are_taken_as_they_are() {
    for (name, at_rest, pressed) in [
        ("tekscan-6077", 1, 200),
        ("icub-forearm", 3920, 2000),
        ("cpm-finger", 24_000, 30_000),
    ] {
        let dir = TempDir::new().unwrap();
        let taxels = Layout::builtin(name).unwrap().len();
        let counts = Array3::from_shape_fn((20, taxels, 3), |(t, taxel, axis)| match axis {
            2 if t > 1 && taxel < 5 => pressed as f32,
            2 => at_rest as f32,
            _ => 0.0,
        });
        write_npz(&dir, "hand.npz", &counts, &times());
        let wanted = compressed(&dir, "hand.npz", name, &[]);
        assert_eq!(
            (&wanted.1, &wanted.2),
            (&times().to_vec(), &vec![0; 20]),
            "{name}"
        );
        assert!(wanted.0.iter().any(|pixel| *pixel > 0), "{name}");
        succeeds(&dir, &["convert", "hand.npz", "again.csv", "--layout", name]);
        assert_eq!(compressed(&dir, "again.csv", name, &[]), wanted, "{name}");
        let as_traffic = ["convert", "hand.npz", "a.log", "--layout", name];
        match Layout::builtin(name).unwrap().wiring[0].array {
            // Its source makes frames of the counts of all taxels.
            Some(_) => assert!(succeeds(&dir, &as_traffic).1.contains("CAN frames")),
            None => assert!(fails(&dir, &as_traffic, 1).contains("no CAN frame for each taxel")),
        }
    }
}

#[test]
fn counts_of_an_image_are_placed_by_their_shape() {
    let dir = TempDir::new().unwrap();
    let counts = counts().mapv(|count| count as u16);
    let image: Array4<u16> = counts.clone().into_shape_with_order((20, 2, 8, 3)).unwrap();
    write_npy(dir.path().join("flat.npy"), &counts).unwrap();
    write_npy(dir.path().join("image.npy"), &image).unwrap();
    let wanted = compressed(&dir, "flat.npy", "grid:2x8", &[]);
    assert_eq!(wanted.0.dim(), (20, 2, 8));
    assert_eq!(compressed(&dir, "image.npy", "grid:2x8", &[]), wanted);
    let (_, err) = succeeds(
        &dir,
        &["compress", "image.npy", "--method", "paper", "--out", "out.npz"],
    );
    assert!(err.contains("20 images of 2x8"), "{err}");
    // Whatever it is converted into; a .csv has no shape, which is said.
    for (from, to, layout, said) in [
        ("image.npy", "again.npz", &[][..], false),
        ("again.npz", "frames.npz", &[], false),
        ("frames.npz", "frames.csv", &[], true),
        ("frames.csv", "last.npz", &["--layout", "grid:2x8"], false),
    ] {
        let (_, err) = succeeds(&dir, &[&["convert", from, to][..], layout].concat());
        assert_eq!(err.contains("frames.csv: a .csv does not say"), said, "{err}");
        let kept = if said {
            &["--layout", "grid:2x8"][..]
        } else {
            layout
        };
        let args = [
            "compress", to, "--method", "paper", "--out", "out.npz", "--frames", "f.npz",
        ];
        let (_, err) = succeeds(&dir, &[&args, kept].concat());
        assert!(err.contains("20 images of 2x8"), "{to}: {err}");
        assert_eq!(compressed(&dir, "f.npz", "grid:2x8", &[]), wanted, "{to}");
    }
    let err = fails(
        &dir,
        &["compress", "image.npy", "--layout", "grid:4x4", "--out", "a.npz"],
        1,
    );
    assert!(
        err.contains("20 x 2 x 8 x 3") && err.contains("T x 4 x 4 x 3"),
        "{err}"
    );
}

#[test]
fn images_of_counts_have_the_recorded_times_and_none_before_a_sweep_could_end() {
    let dir = TempDir::new().unwrap();
    let first_sweep_ns = 15 * FRAME_NS;
    for (begins_ns, first_ns) in [
        (BEGINS_NS, BEGINS_NS),
        (1_700_000_000_123_456_789, 1_700_000_000_123_456_789),
        (first_sweep_ns, first_sweep_ns),
        (0, first_sweep_ns),
    ] {
        let times = times().mapv(|t| t - BEGINS_NS + begins_ns);
        write_npz(&dir, "module.npz", &counts(), &times);
        let frames = ["--frames", "again.csv"];
        let (images, made, _) = compressed(&dir, "module.npz", "uskin-module", &frames);
        let shifted = times.mapv(|t| t - begins_ns + first_ns).to_vec();
        assert_eq!(made, shifted, "{begins_ns}");
        let (again, made, _) = compressed(&dir, "again.csv", "uskin-module", &[]);
        assert_eq!((again, made), (images, shifted), "{begins_ns}");
    }
}

#[test]
fn a_taxel_without_a_value_is_missing_from_file_to_file() {
    let dir = TempDir::new().unwrap();
    let mut counts = counts();
    for (frame, taxel) in [(0, 15), (7, 3), (7, 4)] {
        counts.slice_mut(s![frame, taxel, ..]).fill(f32::NAN);
    }
    write_npz(&dir, "module.npz", &counts, &times());
    let wanted = compressed(&dir, "module.npz", "grid:4x4", &["--frames", "frames.csv"]);
    let mut missing = vec![0; 20];
    (missing[0], missing[7]) = (1, 2);
    assert_eq!(wanted.2, missing);
    assert!(wanted.0.iter().any(|pixel| *pixel > 0));
    let text = read_to_string(dir.path().join("frames.csv")).unwrap();
    assert!(text.lines().nth(1).unwrap().ends_with(",,,"), "{text}");
    assert!(!text.contains(",0,0,0"), "{text}");
    succeeds(
        &dir,
        &["convert", "module.npz", "again.npz", "--layout", "grid:4x4"],
    );
    for input in ["frames.csv", "again.npz"] {
        assert_eq!(compressed(&dir, input, "grid:4x4", &[]), wanted, "{input}");
    }
    // Boards send nothing of such a taxel, and the frame is the recording's all the same.
    let (_, times, missing) = compressed(&dir, "module.npz", "uskin-module", &[]);
    assert_eq!((times, missing), (wanted.1, wanted.2));
}

#[test]
fn frames_before_a_taxel_has_a_value_are_left_out_and_counted() {
    let dir = TempDir::new().unwrap();
    for (silent, said) in [(0, ""), (1, "1 frame is left out"), (3, "3 frames are left out")] {
        let mut counts = counts();
        counts.slice_mut(s![..silent, .., ..]).fill(f32::NAN);
        write_npz(&dir, "module.npz", &counts, &times());
        for out in ["out.npz", "out.csv"] {
            let (_, err) = succeeds(&dir, &["convert", "module.npz", out, "--layout", "grid:4x4"]);
            assert!(err.contains(&format!("{out}: {} frames", 20 - silent)), "{err}");
            match said {
                "" => assert!(!err.contains("left out"), "{err}"),
                said => assert!(err.contains(&format!("{out}: {said}, before the first")), "{err}"),
            }
        }
    }
}

/// When a frame was recorded, nanoseconds.
type Time<'a> = &'a dyn Fn(usize) -> u64;
/// Whether a taxel has no value in a frame.
type IsMissing = fn(usize, usize) -> bool;

#[test]
fn each_frame_has_one_image_at_its_time_whatever_is_missing_in_it() {
    const FRAMES: usize = 24;
    let dir = TempDir::new().unwrap();
    let usual = |t: usize| BEGINS_NS + t as u64 * PERIOD_NS;
    // Between a third of the usual time and twice it, and faster than a bus carries the hand.
    let uneven = |t: usize| usual(t) + [0, 20_000_000, 0, 10_000_000][t % 4];
    let fast = |t: usize| BEGINS_NS + t as u64 * 10_000_000 + [0, 3_000_000, 1_000_000][t % 3];
    let with_a_pause = |t: usize| usual(t) + if t >= 12 { 3_000_000_000 } else { 0 };
    let nothing: IsMissing = |_, _| false;
    let first_taxel: IsMissing = |t, taxel| t == 9 && taxel == 0;
    // What is first on each bus, as the boards are wired.
    let first_taxels: IsMissing = |t, taxel| t == 9 && taxel % 16 == 0;
    let last_board: IsMissing = |t, taxel| (9..15).contains(&t) && taxel / 16 == 7;
    let all_but_one: IsMissing = |t, taxel| t % 2 == 1 && taxel != 100;
    let whole_frames: IsMissing = |t, _| (9..15).contains(&t);
    let the_first: IsMissing = |t, taxel| t == 0 && taxel == 112;
    let cases: [(&str, Time<'_>, IsMissing); 11] = [
        ("nothing", &usual, nothing),
        ("nothing, uneven", &uneven, nothing),
        ("nothing, fast", &fast, nothing),
        ("nothing, with a pause", &with_a_pause, nothing),
        ("the first taxel of a frame", &usual, first_taxel),
        ("the first taxel of every board", &usual, first_taxels),
        ("the last board of a bus", &usual, last_board),
        ("the last board of a bus, fast", &fast, last_board),
        ("all but one taxel of every other frame", &uneven, all_but_one),
        ("every taxel of some frames", &usual, whole_frames),
        ("a taxel of the first frame", &usual, the_first),
    ];
    for (name, time, is_missing) in cases {
        let counts = Array3::from_shape_fn((FRAMES, 240, 3), |(t, taxel, axis)| {
            let count = 20_000 + (t * 7 + taxel * 5 + axis) % 4 + if t > 6 { taxel } else { 0 };
            if is_missing(t, taxel) {
                f32::NAN
            } else {
                count as f32
            }
        });
        let times = Array1::from_shape_fn(FRAMES, time);
        write_npz(&dir, "hand.npz", &counts, &times);
        let (_, made, missing) = compressed(&dir, "hand.npz", "allegro-uskin-15", &[]);
        assert_eq!(made, times.to_vec(), "{name}");
        let wanted = (0..FRAMES).map(|t| (0..240).filter(|taxel| is_missing(t, *taxel)).count() as u16);
        assert_eq!(missing, wanted.collect::<Vec<_>>(), "{name}");
    }
}

#[test]
fn a_configuration_samples_counts_at_its_timer_and_says_so() {
    let dir = TempDir::new().unwrap();
    write_npz(&dir, "module.npz", &counts(), &times());
    let bus = "layout = \"uskin-module\"\n[[bus]]\nsource = \"can:can0\"\n";
    for (tick, sampled) in [
        ("", Some("30 Hz")),
        ("[tick]\nrate_hz = 10.0\n", Some("10 Hz")),
        ("[tick]\nmode = \"sweep\"\n", None),
    ] {
        write(dir.path().join("hand.toml"), format!("{bus}{tick}")).unwrap();
        let args = [
            "compress",
            "module.npz",
            "--config",
            "hand.toml",
            "--out",
            "out.npz",
        ];
        let (_, err) = succeeds(&dir, &args);
        let said = "module.npz [counts]: its frames are sampled at the configuration's ";
        assert_eq!(err.contains(said), sampled.is_some(), "{err}");
        match sampled {
            Some(rate) => assert!(err.contains(&format!("{said}{rate}")), "{err}"),
            None => {
                let mut npz = NpzReader::new(File::open(dir.path().join("out.npz")).unwrap()).unwrap();
                let made: Array1<u64> = npz.by_name("t_ns").unwrap();
                assert_eq!(made, times());
            }
        }
    }
}

#[test]
fn replayed_counts_begin_anew_with_boards_that_settle_and_without_that_give_the_same_images() {
    let dir = TempDir::new().unwrap();
    // A log has whole microseconds.
    let times: Array1<u64> = (0..20).map(|t| 10_000_000 + t * 40_000_000).collect();
    write_npz(&dir, "module.npz", &counts(), &times);
    let replay = [
        "replay",
        "module.npz",
        "--layout",
        "uskin-module",
        "--to",
        "log:module.log",
    ];
    succeeds(&dir, &[&replay[..], &["--speed", "inf"]].concat());
    let bus = "layout = \"uskin-module\"\n[[bus]]\nsource = \"can:can0\"\n[tick]\nmode = \"sweep\"\n";
    write(dir.path().join("boards.toml"), bus).unwrap();
    write(
        dir.path().join("at_once.toml"),
        format!("{bus}[sweep]\nsettle_ms = 0.0\n"),
    )
    .unwrap();
    let made = |input: &str, config: &str| compressed(&dir, input, "uskin-module", &["--config", config]);
    let whole = made("module.npz", "boards.toml");
    assert_eq!(whole.1.len(), 20);
    let at_once = made("module.log", "at_once.toml");
    assert_eq!((&at_once.0, &at_once.2), (&whole.0, &whole.2));
    // What its boards send in the first 200 ms is thrown away, five frames here; an image without a value tells so.
    let anew = made("module.log", "boards.toml");
    assert_eq!((anew.1.len(), anew.2[0], &anew.2[1..]), (16, 16, &[0; 15][..]));
}

#[test]
fn a_rate_takes_the_place_of_the_times_in_a_file_and_the_help_says_so() {
    let dir = TempDir::new().unwrap();
    let mut npz = NpzWriter::new(File::create(dir.path().join("grid.npz")).unwrap());
    npz.add_array("forces", &Array3::<f32>::zeros((4, 2, 2))).unwrap();
    npz.add_array("t_ns", &Array1::from_shape_fn(4, |t| t as u64 * 20_000_000))
        .unwrap();
    npz.finish().unwrap();
    for (rate, apart_ns) in [(&[][..], 20_000_000), (&["--rate", "100"], 10_000_000)] {
        succeeds(
            &dir,
            &[&["compress", "grid.npz", "--out", "grid.jsonl"], rate].concat(),
        );
        let text = read_to_string(dir.path().join("grid.jsonl")).unwrap();
        let times: Vec<u64> = text
            .lines()
            .map(|line| serde_json::from_str::<serde_json::Value>(line).unwrap()["t_ns"].as_u64())
            .map(Option::unwrap)
            .collect();
        assert_eq!(times, [0, 1, 2, 3].map(|t| t * apart_ns), "{rate:?}");
    }
    let (help, _) = succeeds(&dir, &["compress", "--help"]);
    let help = help.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(
        help.contains("Frames per second, in place of the times in the file"),
        "{help}"
    );
}
