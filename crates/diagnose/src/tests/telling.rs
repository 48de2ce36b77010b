//! When a problem is told, and how often.

use super::*;
use crate::{Place, Severity};
use taxel_can::BusState;

#[test]
fn a_problem_is_told_when_it_comes_and_when_it_is_over() {
    let mut bench = Bench::new();
    bench.pass(2000, |s| s.buses[1].counters.bus_state = BusState::BusOff);
    assert_eq!(bench.kinds(), ["bus-off"]);
    let [
        News::Came {
            severity: Severity::Error,
            sentence,
        },
    ] = &bench.said[..]
    else {
        panic!("{:?}", bench.said);
    };
    assert!(
        sentence.starts_with("can1: ") && sentence.contains("type can restart-ms 100"),
        "{sentence}"
    );
    assert_eq!(bench.problems.kinds(Place::Bus(1)), [Kind::BusOff]);
    assert!(bench.problems.kinds(Place::Bus(0)).is_empty());

    bench.pass(500, |s| s.buses[1].counters.bus_state = BusState::ErrorActive);
    assert_eq!(bench.kinds(), [""; 0]);
    let Some(News::Over { sentence }) = bench.said.last() else {
        panic!("{:?}", bench.said);
    };
    assert_eq!(
        (bench.said.len(), sentence.as_str()),
        (2, "can1: the controller is on the bus again (after 2.0 s)")
    );
}

#[test]
fn flapping_is_one_problem_and_not_hundreds() {
    let mut bench = Bench::new();
    // Fifty changes a second, for a minute; where it stands at a look is chance.
    let mut looks = 0;
    bench.pass(60_000, |s| {
        looks += 1;
        let source = &mut s.buses[0].counters;
        source.state_changes += 5;
        source.bus_state = [BusState::ErrorPassive, BusState::ErrorActive][looks % 2];
    });
    assert_eq!(bench.kinds(), ["flapping"]);
    assert!(bench.said.len() <= 4, "{:#?}", bench.said);
    bench.pass(1000, |s| s.buses[0].counters.bus_state = BusState::ErrorActive);
    assert_eq!(bench.kinds(), [""; 0]);
}

#[test]
fn what_comes_and_goes_for_hours_is_told_less_and_less() {
    let mut bench = Bench::new();
    let mut looks = 0;
    bench.pass(3_600_000, |s| {
        looks += 1;
        s.boards[3].silences += u64::from(looks % 10 == 0);
        s.boards[3].state = if looks / 5 % 2 == 0 {
            BoardState::Silent
        } else {
            BoardState::Streaming
        };
    });
    // 7,200 changes in an hour; two kinds of problem, four sentences each, then one after 10 s, 20, 40, .. and 600.
    assert!((8..=2 * 17).contains(&bench.said.len()), "{}", bench.said.len());
    let untold = "changes in between were not told";
    assert!(bench.said.iter().any(|news| sentence(news).contains(untold)));
    assert!(bench.kinds().contains(&"board-unsteady"));
}

/// What was said of the kind `reload-refused` while it is there for so long at a time and gone for so long, milliseconds;
/// each sentence with when it was said, in seconds.
fn said_of_refusals(times_ms: &[(u64, u64)]) -> Vec<(f64, bool, String)> {
    let mut bench = Bench::new();
    let mut said = Vec::new();
    let mut pass = |bench: &mut Bench, ms: u64, refused: Option<&'static str>| {
        for _ in 0..ms / 100 {
            bench.pass(100, |s| {
                s.reload_refused = refused.map(|why| NotReloaded::Refused(why.into()));
            });
            let now_s = (bench.known.now_ns / MS) as f64 / 1e3;
            said.extend((bench.said.drain(..)).map(|news| {
                let came = matches!(news, News::Came { .. });
                (now_s, came, sentence(&news).to_owned())
            }));
        }
    };
    for (there_ms, gone_ms) in times_ms {
        pass(&mut bench, *there_ms, Some("hand.toml:3: unknown key"));
        pass(&mut bench, *gone_ms, None);
    }
    said
}

#[test]
fn what_is_so_in_the_end_is_told_however_often_it_came_and_went_before() {
    let twice = [(500, 500); 2];
    let quick = [(100, 100); 20];
    for (what, times, stays, came) in [
        ("it stays", &twice[..], (18_000, 0), true),
        ("it stays, after many", &quick, (18_000, 0), true),
        ("it is over", &quick, (100, 18_000), false),
        ("it is over after it stayed", &quick, (18_000, 18_000), false),
    ] {
        let times = [times, &[stays]].concat();
        let said = said_of_refusals(&times);
        let (_, last, _) = said.last().unwrap();
        assert_eq!(*last, came, "{what}: {said:#?}");
        // They alternate, so that nothing is told twice.
        assert!(
            said.windows(2).all(|two| two[0].1 != two[1].1),
            "{what}: {said:#?}"
        );
    }
    let said = said_of_refusals(&[&quick[..], &[(18_000, 0)]].concat());
    let (_, _, last) = said.last().unwrap();
    // Each of twenty came and went, and four changes were told.
    assert!(last.ends_with("(36 changes in between were not told)"), "{last}");
}

#[test]
fn what_comes_and_goes_fast_is_told_four_times_and_then_ever_less_often() {
    for times in [(100, 100), (100, 900), (900, 100), (3000, 3000), (9_000, 200)] {
        let (there_ms, gone_ms) = times;
        let count = 600_000 / (there_ms + gone_ms);
        let said = said_of_refusals(&vec![times; count as usize]);
        // After 10 s, 20, 40, 80, 160 and 320.
        assert!((8..=10).contains(&said.len()), "{times:?}: {said:#?}");
    }
}

#[test]
fn a_hand_that_moved_while_its_baseline_was_measured_is_told_until_that_is_done_anew() {
    let mut bench = Bench::new();
    bench.pass(3000, |s| s.moved = Movement::InOneHalf);
    assert_eq!(bench.kinds(), ["baseline-moved"]);
    let [said] = &bench.said[..] else {
        panic!("{:?}", bench.said);
    };
    assert!(
        sentence(said).contains("; `taxel rezero` when nothing touches the hand"),
        "{said:?}"
    );
    bench.pass(20_000, |s| s.moved = Movement::None);
    assert_eq!((bench.kinds(), bench.said.len()), (vec![], 2), "{:?}", bench.said);
}

#[test]
fn what_moved_while_the_baseline_was_measured_is_told_by_what_follows_from_it() {
    for (moved, told) in [
        (Movement::Taxels(1), "a taxel moved, or was touched, "),
        (Movement::Taxels(7), "7 taxels moved, or were touched, "),
        (Movement::Noise, "the contact threshold is of that noise"),
        (Movement::InOneHalf, "it rests as in the quieter half"),
        (
            Movement::InBothHalves,
            "the contact threshold is of that movement",
        ),
    ] {
        let mut bench = Bench::new();
        bench.pass(3000, |s| s.moved = moved);
        let [said] = &bench.said[..] else {
            panic!("{moved:?}: {:?}", bench.said);
        };
        assert!(sentence(said).contains(told), "{said:?}");
    }
}
