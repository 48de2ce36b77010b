//! Recordings of hands of boards beside a pressure array, whose messages are on no bus.

use crate::succeeds;
use serde_json::Value;
use std::fs::File;
use taxel_can::Received;
use taxel_hand::{ForceFrame, Freshness, TactileFrame};
use taxel_recorder::{CanBlock, Entry, Preamble, RecordingWriter, Topic, frame_message};
use taxel_skin::{Layout, Protocol};
use taxel_wire::{Header, RawView, encode_raw_payload};
use tempfile::TempDir;

const HAND: &str = "name = \"mixed\"\nimage = { width = 12, height = 8 }\nbuses = [\"can0\", \"mat\"]\n\
    [[module]]\nname = \"tip\"\npart = \"finger\"\nbus = \"can0\"\nboard = 1\nprotocol = \"uskin-l2\"\nat = [0, 0]\n\
    [[module]]\nname = \"mat\"\npart = \"mat\"\nbus = \"mat\"\nprotocol = \"pressure-array\"\nrows = 7\ncolumns = 5\n\
    at = [5, 0]\n";

#[test]
fn images_of_an_array_beside_boards_are_made_of_the_frames() {
    let dir = TempDir::new().unwrap();
    let hand = Layout::parse(HAND, "mixed.toml").unwrap();
    std::fs::write(dir.path().join("mixed.toml"), HAND).unwrap();
    let file = File::create(dir.path().join("hand.mcap")).unwrap();
    let mut writer = RecordingWriter::begin(file, &Preamble::default(), 0).unwrap();
    let mut frame = TactileFrame::new(hand.len());
    frame.age_ns.fill(0);
    frame.freshness.fill(Freshness::Fresh);
    let mut payload = Vec::new();
    let mat = hand.modules[1].taxel_range();
    for n in 0..200 {
        (frame.seq, frame.t_ns) = (n, 1_000_000_000 + n * 10_000_000);
        let counts = &mut frame.counts;
        counts.fill([30_000; 3]);
        counts[mat.clone()].fill([0, 0, if n < 150 { 0 } else { 900 }]);
        let force = ForceFrame::new(hand.len());
        encode_raw_payload(&frame, &force, None, &mut payload).unwrap();
        let header = Header {
            t_ns: frame.t_ns,
            ..Header::of_frame(&frame, &force, payload.len())
        };
        let data = frame_message(&header, &RawView::decode(&payload).unwrap());
        let (topic, wall_ns) = (Topic::Frames, frame.t_ns);
        writer.put(&Entry { topic, wall_ns, data }).unwrap();
        let mut block = CanBlock::default();
        for k in 0..16 {
            let frame = Protocol::USKIN_L2.frame(1, k, [30_000; 3], 0).unwrap();
            let t_ns = wall_ns;
            assert!(block.push(0, &Received { t_ns, frame }));
        }
        let (topic, data) = (Topic::Can, block.take(&["can0".to_owned()], &[0]));
        writer.put(&Entry { topic, wall_ns, data }).unwrap();
    }
    writer.finish().unwrap();
    let (_, err) = succeeds(
        &dir,
        &[
            "compress",
            "hand.mcap",
            "--layout",
            "mixed.toml",
            "--out",
            "images.jsonl",
        ],
    );
    assert!(
        err.contains(
            "bus mat is a pressure array, whose messages are not in its CAN traffic; its frames are read"
        ),
        "{err}"
    );
    let images = std::fs::read_to_string(dir.path().join("images.jsonl")).unwrap();
    let contacts = |line: &str| {
        let image: Value = serde_json::from_str(line).unwrap();
        image["contacts"].as_u64().unwrap()
    };
    let shown: Vec<u64> = images.lines().map(contacts).collect();
    assert_eq!(shown.len(), 200, "{err}");
    assert_eq!((shown[149], shown[199]), (0, mat.len() as u64), "{shown:?}");
}
