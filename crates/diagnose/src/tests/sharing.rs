//! Buses that another program reads as well.

use super::{Bench, sentence};
use crate::{Kind, Place, Starting};
use taxel_skin::Layout;

#[test]
fn commands_that_were_not_sent_from_here_are_told_once_until_none_came_for_ten_minutes() {
    let mut bench = Bench::new();
    bench.pass(1000, |s| s.buses[0].obeyed = 1);
    assert_eq!(bench.kinds(), ["bus-shared"]);
    assert_eq!(bench.problems.kinds(Place::Bus(0)), [Kind::BusShared]);
    assert!(
        sentence(&bench.said[0]).contains("can0: another program on the bus"),
        "{:?}",
        bench.said
    );
    // As a second daemon in `triggered` mode sends them, 49 a second.
    bench.pass(60_000, |s| s.buses[0].obeyed += 5);
    bench.pass(590_000, |_| {});
    assert_eq!((bench.kinds(), bench.said.len()), (vec!["bus-shared"], 1));
    bench.pass(20_000, |_| {});
    assert_eq!((bench.kinds(), bench.said.len()), (vec![], 2), "{:?}", bench.said);
}

#[test]
fn commands_are_none_of_a_bus_that_another_program_is_to_start_or_of_a_recording() {
    let mut passive = Bench::new();
    passive.pass(1000, |s| {
        s.buses[0].starting = Starting::ByOthers;
        s.buses[0].obeyed += 1;
    });
    assert_eq!(passive.kinds(), [""; 0]);
    let layout = Layout::builtin("uskin-module").unwrap();
    let mut recorded = Bench::of(layout, &["log:a.log"]);
    recorded.pass(1000, |s| s.buses[0].obeyed += 1);
    assert_eq!(recorded.kinds(), [""; 0]);
}

#[test]
fn another_daemon_that_reads_a_bus_is_told_with_its_process_and_hides_its_commands() {
    let mut bench = Bench::new();
    bench.pass(1000, |s| s.buses[1].obeyed += 1);
    let other = Some("process 4242, `taxeld --config left.toml`".to_string());
    bench.pass(1000, |s| s.other_daemons = vec![None, other.clone()]);
    assert_eq!(bench.problems.kinds(Place::Bus(1)), [Kind::BusShared]);
    let told = bench.problems.current()[0].problem.sentence();
    assert!(
        told.contains("can1: another taxeld on this machine reads can:can1 as well: process 4242, `taxeld --config left.toml`"),
        "{told}"
    );
    assert_eq!(bench.problems.current().len(), 1);
}
