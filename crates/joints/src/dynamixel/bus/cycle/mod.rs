//! Cycle after cycle: which request comes next, and what becomes of the answers.

mod answers;
mod checks;
mod commands;
mod repeats;
mod requests;
mod telling;
mod watch;

use super::outcomes::Outcomes;
use super::pass::{Answer, Kind, Pass};
use super::reading::{JointReading, NoReading, PRESENT_BYTES};
use super::servo::{Servo, ServoState};
use super::slow::SlowLane;
use super::wire_ns;
use super::writes::{QUEUE, Write, WriteError};
use crate::dynamixel::config::{DynamixelConfig, FastSyncRead, ServoConfig};
use crate::dynamixel::protocol2::{Encoder, FAST_BLOCK_OVERHEAD, Parser, STATUS_OVERHEAD};
use crate::dynamixel::registers::address;
use checks::Checks;
use repeats::Repeats;
use std::collections::VecDeque;

/// What [`Bus::step`] wants from its caller.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    /// Read what has arrived so far ([`Bus::space`], [`Bus::take_bytes`]), send [`Bus::request`], then
    /// call [`Bus::sent`].
    Send,
    /// Read what arrives until this time, then call [`Bus::step`] again.
    Wait {
        /// Deadline, nanoseconds.
        until_ns: u64,
    },
    /// The cycle is over; [`Bus::results`] holds it. There is no step more before [`Bus::begin`].
    Done,
}

/// Whether all servos answer in one packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FastState {
    /// Not to be tried.
    Off,
    /// Not known yet.
    Probing,
    /// They do.
    On,
    /// Tried, and not answered as it should be: each answers with its own packet.
    NotSupported,
}

/// What happened on the bus as a whole.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub struct BusCounters {
    /// Cycles.
    pub cycles: u64,
    /// Requests sent, of all kinds.
    pub requests: u64,
    /// Bytes that belong to no packet.
    pub noise_bytes: u64,
    /// Good packets of servos that are not in the configuration.
    pub foreign: u64,
    /// Replies to a fast sync read that came after their deadline.
    pub late_fast: u64,
    /// Questions of the slow lane without answer.
    pub slow_unanswered: u64,
    /// Writes that a servo confirmed.
    pub writes_ok: u64,
    /// Writes that were refused or not confirmed.
    pub writes_failed: u64,
    /// How long the newest cycle took, nanoseconds.
    pub cycle_ns: u64,
}

/// Most requests for positions in one cycle: the first, and those for servos that only waited for a
/// silent one.
const PASSES: u32 = 3;
/// After a request without answer, the requested length changes so that an answer that is still to come is
/// recognised by its own; so long after the last it is as it was.
const SUSPICION_NS: u64 = 200_000_000;
/// How many lengths there are: 12 bytes to 19, none of which is that of another question. An answer could only be mistaken for
/// another if it came later than eight deadlines.
const LEADS: u16 = 8;
/// Bytes from Torque Enable to Present PWM: they are read as well where servos are to say whether their motors were left on.
const LEFT_ON_LEAD: u16 = address::PRESENT_PWM - address::TORQUE_ENABLE;
/// From Torque Enable to Present Position.
const LEFT_ON_BYTES: usize = LEFT_ON_LEAD as usize + PRESENT_BYTES;
/// Fast sync reads tried before it is given up, and those in a row that may fail later.
const FAST_TRIES: u32 = 3;
/// After a fast sync read that had worked was given up, it is tried again so much later.
const FAST_AGAIN_NS: u64 = 10_000_000_000;
/// What a servo that lives is told is sent so many times until it says that it holds it: a busy host can miss an answer.
const WRITE_TRIES: u32 = 3;
/// For so long of a cycle servos are told one after the other that their motors are to be off, where some do not answer.
const OFFS_NS: u64 = 100_000_000;
/// Between two questions of the slow lane lies at least so many times the time of a cycle.
const SLOW_SHARE: u64 = 4;
/// Time for the operating system and the adapter on top of the time on the wire, unless [`Bus::set_margins_ns`] says
/// otherwise.
pub(crate) const DEFAULT_MARGIN_NS: u64 = 4_000_000;

/// All servos of one bus.
///
/// The caller drives it: [`Bus::begin`], then [`Bus::step`] until [`Step::Done`].
#[derive(Debug)]
pub struct Bus {
    config: Vec<ServoConfig>,
    servos: Vec<Servo>,
    /// Index of the servo with an id.
    by_id: [Option<u8>; 256],
    results: Vec<Result<JointReading, NoReading>>,
    baud: u32,
    margin_ns: u64,
    resting_margin_ns: u64,
    encoder: Encoder,
    request: Vec<u8>,
    parser: Parser,
    pass: Pass,
    pass_active: bool,
    passes: u32,
    /// Whether one servo had its turn in this cycle to say whether its motor was left on, where it is not asked for that with its
    /// position.
    left_on_done: bool,
    slow_done: bool,
    slow_ns: u64,
    again: Vec<usize>,
    /// Those that are asked for their positions behind the ones that are to say whether their motors were left on.
    behind: Vec<usize>,
    /// 0 to 7: how many bytes before Present PWM are read as well, and which length what servos hold is read with.
    lead: u16,
    /// Which of two lengths that is.
    held_turn: usize,
    suspicious_ns: Option<u64>,
    fast: FastState,
    fast_failures: u32,
    fast_worked: bool,
    /// When fast sync read is tried again, where it has worked before.
    fast_again_ns: Option<u64>,
    checks: Checks,
    lane: SlowLane,
    allow_writes: bool,
    watchdog_steps: u8,
    writes: VecDeque<Write>,
    outcomes: Outcomes,
    /// Whether there are new ones, or a motor that was to be off has news.
    has_outcomes: bool,
    /// Whether no more writes are sent in this cycle but to switch motors off.
    writes_done: bool,
    /// Whether one was in vain in this cycle that was to switch a motor off: nor are more of these, but for the first time.
    offs_done: bool,
    repeats: Repeats,
    /// Whether there are new ones that switch motors off.
    offs_untold: bool,
    /// Until when answers may come to requests that were not waited for as long.
    in_time_until_ns: u64,
    /// Whether nothing is done any more but to switch motors off; for how long once the first packet was sent, and until when
    /// since then.
    ends: bool,
    release_ns: u64,
    release_until_ns: Option<u64>,
    begun_ns: u64,
    counters: BusCounters,
}

impl Bus {
    /// A bus for the servos of a configuration that has been checked. Nothing is asked yet.
    pub fn new(config: &DynamixelConfig) -> Self {
        let n = config.servo.len();
        let mut by_id = [None; 256];
        for (i, servo) in config.servo.iter().enumerate() {
            by_id[usize::from(servo.id)] = u8::try_from(i).ok();
        }
        let longest_data = PRESENT_BYTES + usize::from(LEADS);
        let longest_alone = longest_data + usize::from(LEFT_ON_LEAD) + STATUS_OVERHEAD;
        let longest = (1 + n * (longest_data + FAST_BLOCK_OVERHEAD)).max(longest_alone);
        Self {
            config: config.servo.clone(),
            servos: config.servo.iter().map(|s| Servo::new(s.id)).collect(),
            by_id,
            results: vec![Err(NoReading::NotAsked); n],
            baud: config.baud,
            margin_ns: DEFAULT_MARGIN_NS,
            resting_margin_ns: DEFAULT_MARGIN_NS,
            encoder: Encoder::with_capacity(64 + 4 * n),
            request: Vec::with_capacity(64 + 4 * n),
            parser: Parser::new(longest),
            pass: Pass::new(n),
            pass_active: false,
            passes: 0,
            left_on_done: true,
            slow_done: true,
            slow_ns: 0,
            again: Vec::with_capacity(n),
            behind: Vec::with_capacity(n),
            lead: 0,
            held_turn: 0,
            suspicious_ns: None,
            fast: match config.fast_sync_read {
                // One alone has nobody to share a packet with.
                FastSyncRead::Auto if n == 1 => FastState::Off,
                FastSyncRead::Auto => FastState::Probing,
                FastSyncRead::On => FastState::On,
                FastSyncRead::Off => FastState::Off,
            },
            fast_failures: 0,
            fast_worked: false,
            fast_again_ns: None,
            checks: Checks::default(),
            lane: SlowLane::default(),
            allow_writes: config.allow_writes,
            watchdog_steps: u8::try_from(config.watchdog_ms / 20).unwrap_or(127).clamp(1, 127),
            writes: VecDeque::with_capacity(QUEUE + 2 * n),
            outcomes: Outcomes::new(),
            has_outcomes: false,
            writes_done: false,
            offs_done: false,
            repeats: Repeats::default(),
            offs_untold: false,
            in_time_until_ns: 0,
            ends: false,
            release_ns: 0,
            release_until_ns: None,
            begun_ns: 0,
            counters: BusCounters::default(),
        }
    }

    /// How long beyond the time on the wire an answer is waited for, nanoseconds: what the operating system and the serial
    /// adapter take. `resting_ns`, if that is less, is for servos that have been silent for so long that they rest, until
    /// one answers, late or not: they cost the others little.
    pub fn set_margins_ns(&mut self, margin_ns: u64, resting_ns: u64) {
        self.margin_ns = margin_ns;
        self.resting_margin_ns = resting_ns.min(margin_ns);
    }

    /// One result per servo, in the order of the configuration: those of the newest cycle.
    pub fn results(&self) -> &[Result<JointReading, NoReading>] {
        &self.results
    }

    /// What is known of a servo, by its index in the configuration.
    pub fn servo(&self, index: usize) -> Option<&ServoState> {
        self.servos.get(index).map(|s| &s.state)
    }

    /// What happened on the bus.
    pub fn counters(&self) -> BusCounters {
        let noise_bytes = self.parser.counters().skipped_bytes;
        BusCounters {
            noise_bytes,
            ..self.counters
        }
    }

    /// Whether all servos answer in one packet.
    pub fn fast_state(&self) -> FastState {
        self.fast
    }

    /// No write is sent any more. A motor that was to be switched off is told so when the port is back, and so is one that may
    /// run though its start has failed.
    fn forget_writes(&mut self) {
        self.offs_untold = false;
        while let Some(write) = self.writes.pop_front() {
            let servo = &mut self.servos[write.servo];
            if write.switches_off() || write.is_motor_on() && servo.state.may_run {
                servo.owe_off();
            }
            if !write.only_disarms() {
                self.note(write.servo, write.number, Err(WriteError::PortLost));
            }
        }
        self.forget_repeats();
        self.servos.iter_mut().for_each(|servo| servo.disarm_asks = 0);
    }

    /// Whether writes wait to be sent, or have to be sent again, or may follow from what servos say.
    pub fn has_writes(&self) -> bool {
        let is_owed = |servo: &Servo| servo.is_owed_off() || servo.disarm_asks > 0;
        !self.writes.is_empty() || self.servos.iter().any(is_owed)
    }

    /// Forgets what the port held, and what was to be written: the port has been opened anew.
    pub fn port_opened(&mut self) {
        self.parser.clear();
        self.pass_active = false;
        self.forget_writes();
        self.suspicious_ns = None;
        for servo in &mut self.servos {
            servo.port_opened(self.allow_writes);
        }
        self.results.fill(Err(NoReading::NotAsked));
        if self.fast == FastState::NotSupported {
            self.fast = FastState::Probing;
        }
        self.fast_failures = 0;
        self.fast_worked = false;
    }

    /// No servo can be heard: the port is away.
    pub fn port_lost(&mut self) {
        self.pass_active = false;
        self.forget_writes();
        self.results.fill(Err(NoReading::NotAsked));
        for servo in &mut self.servos {
            servo.state.alive = false;
        }
    }

    /// Begins a cycle.
    pub fn begin(&mut self, now_ns: u64) {
        self.begun_ns = now_ns;
        self.counters.cycles += 1;
        self.passes = 0;
        (self.left_on_done, self.slow_done) = (self.ends, self.ends);
        (self.writes_done, self.offs_done) = (false, false);
        self.begin_checks();
        self.pass_active = false;
        // A cycle that the port did not see to its end leaves those that were to be asked in it.
        self.again.clear();
        self.behind.clear();
        let due = (0..self.servos.len())
            .filter(|i| self.servos[*i].rest.until_ns.is_some_and(|t| t <= now_ns))
            .min_by_key(|i| self.servos[*i].rest.until_ns);
        self.pass.order.clear();
        for (i, servo) in self.servos.iter_mut().enumerate() {
            if servo.rest.until_ns.is_none() {
                self.pass.order.push(i);
                self.results[i] = Err(NoReading::Silent);
            } else if due != Some(i) {
                servo.state.counters.rested += 1;
                self.results[i] = Err(NoReading::Resting);
            }
        }
        let all_answered = self.pass.order.iter().all(|i| self.servos[*i].state.alive);
        // One that was silent comes last, where nobody waits for it.
        if let Some(i) = due {
            self.pass.order.push(i);
            self.results[i] = Err(NoReading::Silent);
        }
        if self.pass.order.is_empty() || self.ends {
            return;
        }
        self.let_left_on_pass();
        let is_off_due =
            self.servos.iter().any(|servo| servo.is_off_due(now_ns)) || self.is_repeat_due(now_ns);
        if is_off_due || self.writes.front().is_some_and(|write| write.urgent) {
            self.again.append(&mut self.pass.order);
            return;
        }
        if self.fast == FastState::NotSupported && self.fast_again_ns.take_if(|t| *t <= now_ns).is_some() {
            self.fast = FastState::Probing;
            self.fast_failures = 0;
        }
        let fast = match self.fast {
            FastState::On => true,
            FastState::Probing => all_answered && due.is_none() && self.pass.order.len() > 1,
            FastState::Off | FastState::NotSupported => false,
        };
        self.ask_positions(if fast { Kind::Fast } else { Kind::Plain }, now_ns);
    }

    /// What to do next. Call it with the newest time after sending, after receiving and at the deadline.
    pub fn step(&mut self, now_ns: u64) -> Step {
        loop {
            if !self.pass_active {
                if !self.next_request(now_ns) {
                    self.counters.cycle_ns = now_ns.saturating_sub(self.begun_ns);
                    self.count_readings();
                    return Step::Done;
                }
                continue;
            }
            if self.pass.sent_ns.is_none() {
                return Step::Send;
            }
            if !self.is_complete() {
                let until_ns = self.deadline_ns();
                if now_ns < until_ns {
                    return Step::Wait { until_ns };
                }
                self.pass.left = self.offs_untold && now_ns < self.whole_deadline_ns();
                if self.offs_untold || self.pass.kind == Kind::ReadBack {
                    self.leave_request();
                }
                self.drop_half_packets(now_ns);
            }
            self.end_pass(now_ns);
        }
    }

    /// Whether nothing more is expected. Where two servos are known to have one id, both are to say what they hold.
    fn is_complete(&self) -> bool {
        let is_shared = |servo: &usize| self.servos[*servo].is_shared(self.begun_ns);
        let may_say_more = self.pass.kind == Kind::ReadBack && self.pass.order.iter().any(is_shared);
        self.pass.is_complete() && !may_say_more
    }

    /// Only now, since a second answer may have shown that the first was none.
    fn count_readings(&mut self) {
        for (servo, result) in self.servos.iter_mut().zip(&self.results) {
            servo.state.counters.ok += u64::from(result.is_ok());
        }
    }

    /// The packet to be sent when [`Bus::step`] says so.
    pub fn request(&self) -> &[u8] {
        &self.request
    }

    /// The request has been handed to the port at `now_ns`. What came before it answers an earlier one.
    pub fn sent(&mut self, now_ns: u64) {
        if !self.pass_active || self.pass.sent_ns.is_some() {
            return;
        }
        self.parser.clear();
        self.counters.requests += 1;
        self.pass.sent_ns = Some(now_ns);
        if self.ends {
            self.release_until_ns.get_or_insert(now_ns + self.release_ns);
        }
        self.pass.heard_ns = None;
        self.pass.wire_ns = self.answers_ns(self.pass.order.len());
    }

    /// How long the request and so many answers to it take on the wire.
    fn answers_ns(&self, answers: usize) -> u64 {
        let asked = self.pass.order[..answers].iter();
        let delays: u64 = asked.map(|i| self.servos[*i].return_delay_ns()).sum();
        wire_ns(self.pass.bytes_before(answers), self.baud) + delays
    }

    /// Until when the answers to the request that is out are waited for: not for long where motors are to be off, since they may
    /// not come.
    fn deadline_ns(&self) -> u64 {
        let whole_ns = self.whole_deadline_ns();
        match self.offs_untold {
            true => whole_ns.min(self.deadline_with_ns(self.resting_margin_ns)),
            false => whole_ns,
        }
    }

    /// The same where no motor waits to be switched off. Once the others have answered, those that rest have no more time than
    /// usual.
    fn whole_deadline_ns(&self) -> u64 {
        let pass = &self.pass;
        let rests = |i: &usize| self.servos[*i].rests();
        let mut awaited = (pass.order.iter().zip(&pass.answers))
            .filter_map(|(i, answer)| (*answer == Answer::Awaited).then_some(i));
        let margin_ns = match pass.kind {
            // Its one packet has begun, and breaks off at the first that is silent.
            Kind::Fast if pass.heard_ns.is_some() && pass.order.iter().any(rests) => self.resting_margin_ns,
            _ if awaited.all(rests) => self.resting_margin_ns,
            Kind::ReadBack => self.read_back_margin_ns(),
            _ => self.margin_ns,
        };
        self.deadline_with_ns(margin_ns)
    }

    fn deadline_with_ns(&self, margin_ns: u64) -> u64 {
        let pass = &self.pass;
        let heard_ns = pass.heard_ns.or(pass.sent_ns).unwrap_or_default();
        self.latest_ns().min(heard_ns + pass.wire_ns + margin_ns)
    }

    /// Until when an answer to the request that is out is in time.
    fn latest_ns(&self) -> u64 {
        self.pass.sent_ns.unwrap_or_default() + self.pass.wire_ns + self.margin_ns
    }

    /// The request that is out is waited for no more, though answers may still be in time.
    fn leave_request(&mut self) {
        self.in_time_until_ns = self.in_time_until_ns.max(self.latest_ns());
    }

    /// Room for bytes that arrived; never empty.
    pub fn space(&mut self) -> &mut [u8] {
        self.parser.space()
    }

    /// Takes the first `bytes` of [`Bus::space`], which arrived at `now_ns`.
    pub fn take_bytes(&mut self, bytes: usize, now_ns: u64) {
        self.parser.take_bytes(bytes);
        self.pass.heard_ns = Some(now_ns);
        self.take_packets(now_ns);
    }
}
