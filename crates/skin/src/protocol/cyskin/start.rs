//! What a CySkin hub is sent to start and stop it: as the layout file has it.

use super::packet::cyskin_frames;
use super::setup::{CyskinHub, CyskinPacket, CyskinSetup};
use crate::protocol::commands::{BoardCommand, HubFrame, Sequences, Step};

/// Least time between two commands to a hub.
const GAP_NS: u64 = 10_000_000;
/// CySkin's usual period is 50 ms; a hub that was told to start is given three of them.
const SILENCE_NS: u64 = 150_000_000;

/// `None` where the file has no packets to start it with: the hub sends by itself.
pub(super) fn sequences(setup: &CyskinSetup, hub: &CyskinHub) -> Option<Sequences> {
    let start = steps(setup, hub, &setup.start);
    (!start.is_empty()).then(|| Sequences {
        wake: start.clone(),
        start,
        ask: Vec::new(),
        grace_ns: 0,
        stop: steps(setup, hub, &setup.stop),
        gap_ns: GAP_NS,
        silence_ns: SILENCE_NS,
        triggered: false,
    })
}

fn steps(setup: &CyskinSetup, hub: &CyskinHub, packets: &[CyskinPacket]) -> Vec<Step> {
    let of_packet = |packet: &CyskinPacket| {
        let frames = cyskin_frames(setup, hub.address, packet.command, &packet.data)
            .expect("the layout file's packets were checked");
        let pause_ns = packet.pause_ms * 1_000_000;
        frames
            .into_iter()
            .filter_map(HubFrame::new)
            .map(move |frame| Step {
                command: BoardCommand::Hub(frame),
                pause_ns,
            })
    };
    packets.iter().flat_map(of_packet).collect()
}
