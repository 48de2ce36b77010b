//! What is written reads back, also where it was torn off or the disk was full.

mod compressed;
mod damage;
mod others;

use std::cell::RefCell;
use std::io::{self, Cursor, Seek, SeekFrom, Write};
use std::path::Path;
use std::rc::Rc;
use taxel_can::{CanFrame, Received};
use taxel_recorder::{
    Around, Attached, CanBlock, CanReader, Entry, Item, Preamble, RecordingReader, RecordingWriter, Split,
    Store, StoreError, Topic, event_message, text_message,
};

const S: u64 = 1_000_000_000;

fn entry(topic: Topic, wall_ns: u64, text: &str) -> Entry {
    let data = text_message(text);
    Entry { topic, wall_ns, data }
}

/// Texts of a topic, in the order in which they stand in the file, and what of it could not be read.
fn texts(path: &Path, topic: Topic) -> (Vec<String>, Vec<String>) {
    let mut reader = RecordingReader::open(path, &[topic]).unwrap();
    let mut texts = Vec::new();
    while let Some(item) = reader.next_item().unwrap() {
        if let Item::Message { data, .. } = item {
            texts.push(taxel_recorder::read_text(data).unwrap().to_owned());
        }
    }
    (texts, reader.left_out())
}

fn names(store: &Store) -> Vec<String> {
    let name = |path: &Path| path.file_name().unwrap().to_string_lossy().into_owned();
    store.files().iter().map(|path| name(path)).collect()
}

#[test]
fn messages_and_attached_files_read_back_as_they_were() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let attached = Attached {
        name: "taxeld.toml".into(),
        media_type: "application/toml".into(),
        data: b"layout = \"x\"".to_vec(),
    };
    let preamble = Preamble {
        attached: vec![attached.clone()],
        ..Preamble::default()
    };
    let mut writer = RecordingWriter::begin(Cursor::new(Vec::new()), &preamble, 7).unwrap();
    for n in 0..1000 {
        writer
            .put(&entry(Topic::Status, n, &format!("status {n}")))
            .unwrap();
        writer.put(&entry(Topic::Hello, n, "hello")).unwrap();
        if n == 500 {
            writer.cut().unwrap();
        }
    }
    assert_eq!(writer.messages(), 2000);
    let whole = writer.finish().unwrap().into_inner();
    let torn = &whole[..whole.len() - 1];
    std::fs::write(&path, torn).unwrap();
    let reader = RecordingReader::open(&path, &[Topic::Status]).unwrap();
    assert!(reader.may_hold(Topic::Images), "its end would tell");
    std::fs::write(&path, &whole).unwrap();
    let mut reader = RecordingReader::open(&path, &[Topic::Status]).unwrap();
    assert!(reader.may_hold(Topic::Status) && reader.may_hold(Topic::Hello));
    assert!(!reader.may_hold(Topic::Images));
    assert_eq!(reader.next_item().unwrap(), Some(Item::Attached(attached)));
    for n in 0..1000 {
        let data = text_message(&format!("status {n}"));
        let wanted = Item::Message {
            topic: Topic::Status,
            wall_ns: n,
            data: &data,
        };
        assert_eq!(reader.next_item().unwrap(), Some(wanted));
    }
    assert_eq!(reader.next_item().unwrap(), None);
    assert!(reader.left_out().is_empty());
}

#[test]
fn notices_are_warnings_and_marks_are_not() {
    // Behind the head of CDR and the time.
    let level = |kind| event_message(kind, "can0: no board speaks", 0)[4 + 8];
    assert_eq!(
        ["notice", "refused", "mark", "calibrated"].map(level),
        [30, 30, 20, 20]
    );
}

#[test]
fn can_frames_of_many_messages_are_one_stream_with_its_losses() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("can.mcap");
    let mut writer = RecordingWriter::begin(Cursor::new(Vec::new()), &Preamble::default(), 0).unwrap();
    let frame = |n: u64| Received {
        t_ns: 5 * S + n,
        frame: CanFrame::standard((n % 0x800) as u16, &n.to_le_bytes()).unwrap(),
    };
    let mut block = CanBlock::default();
    for (names, range) in [(vec!["a"], 0..3), (vec!["a", "b"], 3..6)] {
        let names: Vec<String> = names.into_iter().map(str::to_owned).collect();
        for n in range.clone() {
            assert!(block.push(names.len() as u8 - 1, &frame(n)));
        }
        let lost = vec![range.start; names.len()];
        let data = block.take(&names, &lost);
        writer
            .put(&Entry {
                topic: Topic::Can,
                wall_ns: 100 * S + range.start,
                data,
            })
            .unwrap();
    }
    writer.put(&entry(Topic::Can, 0, "no CAN frames")).unwrap();
    std::fs::write(&path, writer.finish().unwrap().into_inner()).unwrap();
    let mut reader = CanReader::open(&path).unwrap();
    for n in 0..6 {
        assert_eq!(
            reader.next_frame().unwrap(),
            Some((usize::from(n >= 3), frame(n)))
        );
        assert_eq!(reader.wall_ns(frame(n).t_ns), 100 * S + n);
    }
    assert_eq!(reader.next_frame().unwrap(), None);
    let names: Vec<&str> = reader.names().iter().map(|name| &**name).collect();
    assert_eq!(
        (names, reader.lost(), reader.undecodable()),
        (vec!["a", "b"], 6, 1)
    );
}

#[test]
fn a_recording_goes_on_in_another_file_after_its_time_and_the_oldest_make_room() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("day.mcap");
    let split = Split {
        after_ns: Some(10 * S),
        most_files: Some(2),
        ..Split::default()
    };
    std::fs::write(folder.path().join("day-0002.mcap"), "of another recording").unwrap();
    let mut store = Store::new(&path, Preamble::default(), split, None);
    store.check().unwrap();
    store.take(entry(Topic::Hello, 0, "hello")).unwrap();
    for second in 0..35 {
        store
            .take(entry(Topic::Events, second * S, &second.to_string()))
            .unwrap();
        store.cut(second * S).unwrap();
    }
    store.close().unwrap();
    assert_eq!(names(&store), ["day-0005.mcap", "day-0006.mcap"]);
    let last = store.files();
    let (events, torn) = texts(&last[0], Topic::Events);
    assert_eq!(
        (events.first().unwrap().as_str(), events.len(), torn.len()),
        ("22", 11, 0)
    );
    assert_eq!(
        texts(&last[1], Topic::Hello).0,
        ["hello"],
        "each file tells whose hand it is"
    );
    assert!(!folder.path().join("day-0003.mcap").exists());
    assert!(folder.path().join("day-0002.mcap").exists());
}

#[test]
fn a_recording_that_is_begun_anew_goes_on_with_numbers_and_room_where_the_last_one_ended() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("day.mcap");
    let run = |most_files, files: u64| {
        let split = Split {
            after_ns: Some(S),
            most_files: Some(most_files),
            ..Split::default()
        };
        let mut store = Store::new(&path, Preamble::default(), split, None);
        for second in 0..files {
            store.take(entry(Topic::Events, second * S, "")).unwrap();
            store.cut((second + 1) * S).unwrap();
        }
        store.close().unwrap();
        (names(&store), store.removed())
    };
    let there = || {
        let entries = std::fs::read_dir(folder.path()).unwrap();
        let mut names: Vec<String> = entries
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    };
    assert_eq!(run(3, 5).1, 2);
    assert_eq!(there(), ["day-0003.mcap", "day-0004.mcap", "day-0005.mcap"]);
    // What is called otherwise, is no recording, or no file, stays.
    let whole = std::fs::read(folder.path().join("day-0003.mcap")).unwrap();
    let others = [
        "day-1.mcap",
        "day-00003.mcap",
        "day-0003.mcap.part",
        "night-0003.mcap",
        "day-.mcap",
        "day-0003.log",
    ];
    for other in others {
        std::fs::write(folder.path().join(other), &whole).unwrap();
    }
    std::fs::write(folder.path().join("day-0001.mcap"), "notes").unwrap();
    std::os::unix::fs::symlink("day-1.mcap", folder.path().join("day-0002.mcap")).unwrap();
    assert_eq!(run(2, 1), (vec!["day-0006.mcap".to_owned()], 2));
    let mut left: Vec<&str> = others.to_vec();
    left.extend(["day-0001.mcap", "day-0002.mcap", "day-0005.mcap", "day-0006.mcap"]);
    left.sort_unstable();
    assert_eq!(there(), left);
}

#[test]
fn a_recording_goes_on_in_another_file_after_its_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let split = Split {
        bytes: Some(4000),
        ..Split::default()
    };
    let mut store = Store::new(&folder.path().join("a.mcap"), Preamble::default(), split, None);
    for n in 0_u64..20 {
        let mut random = n;
        let mut digit = || {
            random = random
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            char::from(b'0' + (random >> 60) as u8)
        };
        let noise: String = (0..1000).map(|_| digit()).collect();
        store.take(entry(Topic::Events, n, &noise)).unwrap();
        store.cut(n).unwrap();
    }
    store.close().unwrap();
    assert!(store.files().len() > 2, "{}", store.files().len());
    assert_eq!(store.messages(), 20);
    let read: usize = store
        .files()
        .iter()
        .map(|path| texts(path, Topic::Events).0.len())
        .sum();
    assert_eq!(read, 20);
}

#[test]
fn only_what_is_around_a_trigger_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let around = Around {
        before_ns: 3 * S,
        after_ns: 2 * S,
    };
    let mut store = Store::new(
        &folder.path().join("slip.mcap"),
        Preamble::default(),
        Split::default(),
        Some(around),
    );
    store.check().unwrap();
    for second in 0..40 {
        store
            .take(entry(Topic::Events, second * S, &second.to_string()))
            .unwrap();
        store.cut(second * S).unwrap();
        match second {
            10 | 30 => assert!(store.trigger(second * S).unwrap()),
            // Within what is kept already: that goes on for longer.
            11 => assert!(!store.trigger(second * S).unwrap()),
            _ => {}
        }
    }
    store.close().unwrap();
    assert_eq!(names(&store), ["slip-0001.mcap", "slip-0002.mcap"]);
    let files = store.files();
    assert_eq!(
        texts(&files[0], Topic::Events).0,
        ["7", "8", "9", "10", "11", "12", "13"]
    );
    assert_eq!(
        texts(&files[1], Topic::Events).0,
        ["27", "28", "29", "30", "31", "32"]
    );
    assert_eq!(store.messages(), 13);
}

#[test]
fn no_file_is_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    std::fs::write(&path, "precious").unwrap();
    let error = Store::new(&path, Preamble::default(), Split::default(), None)
        .check()
        .unwrap_err();
    assert!(
        matches!(error, StoreError::Create { .. }) && error.to_string().contains("not overwritten"),
        "{error}"
    );
    assert_eq!(std::fs::read(&path).unwrap(), b"precious");
}

/// A disk with so much room.
#[derive(Clone)]
struct Disk {
    bytes: Rc<RefCell<Vec<u8>>>,
    room: usize,
}

impl Write for Disk {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut written = self.bytes.borrow_mut();
        let fits = bytes.len().min(self.room - written.len());
        written.extend_from_slice(&bytes[..fits]);
        match fits {
            0 if !bytes.is_empty() => Err(io::ErrorKind::StorageFull.into()),
            fits => Ok(fits),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Seek for Disk {
    fn seek(&mut self, _: SeekFrom) -> io::Result<u64> {
        unreachable!("a recording is written from its beginning to its end")
    }
}

#[test]
fn a_full_disk_is_told_and_what_it_holds_reads_to_the_last_cut() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("full.mcap");
    for room in [1000, 2500, 5000] {
        let bytes = Rc::default();
        let disk = Disk {
            bytes: Rc::clone(&bytes),
            room,
        };
        let mut writer = RecordingWriter::begin(disk, &Preamble::default(), 0).unwrap();
        let mut cut = 0;
        let error = loop {
            let put = (0..10).try_for_each(|n| writer.put(&entry(Topic::Events, cut, &format!("{n}"))));
            match put.and_then(|()| writer.cut()) {
                Ok(()) => cut += 1,
                Err(error) => break error,
            }
        };
        assert_eq!(error.kind(), io::ErrorKind::StorageFull);
        drop(writer.give_up());
        std::fs::write(&path, &*bytes.borrow()).unwrap();
        let (read, torn) = texts(&path, Topic::Events);
        // What failed may have been no more than the index behind a whole chunk.
        let whole = [10 * cut, 10 * (cut + 1)];
        assert!(
            torn[0].starts_with("torn off") && whole.contains(&(read.len() as u64)),
            "{} of {cut} cuts in {room} bytes",
            read.len()
        );
    }
}

#[test]
fn how_far_a_recording_is_read_is_where_its_last_message_stands_and_not_what_is_read_ahead() {
    const MESSAGES: u64 = 100;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    // All of them are read at once; in one chunk, in two, and in two files.
    for (cut_at, parts) in [(u64::MAX, 1), (50, 1), (50, 2)] {
        let mut written = Vec::new();
        for part in 0..parts {
            let mut writer =
                RecordingWriter::begin(Cursor::new(Vec::new()), &Preamble::default(), 0).unwrap();
            for n in MESSAGES / parts * part..MESSAGES / parts * (part + 1) {
                let text: String = (0..500_u64)
                    .map(|i| format!("{:x}", (n << 10 | i).wrapping_mul(0x9e37_79b9_7f4a_7c15)))
                    .collect();
                writer.put(&entry(Topic::Events, n * S, &text)).unwrap();
                if n == cut_at {
                    writer.cut().unwrap();
                }
            }
            written.push(writer.finish().unwrap().into_inner());
        }
        for (part, bytes) in written.iter().enumerate() {
            let name = if parts == 1 {
                "a.mcap".into()
            } else {
                format!("a-{:04}.mcap", part + 1)
            };
            std::fs::write(path.with_file_name(name), bytes).unwrap();
        }
        let len = written.iter().map(Vec::len).sum::<usize>() as f64;
        let mut reader = RecordingReader::open(&path, &[Topic::Events]).unwrap();
        for n in 0..MESSAGES {
            assert!(reader.next_item().unwrap().is_some());
            let share = reader.position() as f64 / len;
            let wanted = n as f64 / MESSAGES as f64;
            assert!((share - wanted).abs() < 0.05, "{share} at message {n}");
        }
        assert_eq!(reader.next_item().unwrap(), None);
        std::fs::remove_file(&path).unwrap_or_default();
    }
}
