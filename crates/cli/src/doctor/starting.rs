//! Boards on buses where nobody speaks: who is there, and what has them speak while a scan listens.

use super::bus_listener::{BusListener, Listener};
use super::hand::firmware_text;
use anyhow::bail;
use std::collections::BTreeSet;
use std::thread::sleep;
use std::time::Duration;
use taxel_can::{CanFrame, Received, SourceAddress};
use taxel_skin::{
    CyskinPacket, CyskinSetup, Discovery, FoundBoard, ICUB_CALIBRATION_MS, MtbCommand, Protocol,
    RecognisedBus, Recogniser, cyskin_frames, icub_configuration,
};

const DISCOVERY_NS: u64 = 4_000_000_000;
/// A board that was started is heard within this time; the longest period of an iCub board is 209 ms.
const HEARD_NS: u64 = 300_000_000;
/// Between two commands to boards (docs/protocols.md, "MTB3 firmware").
const GAP: Duration = Duration::from_millis(10);
const STOPPED: &str = "stopped before anything was recognised";

/// Who was asked for on silent buses, and what was started there.
#[derive(Debug, Default)]
pub(crate) struct Asked {
    boards: Vec<FoundBoard>,
    /// Buses on which others speak, so that nothing was sent.
    busy: Vec<u8>,
    /// Buses on which CySkin hubs were told to start, if there are any.
    hubs: Vec<u8>,
}

struct Asking(Discovery);

impl Listener for Asking {
    fn handle_frame(&mut self, bus: u8, received: &Received) {
        self.0.handle_frame(bus, received);
    }

    fn handle_turn(&mut self, bus_listener: &mut BusListener, now_ns: u64) -> bool {
        while let Some(command) = self.0.poll_command(now_ns) {
            bus_listener.send(command.bus, &command.frame);
        }
        !self.0.is_done()
    }
}

/// Hears which boards speak, by bus and address, and has all of it recognised.
struct Hearing<'a> {
    recogniser: &'a mut Recogniser,
    speaking: BTreeSet<(u8, u8)>,
}

impl Listener for Hearing<'_> {
    fn handle_frame(&mut self, bus: u8, received: &Received) {
        self.recogniser.handle_frame(bus, received);
        let Some(id) = received.frame.standard_id() else {
            return;
        };
        // Whichever MTB could have sent it.
        let mtbs = Protocol::boards().filter(|protocol| protocol.mtb().is_some());
        let boards = mtbs.filter_map(|protocol| protocol.board_of(id));
        self.speaking.extend(boards.map(|board| (bus, board)));
    }

    fn handle_turn(&mut self, _: &mut BusListener, _: u64) -> bool {
        true
    }
}

impl Asked {
    /// Asks silent buses for MTBs and starts those that answer; what may be an iCub board and stays silent is configured
    /// before it is started again. Where none answers, CySkin hubs are started, which answer no question.
    pub(super) fn start(
        bus_listener: &mut BusListener,
        buses: u8,
        recogniser: &mut Recogniser,
    ) -> anyhow::Result<Self> {
        let mut asking = Asking(Discovery::scan(buses));
        if !bus_listener.listen(DISCOVERY_NS, "asking who is there", &mut asking) {
            bail!(STOPPED);
        }
        let (report, ()) = asking.0.finish();
        let mut asked = Self {
            boards: report.boards,
            busy: report.busy.iter().map(|busy| busy.bus).collect(),
            hubs: Vec::new(),
        };
        for board in asked.startable() {
            recogniser.handle_board_kind(board.bus, board.address, board.kind);
            send(bus_listener, board.bus, &MtbCommand::start(board.address).frame());
        }
        if asked.startable().next().is_some() {
            let mut hearing = Hearing {
                recogniser,
                speaking: BTreeSet::new(),
            };
            if !bus_listener.listen(HEARD_NS, "starting the boards", &mut hearing) {
                bail!(STOPPED);
            }
            asked.configure_all_but(&hearing.speaking, bus_listener);
        }
        for bus in 0..buses {
            let has_mtbs = asked.boards.iter().any(|board| board.bus == bus);
            if !has_mtbs && !asked.busy.contains(&bus) {
                tell_hubs(bus_listener, bus, |hubs| &hubs.start);
                asked.hubs.push(bus);
            }
        }
        Ok(asked)
    }

    /// The boards whose firmware runs.
    fn startable(&self) -> impl Iterator<Item = &FoundBoard> {
        self.boards.iter().filter(|board| !board.in_bootloader)
    }

    /// Configures the boards that stay silent as an iCub board has to be after power-up, and starts them again.
    fn configure_all_but(&self, speaking: &BTreeSet<(u8, u8)>, bus_listener: &mut BusListener) {
        let is_configured = |protocol: &Protocol| protocol.mtb().is_some_and(|mtb| mtb.configured);
        let may_wait = |board: &&FoundBoard| {
            let mut protocols = Protocol::boards().filter(is_configured);
            protocols.any(|protocol| protocol.is_spoken_by(board.kind))
        };
        let silent: Vec<&FoundBoard> = (self.startable().filter(may_wait))
            .filter(|board| !speaking.contains(&(board.bus, board.address)))
            .collect();
        for board in &silent {
            for command in icub_configuration(board.address) {
                send(bus_listener, board.bus, &command.frame());
            }
        }
        if !silent.is_empty() {
            sleep(Duration::from_millis(ICUB_CALIBRATION_MS));
        }
        for board in &silent {
            send(bus_listener, board.bus, &MtbCommand::start(board.address).frame());
        }
    }

    /// Stops what was started.
    pub(super) fn stop(&self, bus_listener: &mut BusListener) {
        for board in self.startable() {
            send(bus_listener, board.bus, &MtbCommand::stop(board.address).frame());
        }
        for bus in &self.hubs {
            tell_hubs(bus_listener, *bus, |hubs| &hubs.stop);
        }
    }

    /// That nothing was sent on a bus (of this index), as others speak there and no board does.
    pub(crate) fn kept_quiet(&self, number: u8, name: &str, found: &RecognisedBus) -> Option<String> {
        let is_so = self.busy.contains(&number) && found.boards.is_empty();
        is_so.then(|| {
            format!(
                "{name}: nobody was asked for boards, since others speak there; who has boards on it that wait to be started \
                 silences the others meanwhile"
            )
        })
    }

    /// How the sentence goes on that nothing was heard on a bus (index).
    pub(crate) fn unheard(&self, bus: u8, source: &SourceAddress) -> String {
        let boards: Vec<String> = (self.boards.iter())
            .filter(|board| board.bus == bus)
            .map(|board| format!("board {} ({})", board.address, firmware_text(board)))
            .collect();
        if !boards.is_empty() {
            return format!(
                ", though these boards answer: {}. Their firmware may be no skin's; one in its bootloader has to be \
                 switched off and on",
                boards.join(", ")
            );
        }
        let command = match source {
            SourceAddress::Can { interface } => format!("`cansend {interface} 20b#0700`"),
            _ => "20b#0700".into(),
        };
        format!(
            " and no MTB or CySkin hub answers: is it powered, and is this its bus and bit rate? A uSkin board may know no \
             question: {command} starts it, b being its address (0 to E), while `taxel doctor --scan` listens; so does \
             taxeld with a layout that has it. Not where an Allegro hand is on the bus, which takes some of these for its \
             own"
        )
    }
}

/// Sends packets of Genoa's library to all CySkin hubs of a bus. Their id, 0x5FF, is no command to any other board or
/// hand that is known.
fn tell_hubs(bus_listener: &mut BusListener, bus: u8, packets: fn(&CyskinSetup) -> &[CyskinPacket]) {
    const PERIOD_MS: u16 = 50;
    let hubs = CyskinSetup::of_library(PERIOD_MS, Vec::new());
    for packet in packets(&hubs) {
        let frames = cyskin_frames(&hubs, hubs.ids.everybody(), packet.command, &packet.data);
        for frame in frames.into_iter().flatten() {
            send(bus_listener, bus, &frame);
        }
    }
}

/// Commands go to boards that stream only as an [`MtbCommand`] or to [`tell_hubs`], neither of which can be one that
/// stops the others.
fn send(bus_listener: &mut BusListener, bus: u8, frame: &CanFrame) {
    bus_listener.send(bus, frame);
    sleep(GAP);
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_skin::{BoardKind, Firmware};

    #[test]
    fn boards_that_answer_are_named_and_a_bus_without_any_is_not_only_called_unpowered() {
        let board = |bus, address, in_bootloader| FoundBoard {
            bus,
            address,
            kind: BoardKind::Mtb3,
            firmware: Firmware {
                major: 2,
                minor: 17,
                build: Some(0),
            },
            in_bootloader,
            protocol_version: None,
            answers: 1,
            module: None,
        };
        let asked = Asked {
            boards: vec![board(0, 2, false), board(0, 14, true)],
            busy: Vec::new(),
            hubs: vec![1],
        };
        let can = |interface: &str| SourceAddress::Can {
            interface: interface.into(),
        };
        let said = asked.unheard(0, &can("can0"));
        assert!(
            said.contains("board 2 (MTB3 firmware 2.17.0), board 14 (MTB3 bootloader 2.17.0)")
                && !said.contains("powered"),
            "{said}"
        );
        let said = asked.unheard(1, &can("can1"));
        assert!(
            said.contains("is it powered") && said.contains("`cansend can1 20b#0700`"),
            "{said}"
        );
    }
}
