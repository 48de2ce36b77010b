//! Problems of the daemon itself: a configuration that is not taken up, sockets that are lost, readers without a place.

use super::{Bench, sentence};
use crate::{Crowd, Kind, News, NotReloaded, Place};

#[test]
fn a_refused_reload_is_a_problem_until_one_is_taken_up() {
    let mut bench = Bench::new();
    bench.pass(60_000, |s| {
        s.reload_refused = Some(NotReloaded::Refused("hand.toml:3: unknown key".into()));
    });
    assert_eq!(bench.kinds(), ["reload-refused"]);
    assert_eq!(bench.problems.kinds(Place::Daemon), [Kind::ReloadRefused]);
    let now = &bench.problems.current()[0].problem;
    assert_eq!((now.bus(&bench.layout), now.modules.len()), (None, 0));
    bench.pass(1000, |s| s.reload_refused = None);
    assert_eq!(bench.kinds(), [""; 0]);
    let [News::Came { sentence, .. }, News::Over { .. }] = &bench.said[..] else {
        panic!("{:?}", bench.said);
    };
    assert!(
        sentence.contains("refused: hand.toml:3: unknown key. The one before goes on"),
        "{sentence}"
    );

    let mut bench = Bench::new();
    bench.pass(1000, |s| {
        s.reload_refused = Some(NotReloaded::Unread(std::time::Duration::from_secs(3)));
    });
    let [News::Came { sentence: told, .. }] = &bench.said[..] else {
        panic!("{:?}", bench.said);
    };
    assert!(
        told.contains("has not been read for 3s") && !told.contains("refused"),
        "{told}"
    );
}

#[test]
fn that_nobody_can_connect_is_an_error_of_the_daemon_until_everybody_can() {
    let mut bench = Bench::new();
    let lost = "/run/taxeld/control.sock: cannot make /run/taxeld: Permission denied";
    bench.pass(60_000, |s| s.sockets_lost = Some(lost));
    assert_eq!(bench.kinds(), ["sockets-lost"]);
    assert_eq!(bench.problems.kinds(Place::Daemon), [Kind::SocketsLost]);
    assert_eq!(bench.said.len(), 1, "{:?}", bench.said);
    assert!(sentence(&bench.said[0]).contains(lost), "{:?}", bench.said);
    bench.pass(1000, |s| s.sockets_lost = None);
    assert_eq!(bench.kinds(), [""; 0]);
}

#[test]
fn that_readers_are_turned_away_is_told_with_who_holds_their_places() {
    let mut bench = Bench::new();
    let mut crowd = Crowd {
        places: 128,
        most: 128,
        holders: vec![
            (Some(1000), Some(4242), 120),
            (None, None, 6),
            (Some(0), Some(7), 1),
            (Some(0), Some(8), 1),
        ],
    };
    bench.pass(3000, |s| s.crowd = Some(crowd.clone()));
    assert_eq!(bench.kinds(), ["readers-turned-away"]);
    let said = sentence(&bench.said[0]);
    for words in [
        "find no place, since all 128 are taken",
        "process 4242 of user 1000 has 120, process ? of user ? has 6, process 7 of user 0 has 1;",
        "or raise [socket] max_subscribers and restart",
    ] {
        assert!(said.contains(words), "{said}");
    }
    // Where the files that may be open are too few, it would not help to raise what is configured.
    crowd.places = 8;
    bench.pass(100, |s| s.crowd = Some(crowd.clone()));
    let now = bench.problems.current()[0].problem.sentence();
    assert!(
        now.contains("LimitNOFILE=") && !now.contains("raise") && now.contains("all 8 are taken"),
        "{now}"
    );
    bench.pass(1000, |s| s.crowd = None);
    assert_eq!(bench.kinds(), [""; 0]);
}
