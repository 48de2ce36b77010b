//! Which files a store makes and removes, whatever happens to it, to them and to others'.

use std::path::Path;
use taxel_recorder::{Around, Entry, Preamble, RecordingReader, Split, Store, Topic, text_message};

const S: u64 = 1_000_000_000;

fn entry(topic: Topic, wall_ns: u64, text: &str) -> Entry {
    let data = text_message(text);
    Entry { topic, wall_ns, data }
}

fn note(wall_ns: u64) -> Entry {
    entry(Topic::Events, wall_ns, "a note")
}

fn split(most_files: usize) -> Split {
    Split {
        after_ns: Some(10 * S),
        most_files: Some(most_files),
        ..Split::default()
    }
}

/// A store of `day.mcap`, split after ten seconds.
fn day(folder: &Path, most_files: usize) -> Store {
    Store::new(
        &folder.join("day.mcap"),
        Preamble::default(),
        split(most_files),
        None,
    )
}

/// What a run of `most_files` leaves that makes so many files.
fn run(folder: &Path, most_files: usize, files: u64) {
    let mut store = day(folder, most_files);
    for n in 0..files {
        store.take(entry(Topic::Events, 20 * n * S, "")).unwrap();
        store.cut((20 * n + 10) * S).unwrap();
    }
    store.close().unwrap();
}

fn there(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<_> = entries
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

/// Texts of the events in a file.
fn events(path: &Path) -> Vec<String> {
    let mut reader = RecordingReader::open(path, &[Topic::Events]).unwrap();
    let mut texts = Vec::new();
    while let Some(item) = reader.next_item().unwrap() {
        if let taxel_recorder::Item::Message { data, .. } = item {
            texts.push(taxel_recorder::read_text(data).unwrap().to_owned());
        }
    }
    assert!(reader.left_out().is_empty(), "{:?}", reader.left_out());
    texts
}

#[test]
fn a_recorder_to_which_nothing_comes_makes_and_removes_no_file_however_often_it_is_started() {
    let folder = tempfile::tempdir().unwrap();
    run(folder.path(), 3, 3);
    let good = there(folder.path());
    assert_eq!(good.len(), 3);
    for _ in 0..4 {
        let mut store = day(folder.path(), 3);
        store.check().unwrap();
        // An hour, in which the daemon is waited for.
        for second in 0..3600 {
            store.note(note(second * S)).unwrap();
            store.cut(second * S).unwrap();
        }
        store.close().unwrap();
        assert_eq!((store.files().len(), store.removed()), (0, 0));
        assert_eq!(there(folder.path()), good);
    }
}

#[test]
fn a_file_begins_with_what_the_recorder_itself_said_in_the_ten_seconds_before() {
    let folder = tempfile::tempdir().unwrap();
    let mut store = day(folder.path(), 3);
    for second in 0..20 {
        store
            .note(entry(Topic::Events, second * S, &second.to_string()))
            .unwrap();
    }
    store.take(entry(Topic::Hello, 20 * S, "hello")).unwrap();
    store.close().unwrap();
    let file = folder.path().join("day-0001.mcap");
    let seconds: Vec<String> = (9..20).map(|second| second.to_string()).collect();
    assert_eq!(events(&file), seconds);
}

#[test]
fn the_oldest_files_make_room_only_when_the_new_one_can_be_read() {
    let folder = tempfile::tempdir().unwrap();
    run(folder.path(), 3, 3);
    let mut store = day(folder.path(), 3);
    store.take(entry(Topic::Events, 0, "")).unwrap();
    assert_eq!(store.removed(), 0);
    assert!(folder.path().join("day-0001.mcap").exists());
    store.cut(S).unwrap();
    assert_eq!(store.removed(), 1);
    assert_eq!(
        there(folder.path()),
        ["day-0002.mcap", "day-0003.mcap", "day-0004.mcap"]
    );
}

#[test]
fn recorders_that_give_their_files_one_name_leave_no_more_than_either_wants_and_no_file_of_the_other_half_written()
 {
    let folder = tempfile::tempdir().unwrap();
    let (mut slow, mut fast) = (day(folder.path(), 3), day(folder.path(), 3));
    slow.take(entry(Topic::Events, 0, "slow")).unwrap();
    slow.cut(0).unwrap();
    for n in 0..6 {
        fast.take(entry(Topic::Events, 20 * n * S, "fast")).unwrap();
        fast.cut((20 * n + 10) * S).unwrap();
    }
    let left = ["day-0001.mcap", "day-0006.mcap", "day-0007.mcap"];
    assert_eq!(there(folder.path()), left);
    slow.close().unwrap();
    assert_eq!(events(&folder.path().join(left[0])), ["slow"]);
    slow.take(entry(Topic::Events, S, "slow")).unwrap();
    slow.close().unwrap();
    assert_eq!(
        there(folder.path()),
        ["day-0006.mcap", "day-0007.mcap", "day-0008.mcap"]
    );
}

#[test]
fn a_trigger_before_which_nothing_came_makes_a_file_of_what_comes_behind_it() {
    let folder = tempfile::tempdir().unwrap();
    let around = Around {
        before_ns: 3 * S,
        after_ns: 5 * S,
    };
    let path = folder.path().join("slip.mcap");
    let mut store = Store::new(&path, Preamble::default(), Split::default(), Some(around));
    store.note(note(S)).unwrap();
    assert!(!store.trigger(S).unwrap());
    store.cut(S).unwrap();
    assert!(there(folder.path()).is_empty() && !store.is_writing());
    for second in 4..10 {
        store
            .take(entry(Topic::Events, second * S, &second.to_string()))
            .unwrap();
        store.cut(second * S).unwrap();
    }
    store.close().unwrap();
    assert_eq!(there(folder.path()), ["slip-0001.mcap"]);
    assert_eq!(
        events(&folder.path().join("slip-0001.mcap")),
        ["a note", "4", "5", "6"]
    );
}
