//! What is told in words, and where it is put.

use super::*;

#[test]
fn what_the_user_must_know_replaces_the_sentence_above() {
    type Change = fn(&mut Picture);
    let changes: [(Change, &str); 6] = [
        (|picture| picture.calibrating = true, "hands off"),
        (|picture| picture.paused = true, "let go"),
        (
            |picture| picture.gone = Some("it ended".into()),
            "the daemon is gone (it ended)",
        ),
        (
            |picture| picture.age_s = Some(3.31),
            "no image for the last 3.3 s",
        ),
        (|picture| picture.note = Some("mark: cup 3".into()), "mark: cup 3"),
        (
            |picture| picture.problems = Some(problems()),
            "2 problems: can0: nobody",
        ),
    ];
    for (change, words) in changes {
        let mut picture = picture();
        change(&mut picture);
        let text = text(&drawn((80, 24), &picture));
        assert!(text.contains(words), "{words}\n{text}");
        assert!(!text.contains("a ball"), "{text}");
    }
}

#[test]
fn what_is_too_long_for_the_line_above_is_told_whole_below_and_the_keys_stay() {
    let refused = "cannot reach taxeld at /run/taxeld/control.sock: Permission denied (os error 13); mode and group of \
                   [control] in its configuration say who may open it";
    type Change = fn(&mut Picture, &str);
    let changes: [Change; 2] = [
        |picture, words| picture.note = Some(words.into()),
        |picture, words| picture.gone = Some(words.into()),
    ];
    for (size, change) in SIZES
        .into_iter()
        .flat_map(|size| changes.map(|change| (size, change)))
    {
        let mut picture = picture();
        change(&mut picture, refused);
        let shown = text(&drawn(size, &picture));
        let joined = shown.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(joined.contains(refused), "{size:?}\n{shown}");
        assert!(shown.contains("? keys  q quit"), "{shown}");
    }
    // Nor is it hidden by what lasts.
    let lasting: [fn(&mut Picture); 3] = [
        |picture| picture.paused = true,
        |picture| picture.calibrating = true,
        |picture| picture.age_s = Some(2.0),
    ];
    for change in lasting {
        let mut picture = picture();
        change(&mut picture);
        picture.note = Some("mark: cup 3".into());
        let shown = text(&drawn((80, 24), &picture));
        assert!(shown.contains("\n mark: cup 3 "), "{shown}");
    }
    // One that no rows can hold ends in dots; a single long name is no reason to break.
    let mut picture = picture();
    picture.note = Some(["cannot create", &"x".repeat(90), &refused.repeat(4)].join(" "));
    let shown = text(&drawn((80, 24), &picture));
    let below: Vec<&str> = shown.lines().skip(20).collect();
    assert!(below[0].starts_with(" cannot create "), "{shown}");
    assert!(
        below[1].trim_end().ends_with('…') && below[2].trim_end().ends_with('…'),
        "{shown}"
    );
    assert!(below[3].contains("? keys  q quit"), "{shown}");
}

fn problems() -> Vec<ProblemStatus> {
    let problem = |sentence: &str, severe| ProblemStatus {
        sentence: sentence.into(),
        severe,
        since_s: 4.0,
        ..ProblemStatus::default()
    };
    vec![
        problem("can0: nobody acknowledges; is the hand switched on?", true),
        problem("index tip is slow", false),
    ]
}

#[test]
fn force_over_time_and_problems_are_beside_the_skin_or_below_where_there_is_room() {
    let mut picture = picture();
    picture.problems = Some(problems());
    picture.traces = vec![
        Trace {
            taxel: 3,
            points: (0..100).map(|i| (-0.1 * f64::from(i), f64::from(i))).collect(),
        },
        Trace {
            taxel: 17,
            points: Vec::new(),
        },
    ];
    let mut screen = Screen::new();
    screen.chosen = vec![3, 17];
    for (right, words) in [
        (Right::Traces, "force over time  a index tip 3  b index distal 1"),
        (Right::Problems, "error can0: nobody acknowledges"),
    ] {
        screen.right = right;
        let text = text(&drawn_with((80, 24), &picture, &screen, Palette::True));
        assert!(text.contains(&words[..38.min(words.len())]), "{text}");
        assert!(
            text.contains("raw: 240") && !text.contains("tactile image"),
            "{text}"
        );
    }
    screen.right = Right::Image;
    let text = text(&drawn_with((200, 60), &picture, &screen, Palette::True));
    for part in [
        "tactile image",
        "force over time  a index tip 3  b index distal 1",
        "error can0",
        "warning index",
    ] {
        assert!(text.contains(part), "{part}\n{text}");
    }
}

#[test]
fn a_recording_in_which_nobody_looks_has_no_none_for_its_problems_and_its_broken_taxels_are_named() {
    let mut picture = picture();
    for taxel in 16..32 {
        picture.taxels[taxel].raw.freshness = Freshness::Missing;
    }
    for taxel in [33, 35] {
        picture.taxels[taxel].raw.faults = Fault::Stuck as u16 | Fault::Missing as u16;
    }
    let mut screen = Screen::new();
    screen.right = Right::Problems;
    for (problems, recorded, words) in [
        (Some(Vec::new()), false, "problems none"),
        (None, true, "problems not looked for in a recording"),
        (None, false, "problems not told yet"),
    ] {
        (picture.problems, picture.recorded) = (problems, recorded);
        for size in SIZES {
            let shown = text(&drawn_with(size, &picture, &screen, Palette::True));
            let half = |line: &str| line.chars().skip(usize::from(size.0) / 2).collect::<String>();
            let joined: String = shown.lines().map(half).collect();
            let joined = joined.split_whitespace().collect::<Vec<_>>().join(" ");
            for part in [
                words,
                "out of use index distal all 16: no value, or one that is too old",
                "out of use index middle 1, 3: stuck, it has not changed",
            ] {
                assert!(joined.contains(part), "{part} {size:?}\n{shown}");
            }
        }
    }
}
