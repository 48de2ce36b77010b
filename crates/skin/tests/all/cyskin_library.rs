//! CySkin hubs as Genoa's own CAN library drives them, against frames that a program of its own made
//! (`tests/harness/cyskin.py`).

use taxel_can::{CanFrame, Received};
use taxel_skin::{Decoded, Decoder, HubIds, Layout, Readings, Recogniser, cyskin_frames};

const VECTORS: &str = include_str!("../vectors/cyskin.txt");
const SENSORS: usize = 12;

/// One line of the vectors.
struct Vector {
    hub: u32,
    command: u8,
    data: Vec<u8>,
    frames: Vec<CanFrame>,
}

fn vectors() -> Vec<Vector> {
    let lines = VECTORS.lines().filter(|line| !line.starts_with('#'));
    let vectors: Vec<Vector> = lines.map(vector).collect();
    assert_eq!(vectors.len(), 22);
    vectors
}

fn vector(line: &str) -> Vector {
    let (what, frames) = line.split_once(" = ").expect("what is sent, and its frames");
    let (kind, numbers) = what.split_once(' ').expect("a kind");
    let numbers: Vec<u16> = numbers.split(' ').map(|n| n.parse().expect("a number")).collect();
    let (command, data) = match kind {
        "values" => {
            let values = numbers[3..].iter().flat_map(|value| value.to_be_bytes());
            (
                0x43,
                [numbers[1] as u8, numbers[2] as u8]
                    .into_iter()
                    .chain(values)
                    .collect(),
            )
        }
        _ => (numbers[1] as u8, numbers[2..].iter().map(|n| *n as u8).collect()),
    };
    let frame = |text: &str| {
        let (id, data) = text.split_once('#').expect("an id and data");
        let byte = |i| u8::from_str_radix(&data[i..i + 2], 16).expect("a byte");
        let data: Vec<u8> = (0..data.len()).step_by(2).map(byte).collect();
        CanFrame::standard(u16::from_str_radix(id, 16).expect("an id"), &data).expect("a frame")
    };
    Vector {
        hub: numbers[0].into(),
        command,
        data,
        frames: frames.split(' ').map(frame).collect(),
    }
}

/// A hub at this address with eleven taxels on every module, and no more said of it.
fn hub(address: u32) -> Layout {
    let mut text = format!(
        "name = \"hub\"\nbuses = [\"can0\"]\nimage = {{ width = 11, height = 248 }}\n[[cyskin.hub]]\nname = \"h\"\n\
         bus = \"can0\"\naddress = {address}\n"
    );
    for m in 0..248 {
        text += &format!(
            "[[module]]\nname = \"{m}\"\npart = \"p\"\nbus = \"can0\"\nhub = \"h\"\nboard = {m}\nprotocol = \"cyskin\"\n\
             at = [0, {m}]\norder = [[1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11]]\n"
        );
    }
    Layout::parse(&text, "hub.toml").unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn packets_are_those_of_another_implementation() {
    let layout = hub(1);
    let setup = layout.cyskin.as_ref().unwrap();
    for vector in vectors() {
        let frames = cyskin_frames(setup, vector.hub, vector.command, &vector.data).unwrap();
        assert_eq!(frames, vector.frames, "{} {:02X?}", vector.hub, vector.data);
    }
}

#[test]
fn values_of_another_implementation_are_read_and_its_commands_told_from_them() {
    for vector in vectors() {
        let everybody = vector.hub == HubIds::Standard.everybody();
        let layout = hub(if everybody { 1 } else { vector.hub });
        let mut decoder = Decoder::new(&layout, 0);
        let mut readings = Readings::new();
        let decoded: Vec<Decoded> = vector
            .frames
            .iter()
            .map(|f| decoder.decode(f, &mut readings))
            .collect();
        if vector.command != 0x43 {
            assert_eq!(decoded, [Decoded::Command], "{:02X?}", vector.data);
            continue;
        }
        let (last, before) = decoded.split_last().unwrap();
        assert_eq!(*last, Decoded::Readings);
        assert!(before.iter().all(|d| *d == Decoded::Partial), "{decoded:?}");
        let passes = |frame: &CanFrame| decoder.filters().iter().any(|filter| filter.passes(frame));
        assert!(vector.frames.iter().all(passes));
        let first = usize::from(vector.data[0]) * SENSORS + usize::from(vector.data[1]);
        let expected: Vec<(u8, u8, u16)> = (first..)
            .zip(vector.data[2..].chunks_exact(2))
            .map(|(n, bytes)| {
                (
                    (n / SENSORS) as u8,
                    (n % SENSORS) as u8,
                    u16::from_be_bytes([bytes[0], bytes[1]]),
                )
            })
            .filter(|(_, sensor, _)| *sensor > 0)
            .collect();
        let read: Vec<(u8, u8, u16)> = readings
            .iter()
            .map(|r| {
                let taxel = usize::from(r.taxel);
                (layout.wiring_of(taxel).board, layout.k[taxel] as u8, r.counts[2])
            })
            .collect();
        assert_eq!(read, expected);
    }
}

#[test]
fn what_the_library_rejects_is_malformed() {
    let layout = hub(0x23);
    let setup = layout.cyskin.clone().unwrap();
    let mut data = vec![3, 0];
    data.extend((0..12u16).flat_map(|n| (20_000 + n).to_be_bytes()));
    let mut numbered = setup.clone();
    numbered.sequence_bytes_above = 0;
    let mut start_at_0 = setup.clone();
    start_at_0.checksum = taxel_skin::Checksum::Crc8;
    for (what, sender) in [
        ("numbered continuation frames", numbered),
        ("CRC from 0", start_at_0),
    ] {
        let mut decoder = Decoder::new(&layout, 0);
        let mut readings = Readings::new();
        let frames = cyskin_frames(&sender, 0x23, 0x43, &data).unwrap();
        let last = frames.iter().map(|f| decoder.decode(f, &mut readings)).last();
        assert_eq!(last, Some(Decoded::Malformed { board: 0 }), "{what}");
    }
}

#[test]
fn a_hub_with_standard_ids_shares_its_bus_with_no_other_kind_of_board() {
    let text = |first: &str, second: &str| {
        format!(
            "name = \"mixed\"\nbuses = [\"can0\", \"can1\"]\nimage = {{ width = 16, height = 16 }}\n[[cyskin.hub]]\n\
             name = \"h\"\nbus = \"can0\"\naddress = 0x10\n{first}{second}"
        )
    };
    let module = "[[module]]\nname = \"m\"\npart = \"p\"\nbus = \"can0\"\nhub = \"h\"\nboard = 3\nprotocol = \"cyskin\"\n\
                  at = [0, 0]\norder = [[1]]\n";
    let board = "[[module]]\nname = \"b\"\npart = \"p\"\nbus = \"can0\"\nboard = 1\nprotocol = \"uskin-l1\"\nat = [4, 4]\n";
    for text in [text(module, board), text(board, module)] {
        let error = Layout::parse(&text, "mixed.toml").unwrap_err().to_string();
        assert!(
            error.contains("cannot share bus \"can0\"") && error.contains("bus of their own"),
            "{error}"
        );
    }
    let apart = text(module, &board.replace("can0", "can1"));
    Layout::parse(&apart, "mixed.toml").unwrap_or_else(|e| panic!("{e}"));
    let error = Layout::parse(&text(module, "").replace("0x10", "0x123"), "hub.toml")
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("0x123 is not 1 to 0xFE; a hub with ids of 29 bits needs ids = \"extended\""),
        "{error}"
    );
}

/// Sweeps of twelve values of each module, by the library's packets.
fn traffic(layout: &Layout, numbers: &[u8]) -> Vec<Received> {
    let setup = layout.cyskin.as_ref().unwrap();
    let mut sent = Vec::new();
    for sweep in 0..10u64 {
        for (place, number) in (0u64..).zip(numbers) {
            let mut data = vec![*number, 0];
            for n in 0..12u16 {
                data.extend((20_000 + 900 * n + u16::from(*number) + (sweep % 3) as u16).to_be_bytes());
            }
            for frame in cyskin_frames(setup, setup.hubs[0].address, 0x43, &data).unwrap() {
                let t_ns = sweep * 50_000_000 + place * 1_000_000;
                sent.push(Received { t_ns, frame });
            }
        }
    }
    sent
}

#[test]
fn a_scan_recognises_the_hub_and_leaves_boards_with_such_ids_alone() {
    let layout = hub(0x23);
    let command = cyskin_frames(layout.cyskin.as_ref().unwrap(), 0xFF, 0x37, &[1]).unwrap()[0];
    let mut recogniser = Recogniser::new(2);
    recogniser.handle_frame(
        0,
        &Received {
            t_ns: 0,
            frame: command,
        },
    );
    for received in traffic(&layout, &[4, 5, 9]) {
        recogniser.handle_frame(0, &received);
    }
    // Boards 1 and 5 of uSkin's second layout of ids, whose status byte happens to be the hub's command.
    for sweep in 0..10u64 {
        for (board, k) in [1, 2, 4, 5]
            .into_iter()
            .flat_map(|board| (0..16).map(move |k| (board, k)))
        {
            let counts = [0x1200 + k, 0x8000, 0x3000];
            let frame = taxel_skin::Protocol::USKIN_L2
                .frame(board, k, counts, 0x43)
                .unwrap();
            recogniser.handle_frame(
                1,
                &Received {
                    t_ns: sweep * 10_000_000,
                    frame,
                },
            );
        }
    }
    let found = recogniser.finish();
    let guess = found.cyskin.expect("a hub");
    assert_eq!(guess.ids, HubIds::Standard);
    assert_eq!(
        (guess.checksum, guess.sequence_bytes_above),
        (taxel_skin::Checksum::Crc8Ff, 255)
    );
    let boards = |bus: usize| -> Vec<(&str, u8, Option<u32>, usize)> {
        let boards = found.buses[bus].boards.iter();
        boards
            .map(|b| (b.protocol.name(), b.board, b.hub, b.taxels.len()))
            .collect()
    };
    assert_eq!(boards(0), [4, 5, 9].map(|m| ("cyskin", m, Some(0x23), 11)));
    assert_eq!(boards(1), [1, 2, 4, 5].map(|b| ("uskin-l2", b, None, 16)));
    assert!(
        found.buses.iter().all(|bus| bus.others.is_empty()),
        "{:?}",
        found.buses
    );
    let text = found.layout_file("found", &["can0", "can1"]).unwrap();
    let proposed = Layout::parse(&text, "found.toml").unwrap_or_else(|e| panic!("{e}\n{text}"));
    let setup = proposed.cyskin.as_ref().unwrap();
    assert_eq!(setup.start, layout.cyskin.as_ref().unwrap().start, "{text}");
}

#[test]
fn a_hub_with_a_standard_id_on_the_wrong_bus_is_told_and_no_stranger() {
    let mut text =
        "name = \"two\"\nbuses = [\"can0\", \"can1\"]\nimage = { width = 11, height = 2 }\n".to_string();
    for (n, bus) in ["can0", "can1"].into_iter().enumerate() {
        text += &format!(
            "[[cyskin.hub]]\nname = \"h{n}\"\nbus = \"{bus}\"\naddress = {}\n",
            0x20 + n
        );
    }
    for (n, bus) in ["can0", "can1"].into_iter().enumerate() {
        text += &format!(
            "[[module]]\nname = \"m{n}\"\npart = \"p\"\nbus = \"{bus}\"\nhub = \"h{n}\"\nboard = 2\nprotocol = \"cyskin\"\n\
             at = [0, {n}]\norder = [[1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11]]\n"
        );
    }
    let layout = Layout::parse(&text, "two.toml").unwrap_or_else(|e| panic!("{e}"));
    // Hub 0x20 speaks on the bus of 0x21, and 0x30 is in no layout.
    for (address, wanted) in [
        (0x20, taxel_skin::Finding::OnOtherBus { module: 0, bus: 1 }),
        (
            0x30,
            taxel_skin::Finding::NotInLayout {
                bus: 1,
                protocol: taxel_skin::Protocol::CYSKIN,
                address: 0x30,
            },
        ),
    ] {
        let mut monitor = taxel_skin::BusMonitor::new(&layout);
        let sender = hub(address);
        for repeat in 0..3 {
            for received in traffic(&sender, &[2]) {
                let t_ns = received.t_ns + repeat * 500_000_000;
                monitor.handle_frame(1, &Received { t_ns, ..received });
            }
        }
        assert_eq!(monitor.findings(), [wanted]);
        assert_eq!(monitor.strangers(1), address == 0x30);
    }
}
