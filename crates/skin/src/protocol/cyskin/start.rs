//! What CySkin hubs are sent to start and stop them: as Genoa's library does, or as the layout file has it.

use super::packet::cyskin_frames;
use super::setup::{CommandsTo, CyskinHub, CyskinPacket, CyskinSetup};
use crate::protocol::commands::{BoardCommand, HubFrame, Sequences, Step};

/// Least time between two commands to a hub.
const GAP_NS: u64 = 10_000_000;
/// A hub that was told to start is given so many of its periods.
const SILENT_PERIODS: u64 = 3;

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
        silence_ns: SILENT_PERIODS * u64::from(setup.period_ms) * 1_000_000,
        triggered: false,
    })
}

fn steps(setup: &CyskinSetup, hub: &CyskinHub, packets: &[CyskinPacket]) -> Vec<Step> {
    let to = match setup.commands_to {
        CommandsTo::All => setup.ids.everybody(),
        CommandsTo::Hub => hub.address,
    };
    let of_packet = |packet: &CyskinPacket| {
        let frames = cyskin_frames(setup, to, packet.command, &packet.data)
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
