//! Listening to the hand: asks the boards who they are, starts them, hears them, stops them, and
//! speaks on no bus where somebody else does.

use super::bus_listener::{BusListener, Listener};
use super::hand::{BusFacts, HandFacts, NotedProblem, Unclaimed};
use taxel_can::{CanFrame, LinkState, Received};
use taxel_diagnose::{BusView, DaemonView, HandSetup, HandView, Problems};
use taxel_engine::Engine;
use taxel_joints::JointFeed;
use taxel_skin::{
    BoardStatus, BoardSupervisor, BoardsMode, Decoded, Discovery, DiscoveryReport, Finding, Layout, Movement,
    Protocol,
};
use taxeld::Config;

const MS: u64 = 1_000_000;
/// How long is listened before anything is sent, and for how long a bus must be silent at the end
/// of that: longer than the 209 ms that an iCub board may pause. What was on its way from before is
/// let pass.
const OVERHEAR_NS: u64 = 700 * MS;
const SILENCE_NS: u64 = 300 * MS;
/// A discovery is over after at most about 2.5 s.
const DISCOVERY_NS: u64 = 4_000 * MS;
/// Time to hand over the stop commands.
const STOP_NS: u64 = 500 * MS;
/// The hand is judged as often as a daemon judges it.
const JUDGE_NS: u64 = 100 * MS;
/// Most ids that nobody claims and that are told apart; the rest is counted with the last.
const MOST_IDS: usize = 4096;

/// What the doctor may do on the buses.
#[derive(Debug, Clone, Copy)]
pub(super) struct ListenPolicy {
    /// Send nothing at all.
    pub(super) listen_only: bool,
    /// How long to listen, seconds.
    pub(super) seconds: f64,
}

/// Listens to the hand of a configuration. `None` where the user stopped it.
pub(super) fn examine(
    config: &Config,
    bitrates: &[u64],
    policy: ListenPolicy,
    bus_listener: &mut BusListener,
) -> anyhow::Result<Option<HandFacts>> {
    let layout = &config.layout;
    let mut buses: Vec<BusFacts> = layout
        .buses
        .iter()
        .zip(&config.sources)
        .zip(bitrates)
        .map(|((name, source), bitrate)| BusFacts {
            name: name.clone(),
            source: source.to_string(),
            bitrate: *bitrate,
            is_passive: config.boards.mode == BoardsMode::Passive,
            ..BusFacts::default()
        })
        .collect();
    let may_send = bus_listener.is_live() && !policy.listen_only && config.boards.mode != BoardsMode::Passive;
    if may_send && !overhear(bus_listener, &mut buses) {
        return Ok(None);
    }
    let speakable: Vec<bool> = buses.iter().map(|b| b.spoken_to).collect();
    let speaks = speakable.contains(&true);

    let mut supervisor = BoardSupervisor::new(layout, &config.boards);
    let mut discovery = None;
    if speaks {
        let asking = supervisor.discover(layout).map_err(anyhow::Error::new)?;
        let Some((report, back)) = ask(bus_listener, asking, layout, &speakable) else {
            return Ok(None);
        };
        supervisor = back;
        discovery = Some(report);
    }

    let begin_ns = bus_listener.now_ns();
    // Joints have checks of their own; here their frames are told from those of strangers.
    let bus = config.joints_bus().map(|bus| bus.index);
    let joints = config.joints.as_ref().filter(|_| bus.is_some());
    let joints = joints
        .map(|joints| JointFeed::new(joints, bus, false))
        .transpose()?;
    let mut skin = config.clone();
    skin.joints = None;
    let mut hearing = HandListener {
        setup: skin.hand_setup(),
        problems: Problems::default(),
        noted: Vec::new(),
        judge_at_ns: begin_ns,
        joints,
        engine: Engine::new(&skin.engine(false)?, begin_ns)?.with_boards(supervisor),
        speaks,
        findings: Vec::new(),
        buses,
        extreme: vec![[0; 3]; layout.len()],
        protocols: (0..layout.len())
            .map(|taxel| layout.wiring_of(taxel).protocol)
            .collect(),
        speakable,
        stopping: false,
    };
    let length_ns = (policy.seconds * 1e9) as u64;
    // A recording is heard to its end.
    let length_ns = if bus_listener.is_live() {
        length_ns
    } else {
        u64::MAX / 2
    };
    let go_on = bus_listener.listen(length_ns, "listening to the hand", &mut hearing);
    let seconds = (bus_listener.now_ns() - begin_ns) as f64 / 1e9;
    let facts = hearing.facts(layout, bus_listener, seconds, discovery);
    if speaks {
        hearing.engine.stop();
        hearing.stopping = true;
        bus_listener.finish(STOP_NS, &mut hearing);
    }
    Ok(go_on.then_some(facts))
}

/// Listens for others, and notes on which buses one may speak; `false` where the user stopped it.
fn overhear(bus_listener: &mut BusListener, buses: &mut [BusFacts]) -> bool {
    let mut overhear = Overhear {
        last: vec![None; buses.len()],
    };
    if !bus_listener.listen(OVERHEAR_NS, "hearing whether others speak", &mut overhear) {
        return false;
    }
    let quiet_from_ns = bus_listener.now_ns().saturating_sub(SILENCE_NS);
    for (bus, facts) in buses.iter_mut().enumerate() {
        facts.overheard = overhear.last[bus]
            .filter(|(t_ns, _)| *t_ns >= quiet_from_ns)
            .map(|(_, id)| id);
        facts.spoken_to = facts.overheard.is_none() && bus_listener.link(bus) == LinkState::Up;
    }
    true
}

/// Asks the boards who they are, and gives their supervisor back; `None` where the user stopped it.
fn ask(
    bus_listener: &mut BusListener,
    discovery: Discovery<BoardSupervisor>,
    layout: &Layout,
    speakable: &[bool],
) -> Option<(DiscoveryReport, BoardSupervisor)> {
    let mut asking = Asking { discovery, speakable };
    let go_on = bus_listener.listen(DISCOVERY_NS, "asking who is there", &mut asking);
    let (mut report, supervisor) = asking.discovery.finish();
    only_asked(&mut report, layout, speakable);
    go_on.then_some((report, supervisor))
}

/// Buses that were not spoken to were not asked, whatever the discovery thinks.
fn only_asked(report: &mut DiscoveryReport, layout: &Layout, speakable: &[bool]) {
    let asked = |bus: u8| speakable.get(usize::from(bus)).copied().unwrap_or(false);
    report
        .missing
        .retain(|module| asked(layout.wiring[usize::from(*module)].bus));
}

struct Overhear {
    /// When the last frame of each bus came, and its id.
    last: Vec<Option<(u64, u32)>>,
}

impl Listener for Overhear {
    fn handle_frame(&mut self, bus: u8, received: &Received) {
        let frame = &received.frame;
        if !frame.is_error() {
            self.last[usize::from(bus)] = Some((received.t_ns, frame.id()));
        }
    }

    fn handle_turn(&mut self, _: &mut BusListener, _: u64) -> bool {
        true
    }
}

struct Asking<'a> {
    discovery: Discovery<BoardSupervisor>,
    speakable: &'a [bool],
}

impl Listener for Asking<'_> {
    fn handle_frame(&mut self, bus: u8, received: &Received) {
        self.discovery.handle_frame(bus, received);
    }

    fn handle_turn(&mut self, bus_listener: &mut BusListener, now_ns: u64) -> bool {
        while let Some(command) = self.discovery.poll_command(now_ns) {
            if self.speakable[usize::from(command.bus)] {
                bus_listener.send(command.bus, &command.frame);
            }
        }
        !self.discovery.is_done()
    }
}

struct HandListener<'a> {
    engine: Engine,
    /// Joints that are read from CAN.
    joints: Option<JointFeed>,
    setup: HandSetup<'a>,
    problems: Problems,
    /// What was wrong at any time.
    noted: Vec<NotedProblem>,
    /// When the hand is judged next.
    judge_at_ns: u64,
    /// Whether any bus is spoken to.
    speaks: bool,
    /// What the watch found at any time, in its last figures.
    findings: Vec<Finding>,
    buses: Vec<BusFacts>,
    /// By taxel: readings at the end of the range, dead ones, and all.
    extreme: Vec<[u32; 3]>,
    /// By taxel.
    protocols: Vec<Protocol>,
    speakable: Vec<bool>,
    stopping: bool,
}

impl Listener for HandListener<'_> {
    fn handle_frame(&mut self, bus: u8, received: &Received) {
        let index = usize::from(bus);
        let frame = &received.frame;
        self.engine.handle_frame(bus, received);
        self.engine.drain(&mut |_| {});
        let facts = &mut self.buses[index];
        if !frame.is_error() {
            facts.frames += 1;
            let [least, most] = frame.bits_within().map(u64::from);
            facts.bits = [facts.bits[0] + least, facts.bits[1] + most];
        }
        match self.engine.last_frame() {
            Some((Decoded::Unknown, _)) => {
                let mut joints = self.joints.iter_mut();
                if !joints.any(|joints| joints.handle_frame(bus, received)) {
                    count_unclaimed(facts, frame);
                }
            }
            Some((Decoded::Readings, readings)) => {
                for reading in readings {
                    let taxel = usize::from(reading.taxel);
                    let protocol = self.protocols[taxel];
                    let [extremes, deads, all] = &mut self.extreme[taxel];
                    *extremes += u32::from(protocol.is_saturated(reading));
                    *deads += u32::from(protocol.is_silent_chip(reading));
                    *all += 1;
                }
            }
            _ => {}
        }
    }

    fn handle_turn(&mut self, bus_listener: &mut BusListener, now_ns: u64) -> bool {
        self.engine.handle_time(now_ns);
        self.engine.drain(&mut |_| {});
        self.note_findings();
        if now_ns >= self.judge_at_ns && !self.stopping {
            self.judge_at_ns = now_ns + JUDGE_NS;
            self.judge(bus_listener, now_ns, false);
        }
        if !self.speaks {
            return true;
        }
        while let Some(command) = self.engine.poll_command(now_ns) {
            if self.speakable[usize::from(command.bus)] && !bus_listener.send(command.bus, &command.frame) {
                self.engine.handle_unsent(&command, now_ns);
            }
        }
        !(self.stopping && self.engine.boards().is_stopped())
    }
}

fn count_unclaimed(facts: &mut BusFacts, frame: &CanFrame) {
    let id = match frame.standard_id() {
        Some(id) => u32::from(id),
        None => frame.id() | taxel_can::EXTENDED_FLAG,
    };
    let full = facts.unclaimed.len() >= MOST_IDS && !facts.unclaimed.contains_key(&id);
    let id = if full {
        facts.unclaimed.last_key_value().map_or(id, |(last, _)| *last)
    } else {
        id
    };
    let unclaimed = facts.unclaimed.entry(id).or_insert(Unclaimed {
        count: 0,
        last: *frame,
    });
    unclaimed.count += 1;
    if !full {
        unclaimed.last = *frame;
    }
}

impl HandListener<'_> {
    fn note_findings(&mut self) {
        for finding in self.engine.bus_monitor().findings() {
            match self.findings.iter_mut().find(|known| is_same(known, finding)) {
                Some(known) => *known = *finding,
                None => self.findings.push(*finding),
            }
        }
    }

    /// Judges the hand as a daemon would, and notes what is wrong.
    fn judge(&mut self, bus_listener: &BusListener, now_ns: u64, boards_due: bool) {
        for (bus, facts) in self.buses.iter_mut().enumerate() {
            facts.counters = bus_listener.counters(bus);
            facts.obeyed = self.engine.decoders()[bus].counters().obeyed;
            // A recording that was played to its end is no lost link.
            facts.link = match bus_listener.is_live() {
                true => bus_listener.link(bus),
                false => LinkState::Up,
            };
        }
        let buses: Vec<BusView> = self.buses.iter().map(BusFacts::view).collect();
        let modules = self.setup.layout.modules.len();
        let boards: Vec<BoardStatus> = (0..modules).map(|m| self.engine.board(m as u16)).collect();
        let conditioner = self.engine.conditioner();
        let taxels = 0..conditioner.taxels();
        let unchanging: Vec<bool> = taxels.map(|t| conditioner.is_unchanging(t)).collect();
        let view = HandView {
            now_ns,
            buses: &buses,
            boards: &boards,
            findings: self.engine.bus_monitor().findings(),
            // Told by the check `touch`; there is no daemon that could measure it again.
            moved: Movement::None,
            // Told by the check `taxels`.
            faults: &[],
            unchanging: &unchanging,
            joints: None,
            boards_due,
            daemon: DaemonView::default(),
        };
        let _ = self.problems.handle_view(&self.setup, &view);
        self.noted.iter_mut().for_each(|noted| noted.is_over = true);
        for current in self.problems.current() {
            let problem = current.problem.clone();
            let noted = NotedProblem {
                problem,
                is_over: false,
            };
            match self
                .noted
                .iter_mut()
                .find(|known| known.problem.is_same(&noted.problem))
            {
                Some(known) => *known = noted,
                None => self.noted.push(noted),
            }
        }
    }

    fn facts(
        &mut self,
        layout: &Layout,
        bus_listener: &BusListener,
        seconds: f64,
        discovery: Option<DiscoveryReport>,
    ) -> HandFacts {
        self.judge(bus_listener, bus_listener.now_ns(), true);
        let buses = std::mem::take(&mut self.buses);
        let conditioner = self.engine.conditioner();
        let report = conditioner.report().filter(|_| !conditioner.is_calibrating());
        let mostly = |of: &dyn Fn(&[u32; 3]) -> bool| -> Vec<bool> { self.extreme.iter().map(of).collect() };
        let facts = HandFacts {
            seconds,
            boards: (0..layout.modules.len())
                .map(|board| self.engine.board(board as u16))
                .collect(),
            readings: self.extreme.iter().map(|[.., all]| *all).collect(),
            discovery,
            findings: std::mem::take(&mut self.findings),
            problems: std::mem::take(&mut self.noted),
            faults: report.map_or(Vec::new(), |_| conditioner.faults().to_vec()),
            dead: mostly(&|[_, deads, all]: &[u32; 3]| deads * 2 > *all),
            saturated: mostly(&|[extremes, _, all]: &[u32; 3]| extremes * 2 > *all),
            touched: report.map_or(0, |r| r.touched),
            buses,
        };
        // What still comes while the boards are stopped is not counted.
        self.buses = vec![BusFacts::default(); layout.buses.len()];
        facts
    }
}

/// Whether two findings are one, in other figures.
fn is_same(a: &Finding, b: &Finding) -> bool {
    match (a, b) {
        (Finding::IdBabbles { bus, id, .. }, Finding::IdBabbles { bus: b, id: i, .. }) => (bus, id) == (b, i),
        (Finding::BoardBabbles { module, .. }, Finding::BoardBabbles { module: m, .. })
        | (Finding::TwoBoards { module, .. }, Finding::TwoBoards { module: m, .. }) => module == m,
        (Finding::BusesSwapped { buses, .. }, Finding::BusesSwapped { buses: b, .. }) => buses == b,
        (a, b) => a == b,
    }
}
