//! Whose hand a recording is read as: that which is named, or that in the file, and never another.

use crate::{fails, succeeds, words};
use std::fs::File;
use taxel_can::{CanFrame, Received};
use taxel_hand::{ForceFrame, Freshness, Profile, TactileFrame, TactileImage};
use taxel_recorder::{
    Attached, CanBlock, CanReader, Entry, Preamble, RecordingWriter, Topic, frame_message, image_message,
    text_message,
};
use taxel_skin::Layout;
use taxel_wire::{
    Clock, Header, Hello, HelloRate, ImageView, RawView, encode_image_payload, encode_raw_payload,
};
use tempfile::TempDir;

/// What a daemon sends of a hand that it was started with: HELLO, and frames.
pub(crate) fn put_hand(writer: &mut RecordingWriter<File>, layout: &str, from_ns: u64, frames: u64) {
    put_hand_with_silence(writer, &Layout::builtin(layout).unwrap(), from_ns, frames, |_| {
        false
    });
}

/// The same, where no taxel has a value in some frames.
pub(crate) fn put_hand_with_silence(
    writer: &mut RecordingWriter<File>,
    layout: &Layout,
    from_ns: u64,
    frames: u64,
    is_silent: fn(u64) -> bool,
) {
    let (mode, hz) = ("sweep".into(), None);
    let profile = Profile::default();
    let hello = Hello::new(
        "taxeld",
        &layout.geometry,
        &profile,
        HelloRate { mode, hz },
        Clock::Monotonic,
    );
    put_hello(writer, from_ns, &String::from_utf8(hello.to_json()).unwrap());
    put_frames(writer, layout, from_ns, frames, is_silent);
}

fn put_hello(writer: &mut RecordingWriter<File>, wall_ns: u64, text: &str) {
    let (topic, data) = (Topic::Hello, text_message(text));
    writer.put(&Entry { topic, wall_ns, data }).unwrap();
}

fn put_frames(
    writer: &mut RecordingWriter<File>,
    layout: &Layout,
    from_ns: u64,
    frames: u64,
    is_silent: fn(u64) -> bool,
) {
    let mut tactile = TactileFrame::new(layout.len());
    tactile.age_ns.fill(0);
    let mut payload = Vec::new();
    for n in 0..frames {
        (tactile.seq, tactile.t_ns) = (n, from_ns + n * 10_000_000);
        tactile.freshness.fill(match is_silent(n) {
            true => Freshness::Missing,
            false => Freshness::Fresh,
        });
        let force = ForceFrame::new(layout.len());
        encode_raw_payload(&tactile, &force, None, &mut payload).unwrap();
        let header = Header::of_frame(&tactile, &force, payload.len());
        let header = Header {
            t_ns: tactile.t_ns,
            ..header
        };
        let (topic, wall_ns) = (Topic::Frames, from_ns + n * 10_000_000);
        let data = frame_message(&header, &RawView::decode(&payload).unwrap());
        writer.put(&Entry { topic, wall_ns, data }).unwrap();
    }
}

/// What reads the counts of `hand.mcap` as those of its hand.
const READERS: [&[&str]; 4] = [
    &["compress", "hand.mcap", "--out", "images.npz"],
    &["convert", "hand.mcap", "hand.csv"],
    &["convert", "hand.mcap", "hand.log"],
    &["replay", "hand.mcap", "--to", "log:played.log", "--speed", "inf"],
];

/// A recording of 20 frames of a hand without CAN, `hand.mcap`, with these files attached.
fn record(dir: &TempDir, hand: &Layout, attached: &[(&str, &str)]) {
    let preamble = Preamble {
        attached: attached
            .iter()
            .map(|(name, text)| Attached {
                name: (*name).into(),
                media_type: "application/toml".into(),
                data: text.as_bytes().into(),
            })
            .collect(),
        ..Preamble::default()
    };
    let file = File::create(dir.path().join("hand.mcap")).unwrap();
    let mut writer = RecordingWriter::begin(file, &preamble, 0).unwrap();
    put_hand_with_silence(&mut writer, hand, 1_000_000_000, 20, |_| false);
    writer.finish().unwrap();
}

#[test]
fn a_recording_whose_description_of_its_hand_is_damaged_says_so_and_is_read_with_its_layout() {
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("hand.mcap");
    let mut writer = RecordingWriter::begin(File::create(&path).unwrap(), &Preamble::default(), 0).unwrap();
    let hand = Layout::builtin("uskin-module").unwrap();
    put_hand_with_silence(&mut writer, &hand, 1_000_000_000, 1, |_| false);
    let first_chunk = writer.bytes() as usize;
    writer.cut().unwrap();
    put_frames(&mut writer, &hand, 2_000_000_000, 20, |_| false);
    writer.finish().unwrap();
    let mut bytes = std::fs::read(&path).unwrap();
    bytes[first_chunk + 80] ^= 0x10;
    std::fs::write(&path, bytes).unwrap();
    let said =
        "hand.mcap: whose hand it is stood in what is damaged or torn off; --layout names it, or --config\n";
    let convert = ["convert", "hand.mcap", "hand.csv"];
    let err = fails(&dir, &convert, 1);
    assert!(err.contains(said) && err.contains("16 taxels"), "{err}");
    let (_, err) = succeeds(&dir, &[&convert[..], &["--layout", "uskin-module"]].concat());
    assert!(
        err.contains("are damaged") && err.contains("hand.csv: 20 frames"),
        "{err}"
    );
    assert!(!err.contains(said), "{err}");
}

#[test]
fn a_recording_of_a_hand_that_is_not_here_is_refused_with_its_name_and_read_with_its_layout() {
    let module = Layout::builtin_text("uskin-module").unwrap();
    let own = module.replace("\"uskin-module\"", "\"my-module\"");
    let turned = module.replace("at = [0, 0]", "at = [0, 0]\nrotation = 90");
    let wider = module.replace("pitch_mm = 4.7", "pitch_mm = 9.4");
    let of_another = "hand.mcap: recorded on hand uskin-module of 16 taxels, which has other modules or places than the \
                      built-in";
    for (text, said) in [
        (
            &own,
            "hand.mcap: recorded on hand my-module of 16 taxels, which is not built in; name its layout with --layout",
        ),
        (&turned, of_another),
        (&wider, of_another),
    ] {
        let dir = TempDir::new().unwrap();
        std::fs::write(dir.path().join("mine.toml"), text).unwrap();
        let config = "layout = \"mine.toml\"\n[[bus]]\nsource = \"udp:\"\n";
        std::fs::write(dir.path().join("hand.toml"), config).unwrap();
        let hand = Layout::parse(text, "mine.toml").unwrap();
        record(&dir, &hand, &[]);
        let others: [&[&str]; 3] = [
            &["eval", "hand.mcap"],
            &["view", "hand.mcap", "--seconds", "1"],
            &["figures", "hand.mcap", "--out", "figures"],
        ];
        for args in READERS.iter().chain(&others) {
            let err = fails(&dir, args, 1);
            assert!(err.contains(said), "{args:?}: {err}");
        }
        for args in READERS {
            for more in [["--layout", "mine.toml"], ["--config", "hand.toml"]] {
                succeeds(&dir, &[args, &more].concat());
            }
        }
        record(&dir, &hand, &[("taxeld.toml", config), ("layout.toml", text)]);
        for args in READERS {
            succeeds(&dir, args);
        }
    }
}

#[test]
fn a_configuration_of_another_hand_than_the_daemon_described_is_left_out_and_told() {
    let dir = TempDir::new().unwrap();
    let hand = Layout::builtin("uskin-module").unwrap();
    let module = Layout::builtin_text("uskin-module").unwrap();
    let turned = module.replace("at = [0, 0]", "at = [0, 0]\nrotation = 90");
    let fingertip = "layout = \"uskin-fingertip\"\n[[bus]]\nsource = \"udp:\"\n";
    let mine = "layout = \"mine.toml\"\n[[bus]]\nsource = \"udp:\"\n";
    let cases: [(&[(&str, &str)], _); 2] = [
        (
            &[("taxeld.toml", fingertip)],
            "is of hand uskin-fingertip, and the daemon read hand uskin-module",
        ),
        (
            &[("taxeld.toml", mine), ("layout.toml", &turned)],
            "is of hand uskin-module, and the daemon read one of that name with other modules or places",
        ),
    ];
    for (attached, said) in cases {
        record(&dir, &hand, attached);
        let said = format!("hand.mcap: the configuration in it {said}; it is left out");
        for args in READERS {
            let (_, err) = succeeds(&dir, args);
            assert!(err.contains(&said), "{args:?}: {err}");
        }
    }
}

#[test]
fn a_damaged_description_does_not_undo_the_whole_one_before() {
    let dir = TempDir::new().unwrap();
    let file = File::create(dir.path().join("hand.mcap")).unwrap();
    let mut writer = RecordingWriter::begin(file, &Preamble::default(), 0).unwrap();
    put_hand(&mut writer, "uskin-module", 1_000_000_000, 0);
    put_hello(&mut writer, 1_000_000_000, "{\"layout\"");
    let hand = Layout::builtin("uskin-module").unwrap();
    put_frames(&mut writer, &hand, 1_000_000_000, 20, |_| false);
    writer.finish().unwrap();
    for args in READERS {
        succeeds(&dir, args);
    }
}

#[test]
fn a_damaged_configuration_in_a_recording_is_left_out_and_named_as_what_it_is() {
    let dir = TempDir::new().unwrap();
    let damage = |wanted: &str| {
        let path = dir.path().join("hand.mcap");
        let mut bytes = std::fs::read(&path).unwrap();
        let at = bytes
            .windows(wanted.len())
            .position(|found| found == wanted.as_bytes());
        bytes[at.unwrap()] ^= 1;
        std::fs::write(path, bytes).unwrap();
    };
    let said = "hand.mcap: the configuration in it is damaged and left out; --config gives one\n";
    let config = "layout = \"uskin-module\"\n[[bus]]\nsource = \"udp:\"\n[profile]\nlevels = 4\n";
    let module = Layout::builtin_text("uskin-module").unwrap();
    let builtin = Layout::builtin("uskin-module").unwrap();
    for wanted in ["taxeld.toml", "levels", "levels = 4"] {
        record(&dir, &builtin, &[("taxeld.toml", config)]);
        damage(wanted);
        for args in READERS {
            let (_, err) = succeeds(&dir, args);
            assert_eq!(err.matches(said).count(), 1, "{args:?}: {err}");
        }
        let named = ["--layout", "uskin-module"];
        let (_, err) = succeeds(&dir, &[READERS[3], &named].concat());
        assert!(!err.contains(said), "not asked for: {err}");
    }
    // Of a hand of one's own, the layout goes with it.
    let own = module.replace("\"uskin-module\"", "\"my-module\"");
    let config = config.replace("uskin-module", "mine.toml");
    let hand = Layout::parse(&own, "mine.toml").unwrap();
    for wanted in ["levels", "my-module"] {
        record(&dir, &hand, &[("taxeld.toml", &config), ("layout.toml", &own)]);
        damage(wanted);
        for args in READERS {
            let err = fails(&dir, args, 1);
            assert!(
                err.contains(said) && err.contains("recorded on hand my-module"),
                "{err}"
            );
        }
    }
    // What is whole and wrong is named by its place in the recording.
    record(
        &dir,
        &hand,
        &[("taxeld.toml", &config.replace("4", "0")), ("layout.toml", &own)],
    );
    let err = fails(&dir, READERS[0], 1);
    assert!(err.contains("hand.mcap: taxeld.toml in it:5: "), "{err}");
}

#[test]
fn a_recording_of_a_built_in_hand_is_read_as_that_hand_by_everything() {
    let dir = TempDir::new().unwrap();
    for hand in ["uskin-module", "tekscan-6077"] {
        record(&dir, &Layout::builtin(hand).unwrap(), &[]);
        for args in READERS {
            succeeds(&dir, args);
        }
    }
}

#[test]
fn a_log_of_other_boards_than_the_layout_has_is_refused_with_their_ids() {
    let dir = TempDir::new().unwrap();
    succeeds(&dir, &["sim", "tap", "--to", "log:tap.log", "--seconds", "1"]);
    let err = fails(
        &dir,
        &words("compress tap.log --layout icub-forearm --out o.npz"),
        1,
    );
    for part in [
        "layout icub-forearm",
        "ids of nobody (000, 001,",
        "taxel doctor --scan log:tap.log",
    ] {
        assert!(err.contains(part), "{part}: {err}");
    }
    assert!(
        !err.contains("calibra") && !dir.path().join("o.npz").exists(),
        "{err}"
    );
}

#[test]
fn a_log_whose_frames_are_all_malformed_is_refused_with_their_length() {
    let dir = TempDir::new().unwrap();
    succeeds(&dir, &["sim", "tap", "--to", "log:tap.log", "--seconds", "1"]);
    let log = std::fs::read_to_string(dir.path().join("tap.log")).unwrap();
    let frames = log.lines().filter(|line| line.len() > 40);
    for (cut, bytes) in [(2, 7), (16, 0)] {
        let short: String = frames
            .clone()
            .map(|line| line[..line.len() - cut].to_owned() + "\n")
            .collect();
        std::fs::write(dir.path().join("short.log"), &short).unwrap();
        for args in [
            &["compress", "short.log", "--out", "o.npz"][..],
            &["convert", "short.log", "o.csv"],
        ] {
            let err = fails(&dir, args, 1);
            let words = format!(
                "{} frames with ids of boards of layout allegro-uskin-15 are malformed",
                short.lines().count()
            );
            let length = format!("with {bytes} data bytes where 8 belong");
            assert!(
                err.contains(&words) && err.contains(&length) && !err.contains("calibra"),
                "{err}"
            );
        }
        assert!(!dir.path().join("o.npz").exists());
    }
}

#[test]
fn frames_of_other_boards_beside_those_of_the_hand_are_told_by_their_ids() {
    let dir = TempDir::new().unwrap();
    succeeds(&dir, &["sim", "tap", "--to", "log:tap.log", "--seconds", "2"]);
    let (_, err) = succeeds(&dir, &["compress", "tap.log", "--out", "hand.npz"]);
    assert!(!err.contains("of nobody"), "{err}");
    let log = std::fs::read_to_string(dir.path().join("tap.log")).unwrap();
    let others = "(0000000000.000001) can0 042#01\n(0000000000.000001) can1 00000052#02\n";
    std::fs::write(dir.path().join("both.log"), others.to_owned() + &log).unwrap();
    for args in [
        &["compress", "both.log", "--out", "both.npz"][..],
        &["convert", "both.log", "both.csv"],
    ] {
        let (_, err) = succeeds(&dir, args);
        let said = "taxel: both.log: not all of its frames are those of layout allegro-uskin-15: 2 ids of nobody (042, \
                    00000052), which are left out; `taxel doctor --scan log:both.log` says whose they are\n";
        assert_eq!(err.matches(said).count(), 1, "{err}");
    }
}

#[test]
fn a_log_of_which_a_few_ids_happen_to_be_those_of_taxels_is_no_hands() {
    let dir = TempDir::new().unwrap();
    succeeds(&dir, &["sim", "tap", "--to", "log:tap.log", "--seconds", "1"]);
    let log = std::fs::read_to_string(dir.path().join("tap.log")).unwrap();
    let id = |line: &str| line.split([' ', '#']).nth(2).unwrap().to_owned();
    let last = id(log.lines().last().unwrap());
    let of_one = |line: &&str| id(line) == last;
    let write = |every: usize| {
        let lines = log.lines().filter(of_one).enumerate().map(|(n, line)| {
            let other = line.replace(&format!("{last}#"), "042#");
            let other = if n % every == 0 {
                other + "\n"
            } else {
                String::new()
            };
            format!("{line}\n{other}")
        });
        std::fs::write(dir.path().join("car.log"), lines.collect::<String>()).unwrap();
    };
    write(2);
    for args in [
        &["compress", "car.log", "--out", "car.npz"][..],
        &["convert", "car.log", "car.csv"],
    ] {
        let err = fails(&dir, args, 1);
        assert!(
            err.contains("frames are of no board of layout allegro-uskin-15, 1 id of nobody (042), and 238 of 240 taxels have no value"),
            "{err}"
        );
        assert!(err.contains("`taxel doctor --scan log:car.log`"), "{err}");
    }
    // A hand of which little is left, and another device beside it.
    write(5);
    let (_, err) = succeeds(&dir, &["compress", "car.log", "--out", "car.npz"]);
    assert!(err.contains("not all of its frames are those of layout"), "{err}");
}

#[test]
fn a_hand_of_as_many_taxels_in_other_places_is_another_hand() {
    let module = Layout::builtin_text("uskin-module").unwrap();
    let turned = module.replace("at = [0, 0]", "at = [0, 0]\nrotation = 90");
    let hands = [module, &turned[..]].map(|text| Layout::parse(text, "hand").unwrap());
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("hands.mcap");
    let mut writer = RecordingWriter::begin(File::create(&path).unwrap(), &Preamble::default(), 0).unwrap();
    // The first is started again, as itself, and then as the other.
    for (hand, from_ns) in [
        (&hands[0], 1_000_000_000),
        (&hands[0], 2_000_000_000),
        (&hands[1], 3_000_000_000),
    ] {
        put_hand_with_silence(&mut writer, hand, from_ns, 10, |_| false);
        put_image(&mut writer, from_ns);
        let frame = CanFrame::standard(0x135, &[0; 8]).unwrap();
        let mut can = CanBlock::default();
        assert!(can.push(0, &Received { t_ns: from_ns, frame }));
        let (topic, data) = (Topic::Can, can.take(&["can0".to_owned()], &[0]));
        let wall_ns = from_ns;
        writer.put(&Entry { topic, wall_ns, data }).unwrap();
    }
    writer.finish().unwrap();

    for (options, out, began, read) in [
        (&[][..], "frames.npz", "20 frames", "frames.npz: 20 frames"),
        (&["--images"], "images.npz", "2 images", "images.npz: 2 images"),
    ] {
        let (_, err) = succeeds(&dir, &[&["convert", "hands.mcap", out], options].concat());
        let began = format!(
            "hands.mcap: the daemon began anew after {began}, with another hand, uskin-module; read up to there"
        );
        assert!(
            err.contains(&began) && err.contains("--start 3000000000"),
            "{err}"
        );
        assert!(err.contains(read), "{err}");
    }
    let mut can = CanReader::open(&path).unwrap();
    for another in [None, None, Some(("uskin-module", 3_000_000_000))] {
        assert!(can.next_frame().unwrap().is_some());
        assert_eq!(can.another_hand(), another);
    }
}

fn put_image(writer: &mut RecordingWriter<File>, wall_ns: u64) {
    let image = TactileImage {
        width: 4,
        height: 4,
        pixels: vec![0; 16],
        ..TactileImage::default()
    };
    let mut payload = Vec::new();
    encode_image_payload(&image, &mut payload).unwrap();
    let header = Header::of_image(&image, payload.len());
    let data = image_message(&header, &ImageView::decode(&payload).unwrap());
    let topic = Topic::Images;
    writer.put(&Entry { topic, wall_ns, data }).unwrap();
}
