//! Chunks that other programs compressed.

use super::texts;
use mcap::{WriteOptions, records::MessageHeader};
use ruzstd::encoding::{CompressionLevel, compress_to_vec};
use std::collections::BTreeMap;
use std::io::Cursor;
use taxel_recorder::{Topic, text_message};

const CHUNK: u8 = 0x06;
/// Where the name of the compression stands in a chunk's record: behind its head, times, length and checksum.
const NAME: usize = 9 + 8 + 8 + 8 + 4;

/// A recording of the numbers up to 2000 in several chunks without an index, which `compress` makes of what they are.
fn recording(name: &str, compress: impl Fn(&[u8]) -> Vec<u8>) -> Vec<u8> {
    let options = WriteOptions::new().compression(None).chunk_size(Some(20_000));
    let options = options.emit_message_indexes(false).emit_summary_records(false);
    let mut writer = options.create(Cursor::new(Vec::new())).unwrap();
    let schema = writer
        .add_schema("std_msgs/msg/String", "ros2msg", b"string data")
        .unwrap();
    let channel = writer
        .add_channel(schema, Topic::Status.name(), "cdr", &BTreeMap::new())
        .unwrap();
    for n in 0..2000 {
        let header = MessageHeader {
            channel_id: channel,
            sequence: n,
            log_time: n.into(),
            publish_time: n.into(),
        };
        writer
            .write_to_known_channel(&header, &text_message(&n.to_string()))
            .unwrap();
    }
    writer.finish().unwrap();
    let whole = writer.into_inner().into_inner();
    let (mut out, mut at) = (whole[..8].to_vec(), 8);
    while at < whole.len() - 8 {
        let end = at + 9 + u64::from_le_bytes(whole[at + 1..at + 9].try_into().unwrap()) as usize;
        match whole[at] {
            CHUNK => {
                let packed = compress(&whole[at + NAME + 4 + 8..end]);
                let mut record = whole[at + 9..at + NAME].to_vec();
                record.extend((name.len() as u32).to_le_bytes());
                record.extend(name.as_bytes());
                record.extend((packed.len() as u64).to_le_bytes());
                record.extend(packed);
                out.push(CHUNK);
                out.extend((record.len() as u64).to_le_bytes());
                out.extend(record);
            }
            // The checksum of it all is no longer that of the file; none is 0.
            DATA_END => out.extend([&whole[at..at + 9], &[0; 4]].concat()),
            _ => out.extend(&whole[at..end]),
        }
        at = end;
    }
    out.extend(&whole[at..]);
    out
}

const DATA_END: u8 = 0x0F;

fn zstd(plain: &[u8]) -> Vec<u8> {
    compress_to_vec(plain, CompressionLevel::Fastest)
}

#[test]
fn chunks_that_others_compress_with_zstd_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("other.mcap");
    let wanted: Vec<String> = (0..2000).map(|n| n.to_string()).collect();
    let in_two_frames = |plain: &[u8]| {
        let (one, other) = plain.split_at(plain.len() / 2);
        // One that readers pass over, of three bytes, between them.
        let skipped = [0x50, 0x2A, 0x4D, 0x18, 3, 0, 0, 0, 1, 2, 3];
        [&zstd(one)[..], &skipped, &zstd(other)].concat()
    };
    for file in [recording("zstd", zstd), recording("zstd", in_two_frames)] {
        std::fs::write(&path, file).unwrap();
        assert_eq!(texts(&path, Topic::Status), (wanted.clone(), vec![]));
    }
}

#[test]
fn a_damaged_chunk_of_zstd_is_passed_over_and_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("other.mcap");
    let cut = |plain: &[u8]| {
        let packed = zstd(plain);
        packed[..packed.len() / 2].to_vec()
    };
    // A head that asks for 2 TB to look back over.
    let wide = |_: &[u8]| vec![0x28, 0xB5, 0x2F, 0xFD, 0x00, 0xF8, 0, 0, 0];
    // Blocks of 128 KiB of one byte, of which there are 4 GB.
    let long = |_: &[u8]| {
        let block = [0x02, 0x00, 0x10, 7];
        [&[0x28, 0xB5, 0x2F, 0xFD, 0x00, 0x40][..], &block.repeat(32_768)].concat()
    };
    for file in [
        recording("zstd", cut),
        recording("zstd", wide),
        recording("zstd", long),
    ] {
        std::fs::write(&path, file).unwrap();
        let (read, left_out) = texts(&path, Topic::Status);
        assert!(read.is_empty() && left_out.len() > 2, "{left_out:?}");
        let damaged = left_out[0].starts_with("bytes ") && left_out[0].contains(" are damaged (");
        assert!(damaged, "{left_out:?}");
    }
}

#[test]
fn a_compression_that_is_not_read_is_told_by_its_name_and_not_as_damage() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("other.mcap");
    std::fs::write(&path, recording("brotli", <[u8]>::to_vec)).unwrap();
    let (read, left_out) = texts(&path, Topic::Status);
    assert!(read.is_empty(), "{read:?}");
    assert!(
        left_out[0].contains(" chunks left out, compressed with \"brotli\"; "),
        "{left_out:?}"
    );
    assert!(!left_out.concat().contains("damaged"), "{left_out:?}");
}
