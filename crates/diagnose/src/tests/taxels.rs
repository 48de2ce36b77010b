//! Modules of which a good part is out of use.

use super::*;

fn faulty(known: &mut Known, taxels: std::ops::Range<usize>, fault: Option<Fault>) {
    for faults in &mut known.faults[taxels] {
        *faults = Faults::NONE;
        fault.into_iter().for_each(|fault| faults.insert(fault));
    }
}

#[test]
fn a_module_of_which_more_than_a_quarter_feels_nothing_is_told_until_less_does() {
    for (taxels, fault, words) in [
        (16..21, Some(Fault::Missing), Some("of its 16 taxels 5 missing")),
        (16..32, Some(Fault::Dead), Some("of its 16 taxels 16 dead")),
        (16..32, Some(Fault::Stuck), Some("of its 16 taxels 16 stuck")),
        // A quarter; what passes by itself or is known.
        (16..20, Some(Fault::Missing), None),
        (16..32, Some(Fault::Noisy), None),
        (16..32, Some(Fault::PaperRule), None),
    ] {
        let mut bench = Bench::new();
        bench.pass(900, |s| faulty(s, taxels.clone(), fault));
        assert_eq!(bench.kinds(), [""; 0], "{fault:?}");
        bench.pass(1000, |_| {});
        let Some(words) = words else {
            assert_eq!(bench.kinds(), [""; 0], "{fault:?}");
            continue;
        };
        assert_eq!(bench.kinds(), ["taxels-out-of-use"], "{fault:?}");
        assert_eq!(bench.modules(0), ["index distal"]);
        let said = bench.problems.current()[0].problem.sentence();
        assert!(said.contains(words), "{said}");
        // One sweep that is whole is no end of it.
        bench.pass(100, |s| faulty(s, 0..32, None));
        bench.pass(900, |s| faulty(s, taxels.clone(), fault));
        assert_eq!(bench.kinds(), ["taxels-out-of-use"], "{fault:?}");
        bench.pass(1200, |s| faulty(s, 0..32, None));
        assert_eq!(bench.kinds(), [""; 0], "{fault:?}");
    }
}

#[test]
fn taxels_that_are_masked_are_known_to_be_out_of_use() {
    let mut bench = Bench::new();
    bench.pass(3000, |s| {
        faulty(s, 16..32, Some(Fault::Dead));
        s.faults[16..32]
            .iter_mut()
            .for_each(|of| of.insert(Fault::Masked));
    });
    assert_eq!(bench.kinds(), [""; 0]);
}

#[test]
fn taxels_of_a_board_that_falls_silent_are_not_in_use_again() {
    let mut bench = Bench::new();
    bench.pass(3000, |s| faulty(s, 16..32, Some(Fault::Dead)));
    assert_eq!(bench.kinds(), ["taxels-out-of-use"]);
    bench.said.clear();
    bench.pass(3000, |s| {
        faulty(s, 16..32, Some(Fault::Missing));
        s.boards[1].state = BoardState::Silent;
    });
    assert_eq!(bench.kinds(), ["board-silent"]);
    bench.pass(300, |s| s.boards[1].state = BoardState::Streaming);
    assert!(
        !bench
            .said
            .iter()
            .any(|news| sentence(news).contains("in use again")),
        "{:?}",
        bench.said
    );
}
