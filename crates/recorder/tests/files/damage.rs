//! What is left of files that were torn off or damaged.

use super::{entry, texts};
use std::io::Cursor;
use taxel_recorder::{Attached, Item, Preamble, ReadError, RecordingReader, RecordingWriter, Topic};

#[test]
fn a_file_torn_off_anywhere_gives_its_whole_chunks_and_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("torn.mcap");
    let mut writer = RecordingWriter::begin(Cursor::new(Vec::new()), &Preamble::default(), 0).unwrap();
    for n in 0..30 {
        writer.put(&entry(Topic::Status, n, &format!("{n}"))).unwrap();
        if n % 10 == 9 {
            writer.cut().unwrap();
        }
    }
    let whole = writer.finish().unwrap().into_inner();
    let data_end = records(&whole)
        .iter()
        .find(|(_, opcode)| *opcode == DATA_END)
        .unwrap()
        .0;
    let mut most = 0;
    for len in (8..whole.len()).step_by(7) {
        std::fs::write(&path, &whole[..len]).unwrap();
        let mut reader = RecordingReader::open(&path, &[Topic::Status]).unwrap();
        let mut count = 0;
        let ended = loop {
            match reader.next_item() {
                Ok(Some(_)) => count += 1,
                Ok(None) => break Ok(()),
                Err(error) => break Err(error),
            }
        };
        // Before the first record nobody can know what it is.
        assert!(ended.is_ok() || count == 0, "{len}");
        assert!(
            count % 10 == 0 && count >= most,
            "{count} messages in {len} bytes"
        );
        most = count;
        let said = reader.left_out();
        let wanted = match len > data_end + DATA_END_LENGTH {
            true => "torn off behind its last message; all of it was read",
            false => "torn off (it ends in the middle)",
        };
        assert!(ended.is_err() || said[0].starts_with(wanted), "{len}: {said:?}");
    }
    assert_eq!(most, 30);
}

/// Where the records of a file begin, and what they are, up to the end of its data.
fn records(file: &[u8]) -> Vec<(usize, u8)> {
    let (mut records, mut at) = (Vec::new(), 8);
    while records.last().is_none_or(|(_, opcode)| *opcode != DATA_END) {
        records.push((at, file[at]));
        at += 9 + u64::from_le_bytes(file[at + 1..at + 9].try_into().unwrap()) as usize;
    }
    records
}

const CHUNK: u8 = 0x06;
const ATTACHMENT: u8 = 0x09;
const DATA_END: u8 = 0x0F;
/// Bytes of the record that ends the messages: what it is, how long, and a checksum.
const DATA_END_LENGTH: usize = 9 + 4;

#[test]
fn damaged_chunks_are_passed_over_and_their_bytes_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("damaged.mcap");
    let mut writer = RecordingWriter::begin(Cursor::new(Vec::new()), &Preamble::default(), 0).unwrap();
    for n in 0..50 {
        writer.put(&entry(Topic::Status, n, &format!("{n}"))).unwrap();
        if n % 10 == 9 {
            writer.cut().unwrap();
        }
    }
    let whole = writer.finish().unwrap().into_inner();
    let records = records(&whole);
    let chunks: Vec<usize> = (records.iter().filter(|(_, opcode)| *opcode == CHUNK))
        .map(|(at, _)| *at)
        .collect();
    let read = |file: &[u8]| {
        std::fs::write(&path, file).unwrap();
        texts(&path, Topic::Status)
    };
    for (damaged, begin) in chunks.iter().enumerate() {
        let mut file = whole.clone();
        file[begin + 80] ^= 0x10;
        let (read, left_out) = read(&file);
        let wanted: Vec<String> = (0..50)
            .filter(|n| n / 10 != damaged)
            .map(|n| n.to_string())
            .collect();
        // The first chunk says which topic the messages are of; so does the summary.
        assert_eq!(read, wanted, "chunk {damaged}");
        let end = records.iter().find(|(at, _)| at > begin).unwrap().0 - 1;
        let bytes = format!("bytes {begin} to {end} are damaged");
        assert!(
            left_out.len() == 1 && left_out[0].starts_with(&bytes),
            "{left_out:?}"
        );
    }
    // Without the summary nobody knows what the messages behind the first chunk are of.
    let mut torn = whole[..records.last().unwrap().0].to_vec();
    torn[chunks[0] + 80] ^= 0x10;
    let (left, left_out) = read(&torn);
    assert!(
        left.is_empty() && left_out[1].starts_with("40 messages"),
        "{left_out:?}"
    );
    assert!(left_out[2].starts_with("torn off"), "{left_out:?}");
    // A length: where the next record begins is not known.
    let mut file = whole.clone();
    file[chunks[2] + 1] ^= 0x08;
    let (left, left_out) = read(&file);
    assert!(left.len() >= 20 && left.len() < 50, "{left:?}");
    let last = left_out.last().unwrap();
    assert!(
        last.starts_with("damaged at byte ") && last.ends_with(" bytes behind it not read"),
        "{left_out:?}"
    );
    // What no message needs: an index behind a chunk.
    let mut file = whole.clone();
    file[chunks[1] - 4] ^= 0x01;
    let (left, left_out) = read(&file);
    assert_eq!(left.len(), 50);
    assert!(
        left_out[0].contains("checksum") && left_out.len() == 1,
        "{left_out:?}"
    );
}

#[test]
fn an_attached_file_is_given_as_it_was_or_left_out_and_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("attached.mcap");
    let attached = Attached {
        name: "taxeld.toml".into(),
        media_type: "application/toml".into(),
        data: b"layout = \"x\"".to_vec(),
    };
    let preamble = Preamble {
        attached: vec![attached],
        ..Preamble::default()
    };
    let mut writer = RecordingWriter::begin(Cursor::new(Vec::new()), &preamble, 7).unwrap();
    writer.put(&entry(Topic::Status, 1, "there")).unwrap();
    let whole = writer.finish().unwrap().into_inner();
    let records = records(&whole);
    let place = records
        .iter()
        .position(|(_, opcode)| *opcode == ATTACHMENT)
        .unwrap();
    let [begin, end] = [place, place + 1].map(|place| records[place].0);
    // Every byte but those that say what the record is, and how long.
    for byte in begin + 9..end {
        let mut file = whole.clone();
        file[byte] ^= 0x04;
        std::fs::write(&path, &file).unwrap();
        let mut reader = RecordingReader::open(&path, &[Topic::Status]).unwrap();
        assert_eq!(reader.next_item().unwrap(), Some(Item::Damaged), "byte {byte}");
        let (left, left_out) = texts(&path, Topic::Status);
        assert_eq!(left, ["there"], "byte {byte}");
        let bytes = format!("bytes {begin} to {} are damaged (the attached \"", end - 1);
        assert!(
            left_out.len() == 1 && left_out[0].starts_with(&bytes),
            "{left_out:?}"
        );
    }
}

#[test]
fn what_is_no_recording_is_refused_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("no.mcap");
    for bytes in [&b""[..], b"(1.0) can0 001#\n", &[0; 100_000]] {
        std::fs::write(&path, bytes).unwrap();
        let mut reader = RecordingReader::open(&path, &[Topic::Can]).unwrap();
        let error = reader.next_item().unwrap_err();
        assert!(matches!(error, ReadError::NotMcap { .. }), "{error}");
        assert!(error.to_string().contains("no.mcap: no MCAP file"), "{error}");
    }
    assert!(RecordingReader::open(&folder.path().join("none.mcap"), &[]).is_err());
}
