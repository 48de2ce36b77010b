//! One simulated CAN bus: arbitration, bit timing, and what goes wrong between the bus and the host.

use crate::board::{Board, plans};
use crate::clock::{SceneClock, Span};
use crate::fault::{BoardFault, BusFault, Fault, FaultKind};
use crate::random::{bits, happens};
use crate::scene::{Scene, SceneError};
use crate::skin_model::{SkinModel, modules_named, present_modules};
use std::collections::VecDeque;
use std::sync::Arc;
use taxel_can::{CanFrame, Received};
use taxel_skin::Layout;

/// Nanoseconds per bit at 1 Mbit/s, the rate of every uSkin bus (docs/protocols.md, "Bus timing").
const BIT_NS: u64 = 1000;
/// The same of a pressure array, whose frames come over no bus, and all at once.
const ARRAY_BIT_NS: u64 = 1;
/// Frames the host's controller keeps until they win the bus; SocketCAN's usual `txqueuelen`.
const HOST_QUEUE: usize = 10;
/// A frame held back to be overtaken is let go after this time if none comes.
const HOLD_NS: u64 = 2_000_000;
/// Random numbers of faults between bus and host, one stream per bus and fault.
const HOST_STREAM: u64 = 0x6873;

/// A bus with its boards. Its time only moves forward, in [`Bus::pop`].
#[derive(Debug)]
pub(crate) struct Bus {
    index: u8,
    bit_ns: u64,
    seed: u64,
    skin: Arc<SkinModel>,
    boards: Vec<Board>,
    /// Commands of the host with the time from which they want the bus.
    host: VecDeque<(u64, CanFrame)>,
    injectors: Vec<Injector>,
    faults: Vec<(Span, BusFault)>,
    in_flight: Option<Flight>,
    edge_ns: Option<u64>,
    now_ns: u64,
    /// Whether the host's controller is off the bus.
    bus_off: bool,
    /// Frames that were on the bus.
    carried: u64,
    /// A frame to be overtaken, and when it is let go at the latest.
    held: Option<(u64, CanFrame)>,
    /// What the host has received and not been given yet.
    out: VecDeque<Received>,
}

/// A frame on the wire.
#[derive(Debug)]
struct Flight {
    sender: Sender,
    frame: CanFrame,
    end_ns: u64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Sender {
    Board(usize),
    Host,
    Injector(usize),
}

/// A source of frames that no board sends.
#[derive(Debug)]
struct Injector {
    span: Span,
    period_ns: u64,
    frame: CanFrame,
    /// What it sends the next time.
    next: CanFrame,
    next_ns: Option<u64>,
    /// Whether its frame waits for the bus; error frames never do.
    waiting: bool,
}

/// The transmit queue of the host is full.
#[derive(Debug)]
pub(crate) struct QueueFull;

impl Bus {
    pub(crate) fn new(
        scene: &Scene,
        layout: &Layout,
        skin: Arc<SkinModel>,
        seed: u64,
        index: u8,
    ) -> Result<Self, SceneError> {
        let present = present_modules(scene, layout)?;
        let faults_of = |m: usize| faults_of_module(scene, layout, m);
        let plans = plans(scene, layout, seed, index, &present, faults_of)?;
        let boards = plans
            .into_iter()
            .map(|plan| Board::new(plan, scene.boards, seed))
            .collect();
        let (faults, injectors) = faults_of_bus(scene, layout, skin.clock(), index)?;
        let mut bus = Self {
            index,
            bit_ns: match layout.array_on(index.into()) {
                Some(_) => ARRAY_BIT_NS,
                None => BIT_NS,
            },
            seed,
            skin,
            boards,
            host: VecDeque::with_capacity(HOST_QUEUE),
            injectors,
            faults,
            in_flight: None,
            edge_ns: None,
            now_ns: 0,
            bus_off: false,
            carried: 0,
            held: None,
            out: VecDeque::with_capacity(16),
        };
        bus.follow_controller(0);
        bus.edge_ns = bus.next_edge(0);
        Ok(bus)
    }

    /// The next frame the host receives up to `until_ns`, if there is one. Simulates as far as needed.
    pub(crate) fn pop(&mut self, until_ns: u64) -> Option<Received> {
        loop {
            if let Some(received) = self.out.pop_front() {
                return Some(received);
            }
            match self.next_event_ns() {
                Some(t) if t <= until_ns => self.step(t),
                _ => {
                    self.now_ns = self.now_ns.max(until_ns);
                    return None;
                }
            }
        }
    }

    /// When something happens next that may give the host a frame; `None` if nothing will without a command.
    pub(crate) fn next_event_ns(&self) -> Option<u64> {
        if !self.out.is_empty() {
            return Some(self.now_ns);
        }
        let boards = self.boards.iter().filter_map(Board::next_event_ns);
        let injectors = self.injectors.iter().filter_map(|i| i.next_ns);
        let held = self.held.map(|(until, _)| until);
        let bus = match &self.in_flight {
            Some(flight) => Some(flight.end_ns),
            None if self.arbitrate().is_some() => Some(self.now_ns),
            None => self.host.front().map(|(t, _)| *t).filter(|t| *t > self.now_ns),
        };
        boards
            .chain(injectors)
            .chain(held)
            .chain(bus)
            .chain(self.edge_ns)
            .min()
    }

    /// The host wants to send. A time already simulated means now.
    pub(crate) fn command(&mut self, frame: &CanFrame, t_ns: u64) -> Result<(), QueueFull> {
        if self.host.len() >= HOST_QUEUE {
            return Err(QueueFull);
        }
        let last_ns = self.host.back().map_or(0, |(t, _)| *t);
        self.host.push_back((t_ns.max(self.now_ns).max(last_ns), *frame));
        Ok(())
    }

    pub(crate) fn start_all(&mut self) {
        for board in &mut self.boards {
            board.set_autostart(self.now_ns);
        }
    }

    /// Whether a scene played once is over and its last frame delivered.
    pub(crate) fn is_finished(&self) -> bool {
        self.clock().is_over(self.now_ns) && self.next_event_ns().is_none()
    }

    pub(crate) fn boards(&self) -> &[Board] {
        &self.boards
    }

    fn step(&mut self, t_ns: u64) {
        self.now_ns = t_ns;
        if self.in_flight.as_ref().is_some_and(|f| f.end_ns == t_ns)
            && let Some(flight) = self.in_flight.take()
        {
            self.land(&flight, t_ns);
        }
        let edge = self.edge_ns == Some(t_ns);
        if edge {
            self.follow_controller(t_ns);
            self.edge_ns = self.next_edge(t_ns);
        }
        for board in &mut self.boards {
            if edge || board.next_event_ns() == Some(t_ns) {
                board.run(t_ns, &self.skin);
            }
        }
        let clock = self.skin.clock();
        for i in 0..self.injectors.len() {
            let injector = &mut self.injectors[i];
            if injector.next_ns != Some(t_ns) {
                continue;
            }
            injector.next_ns = clock.next_periodic(injector.span, injector.period_ns, t_ns);
            let frame = injector.frame;
            injector.waiting = !frame.is_error();
            std::mem::swap(&mut injector.frame, &mut injector.next);
            if frame.is_error() && !self.bus_off {
                self.out.push_back(Received { t_ns, frame });
            }
        }
        if self.held.is_some_and(|(until, _)| until == t_ns) {
            self.let_go(t_ns);
        }
        if self.in_flight.is_none()
            && let Some((sender, frame)) = self.arbitrate()
        {
            self.in_flight = Some(Flight {
                sender,
                frame,
                end_ns: t_ns + u64::from(frame.bits()) * self.bit_ns,
            });
        }
    }

    /// Who gets the free bus: the lowest id; a data frame before a remote one, a standard id before
    /// an extended one that begins alike.
    fn arbitrate(&self) -> Option<(Sender, CanFrame)> {
        let scene_ns = self.skin.clock().scene_ns(self.now_ns);
        let boards = self.boards.iter().enumerate();
        let boards = boards.filter_map(|(i, b)| Some((Sender::Board(i), b.offer(scene_ns)?)));
        let host = self
            .host
            .front()
            .filter(|(t, _)| *t <= self.now_ns && !self.bus_off);
        let host = host.map(|(_, frame)| (Sender::Host, *frame));
        let injectors = self.injectors.iter().enumerate().filter(|(_, i)| i.waiting);
        let injectors = injectors.map(|(i, injector)| (Sender::Injector(i), injector.frame));
        boards
            .chain(host)
            .chain(injectors)
            .min_by_key(|(_, frame)| arbitration_key(frame))
    }

    /// A frame is through: its sender goes on, everybody else has heard it.
    fn land(&mut self, flight: &Flight, t_ns: u64) {
        let by_board = matches!(flight.sender, Sender::Board(_));
        for (i, board) in self.boards.iter_mut().enumerate() {
            if flight.sender == Sender::Board(i) {
                board.sent();
            } else {
                board.handle_frame(&flight.frame, by_board, t_ns, &self.skin);
            }
        }
        match flight.sender {
            Sender::Board(_) => {}
            Sender::Host => {
                self.host.pop_front();
            }
            Sender::Injector(i) => self.injectors[i].waiting = false,
        }
        let number = self.carried;
        self.carried += 1;
        if flight.sender != Sender::Host && !self.bus_off {
            self.deliver(flight.frame, number, t_ns);
        }
    }

    /// Gives the host a frame, with what the scene says goes wrong on the way.
    fn deliver(&mut self, mut frame: CanFrame, number: u64, t_ns: u64) {
        let scene_ns = self.skin.clock().scene_ns(t_ns);
        let (mut copies, mut hold) = (1, false);
        for (i, (span, fault)) in self.faults.iter().enumerate() {
            let probability = match *fault {
                BusFault::Lost { probability }
                | BusFault::Duplicate { probability }
                | BusFault::Reorder { probability }
                | BusFault::Short { probability } => probability,
                BusFault::BusOff | BusFault::ErrorFrames { .. } | BusFault::Babble { .. } => continue,
            };
            let stream = HOST_STREAM << 32 | u64::from(self.index) << 16 | i as u64;
            if !span.contains(scene_ns) || !happens(bits(self.seed, stream, number), probability) {
                continue;
            }
            match fault {
                BusFault::Lost { .. } => return,
                BusFault::Duplicate { .. } => copies = 2,
                BusFault::Reorder { .. } => hold = true,
                _ => {
                    let data = frame.data();
                    let short = &data[..data.len().saturating_sub(1)];
                    frame = CanFrame::from_raw(frame.raw_id(), short).unwrap_or(frame);
                }
            }
        }
        if hold && self.held.is_none() {
            self.held = Some((t_ns + HOLD_NS, frame));
            return;
        }
        for _ in 0..copies {
            self.out.push_back(Received { t_ns, frame });
        }
        self.let_go(t_ns);
    }

    fn let_go(&mut self, t_ns: u64) {
        if let Some((_, frame)) = self.held.take() {
            self.out.push_back(Received { t_ns, frame });
        }
    }

    /// The host's controller goes off the bus or comes back, and says so (`linux/can/error.h`).
    fn follow_controller(&mut self, t_ns: u64) {
        let scene_ns = self.skin.clock().scene_ns(t_ns);
        let mut spans = self.faults.iter().filter(|(_, f)| *f == BusFault::BusOff);
        let off = spans.any(|(span, _)| span.contains(scene_ns));
        if off != self.bus_off {
            const CAN_ERR_BUSOFF: u32 = 0x40;
            const CAN_ERR_RESTARTED: u32 = 0x100;
            let class = if off { CAN_ERR_BUSOFF } else { CAN_ERR_RESTARTED };
            let frame = CanFrame::error(class, [0; 8]);
            self.out.push_back(Received { t_ns, frame });
            self.bus_off = off;
            if off {
                self.host.clear();
                if self.in_flight.as_ref().is_some_and(|f| f.sender == Sender::Host) {
                    self.in_flight = None;
                }
            }
        }
    }

    fn next_edge(&self, after_ns: u64) -> Option<u64> {
        let boards = self.boards.iter().flat_map(Board::fault_spans);
        let own = self
            .faults
            .iter()
            .filter(|(_, f)| *f == BusFault::BusOff)
            .map(|(span, _)| *span);
        self.clock().next_edge(boards.chain(own), after_ns)
    }

    fn clock(&self) -> SceneClock {
        self.skin.clock()
    }
}

/// What the scene has go wrong with the board of a module.
fn faults_of_module(scene: &Scene, layout: &Layout, m: usize) -> Result<Vec<(Span, BoardFault)>, SceneError> {
    let (module, protocol) = (&layout.modules[m], layout.wiring[m].protocol);
    let mut faults = Vec::new();
    for fault in &scene.faults {
        let FaultKind::Board(kind) = fault.kind else {
            continue;
        };
        let mut on_module = false;
        for name in &fault.on {
            on_module |= modules_named(scene, layout, fault.line, name)?.contains(&m);
        }
        if !on_module {
            continue;
        }
        if let BoardFault::WrongId { board } = kind
            && !protocol.addresses().contains(&board)
        {
            return Err(SceneError::Invalid {
                file: scene.file.clone(),
                line: fault.line,
                problem: format!("the protocol of `{}` has no board {board}", module.name),
            });
        }
        faults.push((fault.span, kind));
    }
    Ok(faults)
}

/// What the faults of a scene do to a bus and when, and what they send on it.
type FaultsOfBus = (Vec<(Span, BusFault)>, Vec<Injector>);

fn faults_of_bus(
    scene: &Scene,
    layout: &Layout,
    clock: SceneClock,
    index: u8,
) -> Result<FaultsOfBus, SceneError> {
    let mut faults = Vec::new();
    let mut injectors = Vec::new();
    for fault in &scene.faults {
        let FaultKind::Bus(kind) = fault.kind else {
            continue;
        };
        if fault.bus.is_some_and(|b| b as usize >= layout.buses.len()) {
            return Err(SceneError::Invalid {
                file: scene.file.clone(),
                line: fault.line,
                problem: format!(
                    "`bus` is {}; the layout {} has {} buses, numbered from 0",
                    fault.bus.unwrap_or(0),
                    layout.name,
                    layout.buses.len()
                ),
            });
        }
        if fault.bus.is_some_and(|b| b != index) {
            continue;
        }
        let inject = |frame, next, period_ns| Injector {
            span: fault.span,
            period_ns,
            frame,
            next,
            next_ns: clock.next_periodic(fault.span, period_ns, 0),
            waiting: false,
        };
        match kind {
            BusFault::ErrorFrames { error, period_ns } => {
                let [frame, next] = error.frames().map(|(class, data)| CanFrame::error(class, data));
                injectors.push(inject(frame, next, period_ns));
            }
            BusFault::Babble { id, period_ns } => {
                for id in babbling_ids(scene, layout, fault, index, id)? {
                    if let Ok(frame) = CanFrame::standard(id, &[0xBA; 8]) {
                        injectors.push(inject(frame, frame, period_ns));
                    }
                }
            }
            _ => faults.push((fault.span, kind)),
        }
    }
    Ok((faults, injectors))
}

/// The ids that a babble floods this bus with: its own, or those of the first taxels of the boards it is on.
fn babbling_ids(
    scene: &Scene,
    layout: &Layout,
    fault: &Fault,
    bus: u8,
    id: Option<u16>,
) -> Result<Vec<u16>, SceneError> {
    let mut ids: Vec<u16> = id.into_iter().collect();
    for name in &fault.on {
        for m in modules_named(scene, layout, fault.line, name)? {
            let wiring = &layout.wiring[m];
            let k = layout.k[usize::from(layout.modules[m].first_taxel)];
            let own = wiring.protocol.frame_id(wiring.board, k);
            ids.extend(own.filter(|_| wiring.bus == bus));
        }
    }
    Ok(ids)
}

/// Sorts frames as the bus does, lowest first.
fn arbitration_key(frame: &CanFrame) -> u32 {
    let rtr = u32::from(frame.is_remote());
    if frame.is_extended() {
        let id = frame.id();
        (id >> 18) << 21 | 0b11 << 19 | (id & 0x3FFFF) << 1 | rtr
    } else {
        frame.id() << 21 | rtr << 20
    }
}
