//! Lines, datagrams and messages.

use taxel_can::LogReader;
use taxel_wire::{Event, Subscribe};

/// A candump log: as many results as lines at most, and a frame that was read prints as a line that
/// reads as the same.
pub fn candump_line(data: &[u8]) {
    let lines = data.split(|b| *b == b'\n').count();
    let mut results = 0;
    for entry in LogReader::new(data).flatten() {
        results += 1;
        let line = format!("(1.000000) can0 {}\n", entry.frame);
        let again = LogReader::new(line.as_bytes()).next();
        let again = again.expect("a line").expect("what was printed can be read");
        assert_eq!(again.frame, entry.frame, "{line}");
    }
    assert!(results <= lines);
}

/// A datagram of python-can's `udp_multicast`: a frame that prints as a line that reads as the same, or none.
pub fn python_can_datagram(data: &[u8]) {
    if let Ok(frame) = taxel_can::decode_python_can(data) {
        let line = format!("(1.000000) can0 {frame}\n");
        let again = LogReader::new(line.as_bytes()).next();
        let again = again.expect("a line").expect("what was printed can be read");
        assert_eq!(again.frame, frame, "{line}");
    }
}

/// A message of the wire format: decoded within the bytes given, alone and as a packet.
pub fn wire_decode(data: &[u8]) {
    if let Ok((_, used)) = taxel_wire::decode(data) {
        assert!(used <= data.len());
    }
    let _ = taxel_wire::decode_packet(data);
}

/// The text of a SUBSCRIBE and of an EVENT: what is accepted, is accepted again when it is sent on.
pub fn subscribe_text(data: &[u8]) {
    if let Ok(subscribe) = Subscribe::parse(data) {
        let again = Subscribe::from_packet(&subscribe.to_packet());
        assert_eq!(again.expect("what was accepted"), subscribe);
    }
    if let Ok(event) = Event::parse(data) {
        assert_eq!(
            Event::parse(event_text(&event).as_bytes()).expect("an event"),
            event
        );
    }
    let _ = Subscribe::from_packet(data);
}

fn event_text(event: &Event) -> String {
    serde_json::to_string(event).expect("text and a name")
}
