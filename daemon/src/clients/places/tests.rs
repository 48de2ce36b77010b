use super::*;

const MOST: usize = MOST_CLIENTS;

fn has_to_go(place: &Place) -> bool {
    let clients = place.places.clients.borrow();
    !clients.iter().any(|client| Rc::ptr_eq(client, &place.client))
}

/// Has the client hold a motor for as long as this is there.
fn drive(place: &Place) -> [Motors; 2] {
    let motors = Motors::default();
    place.hold(&motors);
    [motors.clone(), motors]
}

#[test]
fn the_oldest_idle_connection_makes_room_and_one_that_releases_a_motor_goes_last() {
    let places = Rc::new(Places::new(MOST));
    let start = Instant::now();
    let at = |ms| start + Duration::from_millis(ms);
    let held: Vec<Place> = (0..MOST as u64).map(|n| places.enter(None, at(n))).collect();
    // The two oldest are at work, the third has asked something since, and the fourth too much.
    held[0].set(Doing::Releasing, at(501));
    held[1].set(Doing::Obeying, at(500));
    held[2].set(Doing::Nothing, at(500));
    held[3].slowed(at(500));
    let mut order = Vec::new();
    let mut newer = Vec::new();
    for n in 0..MOST as u64 {
        let place = places.enter(None, at(1000 + n));
        // A motor's release is asked for by each that comes.
        place.set(Doing::Releasing, at(1000 + n));
        newer.push(place);
        order.extend(
            (0..MOST)
                .filter(|i| has_to_go(&held[*i]) && !order.contains(i))
                .collect::<Vec<_>>(),
        );
    }
    let expected: Vec<usize> = [3].into_iter().chain(4..MOST).chain([2, 1, 0]).collect();
    assert_eq!(order, expected);
    assert!(!newer.iter().any(has_to_go));

    let mut status = ControlStatus::default();
    places.add_to(&mut status);
    assert_eq!((status.clients, status.made_room), (MOST, MOST as u64));
}

#[test]
fn who_has_not_been_heard_stays_where_one_process_fills_all_places_with_releases_without_end() {
    let places = Rc::new(Places::new(MOST));
    let now = Instant::now();
    let (crowding, other) = (Some((1000, Some(1))), Some((1000, Some(2))));
    let enter = || {
        let place = places.enter(crowding, now);
        place.set(Doing::Releasing, now);
        place
    };
    let _held: Vec<Place> = (0..MOST).map(|_| enter()).collect();
    let new = places.enter(other, now);
    // Whose place is taken connects again.
    let _again: Vec<Place> = (0..3 * MOST).map(|_| enter()).collect();
    assert!(!has_to_go(&new));
}

#[test]
fn however_many_let_go_of_motors_they_put_out_nobody_who_comes_to_do_so_once() {
    let process = |pid| Some((1000, Some(pid)));
    let ten_times_fourteen = (0..MOST as i32).map(|n| process(10 + n % 10));
    let once_each = (0..MOST as i32).map(|n| process(10 + n));
    for occupants in [ten_times_fourteen.collect::<Vec<_>>(), once_each.collect()] {
        let places = Rc::new(Places::new(MOST));
        let now = Instant::now();
        let enter = |process| {
            let place = places.enter(process, now);
            place.set(Doing::Releasing, now);
            place
        };
        let held: Vec<Place> = occupants.iter().map(|process| enter(*process)).collect();
        // Until one of them has been answered, whoever comes waits; and then it is heard before any other.
        assert!(!places.has_room(now));
        held[40].set(Doing::Nothing, now);
        assert!(places.has_room(now));
        let new = places.enter(process(1), now);
        assert!(has_to_go(&held[40]) && !places.has_room(now));
        new.set(Doing::Releasing, now);
        // Each that was answered comes again.
        let mut again = Vec::new();
        for place in held.iter().filter(|place| !has_to_go(place)) {
            place.set(Doing::Nothing, now);
            again.push(enter(place.client.process));
        }
        assert!(!has_to_go(&new) && !places.has_room(now));
    }
}

#[tokio::test(start_paused = true)]
async fn whoever_waits_for_a_place_has_one_once_another_is_idle() {
    let places = Rc::new(Places::new(2));
    let now = Instant::now();
    let first = places.enter(Some((1000, Some(1))), now);
    let _silent = places.enter(Some((1000, Some(2))), now);
    first.set(Doing::Releasing, now);
    assert!(timeout(UNHEARD / 2, places.room()).await.is_err());
    first.set(Doing::Nothing, now);
    places.room().await;
    first.set(Doing::Releasing, now);
    assert!(timeout(UNHEARD / 4, places.room()).await.is_err());
    // The other has said nothing for long.
    places.room().await;
    assert!(now.elapsed() >= UNHEARD);
}

#[test]
fn who_says_nothing_at_all_is_idle_before_long() {
    let places = Rc::new(Places::new(MOST));
    let start = Instant::now();
    let of = |pid| Some((1000, Some(pid)));
    let silent = places.enter(of(1), start);
    let releasing: Vec<_> = (2..=MOST as i32)
        .map(|pid| {
            let place = places.enter(of(pid), start);
            place.set(Doing::Releasing, start);
            place
        })
        .collect();
    assert!(!places.has_room(start));
    let _new = places.enter(None, start + UNHEARD);
    assert!(has_to_go(&silent) && !releasing.iter().any(has_to_go));
}

#[test]
fn who_drives_a_motor_goes_last_of_those_that_are_busy_and_they_only_where_they_have_most_places() {
    let start = Instant::now();
    let places = Rc::new(Places::new(MOST));
    let enter = |pid| places.enter(Some((1000, Some(pid))), start);
    let driving = enter(1);
    let _motors = drive(&driving);
    let silent: Vec<_> = (2..=MOST as i32).map(enter).collect();
    assert!(!places.has_room(start));
    let heard = start + UNHEARD;
    let new = places.enter(None, heard);
    assert!(has_to_go(&silent[0]) && !has_to_go(&driving));
    // With these the busy ones have half of the places.
    let busy = &silent[1..MOST / 2];
    busy.iter().for_each(|place| place.set(Doing::Obeying, heard));
    (silent[MOST / 2..].iter()).for_each(|place| place.set(Doing::Releasing, heard));
    assert!(!places.has_room(heard));
    new.set(Doing::Obeying, heard);
    assert!(places.has_room(heard));
    let _newer = places.enter(None, heard);
    assert!(has_to_go(&busy[0]) && !has_to_go(&driving) && !places.has_room(heard));
}

#[test]
fn who_drives_many_motors_by_a_connection_each_keeps_them_where_others_are_idle() {
    let places = Rc::new(Places::new(MOST));
    let start = Instant::now();
    let enter = |pid| places.enter(Some((1000, Some(pid))), start);
    let driving: Vec<_> = (0..MOST / 8 + 1).map(|_| enter(1)).collect();
    let _motors: Vec<_> = driving.iter().map(drive).collect();
    let silent: Vec<_> = (driving.len()..MOST).map(|n| enter(2 + n as i32 % 8)).collect();
    let _new = places.enter(None, start + UNHEARD);
    assert!(has_to_go(&silent[0]) && !driving.iter().any(has_to_go));
}

#[test]
fn who_held_a_motor_once_crowds_others_and_goes_before_who_still_does() {
    let places = Rc::new(Places::new(MOST));
    let start = Instant::now();
    let at = |n| start + Duration::from_millis(n);
    let driving = places.enter(Some((1000, Some(1))), start);
    let _motors = drive(&driving);
    driving.set(Doing::Nothing, start);
    // One connection after the other of another process takes hold of a motor, of which each has held but the last.
    let others: Vec<_> = (1..MOST as u64)
        .map(|n| {
            let place = places.enter(Some((1000, Some(2))), at(n));
            let [own, of_motor] = drive(&place);
            place.set(Doing::Nothing, at(n));
            (place, own, Some(of_motor).filter(|_| n + 1 == MOST as u64))
        })
        .collect();
    let mut new = Vec::new();
    for n in 0..3 {
        new.push(places.enter(Some((1000, Some(3))), at(MOST as u64)));
        assert!(has_to_go(&others[n].0) && !has_to_go(&others[n + 1].0));
    }
    assert!(!has_to_go(&driving));
}

/// What a connection does at this time, ms, where it does something else than before.
type Habit = fn(number: usize, ms: u64) -> Option<Doing>;

const HABITS: [(&str, Habit); 7] = [
    ("says nothing", |_, _| None),
    ("switches motors off without a pause", |_, _| {
        Some(Doing::Releasing)
    }),
    ("has one after the other switched off", |_, ms| match ms % 20 {
        0 => Some(Doing::Releasing),
        10 => Some(Doing::Unheard),
        _ => None,
    }),
    ("begins as late as it may", |_, ms| {
        (ms % 400 == 90).then_some(Doing::Releasing)
    }),
    ("asks", |_, ms| {
        Some([Doing::Obeying, Doing::Nothing][ms as usize % 20 / 10])
    }),
    (
        "asks for what takes long, but for one",
        |number, ms| match number {
            0 => (ms % 20 == 0).then_some(Doing::Releasing),
            _ => Some(Doing::Obeying),
        },
    ),
    ("does now this and now that", |number, ms| {
        let random = (number as u64 * 7919 + ms).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 60;
        let doing = [Doing::Releasing, Doing::Unheard, Doing::Obeying, Doing::Releasing];
        doing.get(random as usize).copied()
    }),
];

#[test]
fn whoever_comes_is_let_in_in_time_and_heard_whatever_eight_processes_do_with_sixteen_connections_each() {
    for (habit, does) in HABITS {
        for comes_ms in (0..1500).step_by(250) {
            let places = Rc::new(Places::new(MOST));
            let start = Instant::now();
            let enter = |number: usize, now| places.enter(Some((1000, Some(number as i32 / 16))), now);
            let mut others: Vec<Place> = (0..MOST).map(|number| enter(number, start)).collect();
            let mut new: Option<Place> = None;
            let mut let_in_ms = None;
            for ms in (0..comes_ms + 900).step_by(10) {
                let now = start + Duration::from_millis(ms);
                for (number, place) in others.iter_mut().enumerate() {
                    if let Some(doing) = does(number, ms) {
                        place.set(doing, now);
                    }
                    // Whose place is taken comes again, behind whoever waits.
                    if new.is_some() && has_to_go(place) && places.has_room(now) {
                        *place = enter(number, now);
                    }
                }
                match &new {
                    None if ms >= comes_ms && places.has_room(now) => {
                        new = Some(places.enter(Some((1000, Some(99))), now));
                        let_in_ms = Some(ms);
                    }
                    Some(place) => {
                        // Its line comes after 90 ms, and its servo answers in no time.
                        if let_in_ms.is_some_and(|let_in| ms == let_in + 90) {
                            place.set(Doing::Releasing, now);
                        }
                        let is_kept = let_in_ms.is_some_and(|let_in| ms < let_in + 400);
                        assert!(!is_kept || !has_to_go(place), "{habit}: {comes_ms} ms");
                    }
                    None => {}
                }
            }
            let waited = let_in_ms.map(|ms| ms - comes_ms);
            assert!(
                waited.is_some_and(|ms| ms <= 400),
                "{habit}: {waited:?} from {comes_ms} ms"
            );
        }
    }
}

#[test]
fn who_has_motors_switched_off_one_after_the_other_is_kept_until_the_last_but_not_for_ever() {
    let start = Instant::now();
    let at = |ms| start + Duration::from_millis(ms);
    let places = Rc::new(Places::new(2));
    let enter = |pid, ms| places.enter(Some((1000, Some(pid))), at(ms));
    let client = enter(1, 0);
    let mut silent: Option<Place> = None;
    let mut has_room = |ms| {
        // The other one always has just come.
        drop(silent.take());
        silent = Some(enter(2, ms));
        places.has_room(at(ms))
    };
    for batch_ms in [0, 5000, 6000] {
        for ms in (batch_ms..batch_ms + 400).step_by(100) {
            client.set(Doing::Releasing, at(ms));
            assert!(!has_room(ms + 10), "{ms} ms");
            client.set(Doing::Unheard, at(ms + 20));
            assert!(!has_room(ms + 99), "{ms} ms");
        }
        client.set(Doing::Releasing, at(batch_ms + 400));
        client.set(Doing::Unheard, at(batch_ms + 420));
        assert!(has_room(batch_ms + 420), "{batch_ms} ms");
        client.set(Doing::Nothing, at(batch_ms + 500));
    }
}

#[test]
fn who_has_gone_is_not_waited_for_whatever_it_had_asked() {
    let places = Rc::new(Places::new(MOST));
    let now = Instant::now();
    let enter = |pid| places.enter(Some((1000, Some(pid))), now);
    let held: Vec<_> = (0..MOST as i32).map(enter).collect();
    held[7].set(Doing::Gone, now);
    held[7].set(Doing::Releasing, now);
    assert!(places.has_room(now));
    let _new = enter(-1);
    assert!(has_to_go(&held[7]) && !places.has_room(now));
}

#[test]
fn who_leaves_gives_the_place_back_and_nobody_has_to_go() {
    let places = Rc::new(Places::new(MOST));
    let now = Instant::now();
    let held: Vec<Place> = (0..MOST).map(|_| places.enter(None, now)).collect();
    let mut held = held.into_iter();
    drop(held.next());
    let new = places.enter(None, now);
    assert!(!has_to_go(&new) && !held.any(|place| has_to_go(&place)));
}
