use super::*;

fn live(rest_ms: Option<f64>) -> Live {
    Live::new(MapFile::of_two_classes(rest_ms), "away").unwrap()
}

#[test]
fn a_touch_is_told_at_the_mark_that_ends_it() {
    let mut live = live(Some(100.0));
    assert!(live.handle_mark(1_000_000_000, "away").is_none());
    assert!(live.handle_mark(2_000_000_000, "touch 3").is_none());
    // Two frames a step; one while the probe moves, which is not taken.
    for (ms, value) in [
        (20, 10.0),
        (70, 10.2),
        (101, 999.0),
        (120, 20.0),
        (170, 20.2),
        (220, 30.0),
        (270, 30.2),
    ] {
        live.handle_frame(2_000_000_000 + ms * 1_000_000, std::iter::once(value));
    }
    let touch = live.handle_mark(2_300_000_000, "away").unwrap().unwrap();
    assert_eq!(
        (touch.category, touch.label.as_deref(), touch.unknown),
        (0, Some("soft"), false)
    );
    assert_eq!((touch.start_ns, touch.end_ns), (2_000_000_000, 2_270_000_000));
    assert_eq!((touch.mark.as_str(), touch.distances.len()), ("touch 3", 2));
    // Frames between touches are of none.
    live.handle_frame(2_400_000_000, std::iter::once(500.0));
    assert!(live.handle_mark(3_000_000_000, "touch 4").is_none());
}

#[test]
fn a_touch_ends_where_the_next_begins_and_one_without_a_step_is_named() {
    let mut live = live(None);
    live.handle_mark(0, "a");
    for value in [20.0, 40.0, 60.0] {
        live.handle_frame(1, std::iter::once(value));
    }
    let touch = live.handle_mark(2, "b").unwrap().unwrap();
    assert_eq!((touch.category, touch.label), (1, None));
    live.handle_frame(3, std::iter::once(1.0));
    let untold = live.handle_mark(4, "away").unwrap().unwrap_err();
    let error = &untold.error;
    assert!(error.contains("touch b: no frame at depth 1;"), "{error}");
    assert!(error.contains("--step"), "{error}");
    let line = serde_json::to_value(&untold).unwrap();
    assert_eq!((&line["mark"], &line["unknown"]), (&"b".into(), &true.into()));
    assert_eq!(
        (&line["category"], &line["start_ns"], &line["end_ns"]),
        (&serde_json::Value::Null, &2.into(), &3.into())
    );
    live.handle_mark(5, "c");
    for value in [900.0, -900.0, 900.0] {
        live.handle_frame(6, std::iter::once(value));
    }
    assert!(live.handle_mark(7, "away").unwrap().unwrap().unknown);
}

#[test]
fn a_touch_that_nobody_ends_keeps_what_its_steps_need_and_ends_with_its_last_frame() {
    let by_time = || MapFile {
        motion: None,
        first: 0.0,
        ..MapFile::of_two_classes(None)
    };
    for (map, is_told) in [
        (by_time(), true),
        (MapFile::of_two_classes(None), false),
        (MapFile::of_two_classes(Some(100.0)), true),
    ] {
        let mut live = Live::new(map, "away").unwrap();
        live.handle_mark(0, "on and on");
        for ms in 0..100_000 {
            live.handle_frame(ms * 1_000_000, std::iter::once(20.0));
        }
        let kept = live.touch.as_ref().unwrap().touch.at.len();
        assert!(
            (3..4000).contains(&kept) || !is_told && kept < 10,
            "{kept} frames"
        );
        let touch = live.handle_mark(100_000_000_000, "away").unwrap();
        assert_eq!(touch.unwrap().end_ns, 99_999_000_000);
    }
}

#[test]
fn a_touch_while_the_baseline_is_measured_says_so() {
    let mut live = live(None);
    live.handle_mark(0, "touch 11 SD");
    for value in [20.0, f64::NAN, 60.0] {
        live.handle_frame(1, std::iter::once(value));
    }
    let error = live.handle_mark(2, "away").unwrap().unwrap_err().error;
    assert!(error.contains("no baseline in a part of this touch"), "{error}");
}

#[test]
fn time_counts_from_the_first_frame_as_in_a_recording() {
    let map = MapFile {
        motion: None,
        first: 0.0,
        ..MapFile::of_two_classes(None)
    };
    let mut live = Live::new(map, "away").unwrap();
    live.handle_mark(0, "late");
    // The first frame comes most of a step after the mark.
    for (ms, value) in [(450, 10.0), (950, 20.0), (1450, 30.0)] {
        live.handle_frame(ms * 1_000_000, std::iter::once(value));
    }
    let touch = live.handle_mark(1_500_000_000, "away").unwrap().unwrap();
    assert_eq!((touch.category, touch.unknown), (0, false));
    assert_eq!((touch.start_ns, touch.end_ns), (0, 1_450_000_000));
}

/// The categories of touches that rise by 10 or 20 in each step, as those of the map, on a probe that shows `rest`, or rests so in the hand's own
/// mind.
fn categories(values_are: Values, rest: f64) -> Vec<Option<usize>> {
    let map = MapFile {
        values_are: Some(values_are),
        ..MapFile::of_two_classes(None)
    };
    let mut live = Live::new(map, "away").unwrap();
    let mut at = 0..;
    let mut frame = |live: &mut Live, value: f64| live.handle_frame(at.next().unwrap(), [value].into_iter());
    let mut found = Vec::new();
    for rise in [10.0, 20.0, 10.0] {
        // A press that was over long before.
        for value in [500.0, 0.0, 0.0, 1.0, 0.0, -1.0] {
            frame(&mut live, rest + value);
        }
        assert_eq!(live.handle_mark(0, "touch"), None);
        for step in 1..=3u8 {
            frame(&mut live, rest + rise * (f64::from(step) + 0.02));
        }
        let touch = live.handle_mark(0, "away").unwrap();
        found.push(
            touch
                .ok()
                .filter(|touch| !touch.unknown)
                .map(|touch| touch.category),
        );
    }
    found
}

#[test]
fn touches_of_counts_are_above_the_frames_before_their_mark_as_in_a_file() {
    let found = categories(Values::Z, 0.0);
    assert!(
        found[0].is_some() && found[1].is_some() && found[0] != found[1],
        "{found:?}"
    );
    assert_eq!(categories(Values::Xyz, 0.0), found);
    assert_eq!(categories(Values::Xyz, 13_000.0), found);
    assert_eq!(categories(Values::Z, 13_000.0), [None; 3]);
}
