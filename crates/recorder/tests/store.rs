//! Which files a store makes and removes, whatever happens to it, to them and to others'.

use std::ops::Range;
use std::path::Path;
use taxel_recorder::{
    Around, Attached, Entry, Item, Preamble, RecordingReader, Split, Store, Topic, text_message,
};

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

/// A store of `slip.mcap`: what is around triggers, from three seconds before to five behind.
fn slip(folder: &Path) -> Store {
    let around = Around {
        before_ns: 3 * S,
        after_ns: 5 * S,
    };
    Store::new(
        &folder.join("slip.mcap"),
        Preamble::default(),
        Split::default(),
        Some(around),
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

/// An event at each of these seconds, which says which.
fn fill(store: &mut Store, seconds: Range<u64>) {
    for second in seconds {
        let event = entry(Topic::Events, second * S, &second.to_string());
        store.take(event).unwrap();
        store.cut(second * S).unwrap();
    }
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
fn a_finished_file_makes_room_while_it_is_on_its_way_to_the_disk() {
    let folder = tempfile::tempdir().unwrap();
    let mut store = day(folder.path(), 1);
    let on_their_way: Vec<_> = (0..3)
        .map(|n| {
            store.take(entry(Topic::Events, 20 * n * S, "")).unwrap();
            store.cut((20 * n + 10) * S).unwrap();
            let mut out = Vec::new();
            store.hand_out(|written| {
                out.push(written);
                Ok(())
            });
            out
        })
        .collect();
    assert_eq!(there(folder.path()), ["day-0003.mcap"]);
    assert_eq!((on_their_way.len(), store.removed()), (3, 2));
}

#[test]
fn every_file_is_handed_out_when_it_is_whole_however_it_ended_and_however_busy_its_disk_was() {
    let folder = tempfile::tempdir().unwrap();
    let around = Around {
        before_ns: S,
        after_ns: S,
    };
    let path = folder.path().join("marks.mcap");
    let mut store = Store::new(&path, Preamble::default(), Split::default(), Some(around));
    let (mut being_written, mut whole) = (Vec::new(), Vec::new());
    // Marks at 10, 20 .. s. Each file ends by the first message behind it, by a cut, or in the end; the disk is busy
    // up to 35 s, and takes one at a time then.
    for half_second in 0..=100 {
        let now_ns = half_second * S / 2;
        if half_second % 20 == 0 && half_second > 0 {
            store.trigger(now_ns).unwrap();
        }
        if half_second % 40 < 22 {
            store.take(entry(Topic::Events, now_ns, "felt")).unwrap();
        }
        store.cut(now_ns).unwrap();
        let current = store.files().pop().filter(|_| store.is_writing());
        let mut room = usize::from(half_second > 70);
        store.hand_out(|written| {
            if room == 0 {
                return Err(written);
            }
            room -= 1;
            match current.as_ref() == Some(&written.path) {
                true => being_written.push(written.path),
                false => whole.push(written.path),
            }
            Ok(())
        });
    }
    let made = store.files();
    assert_eq!(made.len(), 5);
    assert!(store.is_writing() && being_written.contains(&made[4]));
    assert_eq!(whole, made[..4]);
    store.close().unwrap();
    store.hand_out(|written| {
        whole.push(written.path);
        Ok(())
    });
    assert_eq!(whole, made);
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
    let mut store = slip(folder.path());
    store.note(note(S)).unwrap();
    assert!(!store.trigger(S).unwrap());
    store.cut(S).unwrap();
    assert!(there(folder.path()).is_empty() && !store.is_writing());
    fill(&mut store, 4..10);
    store.close().unwrap();
    assert_eq!(there(folder.path()), ["slip-0001.mcap"]);
    assert_eq!(
        events(&folder.path().join("slip-0001.mcap")),
        ["a note", "4", "5", "6"]
    );
}

#[test]
fn frames_that_were_gathered_across_an_end_of_what_is_kept_are_kept() {
    let folder = tempfile::tempdir().unwrap();
    let mut store = slip(folder.path());
    // A message of frames has the time of its first one, and comes when its last one is there.
    const MS: u64 = 1_000_000;
    let images = |from_ns: u64, to_ns: u64| (from_ns..to_ns).step_by(10 * MS as usize);
    let (begins_ns, ends_ns) = (7 * S - 90 * MS, 15 * S - 10 * MS);
    for (from_ns, can_ns, comes_ns) in [
        (6 * S, begins_ns, 7 * S + 10 * MS),
        (10 * S, ends_ns, 15 * S + 90 * MS),
    ] {
        for at_ns in images(from_ns, comes_ns) {
            store.take(entry(Topic::Images, at_ns, "")).unwrap();
            if at_ns == 10 * S {
                store.trigger(at_ns).unwrap();
            }
        }
        store.take(entry(Topic::Can, can_ns, "")).unwrap();
        store.cut(comes_ns).unwrap();
    }
    store.close().unwrap();
    let mut reader = RecordingReader::open(&folder.path().join("slip-0001.mcap"), &[Topic::Can]).unwrap();
    let mut kept_ns = Vec::new();
    while let Some(item) = reader.next_item().unwrap() {
        if let taxel_recorder::Item::Message { wall_ns, .. } = item {
            kept_ns.push(wall_ns);
        }
    }
    assert_eq!(kept_ns, [begins_ns, ends_ns]);
}

#[test]
fn each_file_has_the_times_of_the_clock_as_it_stood_when_it_was_begun() {
    let folder = tempfile::tempdir().unwrap();
    let mut store = day(folder.path(), 9);
    let day_ns = 86_400 * S;
    let times = |number: u64| {
        let path = folder.path().join(format!("day-000{number}.mcap"));
        let mut reader = RecordingReader::open(&path, &[Topic::Hello, Topic::Events]).unwrap();
        let mut seconds = Vec::new();
        while let Some(item) = reader.next_item().unwrap() {
            if let taxel_recorder::Item::Message { wall_ns, .. } = item {
                seconds.push(wall_ns / S);
            }
        }
        seconds
    };
    store.set_clock(day_ns as i64);
    store.take(entry(Topic::Hello, 100 * S, "")).unwrap();
    // Set in the middle of a file: forward, and back to before the first.
    for (clock_ns, second) in [(2 * day_ns, 105), (2 * day_ns, 110), (0, 115), (0, 121), (0, 125)] {
        store.set_clock(clock_ns as i64);
        fill(&mut store, second..second + 1);
    }
    store.close().unwrap();
    let day_s = day_ns / S;
    // The first message of a hand stands at the beginning of every file.
    assert_eq!(times(1), [100, 100, 105, 110].map(|second| day_s + second));
    assert_eq!(times(2), [115, 115, 121, 125]);
}

#[test]
fn a_file_that_others_do_something_to_is_told_and_the_recording_goes_on_in_another() {
    type Harm = fn(&Path);
    let rename: Harm = |path| std::fs::rename(path, path.with_extension("old")).unwrap();
    let cases: [(&str, Harm, &str, &[&str]); 6] = [
        (
            "removed",
            |path| std::fs::remove_file(path).unwrap(),
            "was removed or renamed",
            &["a-0001.mcap"],
        ),
        (
            "renamed",
            rename,
            "was removed or renamed",
            &["a-0001.mcap", "a.old"],
        ),
        (
            "replaced",
            |path| {
                std::fs::write(path.with_extension("new"), "another").unwrap();
                std::fs::rename(path.with_extension("new"), path).unwrap();
            },
            "is now another file",
            &["a-0001.mcap", "a.mcap"],
        ),
        (
            "emptied",
            |path| std::fs::write(path, "").unwrap(),
            "was changed by another program",
            &["a-0001.mcap", "a.mcap"],
        ),
        (
            "emptied by a link to it",
            |path| {
                std::fs::rename(path, path.with_extension("old")).unwrap();
                std::os::unix::fs::symlink("a.old", path).unwrap();
                std::fs::write(path, "").unwrap();
            },
            "was changed by another program",
            &["a-0001.mcap", "a.mcap", "a.old"],
        ),
        (
            "with more in it",
            |path| {
                let mut whole = std::fs::read(path).unwrap();
                whole.extend([0; 100]);
                std::fs::write(path, whole).unwrap();
            },
            "was changed by another program",
            &["a-0001.mcap", "a.mcap"],
        ),
    ];
    for (name, harm, said, files) in cases {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.mcap");
        let mut store = Store::new(&path, Preamble::default(), Split::default(), None);
        store.take(entry(Topic::Events, 0, "before")).unwrap();
        store.cut(0).unwrap();
        assert!(store.gone().is_empty(), "{name}");
        harm(&path);
        store.take(entry(Topic::Events, S, "at")).unwrap();
        store.cut(S).unwrap();
        assert_eq!(store.gone().len(), 1, "{name}");
        let gone = store.gone()[0].to_string();
        assert!(gone.contains("a.mcap") && gone.contains(said), "{name}: {gone}");
        store.take(entry(Topic::Events, 2 * S, "behind")).unwrap();
        store.cut(2 * S).unwrap();
        store.close().unwrap();
        let another = folder.path().join("a-0001.mcap");
        assert_eq!(store.files(), [&*another], "{name}");
        assert_eq!(store.gone().len(), 1, "{name}");
        assert_eq!(there(folder.path()), files, "{name}");
        assert_eq!(events(&another), ["behind"], "{name}");
        if name == "renamed" {
            assert_eq!(events(&path.with_extension("old")), ["before", "at"]);
        }
    }
}

#[test]
fn what_is_around_a_trigger_goes_on_in_another_file_where_its_own_is_gone() {
    let folder = tempfile::tempdir().unwrap();
    let mut store = slip(folder.path());
    store.take(entry(Topic::Events, S, "1")).unwrap();
    assert!(store.trigger(S).unwrap());
    store.cut(S).unwrap();
    std::fs::remove_file(folder.path().join("slip-0001.mcap")).unwrap();
    fill(&mut store, 2..9);
    store.close().unwrap();
    assert_eq!(there(folder.path()), ["slip-0002.mcap"]);
    assert_eq!(
        events(&folder.path().join("slip-0002.mcap")),
        ["3", "4", "5", "6"]
    );
}

#[test]
fn a_file_that_is_gone_when_it_is_closed_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let mut store = Store::new(&path, Preamble::default(), Split::default(), None);
    store.take(entry(Topic::Events, 0, "")).unwrap();
    std::fs::remove_file(&path).unwrap();
    store.close().unwrap();
    assert_eq!((store.gone().len(), store.files().len()), (1, 0));
}

#[test]
fn what_is_of_another_configuration_is_in_another_file_with_that_at_its_beginning() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let preamble = |config: &str| Preamble {
        attached: vec![Attached {
            name: "taxeld.toml".into(),
            media_type: "application/toml".into(),
            data: config.into(),
        }],
        ..Preamble::default()
    };
    let held = |name: &str| {
        let topics = [Topic::Hello, Topic::Events];
        let mut reader = RecordingReader::open(&folder.path().join(name), &topics).unwrap();
        let mut held = Vec::new();
        while let Some(item) = reader.next_item().unwrap() {
            held.push(match item {
                Item::Attached(attached) => String::from_utf8(attached.data).unwrap(),
                Item::Message { data, .. } => taxel_recorder::read_text(data).unwrap().to_owned(),
                Item::Damaged => panic!("damaged"),
            });
        }
        held.dedup();
        held
    };
    let mut store = Store::new(&path, preamble("first"), Split::default(), None);
    // Nothing came yet that would be in another file.
    assert!(!store.begin_another(preamble("second")).unwrap());
    store.take(entry(Topic::Hello, 0, "one hand")).unwrap();
    assert!(store.begin_another(preamble("third")).unwrap());
    // Before the daemon describes its hand anew, frames of its buses may come.
    store.take(entry(Topic::Events, S, "between")).unwrap();
    store.take(entry(Topic::Hello, S, "another")).unwrap();
    store.close().unwrap();
    assert_eq!(held("a.mcap"), ["second", "one hand"]);
    assert_eq!(held("a-0001.mcap"), ["third", "between", "another"]);

    // What waits for a trigger is of one configuration, too.
    let around = Around {
        before_ns: 30 * S,
        after_ns: S,
    };
    let path = folder.path().join("slip.mcap");
    let mut store = Store::new(&path, preamble("first"), Split::default(), Some(around));
    store.take(entry(Topic::Events, 0, "before")).unwrap();
    assert!(store.begin_another(preamble("second")).unwrap());
    store.take(entry(Topic::Events, S, "behind")).unwrap();
    assert!(store.trigger(2 * S).unwrap());
    store.close().unwrap();
    assert_eq!(held("slip-0001.mcap"), ["second", "behind"]);
}

#[test]
fn files_beyond_the_millionth_are_of_the_ring_too_and_those_with_a_date_are_not() {
    let folder = tempfile::tempdir().unwrap();
    for number in ["999998", "20261125", "1764131234"] {
        std::fs::write(folder.path().join(format!("day-{number}.mcap")), mcap::MAGIC).unwrap();
    }
    for (files, ring) in [(4, ["1000001", "1000002"]), (1, ["1000002", "1000003"])] {
        run(folder.path(), 2, files);
        let left = [ring, ["1764131234", "20261125"]].concat();
        let left = left.iter().map(|number| format!("day-{number}.mcap"));
        assert_eq!(there(folder.path()), left.collect::<Vec<_>>());
    }
    assert_eq!(taxel_recorder::parts(&folder.path().join("day.mcap")).len(), 2);

    std::fs::write(folder.path().join("day-9999999.mcap"), mcap::MAGIC).unwrap();
    let mut store = day(folder.path(), 2);
    let error = store.take(entry(Topic::Events, 0, "")).unwrap_err();
    assert!(
        error
            .to_string()
            .contains("day-10000000.mcap: its numbers are used up")
    );
}
