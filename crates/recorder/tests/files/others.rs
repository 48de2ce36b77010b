//! Recordings of other programs.

use mcap::{WriteOptions, records::MessageHeader};
use std::collections::BTreeMap;
use std::io::Cursor;
use taxel_recorder::{RecordingReader, Topic, text_message};

#[test]
fn topics_are_those_of_the_index_whoever_wrote_them() {
    let folder = tempfile::TempDir::new().unwrap();
    let path = folder.path().join("bag.mcap");
    for (has_index, wanted) in [
        (true, &["/chatter", "/tactile", Topic::Hello.name()][..]),
        (false, &[]),
    ] {
        let options = WriteOptions::new().compression(None);
        let options = options.emit_summary_records(has_index);
        let mut writer = options.create(Cursor::new(Vec::new())).unwrap();
        let schema = writer.add_schema("std_msgs/msg/String", "ros2msg", b"string data");
        let schema = schema.unwrap();
        // A topic of two publishers has two channels.
        for (topic, publisher) in [
            ("/tactile", "a"),
            (Topic::Hello.name(), "a"),
            ("/chatter", "a"),
            ("/chatter", "b"),
        ] {
            let metadata = BTreeMap::from([("publisher".to_owned(), publisher.to_owned())]);
            let channel = writer.add_channel(schema, topic, "cdr", &metadata);
            let header = MessageHeader {
                channel_id: channel.unwrap(),
                sequence: 0,
                log_time: 1,
                publish_time: 1,
            };
            writer
                .write_to_known_channel(&header, &text_message("7"))
                .unwrap();
        }
        writer.finish().unwrap();
        std::fs::write(&path, writer.into_inner().into_inner()).unwrap();
        let reader = RecordingReader::open(&path, &[]).unwrap();
        assert_eq!(reader.topics(), wanted);
    }
}
