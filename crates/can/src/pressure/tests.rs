use super::*;
use crate::{CanFrame, CanSource, Received, SendError};
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixDatagram;

/// An array of 3 x 5, so that its last frame carries three taxels.
const SIZE: [u16; 2] = [3, 5];
const MS: u64 = 1_000_000;

struct Pair {
    program: UnixDatagram,
    source: PressureSocket,
    batch: Vec<Received>,
}

impl Pair {
    fn new() -> Self {
        let (program, socket) = UnixDatagram::pair().unwrap();
        Self {
            program,
            source: PressureSocket::new(OwnedFd::from(socket), SIZE, ()).unwrap(),
            batch: Vec::with_capacity(64),
        }
    }

    fn send(&self, bytes: &[u8]) {
        self.program.send(bytes).unwrap();
    }

    fn receive(&mut self, now_ns: u64) -> Vec<Received> {
        self.batch.clear();
        assert!(!self.source.receive(now_ns, &mut self.batch));
        self.batch.clone()
    }

    fn counters(&self) -> ArrayCounters {
        self.source.counters().array
    }
}

/// The bytes of docs/protocols.md.
fn message(sequence: u32, measured_ns: u64, counts: &[u16]) -> Vec<u8> {
    let mut bytes = b"TXPA\x01\x00\x03\x00\x05\x00\x00\x00".to_vec();
    bytes.extend(sequence.to_le_bytes());
    bytes.extend(measured_ns.to_le_bytes());
    bytes.extend(counts.iter().flat_map(|count| count.to_le_bytes()));
    bytes
}

fn counts() -> Vec<u16> {
    (0..15).map(|n| 1000 + n).collect()
}

#[test]
fn a_message_becomes_the_frames_that_a_recording_of_it_has() {
    let mut pair = Pair::new();
    pair.send(&message(7, 0, &counts()));
    let received = pair.receive(5 * MS);
    let frames: Vec<_> = received.iter().map(|received| received.frame).collect();
    assert_eq!(frames, pressure_frames(SIZE, 7, &counts()));
    let text: Vec<String> = frames.iter().map(ToString::to_string).collect();
    assert_eq!(text[..2], ["000#0300050007000000", "001#E803E903EA03EB03"]);
    assert_eq!(text[4], "004#F403F503F603");
    assert!(received.iter().all(|received| received.t_ns == 5 * MS));
    assert_eq!((pair.counters().taken, pair.counters().refused()), (1, 0));
}

#[test]
fn what_is_no_message_for_this_array_is_refused_for_its_reason() {
    let good = message(0, 0, &counts());
    let with = |at: usize, byte: u8| {
        let mut bytes = good.clone();
        bytes[at] = byte;
        bytes
    };
    let mut pair = Pair::new();
    for bytes in [&b""[..], b"TXP", &with(0, b'X'), &[0xFF; 200]] {
        pair.send(bytes);
    }
    pair.send(&with(4, 2));
    pair.send(&with(6, 4));
    for bytes in [&good[..20], &good[..good.len() - 1], &[&good[..], &[0]].concat()] {
        pair.send(bytes);
    }
    pair.send(&good);
    assert_eq!(pair.receive(0).len(), 5, "what comes after is taken");
    let expected = ArrayCounters {
        taken: 1,
        foreign: 4,
        version: 1,
        size: 1,
        other_size: [4, 5],
        torn: 3,
        ..ArrayCounters::default()
    };
    assert_eq!(pair.counters(), expected);
    assert_eq!(pair.source.counters().undecodable, 9);
}

#[test]
fn lost_messages_and_new_senders_are_told_by_the_sequence() {
    let mut pair = Pair::new();
    for (sequence, lost, restarts) in [
        (10, 0, 0),
        (11, 0, 0),
        (14, 2, 0),
        (0, 2, 1),
        (1, 2, 1),
        (u32::MAX, 2, 2),
        (0, 2, 2),
    ] {
        pair.send(&message(sequence, 0, &counts()));
        pair.receive(0);
        assert_eq!(
            (pair.counters().lost, pair.counters().restarts),
            (lost, restarts),
            "{sequence}"
        );
    }
}

#[test]
fn a_time_of_measurement_is_taken_where_it_can_be_one_and_never_goes_back() {
    let (mut pair, second) = (Pair::new(), 1000 * MS);
    for (measured_ns, now_ns, taken_ns, late) in [
        (99 * second, 99 * second + 3 * MS, 99 * second, 0),
        (0, 100 * second, 100 * second, 0),
        (100 * second - MS, 100 * second + MS, 100 * second, 0),
        (100 * second + 500 * MS, 101 * second, 100 * second + 500 * MS, 1),
        (1, 102 * second, 102 * second, 1),
        (900 * second, 103 * second, 103 * second, 1),
    ] {
        pair.send(&message(0, measured_ns, &counts()));
        let received = pair.receive(now_ns);
        assert_eq!(
            (received[0].t_ns, pair.counters().late),
            (taken_ns, late),
            "{measured_ns}"
        );
    }
}

#[test]
fn a_message_larger_than_the_room_goes_on_and_garbage_without_end_is_taken_in_portions() {
    let mut pair = Pair::new();
    pair.send(&message(0, 0, &counts()));
    pair.send(&message(1, 0, &counts()));
    let mut frames = Vec::new();
    let mut portion = Vec::with_capacity(4);
    while pair.source.receive(0, &mut portion) {
        frames.append(&mut portion);
        portion.reserve_exact(4);
    }
    frames.append(&mut portion);
    assert_eq!(frames.len(), 10);
    pair.program.set_nonblocking(true).unwrap();
    let mut sent = 0;
    while sent < 200 {
        while sent < 200 && pair.program.send(b"garbage").is_ok() {
            sent += 1;
        }
        let before = pair.counters().foreign;
        pair.source.receive(0, &mut pair.batch);
        assert!(pair.counters().foreign - before <= 64);
    }
}

#[test]
fn what_is_sent_frame_by_frame_arrives_as_it_was_and_nobody_there_is_an_error() {
    let dir = tempfile::TempDir::new().unwrap();
    let path = dir.path().join("touch.sock");
    assert!(PressureSender::open(&path).is_err());
    let socket = UnixDatagram::bind(&path).unwrap();
    let mut source = PressureSocket::new(OwnedFd::from(socket), SIZE, ()).unwrap();
    let mut sender = PressureSender::open(&path).unwrap();
    let frames = pressure_frames(SIZE, 3, &counts());
    // The end of a message whose beginning was not heard is left out.
    for frame in frames[2..].iter().chain(&frames) {
        sender.send(frame).unwrap();
    }
    let mut batch = Vec::with_capacity(64);
    source.receive(crate::monotonic_ns(), &mut batch);
    assert_eq!(batch.iter().map(|r| r.frame).collect::<Vec<_>>(), frames);
    assert_eq!(source.counters().array.taken, 1);
    drop(source);
    sender.send(&frames[0]).unwrap();
    let ended = frames[1..]
        .iter()
        .map(|frame| sender.send(frame))
        .find(Result::is_err);
    assert!(ended.unwrap().unwrap_err().to_string().contains("absent"));
}

#[test]
fn a_frame_that_promises_more_taxels_than_an_array_has_is_no_head() {
    for [rows, columns] in [[u16::MAX, u16::MAX], [0, 5], [1, MAX_ARRAY_TAXELS + 1]] {
        let ([a, b], [c, d]) = (rows.to_le_bytes(), columns.to_le_bytes());
        assert_eq!(
            ArrayHead::of_frame(&[a, b, c, d, 0, 0, 0, 0]),
            None,
            "{rows} x {columns}"
        );
    }
    assert!(ArrayHead::of_frame(pressure_frames([1, MAX_ARRAY_TAXELS], 0, &[0; 8188])[0].data()).is_some());
}

#[test]
fn an_array_takes_no_commands_and_that_is_no_failure() {
    let mut pair = Pair::new();
    let frame = CanFrame::standard(1, &[]).unwrap();
    assert!(matches!(pair.source.send(&frame), Err(SendError::ReceiveOnly)));
    assert_eq!(pair.source.counters().send_failures, 0);
}

#[test]
fn what_came_by_a_socket_is_taken_before_it_is_given_up_for_another() {
    let mut pair = Pair::new();
    let renewal = pair.source.renewal();
    let (program, socket) = UnixDatagram::pair().unwrap();
    renewal.renew(socket.into()).unwrap();
    let (_, third) = UnixDatagram::pair().unwrap();
    let full = renewal.renew(third.into()).unwrap_err();
    assert_eq!(full.kind(), std::io::ErrorKind::WouldBlock);
    pair.send(&message(7, 0, &counts()));
    program.send(&message(8, 0, &counts())).unwrap();
    assert_eq!(
        pair.receive(MS).len(),
        2 * pressure_frames(SIZE, 7, &counts()).len()
    );
    assert_eq!((pair.counters().taken, pair.counters().lost), (2, 0));
    drop(pair);
    let gone = renewal
        .renew(UnixDatagram::unbound().unwrap().into())
        .unwrap_err();
    assert_eq!(gone.kind(), std::io::ErrorKind::BrokenPipe);
}
