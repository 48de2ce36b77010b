//! The iCub's boards as docs/protocols.md, "iCub frames", "MTB commands" and "MTB4" describe them.

use crate::support::{Bench, scene};
use taxel_can::CanFrame;
use taxel_skin::{
    Decoded, Decoder, ICUB_NO_ACK, ICUB_NOT_CONNECTED, ICUB_OUT_OF_RANGE, Layout, Readings, STATUS_ERROR,
};

const START: (u16, &[u8]) = (0x201, &[0x07, 0x00]);

/// Triangles 0 and 3 of board 1.
fn arm(protocol: &str) -> Layout {
    let triangle = |t: u32| {
        let pads = [0, 1, 2, 3, 4, 5, 7, 8, 9, 11].map(|pad| (12 * t + pad).to_string());
        format!("[{}]", pads.join(", "))
    };
    let text = format!(
        "name = \"arm\"\nimage = {{ width = 10, height = 2 }}\nbuses = [\"can0\"]\n[[module]]\nname = \"arm\"\n\
         part = \"arm\"\nbus = \"can0\"\nboard = 1\nprotocol = \"{protocol}\"\nat = [0, 0]\norder = [{}, {}]\n",
        triangle(0),
        triangle(3)
    );
    Layout::parse(&text, "arm.toml").unwrap()
}

/// Configures board 1 from `ms` on with the two triangles and this period, as the official document has it.
fn configure(bench: &mut Bench, ms: u64, period_ms: u8) {
    bench.command(ms, 0x201, &[0x4D, 0, period_ms, 245]);
    bench.command(ms + 10, 0x201, &[0x50, 0, 15, 2, 0, 0x00, 0x22]);
    bench.command(ms + 20, 0x201, &[0x50, 0, 0, 2, 1, 0x00, 0x22]);
    bench.command(ms + 30, 0x201, &[0x50, 3, 3, 2, 1, 0x00, 0x22]);
}

fn started(protocol: &str, more: &str) -> Bench {
    let mut bench = Bench::new(&scene(10, more), &arm(protocol));
    configure(&mut bench, 0, 50);
    bench.command(540, START.0, START.1);
    bench.until_ms(560);
    bench
}

/// The newest two frames of a triangle: seven pads, five pads and the status.
fn triangle(frames: &[taxel_can::Received], id: u32) -> ([u8; 12], u16) {
    let newest = |kind: u8| {
        let found = frames
            .iter()
            .rev()
            .find(|f| f.frame.id() == id && f.frame.data()[0] == kind);
        found
            .unwrap_or_else(|| panic!("no frame {kind:#x} of {id:#x}"))
            .frame
    };
    let (first, second) = (newest(0x40), newest(0xC0));
    let mut pads = [0; 12];
    pads[..7].copy_from_slice(&first.data()[1..]);
    pads[7..].copy_from_slice(&second.data()[1..6]);
    (pads, u16::from_be_bytes([second.data()[6], second.data()[7]]))
}

#[test]
fn a_board_is_silent_until_it_is_configured_and_started() {
    for protocol in ["icub-mtb3", "icub-mtb4"] {
        let layout = arm(protocol);
        let mut bench = Bench::new(&scene(10, ""), &layout);
        bench.command(0, START.0, START.1);
        assert_eq!(
            bench.until_ms(1000).len(),
            0,
            "{protocol}: started, not configured"
        );
        configure(&mut bench, 1000, 50);
        assert_eq!(
            bench.until_ms(2000).len(),
            0,
            "{protocol}: configured, not started"
        );
        bench.command(2000, START.0, START.1);
        let frames = bench.until_ms(3000).to_vec();
        assert!(
            (76..=80).contains(&frames.len()),
            "{protocol}: {} frames",
            frames.len()
        );
        assert!(frames.iter().all(|f| [0x410, 0x413].contains(&f.frame.id())));
        // Configuring a triangle stops transmission, until it is started again.
        bench.command(3000, 0x201, &[0x50, 0, 0, 2, 1, 0x00, 0x22]);
        bench.until_ms(3020);
        assert_eq!(
            bench.until_ms(4000).len(),
            0,
            "{protocol}: configured while it sent"
        );
        bench.command(4000, START.0, START.1);
        assert!(bench.until_ms(5000).len() >= 76, "{protocol}: started again");
    }
}

#[test]
fn a_start_during_calibration_is_lost() {
    for (start_ms, sends) in [(100, false), (400, false), (431, true), (540, true)] {
        let mut bench = Bench::new(&scene(10, ""), &arm("icub-mtb3"));
        configure(&mut bench, 0, 50);
        bench.command(start_ms, START.0, START.1);
        let frames = bench.until_ms(2000).len();
        assert_eq!(frames > 0, sends, "started at {start_ms} ms");
    }
}

#[test]
fn the_period_is_the_one_it_was_configured_with() {
    for (period_ms, sweeps) in [(20, 98..=100), (50, 39..=40), (200, 9..=10), (255, 9..=10)] {
        let mut bench = Bench::new(&scene(10, "[boards]\nrate_hz = 77\n"), &arm("icub-mtb4"));
        configure(&mut bench, 0, period_ms);
        bench.command(1000, START.0, START.1);
        bench.until_ms(1000);
        let frames = bench.until_ms(3000).len();
        assert!(
            sweeps.contains(&(frames / 4)),
            "{period_ms} ms: {frames} frames in 2 s"
        );
    }
}

#[test]
fn an_mtb3_turns_the_frames_of_a_line_around_and_an_mtb4_does_not() {
    for (protocol, sent) in [
        // The first frame is in the controller before the stack fills.
        ("icub-mtb3", ["420#40", "424#C0", "424#40", "420#C0"]),
        ("icub-mtb4", ["420#40", "420#C0", "424#40", "424#C0"]),
    ] {
        let text = format!(
            "name = \"x\"\nimage = {{ width = 2, height = 1 }}\nbuses = [\"can0\"]\n[[module]]\nname = \"m\"\n\
             part = \"p\"\nbus = \"can0\"\nboard = 2\nprotocol = \"{protocol}\"\nat = [0, 0]\norder = [[0, 48]]\n"
        );
        let mut bench = Bench::streaming(&scene(1, ""), &Layout::parse(&text, "x.toml").unwrap());
        let frames = bench.until_ms(200).to_vec();
        let sweep: Vec<String> = frames[..4]
            .iter()
            .map(|f| f.frame.to_string()[..6].into())
            .collect();
        assert_eq!(sweep, sent, "{protocol}");
    }
}

#[test]
fn pads_at_rest_read_no_load_and_thermal_pads_their_temperature() {
    let mut bench = started("icub-mtb3", "");
    let (pads, status) = triangle(bench.until_ms(1000), 0x410);
    assert_eq!(status, 0);
    for (pad, value) in pads.into_iter().enumerate() {
        let range = if [6, 10].contains(&pad) {
            145..=155
        } else {
            244..=246
        };
        assert!(range.contains(&value), "pad {pad}: {value}");
    }
}

#[test]
fn a_press_lowers_the_value_and_ends_at_zero_out_of_range() {
    for (force_n, values, out_of_range) in [(2.0, 120..=200, 0), (9.0, 0..=0, 1)] {
        let press = format!(
            "[[contact]]\nshape = \"flat\"\non = [\"all\"]\nradius = 20\nforce_n = [[1.0, 0.0], [1.5, {force_n}]]\n"
        );
        let mut bench = started("icub-mtb4", &press);
        let (pads, status) = triangle(bench.until_ms(2500), 0x413);
        for pad in [0, 1, 2, 3, 4, 5, 7, 8, 9, 11] {
            assert!(
                values.contains(&pads[pad]),
                "{force_n} N, pad {pad}: {}",
                pads[pad]
            );
            assert_eq!(status >> (4 + pad) & 1, out_of_range, "{force_n} N, pad {pad}");
        }
        assert_eq!(status >> 10 & 1, 0, "the thermal pad is not pressed");
    }
}

#[test]
fn what_lies_on_the_skin_while_it_is_calibrated_is_not_felt() {
    let press = "[[contact]]\nshape = \"flat\"\non = [\"all\"]\nradius = 20\nforce_n = [[0.0, 2.0], [1.5, 2.0], [1.6, 0.0]]\n";
    let mut bench = started("icub-mtb3", press);
    let (pads, _) = triangle(bench.until_ms(1000), 0x410);
    assert!((243..=247).contains(&pads[0]), "{pads:?}");
    // Lifted, it is above no load, and so out of range.
    let (pads, status) = triangle(bench.until_ms(2500), 0x410);
    assert_eq!((pads[0], status >> 4 & 1), (255, 1));
}

#[test]
fn faults_of_pads_are_the_bits_of_the_status() {
    let fault =
        |kind: &str| format!("[[fault]]\nkind = \"{kind}\"\non = [\"arm\"]\ntaxels = [1]\nfrom = 1.0\n");
    let layout = arm("icub-mtb3");
    for (kind, status, of_others) in [
        ("dead", STATUS_ERROR | ICUB_OUT_OF_RANGE, 0),
        ("status", STATUS_ERROR | ICUB_NO_ACK, STATUS_ERROR | ICUB_NO_ACK),
        (
            "not-connected",
            STATUS_ERROR | ICUB_NOT_CONNECTED,
            STATUS_ERROR | ICUB_NOT_CONNECTED,
        ),
    ] {
        let mut bench = started("icub-mtb3", &fault(kind));
        bench.until_ms(1000);
        let mut decoder = Decoder::new(&layout, 0);
        let mut readings = Readings::new();
        let mut newest = vec![0; layout.len()];
        for received in bench.until_ms(2000).to_vec() {
            assert_eq!(decoder.decode(&received.frame, &mut readings), Decoded::Readings);
            for reading in readings.iter() {
                newest[usize::from(reading.taxel)] = reading.status;
            }
        }
        // Triangle 0 is the first row, taxel 1 its pad 1.
        assert_eq!(newest[1], status, "{kind}");
        assert_eq!(newest[2], of_others, "{kind}: another pad of the triangle");
        assert_eq!(newest[12], 0, "{kind}: another triangle");
    }
}

#[test]
fn a_triangle_that_is_not_there_says_so_when_it_is_switched_on() {
    let mut bench = Bench::new(&scene(10, ""), &arm("icub-mtb3"));
    bench.command(0, 0x201, &[0x50, 0, 15, 2, 1, 0x00, 0x22]);
    bench.command(500, START.0, START.1);
    let frames = bench.until_ms(1000).to_vec();
    assert_eq!(
        triangle(&frames, 0x415),
        ([0xFF; 12], u16::from(ICUB_NOT_CONNECTED))
    );
    assert_eq!(triangle(&frames, 0x413).1, 0);
}

#[test]
fn an_mtb4_calibrates_a_triangle_that_does_not_answer_anew_and_an_mtb3_does_not() {
    let more = "[[contact]]\nshape = \"flat\"\non = [\"all\"]\nradius = 20\nforce_n = [[0.9, 0.0], [1.0, 2.0]]\n\
                [[fault]]\nkind = \"status\"\non = [\"arm\"]\ntaxels = [1]\nfrom = 2.0\nto = 3.0\n";
    for (protocol, recalibrations, values) in [("icub-mtb3", 0, 120..=200), ("icub-mtb4", 1, 243..=247)] {
        let mut bench = started(protocol, more);
        let layout = arm(protocol);
        let mut decoder = Decoder::new(&layout, 0);
        let mut readings = Readings::new();
        let frames = bench.until_ms(4000).to_vec();
        for received in &frames {
            decoder.decode(&received.frame, &mut readings);
        }
        assert_eq!(decoder.recalibrations(0), recalibrations, "{protocol}");
        let (pads, _) = triangle(&frames, 0x410);
        assert!(values.contains(&pads[0]), "{protocol}: {pads:?}");
        let (pads, _) = triangle(&frames, 0x413);
        assert!(
            (120..=200).contains(&pads[0]),
            "{protocol}: the other triangle, {pads:?}"
        );
    }
}

#[test]
fn a_board_that_lost_power_comes_back_unconfigured() {
    let more = "[[fault]]\nkind = \"silent\"\non = [\"arm\"]\nfrom = 2.0\nto = 2.5\n";
    let mut bench = started("icub-mtb3", more);
    assert!(!bench.until_ms(2000).is_empty());
    bench.until_ms(2600);
    bench.command(2600, START.0, START.1);
    assert_eq!(
        bench.until_ms(3500).len(),
        0,
        "a start alone does not bring it back"
    );
    configure(&mut bench, 3500, 50);
    bench.command(4040, START.0, START.1);
    assert!(bench.until_ms(5000).len() > 60);
}

#[test]
fn a_board_under_another_address_sends_as_that_one_and_still_hears_its_own() {
    let more = "[[fault]]\nkind = \"wrong-id\"\non = [\"arm\"]\nboard = 9\nfrom = 1.0\n";
    let mut bench = started("icub-mtb4", more);
    bench.until_ms(1010);
    let frames = bench.until_ms(2000).to_vec();
    assert!(!frames.is_empty() && frames.iter().all(|f| f.frame.id() & 0x7F0 == 0x490));
    bench.command(2000, 0x201, &[0x07, 0x01]);
    bench.until_ms(2010);
    assert_eq!(bench.until_ms(3000).len(), 0);
}

#[test]
fn identity_is_that_of_the_board() {
    for (protocol, answer, version) in [
        ("icub-mtb3", "710#FF05021100", "210#1C05021100010001"),
        ("icub-mtb4", "710#FF0B020900", "210#1C0B020900010001"),
    ] {
        let mut bench = started(protocol, "");
        bench.command(1000, 0x70F, &[0xFF]);
        bench.command(1100, 0x201, &[0x1C, 1, 0]);
        let frames: Vec<CanFrame> = bench.until_ms(2000).iter().map(|f| f.frame).collect();
        for reply in [answer, version] {
            assert!(
                frames.iter().any(|f| f.to_string() == reply),
                "{protocol}: no {reply}"
            );
        }
        assert_eq!(
            bench.until_ms(3000).len(),
            0,
            "{protocol}: a class-7 frame stops it"
        );
    }
}
