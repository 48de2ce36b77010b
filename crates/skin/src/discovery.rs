//! Which boards are on the buses, and with which firmware: asked before they are started, and only then.
//!
//! The question is a class-7 frame to everybody, which stops the sampling of an MTB3 (docs/protocols.md,
//! "MTB discovery" and "MTB3 firmware"). Three things keep it away from boards that stream: while a
//! [`Discovery`] lives, it holds the supervisor that would start them; it cannot be made from a supervisor
//! that has spoken; and it listens first, and does not ask on a bus where anything is being sent.

use crate::boards::BoardSupervisor;
use crate::layout::Layout;
use crate::protocol::Protocol;
use crate::protocol::commands::BoardCommand;
use crate::protocol::mtb::{BoardKind, GET_FW_VERSION, MtbCommand};
use serde::Serialize;
use taxel_can::{CanFrame, Received};

const MS: u64 = 1_000_000;
/// A bus that is silent for this long is asked. The longest period of an iCub board is 209 ms.
const QUIET_NS: u64 = 250 * MS;
/// A bus that is not silent by then is not asked.
const PATIENCE_NS: u64 = 1_500 * MS;
/// The same of buses of which nothing is known: devices of other kinds may say once a second that they are there.
const UNKNOWN_QUIET_NS: u64 = 1_100 * MS;
const UNKNOWN_PATIENCE_NS: u64 = 2_500 * MS;
/// Time for answers to the question to everybody.
const COLLECT_NS: u64 = 200 * MS;
/// Pause between commands to boards.
const GAP_NS: u64 = 10 * MS;
/// Time for answers to the last question.
const LAST_NS: u64 = 100 * MS;
/// The protocol version a host of this protocol asks for.
const PROTOCOL_VERSION: [u8; 2] = [1, 0];

/// Version of a board's firmware.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Firmware {
    /// Major number.
    pub major: u8,
    /// Minor number.
    pub minor: u8,
    /// Build number, where it was told.
    pub build: Option<u8>,
}

/// A board that answered.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct FoundBoard {
    /// Number of its bus.
    pub bus: u8,
    /// Its address, 0 to 15.
    pub address: u8,
    /// What it says it is.
    pub kind: BoardKind,
    /// Its firmware, or its bootloader's.
    pub firmware: Firmware,
    /// It is in its bootloader, so that it cannot be started: its firmware is missing, or it was
    /// told to go there.
    pub in_bootloader: bool,
    /// The protocol version its firmware speaks, major and minor; `None` if it did not say.
    pub protocol_version: Option<[u8; 2]>,
    /// How often it answered one question: more than once is two boards with one address.
    pub answers: u8,
    /// Its module in the layout, where one has its address.
    pub module: Option<u16>,
}

/// A bus that was not asked, because something is being sent on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct BusTraffic {
    /// Number of the bus.
    pub bus: u8,
    /// Identifier of the last frame heard.
    pub id: u32,
}

/// What a discovery found.
#[derive(Debug, Default, Clone, PartialEq, Eq, Serialize)]
pub struct DiscoveryReport {
    /// Boards by bus and address.
    pub boards: Vec<FoundBoard>,
    /// Modules of the layout on buses that were asked, whose board did not answer.
    pub missing: Vec<u16>,
    /// Buses that were not asked.
    pub busy: Vec<BusTraffic>,
}

impl DiscoveryReport {
    /// Boards that are not what the layout says: module, protocol it is said to speak, and what answered.
    pub fn mismatches<'a>(
        &'a self,
        layout: &'a Layout,
    ) -> impl Iterator<Item = (u16, Protocol, &'a FoundBoard)> + 'a {
        self.boards.iter().filter_map(|found| {
            let module = found.module?;
            let protocol = layout.wiring.get(module as usize)?.protocol;
            (!protocol.is_spoken_by(found.kind)).then_some((module, protocol, found))
        })
    }
}

/// A frame to send on a bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DiscoveryCommand {
    /// Number of the bus.
    pub bus: u8,
    /// The frame.
    pub frame: CanFrame,
}

/// The supervisor has already sent commands: its boards may stream, and would be stopped.
#[derive(Debug, Clone, thiserror::Error)]
#[error(
    "boards cannot be discovered once they were started: discover first, or stop and make a new supervisor"
)]
pub struct AlreadyStarted(
    /// The supervisor, unchanged.
    pub Box<BoardSupervisor>,
);

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    /// Stop commands to the boards of the layout: how many are out.
    Stop(usize),
    /// Waits for silence.
    Listen,
    /// Asked everybody.
    Collect,
    /// Asks each board found for its firmware: the next one.
    Versions(usize),
    /// Waits for the last answers.
    Last,
    Done,
}

#[derive(Debug, Clone)]
struct Bus {
    number: u8,
    phase: Phase,
    /// When something is due.
    at_ns: u64,
    /// How long it has to be silent before it is asked.
    quiet_ns: u64,
    /// How long that is waited for.
    longest_ns: u64,
    /// When listening is given up.
    patience_ns: Option<u64>,
    /// When something was last sent on the bus by others, and its id.
    heard: Option<(u64, u32)>,
    busy: bool,
    stops: Vec<CanFrame>,
}

/// Asks the MTBs of the buses who they are. Holds no clock and sends nothing itself: send what
/// [`Discovery::poll_command`] gives, give every frame that is received to
/// [`Discovery::handle_frame`], poll again at [`Discovery::poll_due_ns`], and [`Discovery::finish`]
/// when it is done, after at most about 2.5 s. It needs every frame of the bus, without the kernel
/// filters of the decoder, to know that a bus is silent. `Then` is what it holds back meanwhile.
///
/// ```
/// use taxel_can::{CanFrame, Received};
/// use taxel_skin::{BoardSupervisor, BoardsConfig, Layout};
///
/// let hand = Layout::builtin("uskin-module").expect("built in");
/// let supervisor = BoardSupervisor::new(&hand, &BoardsConfig::default());
/// let mut discovery = supervisor.discover(&hand).expect("nothing was started yet");
/// let mut now_ns = 0;
/// while let Some(next_ns) = discovery.poll_due_ns() {
///     now_ns = now_ns.max(next_ns);
///     while let Some(command) = discovery.poll_command(now_ns) {
///         if command.frame.to_string() == "70F#FF" {
///             let frame = CanFrame::standard(0x710, &[0xFF, 5, 2, 17, 0]).expect("a frame");
///             discovery.handle_frame(0, &Received { t_ns: now_ns, frame });
///         }
///     }
/// }
/// let (report, mut supervisor) = discovery.finish();
/// assert_eq!(report.boards[0].firmware.minor, 17);
/// assert!(report.missing.is_empty());
/// assert!(supervisor.poll_command(now_ns, |_| None).is_some(), "now the board is started");
/// ```
#[derive(Debug, Clone)]
pub struct Discovery<Then = ()> {
    buses: Vec<Bus>,
    boards: Vec<FoundBoard>,
    /// Bus, address and module of each MTB of the layout.
    expected: Vec<(u8, u8, u16)>,
    then: Then,
}

impl BoardSupervisor {
    /// Asks who is there before anything is started: first tells the boards of the layout to be
    /// silent, then waits for silence, then asks. The supervisor comes back when the discovery is
    /// finished. A passive supervisor sends nothing, so nothing is found.
    pub fn discover(self, layout: &Layout) -> Result<Discovery<BoardSupervisor>, AlreadyStarted> {
        if self.has_spoken() {
            return Err(AlreadyStarted(Box::new(self)));
        }
        let mut buses: Vec<Bus> = Vec::new();
        let mut expected = Vec::new();
        for (number, module, sequences) in self.mtbs() {
            let stops = sequences.stop.iter().map(|step| step.command);
            let stops = stops.filter(|command| matches!(command, BoardCommand::Mtb(_)));
            let place = buses
                .iter()
                .position(|bus| bus.number == number)
                .unwrap_or_else(|| {
                    buses.push(Bus::new(number));
                    buses.len() - 1
                });
            buses[place].stops.extend(stops.map(|command| command.frame()));
            expected.push((number, layout.wiring[module as usize].board & 15, module));
        }
        Ok(Discovery {
            buses,
            boards: Vec::new(),
            expected,
            then: self,
        })
    }
}

impl Discovery<()> {
    /// Looks for boards on buses `0..buses` without a layout. It stops nobody: a bus on which
    /// boards stream is reported as busy.
    pub fn scan(buses: u8) -> Self {
        Self {
            buses: (0..buses).map(Bus::unknown).collect(),
            boards: Vec::new(),
            expected: Vec::new(),
            then: (),
        }
    }
}

impl<Then> Discovery<Then> {
    /// The next frame to send at `now_ns`, if any.
    pub fn poll_command(&mut self, now_ns: u64) -> Option<DiscoveryCommand> {
        for bus in &mut self.buses {
            while bus.phase != Phase::Done && now_ns >= bus.at_ns {
                if let Some(frame) = bus.step(now_ns, &self.boards) {
                    return Some(DiscoveryCommand {
                        bus: bus.number,
                        frame,
                    });
                }
            }
        }
        None
    }

    /// When to poll again, nanoseconds; `None` once everything is known.
    pub fn poll_due_ns(&self) -> Option<u64> {
        let open = self.buses.iter().filter(|bus| bus.phase != Phase::Done);
        open.map(|bus| bus.at_ns).min()
    }

    /// Whether everything is known.
    pub fn is_done(&self) -> bool {
        self.poll_due_ns().is_none()
    }

    /// Takes a frame that was received on a bus.
    pub fn handle_frame(&mut self, bus: u8, received: &Received) {
        let frame = &received.frame;
        let Some(state) = self.buses.iter_mut().find(|b| b.number == bus) else {
            return;
        };
        if frame.is_error() || frame.is_remote() {
            return;
        }
        match state.phase {
            Phase::Stop(_) | Phase::Listen => state.handle_traffic(frame, received.t_ns),
            Phase::Collect => self.handle_answer(bus, frame),
            Phase::Versions(_) | Phase::Last => self.handle_version(bus, frame),
            Phase::Done => {}
        }
    }

    /// What was found, and what was held back. To be called when [`Discovery::is_done`]; buses that
    /// are not, count as asked.
    pub fn finish(self) -> (DiscoveryReport, Then) {
        let busy: Vec<BusTraffic> = self
            .buses
            .iter()
            .filter(|bus| bus.busy)
            .map(|bus| BusTraffic {
                bus: bus.number,
                id: bus.heard.map_or(0, |(_, id)| id),
            })
            .collect();
        let mut boards = self.boards;
        boards.sort_by_key(|found| (found.bus, found.address));
        let asked = |bus: u8| busy.iter().all(|b| b.bus != bus);
        let missing = self
            .expected
            .iter()
            .filter(|(bus, _, module)| asked(*bus) && boards.iter().all(|f| f.module != Some(*module)))
            .map(|(_, _, module)| *module)
            .collect();
        (
            DiscoveryReport {
                boards,
                missing,
                busy,
            },
            self.then,
        )
    }

    /// An answer to discovery: `[FF, type, major, minor, build]` from the application, without the
    /// build number from the bootloader.
    fn handle_answer(&mut self, bus: u8, frame: &CanFrame) {
        let Some(id) = frame.standard_id().filter(|id| id & 0x70F == 0x700) else {
            return;
        };
        let (kind, major, minor, build) = match *frame.data() {
            [0xFF, kind, major, minor, build] => (kind, major, minor, Some(build)),
            [0xFF, kind, major, minor] => (kind, major, minor, None),
            _ => return,
        };
        let address = (id >> 4 & 15) as u8;
        if let Some(found) = self
            .boards
            .iter_mut()
            .find(|f| (f.bus, f.address) == (bus, address))
        {
            found.answers = found.answers.saturating_add(1);
            return;
        }
        let module = self.expected.iter().find(|(b, a, _)| (*b, *a) == (bus, address));
        self.boards.push(FoundBoard {
            bus,
            address,
            kind: BoardKind::of(kind),
            firmware: Firmware { major, minor, build },
            in_bootloader: build.is_none(),
            protocol_version: None,
            answers: 1,
            module: module.map(|(_, _, module)| *module),
        });
    }

    /// An answer to `GET_FW_VERSION`: `[1C, type, major, minor, build, protocol major, minor, compatible]`.
    fn handle_version(&mut self, bus: u8, frame: &CanFrame) {
        let Some(id) = frame.standard_id().filter(|id| id & 0x70F == 0x200) else {
            return;
        };
        let [
            GET_FW_VERSION,
            kind,
            major,
            minor,
            build,
            protocol_major,
            protocol_minor,
            _,
        ] = *frame.data()
        else {
            return;
        };
        let address = (id >> 4 & 15) as u8;
        if let Some(found) = self
            .boards
            .iter_mut()
            .find(|f| (f.bus, f.address) == (bus, address))
        {
            found.kind = BoardKind::of(kind);
            found.firmware = Firmware {
                major,
                minor,
                build: Some(build),
            };
            found.protocol_version = Some([protocol_major, protocol_minor]);
        }
    }
}

impl Bus {
    fn new(number: u8) -> Self {
        Self {
            number,
            phase: Phase::Stop(0),
            at_ns: 0,
            quiet_ns: QUIET_NS,
            longest_ns: PATIENCE_NS,
            patience_ns: None,
            heard: None,
            busy: false,
            stops: Vec::new(),
        }
    }

    fn unknown(number: u8) -> Self {
        Self {
            quiet_ns: UNKNOWN_QUIET_NS,
            longest_ns: UNKNOWN_PATIENCE_NS,
            ..Self::new(number)
        }
    }

    /// Any frame but a command makes the bus one on which something is being sent.
    fn handle_traffic(&mut self, frame: &CanFrame, now_ns: u64) {
        if frame
            .standard_id()
            .is_some_and(|id| id & 0x7F0 == 0x200 && frame.dlc() < 8)
        {
            return;
        }
        self.heard = Some((now_ns, frame.id()));
    }

    /// Does what is due, and gives the frame to send, if that is one.
    fn step(&mut self, now_ns: u64, boards: &[FoundBoard]) -> Option<CanFrame> {
        match self.phase {
            Phase::Stop(out) if out < self.stops.len() => {
                self.phase = Phase::Stop(out + 1);
                self.at_ns = now_ns + GAP_NS;
                Some(self.stops[out])
            }
            Phase::Stop(_) => {
                self.phase = Phase::Listen;
                self.at_ns = now_ns + self.quiet_ns;
                self.patience_ns = Some(now_ns + self.longest_ns);
                None
            }
            Phase::Listen => {
                let patience_ns = self.patience_ns.unwrap_or(now_ns);
                let quiet_at_ns = self.heard.map_or(0, |(heard_ns, _)| heard_ns + self.quiet_ns);
                if now_ns >= quiet_at_ns {
                    self.phase = Phase::Collect;
                    self.at_ns = now_ns + COLLECT_NS;
                    return Some(
                        CanFrame::standard(0x70F, &[0xFF]).expect("11 bits and a byte make a frame"),
                    );
                }
                if now_ns < patience_ns {
                    self.at_ns = quiet_at_ns.min(patience_ns);
                } else {
                    self.busy = true;
                    self.phase = Phase::Done;
                }
                None
            }
            Phase::Collect => {
                self.phase = Phase::Versions(0);
                None
            }
            Phase::Versions(next) => {
                let mut of_bus = boards.iter().filter(|f| f.bus == self.number && !f.in_bootloader);
                let Some(found) = of_bus.nth(next) else {
                    self.phase = Phase::Last;
                    self.at_ns = now_ns + LAST_NS;
                    return None;
                };
                self.phase = Phase::Versions(next + 1);
                self.at_ns = now_ns + GAP_NS;
                Some(MtbCommand::firmware_version(found.address, PROTOCOL_VERSION).frame())
            }
            Phase::Last | Phase::Done => {
                self.phase = Phase::Done;
                None
            }
        }
    }
}
