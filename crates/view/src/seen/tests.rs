use super::*;
use crate::keys::Action;
use crate::screen::Screen;
use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyModifiers};
use taxel_hand::{Actuator, ForceFrame, Method, TactileFrame, TactileImage};
use taxel_skin::Layout;
use taxel_wire::{HelloRate, encode_image_payload, encode_raw_payload};

const SECOND_NS: u64 = 1_000_000_000;

fn hello() -> Hello {
    let layout = Layout::builtin("allegro-uskin-15").unwrap();
    let rate = HelloRate {
        mode: "timer".into(),
        hz: Some(50.0),
    };
    Hello::new(
        "taxeld 0.1.0",
        &layout,
        &Profile::default(),
        rate,
        Clock::Monotonic,
    )
}

fn seen() -> Seen {
    let mut seen = Seen::new();
    seen.see_hello(&hello(), 0);
    seen
}

/// Image `index` at 50 Hz, with as many passed over before it.
fn see(seen: &mut Seen, index: u64, skipped: u32, force: f64) {
    see_while(seen, index, skipped, force, Flags::default());
}

/// The same, of a frame with these flags.
fn see_while(seen: &mut Seen, index: u64, skipped: u32, force: f64, flags: Flags) {
    let image = TactileImage {
        seq: index,
        t_ns: SECOND_NS + index * 20_000_000,
        width: 2,
        height: 1,
        pixels: vec![0, 255],
        levels: vec![force],
        actuators: vec![Actuator {
            id: 0,
            x: 1,
            y: 0,
            level: 1,
            force,
        }],
        contacts: 1,
        ..TactileImage::default()
    };
    let mut payload = Vec::new();
    encode_image_payload(&image, &mut payload).unwrap();
    let mut header = Header::of_image(&image, payload.len()).with_skipped(skipped);
    header.flags |= flags;
    seen.see_image(
        &header,
        &ImageView::decode(&payload).unwrap(),
        image.t_ns + 250_000,
    );
}

fn press(seen: &Seen, screen: &mut Screen, key: char) -> Action {
    screen.key(KeyEvent::new(KeyCode::Char(key), KeyModifiers::NONE), seen)
}

#[test]
fn rate_and_latency_are_those_of_the_images() {
    let mut seen = seen();
    (0..200).for_each(|index| see(&mut seen, index, 0, 10.0));
    let figures = seen.figures(SECOND_NS + 199 * 20_000_000 + 300_000);
    assert!((figures.rate_hz - 50.0).abs() < 0.01, "{figures:?}");
    assert_eq!(
        (figures.latency_p50_ms, figures.latency_p99_ms),
        (Some(0.25), Some(0.25))
    );
    let summary = seen.summary(SECOND_NS, None).to_string();
    for part in [
        "images     200 in 4.0 s, 50.0 Hz",
        "p50 0.25 ms",
        "in 100 % of images, up to 1 taxel and",
        "calibrated before the start",
    ] {
        assert!(summary.contains(part), "{part}: {summary}");
    }
}

#[test]
fn the_rate_is_the_daemons_also_where_fewer_images_are_asked_for() {
    let mut seen = seen();
    (0..50).for_each(|index| see(&mut seen, 4 * index, 3, 10.0));
    let figures = seen.figures(SECOND_NS + 196 * 20_000_000);
    assert!((figures.rate_hz - 50.0).abs() < 0.01, "{figures:?}");
    let summary = seen.summary(SECOND_NS, None).to_string();
    assert!(
        summary.contains("images     200 in ") && summary.contains(", 150 of them skipped"),
        "{summary}"
    );
}

#[test]
fn the_rate_falls_to_zero_when_images_stay_away() {
    let mut seen = seen();
    (0..20).for_each(|index| see(&mut seen, index, 0, 10.0));
    assert_eq!(seen.figures(10 * SECOND_NS).rate_hz, 0.0);
}

#[test]
fn a_daemon_that_is_gone_shows_no_force_and_one_that_is_back_says_no_more_of_it() {
    let mut seen = seen();
    see(&mut seen, 0, 0, 10.0);
    seen.set_gone("it ended");
    let picture = seen.picture(&Screen::new(), SECOND_NS).unwrap();
    assert_eq!(picture.gone.as_deref(), Some("it ended"));
    assert!(picture.actuators.is_empty() && picture.taxels.is_empty());
    seen.see_hello(&hello(), SECOND_NS);
    assert_eq!(seen.picture(&Screen::new(), SECOND_NS).unwrap().gone, None);
}

#[test]
fn another_hand_takes_the_place_of_the_one_before() {
    let mut seen = seen();
    let mut screen = Screen::new();
    screen.cursor = Some(200);
    screen.chosen = vec![3, 200];
    let layout = Layout::builtin("uskin-module").unwrap();
    let rate = HelloRate {
        mode: "timer".into(),
        hz: None,
    };
    let hello = Hello::new("taxeld", &layout, &Profile::default(), rate, Clock::Monotonic);
    seen.see_hello(&hello, 0);
    assert_eq!(seen.picture(&screen, 0).unwrap().hand.len(), 16);
    screen.fit(seen.hand().unwrap());
    assert_eq!((screen.cursor, screen.chosen), (None, vec![3]));
}

#[test]
fn keys_ask_for_the_profile_shown_with_one_thing_changed() {
    let mut seen = seen();
    seen.see_status(serde_json::json!({ "profile": { "level_hysteresis": 0.1, "levels": 5 } }));
    let mut screen = Screen::new();
    let mut profile = |key| match press(&seen, &mut screen, key) {
        Action::Profile(Some(profile)) => *profile,
        other => panic!("{key}: {other:?}"),
    };
    let own = Profile {
        level_hysteresis: 0.1,
        ..Profile::default()
    };
    assert_eq!(
        profile('+'),
        Profile {
            levels: 9,
            ..own.clone()
        }
    );
    assert_eq!(
        profile('-'),
        Profile {
            levels: 7,
            ..own.clone()
        }
    );
    assert_eq!(
        profile('{'),
        Profile {
            actuators: 15,
            ..own.clone()
        }
    );
    assert_eq!(
        profile('o'),
        Profile {
            method: Method::Paper,
            ..own
        }
    );
    assert_eq!(press(&seen, &mut screen, '0'), Action::Profile(None));
}

#[test]
fn a_mark_is_written_and_then_made() {
    let seen = seen();
    let mut screen = Screen::new();
    for key in "mq p".chars() {
        assert_eq!(press(&seen, &mut screen, key), Action::None, "{key}");
    }
    let enter = KeyEvent::new(KeyCode::Enter, KeyModifiers::NONE);
    assert_eq!(screen.key(enter, &seen), Action::Mark("q p".into()));
    assert_eq!(press(&seen, &mut screen, 'q'), Action::Quit);
}

#[test]
fn a_recording_has_keys_of_its_own() {
    let seen = seen();
    let mut screen = Screen::of_recording();
    assert_eq!(press(&seen, &mut screen, 'p'), Action::Halt);
    assert_eq!(press(&seen, &mut screen, '>'), Action::Skip(5.0));
    assert_eq!(press(&seen, &mut screen, 'z'), Action::None);
}

#[test]
fn what_was_said_is_gone_with_the_next_key() {
    let mut seen = seen();
    seen.say("cannot reach taxeld", SECOND_NS);
    let note = |seen: &mut Seen| seen.picture(&Screen::new(), SECOND_NS).unwrap().note;
    assert_eq!(note(&mut seen).as_deref(), Some("cannot reach taxeld"));
    seen.hush();
    assert_eq!(note(&mut seen), None);
}

#[test]
fn what_became_of_a_key_is_not_replaced_by_what_happens_meanwhile() {
    let mut seen = seen();
    seen.say("recording taxel.mcap; r ends it", SECOND_NS);
    let event = Event::new(EventKind::Notice, "joints: servo 3 answers in time");
    seen.see_event(event, 3 * SECOND_NS);
    // The answer for its six seconds, then the event for what is left of its own.
    for (second, note) in [
        (3, Some("recording taxel.mcap; r ends it")),
        (7, Some("recording taxel.mcap; r ends it")),
        (8, Some("joints: servo 3 answers in time")),
        (10, None),
    ] {
        let picture = seen.picture(&Screen::new(), second * SECOND_NS).unwrap();
        assert_eq!(picture.note.as_deref(), note, "at {second} s");
    }
    // The next answer is to the next key.
    seen.say("one", 11 * SECOND_NS);
    seen.say("two", 11 * SECOND_NS);
    let picture = seen.picture(&Screen::new(), 11 * SECOND_NS).unwrap();
    assert_eq!(picture.note.as_deref(), Some("two"));
}

#[test]
fn a_summary_has_no_figure_that_nobody_measured() {
    let mut seen = seen();
    see(&mut seen, 0, 0, 10.0);
    let summary = seen.summary(SECOND_NS, None);
    assert_eq!(
        (summary.calibrated_s, summary.joints_known_ratio, summary.paused),
        (None, None, None)
    );
    assert!(!summary.calibrating && summary.gone.is_none());
    seen.see_status(serde_json::json!({ "paused": true }));
    seen.set_gone("it ended");
    let summary = seen.summary(SECOND_NS, None);
    assert_eq!(
        (summary.paused, summary.gone.as_deref()),
        (Some(true), Some("it ended"))
    );
    assert!(summary.to_string().contains("paused at the end"), "{summary}");
}

#[test]
fn a_summary_tells_how_long_no_image_came_in_between_and_at_the_end() {
    let mut seen = seen();
    let end = Some(9 * SECOND_NS);
    assert_eq!(seen.summary(SECOND_NS, end).age_s, None);
    see(&mut seen, 0, 0, 10.0);
    let one = seen.summary(SECOND_NS, None);
    assert_eq!((one.hz, one.longest_gap_s, one.age_s), (None, None, None));
    assert_eq!((one.raw_bits_per_s, one.image_bits_per_s), (None, None));
    assert!(
        !one.to_string().contains("Hz") && !one.to_string().contains("bit/s"),
        "{one}"
    );
    // At 1.0 s and up to 1.2 s, at 3.0 s and up to 4.0 s.
    (1..=10)
        .chain(100..=150)
        .for_each(|index| see(&mut seen, index, 0, 10.0));
    let recorded = seen.summary(SECOND_NS, None);
    assert_eq!((recorded.longest_gap_s, recorded.age_s), (Some(1.8), None));
    assert!(
        recorded
            .to_string()
            .contains("gaps       1.80 s at most between two\n"),
        "{recorded}"
    );
    let live = seen.summary(SECOND_NS, Some(4 * SECOND_NS + 200_250_000));
    assert_eq!(live.age_s, Some(0.2));
    assert!(!live.to_string().contains("no image"), "{live}");
    let ceased = seen.summary(SECOND_NS, Some(7 * SECOND_NS + 300_250_000));
    assert_eq!(ceased.age_s, Some(3.3));
    assert!(
        ceased
            .to_string()
            .contains(" between two; no image for the last 3.3 s\n"),
        "{ceased}"
    );
    let mut picture = |now_ns| seen.picture(&Screen::new(), now_ns).unwrap().age_s;
    assert_eq!(picture(7 * SECOND_NS + 300_250_000), Some(3.3));
}

#[test]
fn when_the_baseline_was_measured_is_told_where_that_was_seen() {
    let mut seen = seen();
    for (index, flags, wanted) in [
        (0, Flags::default(), "calibrated before the start"),
        (1, Flags::CALIBRATING, "still calibrating"),
        (50, Flags::default(), "calibrated 1.0 s after the start"),
        (51, Flags::CALIBRATING, "still calibrating"),
        (100, Flags::default(), "calibrated 2.0 s after the start"),
        (101, Flags::default(), "calibrated 2.0 s after the start"),
    ] {
        see_while(&mut seen, index, 0, 10.0, flags);
        let summary = seen.summary(SECOND_NS, None).to_string();
        assert!(summary.contains(wanted), "{wanted}: {summary}");
    }
    see_while(&mut seen, 102, 0, 10.0, Flags::CALIBRATING);
    see(&mut seen, 150, 0, 10.0);
    let before = seen.summary(5 * SECOND_NS, None);
    assert_eq!(before.calibrated_s, Some(-1.0));
    assert!(
        before.to_string().contains("calibrated before the start"),
        "{before}"
    );
}

#[test]
fn a_summary_says_where_nobody_has_looked_for_problems() {
    let problems = |seen: &Seen| {
        let summary = seen.summary(0, None).to_string();
        let line = summary.lines().find(|line| line.starts_with("problem"));
        line.map(str::to_owned)
    };
    let mut seen = seen();
    assert_eq!(problems(&seen).as_deref(), Some("problems   not told yet"));
    seen.see_status(serde_json::json!({ "problems": [] }));
    assert_eq!(problems(&seen), None);
    let mut recorded = Seen::new();
    let clock = Clock::Recording;
    recorded.see_hello(&Hello { clock, ..hello() }, 0);
    let unlooked = "problems   not looked for in a recording";
    assert_eq!(problems(&recorded).as_deref(), Some(unlooked));
}

#[test]
fn what_is_found_wrong_in_a_recording_is_a_problem_until_it_is_over() {
    let mut seen = Seen::new();
    let clock = Clock::Recording;
    seen.see_hello(&Hello { clock, ..hello() }, 0);
    see(&mut seen, 0, 0, 10.0);
    let sentence = "the hand moved".to_owned();
    let problem = ProblemStatus {
        sentence,
        ..ProblemStatus::default()
    };
    seen.set_problem(Some(problem), SECOND_NS);
    see(&mut seen, 100, 0, 10.0);
    let told = seen.problems().unwrap();
    assert_eq!((told.len(), told[0].since_s), (1, 2.0));
    let picture = seen.picture(&Screen::of_recording(), 0).unwrap();
    assert_eq!(picture.problems, Some(told));
    let summary = seen.summary(0, None).to_string();
    assert!(summary.contains("problem    the hand moved\n"), "{summary}");
    assert!(!summary.contains("not looked for"), "{summary}");
    seen.set_problem(None, 4 * SECOND_NS);
    assert_eq!(seen.problems(), None);
}

/// A raw frame of the hand at so many seconds, with one taxel touched or none.
fn see_touch(seen: &mut Seen, second: u64, touched: Option<usize>) {
    let taxels = seen.hand().unwrap().len();
    let (mut tactile, mut force) = (TactileFrame::new(taxels), ForceFrame::new(taxels));
    tactile.t_ns = second * SECOND_NS;
    if let Some(taxel) = touched {
        force.force[taxel] = 50.0;
        force.contact[taxel] = true;
    }
    let mut payload = Vec::new();
    encode_raw_payload(&tactile, &force, None, &mut payload).unwrap();
    let header = Header::of_frame(&tactile, &force, payload.len());
    seen.see_raw(&header, &RawView::decode(&payload).unwrap());
}

#[test]
fn the_curve_of_the_taxel_that_was_touched_stays_when_it_is_let_go() {
    let (mut seen, screen) = (seen(), Screen::new());
    let mut told = |second, touched| {
        see_touch(&mut seen, second, touched);
        let picture = seen.picture(&screen, second * SECOND_NS).unwrap();
        let traces = picture.traces.iter();
        let traces = traces.map(|trace| (trace.taxel, trace.points.iter().map(|point| point.1).collect()));
        (picture.cursor, traces.collect::<Vec<(usize, Vec<f64>)>>())
    };
    assert_eq!(told(1, None), (None, vec![]));
    assert_eq!(told(2, Some(7)), (Some(7), vec![(7, vec![0.0, 50.0])]));
    assert_eq!(told(3, None), (None, vec![(7, vec![0.0, 50.0, 0.0])]));
    assert_eq!(told(4, Some(9)).1[0].0, 9);
    // A recording from its start again.
    assert_eq!(told(0, None), (None, vec![]));
}
