//! Who is let in, and who makes room for whom.

use super::*;

fn registry(max_subscribers: usize) -> Registry {
    let stall_ms = 1000;
    Registry::new(Limits {
        max_subscribers,
        stall_ms,
    })
}

fn entry(pid: i32) -> Arc<Entry> {
    Arc::new(Entry::new(Some(pid), Some(1000), 0))
}

fn has_place(registry: &Registry, entry: &Arc<Entry>) -> bool {
    registry.entries().iter().any(|other| Arc::ptr_eq(other, entry))
}

fn enter_as_guest(registry: &Registry, entry: &Arc<Entry>) -> bool {
    registry.enter(entry) && entry.is_guest()
}

/// Whether one of this process is let in, and stays.
fn enter(registry: &Registry, pid: i32) -> bool {
    let entry = entry(pid);
    if enter_as_guest(registry, &entry) {
        registry.settle(&entry);
    }
    has_place(registry, &entry)
}

fn why(entry: &Entry) -> Option<Farewell> {
    entry.dismissal.lock().unwrap().take()
}

fn want_nothing(entry: &Entry) {
    entry.set_wants(&taxel_wire::Subscribe {
        image: false,
        ..Default::default()
    });
}

fn places(registry: &Registry) -> Vec<i32> {
    registry.entries().iter().filter_map(|entry| entry.pid).collect()
}

fn places_of(registry: &Registry, pid: i32) -> usize {
    places(registry).iter().filter(|other| **other == pid).count()
}

#[test]
fn the_process_with_most_readers_makes_room_for_one_that_has_fewer_until_both_have_as_many() {
    let registry = registry(8);
    assert!((0..7).all(|_| enter(&registry, 1)) && enter(&registry, 2));
    let oldest = registry.entries()[0].clone();
    assert!(!enter(&registry, 1), "it has most of them itself");
    assert!(enter(&registry, 3));
    assert!(!has_place(&registry, &oldest));
    assert_eq!(places(&registry), [1, 1, 1, 1, 1, 1, 2, 3]);
    assert!(matches!(why(&oldest), Some(Farewell::Crowds)));
    assert!(enter(&registry, 2) && enter(&registry, 2));
    assert_eq!(places(&registry), [1, 1, 1, 1, 2, 3, 2, 2]);
    assert!(!enter(&registry, 2), "both would push each other out in turn");
    assert!(enter(&registry, 3));
    assert_eq!(places(&registry), [1, 1, 1, 2, 3, 2, 2, 3]);
}

#[test]
fn who_is_shown_nothing_makes_room_first_and_nobody_where_each_has_one() {
    let registry = registry(8);
    assert!((0..8).all(|_| enter(&registry, 1)));
    let onlooker = registry.entries()[5].clone();
    want_nothing(&onlooker);
    assert!(enter(&registry, 2));
    assert!(matches!(why(&onlooker), Some(Farewell::MadeRoom)));
    assert!(!has_place(&registry, &onlooker));

    let registry = self::registry(8);
    assert!((0..8).all(|pid| enter(&registry, pid)) && !enter(&registry, 9));
}

#[test]
fn who_only_looks_in_or_is_to_be_shown_nothing_puts_no_display_out() {
    let registry = registry(8);
    assert!((0..8).all(|_| enter(&registry, 1)));
    for pid in 2..100 {
        let guest = entry(pid);
        assert!(enter_as_guest(&registry, &guest));
        registry.remove(&guest);
        registry.settle(&guest);
    }
    let onlooker = entry(100);
    assert!(enter_as_guest(&registry, &onlooker));
    want_nothing(&onlooker);
    registry.settle(&onlooker);
    assert!(matches!(why(&onlooker), Some(Farewell::TooMany(8))));
    assert_eq!(places(&registry), [1; 8]);

    // Where somebody has left meanwhile, nobody has to.
    let guest = entry(101);
    assert!(enter_as_guest(&registry, &guest));
    registry.remove(&registry.entries()[0].clone());
    registry.settle(&guest);
    assert_eq!(places(&registry), [1, 1, 1, 1, 1, 1, 1, 101]);
}

#[test]
fn guests_are_few_and_each_that_stays_puts_out_one() {
    let registry = registry(8);
    assert!((0..8).all(|_| enter(&registry, 1)));
    let guests: Vec<_> = (2..5).map(entry).collect();
    let entered: Vec<_> = (guests.iter().map(|guest| enter_as_guest(&registry, guest))).collect();
    assert_eq!(entered, [true, true, false]);
    for guest in &guests {
        registry.settle(guest);
    }
    assert_eq!(places(&registry), [1, 1, 1, 1, 1, 1, 2, 3]);
}

#[test]
fn a_process_that_looks_in_again_and_again_keeps_no_display_from_being_a_guest() {
    for places in [4, 8, 32] {
        let registry = registry(places);
        assert!((0..places).all(|_| enter(&registry, 1)));
        let lookers: Vec<_> = (0..16).map(|_| entry(2)).collect();
        let entered = (lookers.iter().filter(|looker| registry.enter(looker))).count();
        assert_eq!(entered, (places / 4).max(2));
        let display = entry(3);
        assert!(enter_as_guest(&registry, &display), "{places} places");
        assert!(matches!(why(&lookers[0]), Some(Farewell::TooMany(_))));
        assert!(!has_place(&registry, &lookers[0]));
        assert!(!registry.enter(&entry(2)), "not in turn");
        lookers.iter().for_each(|looker| registry.remove(looker));
        registry.settle(&display);
        assert_eq!(places_of(&registry, 3), 1);
        assert_eq!(places_of(&registry, 1), places - 1);
    }
}

#[test]
fn many_processes_that_look_in_again_and_again_keep_no_display_from_being_a_guest() {
    for places in [4, 8, 32] {
        let registry = registry(places);
        assert!((0..places).all(|_| enter(&registry, 1)));
        let look_in = || -> Vec<_> {
            let guests = (100..140).map(entry);
            guests.filter(|guest| enter_as_guest(&registry, guest)).collect()
        };
        let mut lookers = look_in();
        assert!(
            !registry.enter(&entry(2)),
            "nobody knows yet that they will not stay"
        );
        while registry.looked_in.borrow().len() < 40 {
            lookers.iter().for_each(|looker| registry.remove(looker));
            lookers = look_in();
        }
        let displays = [entry(2), entry(3)];
        for display in &displays {
            assert!(enter_as_guest(&registry, display), "{places} places");
        }
        assert!(!has_place(&registry, &lookers[0]) && !has_place(&registry, &lookers[1]));
        // Put out, they try again.
        assert!(look_in().is_empty());
        for display in &displays {
            registry.settle(display);
            assert!(has_place(&registry, display));
        }
        assert_eq!(places_of(&registry, 1), places - 2);
    }
}

#[test]
fn whoever_stays_has_not_looked_in_and_few_that_have_are_known() {
    let registry = registry(8);
    assert!((0..8).all(|_| enter(&registry, 1)));
    for pid in (2..1000).chain([2, 3]) {
        let guest = entry(pid);
        assert!(enter_as_guest(&registry, &guest));
        registry.remove(&guest);
    }
    assert_eq!(registry.looked_in.borrow().len(), LOOKED_IN);
    assert!(enter(&registry, 2) && places_of(&registry, 2) == 1);
    let looked_in = registry.looked_in.borrow();
    assert_eq!(looked_in.back(), Some(&(Some(1000), 3)));
}

#[test]
fn who_is_shown_nothing_puts_nobody_out_also_where_another_is_shown_nothing() {
    let registry = registry(1);
    let [first, second] = [entry(1), entry(2)];
    assert!(registry.enter(&first));
    want_nothing(&first);
    assert!(enter_as_guest(&registry, &second));
    want_nothing(&second);
    registry.settle(&second);
    assert!(matches!(why(&second), Some(Farewell::TooMany(1))));
    assert!(has_place(&registry, &first) && !has_place(&registry, &second));
}

#[test]
fn a_guest_leaves_for_no_place() {
    let registry = registry(8);
    assert!((0..8).all(|_| enter(&registry, 1)));
    let [display, onlooker] = [entry(2), entry(3)];
    assert!(enter_as_guest(&registry, &onlooker) && enter_as_guest(&registry, &display));
    want_nothing(&onlooker);
    registry.settle(&display);
    registry.settle(&onlooker);
    assert_eq!(places(&registry), [1, 1, 1, 1, 1, 1, 1, 2]);
}

#[test]
fn readers_that_the_kernel_does_not_tell_apart_crowd_nobody() {
    let unknown = || Arc::new(Entry::new(None, Some(0), 0));
    let registry = registry(8);
    assert!((0..6).all(|_| registry.enter(&unknown())));
    assert!(enter(&registry, 1) && enter(&registry, 1));
    // Two of a process are more than an eighth, and six of nobody knows whom are not for one that is known.
    assert!(enter(&registry, 2));
    assert_eq!(places(&registry), [1, 2]);
    assert!(!registry.enter(&unknown()));
}
