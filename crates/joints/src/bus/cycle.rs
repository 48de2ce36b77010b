//! Cycle after cycle: which request comes next, and what becomes of the answers.

use super::pass::{Answer, Kind, Pass};
use super::reading::{JointReading, NoReading, PRESENT_BYTES};
use super::servo::{Servo, ServoState};
use super::slow::SlowLane;
use super::wire_ns;
use super::writes::{QUEUE, Write, WriteCommand, WriteRefused};
use crate::config::{FastSyncRead, JointsConfig, ServoConfig};
use crate::protocol2::{
    BROADCAST_ID, BadCrc, Encoder, FAST_BLOCK_OVERHEAD, FastBlock, FastBlocks, Instruction, Packet, Parser,
    STATUS_OVERHEAD, StatusByte,
};
use crate::registers::address;
use std::collections::VecDeque;

/// What [`Bus::step`] wants from its caller.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    /// Read what has arrived so far ([`Bus::space`], [`Bus::filled`]), send [`Bus::request`], then call [`Bus::sent`].
    Send,
    /// Read what arrives until this time, then call [`Bus::step`] again.
    Wait {
        /// Deadline, nanoseconds.
        until_ns: u64,
    },
    /// The cycle is over; [`Bus::results`] holds it.
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

/// Most requests for positions in one cycle: the first, and those for servos that only waited for a silent one.
const PASSES: u32 = 3;
/// After a request without answer, the requested length changes so that an answer that is still to come is
/// recognised by its own; so long after the last it is as it was.
const SUSPICION_NS: u64 = 200_000_000;
/// How many lengths there are: 12 bytes to 19, none of which is that of a question of the slow lane. An answer could
/// only be mistaken for another if it came later than eight deadlines.
const LEADS: u16 = 8;
/// Fast sync reads tried before it is given up, and those in a row that may fail later.
const FAST_TRIES: u32 = 3;
/// Between two questions of the slow lane lies at least so many times the time of a cycle.
const SLOW_SHARE: u64 = 4;
/// Time for the operating system and the adapter on top of the time on the wire, unless [`Bus::set_margin_ns`] says
/// otherwise.
const DEFAULT_MARGIN_NS: u64 = 4_000_000;

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
    encoder: Encoder,
    request: Vec<u8>,
    parser: Parser,
    pass: Pass,
    pass_active: bool,
    passes: u32,
    slow_done: bool,
    slow_ns: u64,
    again: Vec<usize>,
    /// 0 to 7: how many bytes before Present PWM are read as well.
    lead: u16,
    suspicious_ns: Option<u64>,
    fast: FastState,
    fast_failures: u32,
    lane: SlowLane,
    allow_writes: bool,
    watchdog_steps: u8,
    writes: VecDeque<Write>,
    motors_on: Vec<bool>,
    begun_ns: u64,
    counters: BusCounters,
}

impl Bus {
    /// A bus for the servos of a configuration that has been checked. Nothing is asked yet.
    pub fn new(config: &JointsConfig) -> Self {
        let n = config.servo.len();
        let mut by_id = [None; 256];
        for (i, servo) in config.servo.iter().enumerate() {
            by_id[usize::from(servo.id)] = u8::try_from(i).ok();
        }
        let longest_data = PRESENT_BYTES + usize::from(LEADS);
        let longest = (1 + n * (longest_data + FAST_BLOCK_OVERHEAD)).max(64);
        Self {
            config: config.servo.clone(),
            servos: config.servo.iter().map(|s| Servo::new(s.id)).collect(),
            by_id,
            results: vec![Err(NoReading::NotAsked); n],
            baud: config.baud,
            margin_ns: DEFAULT_MARGIN_NS,
            encoder: Encoder::with_capacity(64 + 2 * n),
            request: Vec::with_capacity(64 + 2 * n),
            parser: Parser::new(longest),
            pass: Pass::new(n),
            pass_active: false,
            passes: 0,
            slow_done: true,
            slow_ns: 0,
            again: Vec::with_capacity(n),
            lead: 0,
            suspicious_ns: None,
            fast: match config.fast_sync_read {
                FastSyncRead::Auto => FastState::Probing,
                FastSyncRead::On => FastState::On,
                FastSyncRead::Off => FastState::Off,
            },
            fast_failures: 0,
            lane: SlowLane::default(),
            allow_writes: config.allow_writes,
            watchdog_steps: u8::try_from(config.watchdog_ms / 20).unwrap_or(127).clamp(1, 127),
            writes: VecDeque::with_capacity(QUEUE),
            motors_on: vec![false; n],
            begun_ns: 0,
            counters: BusCounters::default(),
        }
    }

    /// How long beyond the time on the wire an answer is waited for: what the operating system and the serial adapter
    /// take.
    pub fn set_margin_ns(&mut self, margin_ns: u64) {
        self.margin_ns = margin_ns;
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

    /// Has a servo told something, after the next cycle's positions.
    pub fn command(&mut self, servo: usize, command: WriteCommand) -> Result<(), WriteRefused> {
        if !self.allow_writes {
            return Err(WriteRefused::ReadOnly);
        }
        command.check(servo, self.servos.len())?;
        let writes = Write::of(servo, command, self.watchdog_steps);
        if self.writes.len() + 3 > QUEUE {
            return Err(WriteRefused::QueueFull(self.writes.len()));
        }
        self.writes.extend(writes);
        if let WriteCommand::Torque(on) = command {
            self.motors_on[servo] = on;
        }
        Ok(())
    }

    /// Has every motor that was switched on with [`Bus::command`] switched off.
    pub fn release_motors(&mut self) {
        for servo in 0..self.servos.len() {
            if self.motors_on[servo] {
                self.motors_on[servo] = false;
                let off = Write::of(servo, WriteCommand::Torque(false), self.watchdog_steps);
                self.writes.extend(off);
            }
        }
    }

    /// Whether writes wait to be sent.
    pub fn has_writes(&self) -> bool {
        !self.writes.is_empty()
    }

    /// Forgets what the port held, and what was to be written: the port has been opened anew.
    pub fn port_opened(&mut self) {
        self.parser.clear();
        self.pass_active = false;
        self.writes.clear();
        self.suspicious_ns = None;
        self.results.fill(Err(NoReading::NotAsked));
        if self.fast == FastState::NotSupported {
            self.fast = FastState::Probing;
        }
        self.fast_failures = 0;
    }

    /// No servo can be heard: the port is away.
    pub fn port_lost(&mut self) {
        self.pass_active = false;
        self.writes.clear();
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
        self.slow_done = false;
        self.pass_active = false;
        let due = (0..self.servos.len())
            .filter(|i| self.servos[*i].ask_again_ns.is_some_and(|t| t <= now_ns))
            .min_by_key(|i| self.servos[*i].ask_again_ns);
        self.pass.order.clear();
        for (i, servo) in self.servos.iter_mut().enumerate() {
            if servo.ask_again_ns.is_none() {
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
        if self.pass.order.is_empty() {
            return;
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
                    return Step::Done;
                }
                continue;
            }
            if self.pass.sent_ns.is_none() {
                return Step::Send;
            }
            if !self.pass.is_complete() {
                if now_ns < self.pass.deadline_ns {
                    return Step::Wait {
                        until_ns: self.pass.deadline_ns,
                    };
                }
                self.drop_half_packets(now_ns);
            }
            self.end_pass(now_ns);
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
        let answers = self.pass.order.len();
        let delays: u64 = self
            .pass
            .order
            .iter()
            .map(|i| self.servos[*i].return_delay_ns())
            .sum();
        self.pass.deadline_ns =
            now_ns + wire_ns(self.pass.bytes_before(answers), self.baud) + delays + self.margin_ns;
    }

    /// Room for bytes that arrived; never empty.
    pub fn space(&mut self) -> &mut [u8] {
        self.parser.space()
    }

    /// So many bytes arrived at `now_ns` and are in [`Bus::space`].
    pub fn filled(&mut self, bytes: usize, now_ns: u64) {
        self.parser.filled(bytes);
        self.take_packets(now_ns);
    }

    // ------------------------------------------------------------------ requests

    /// Prepares a request for the positions of the servos in `pass.order`.
    fn ask_positions(&mut self, kind: Kind, now_ns: u64) {
        if self
            .suspicious_ns
            .is_some_and(|t| now_ns.saturating_sub(t) > SUSPICION_NS)
        {
            self.suspicious_ns = None;
            self.lead = 0;
        }
        let length = PRESENT_BYTES as u16 + self.lead;
        let at = address::PRESENT_PWM - self.lead;
        self.pass.begin(kind, at, length);
        self.passes += 1;
        let mut ids = [0_u8; 256];
        for (id, servo) in ids.iter_mut().zip(&self.pass.order) {
            *id = self.servos[*servo].id;
        }
        let ids = &ids[..self.pass.order.len()];
        let packet = if kind == Kind::Fast {
            self.encoder.fast_sync_read(at, length, ids)
        } else {
            self.encoder.sync_read(at, length, ids)
        };
        load(&mut self.request, packet);
        self.activate();
    }

    /// Decides what comes after the pass that ended; `false` if the cycle is over.
    fn next_request(&mut self, now_ns: u64) -> bool {
        if !self.again.is_empty() {
            self.pass.order.clear();
            self.pass.order.append(&mut self.again);
            self.ask_positions(Kind::Plain, now_ns);
            return true;
        }
        if let Some(write) = self.writes.front() {
            self.pass.order.clear();
            self.pass.order.push(write.servo);
            let packet = self.encoder.write(
                self.servos[write.servo].id,
                write.address,
                &write.data[..write.len],
            );
            load(&mut self.request, packet);
            self.pass.begin(Kind::Write, 0, 0);
            self.activate();
            return true;
        }
        if self.slow_done {
            return false;
        }
        self.slow_done = true;
        // On a slow bus the questions come less often, so that they take a small part of its time.
        let busy_ns = now_ns.saturating_sub(self.begun_ns);
        if now_ns.saturating_sub(self.slow_ns) < SLOW_SHARE * busy_ns {
            return false;
        }
        let Some((servo, task)) = self.lane.next(&self.servos, now_ns) else {
            return false;
        };
        let (at, length) = task.span();
        self.pass.order.clear();
        self.pass.order.push(servo);
        let packet = self.encoder.read(self.servos[servo].id, at, length);
        load(&mut self.request, Some(packet));
        self.pass.begin(Kind::Slow(task), at, length);
        self.slow_ns = now_ns;
        self.activate();
        true
    }

    fn activate(&mut self) {
        self.pass.request_bytes = self.request.len();
        self.pass_active = true;
    }

    /// Draws the conclusions of a pass that is complete or past its deadline.
    fn end_pass(&mut self, now_ns: u64) {
        self.pass_active = false;
        let unanswered = self.pass.answers.contains(&Answer::Awaited);
        if unanswered {
            // An answer may still come: the next requests ask for another length.
            self.suspicious_ns = Some(now_ns);
            self.lead = (self.lead + 1) % LEADS;
        }
        match self.pass.kind {
            Kind::Write => {
                let write = self.writes.pop_front();
                if unanswered {
                    self.counters.writes_failed += 1;
                    self.call_off_torque(write);
                }
            }
            Kind::Slow(_) => self.counters.slow_unanswered += u64::from(unanswered),
            Kind::Plain => self.end_plain(now_ns),
            Kind::Fast => self.end_fast(unanswered, now_ns),
        }
    }

    fn end_plain(&mut self, now_ns: u64) {
        self.again.clear();
        for (position, i) in self.pass.order.iter().copied().enumerate() {
            match self.pass.answers[position] {
                Answer::Got => {}
                Answer::Damaged => self.servos[i].answered(),
                Answer::Awaited if self.pass.is_silent(position) => self.servos[i].was_silent(now_ns),
                Answer::Awaited => self.again.push(i),
            }
        }
        if self.passes >= PASSES {
            self.again.clear();
        }
    }

    fn end_fast(&mut self, unanswered: bool, now_ns: u64) {
        let whole = self.pass.answers.iter().all(|a| *a == Answer::Got);
        if whole {
            self.fast_failures = 0;
            self.fast = FastState::On;
        } else if unanswered {
            self.fast_failures += 1;
            if self.pass.fast_refused || self.fast_failures >= FAST_TRIES {
                self.fast = FastState::NotSupported;
            }
        }
        // The first one missing comes last, where it holds up nobody.
        self.again.clear();
        let mut first = None;
        for (position, i) in self.pass.order.iter().copied().enumerate() {
            if self.pass.answers[position] != Answer::Awaited {
                continue;
            }
            if self.servos[i].ask_again_ns.is_some() {
                // It had been silent and was asked last: it still is.
                self.servos[i].was_silent(now_ns);
            } else if first.is_none() {
                first = Some(i);
            } else {
                self.again.push(i);
            }
        }
        self.again.extend(first);
    }

    /// A motor whose watchdog could not be armed is not switched on.
    fn call_off_torque(&mut self, failed: Option<Write>) {
        let Some(failed) = failed.filter(|w| w.address == address::BUS_WATCHDOG) else {
            return;
        };
        while let Some(next) = self.writes.front() {
            let same_command = next.servo == failed.servo
                && (next.address == address::BUS_WATCHDOG
                    || (next.address == address::TORQUE_ENABLE && next.data[0] == 1));
            if !same_command {
                break;
            }
            self.writes.pop_front();
            self.counters.writes_failed += 1;
        }
    }

    // ------------------------------------------------------------------- answers

    fn take_packets(&mut self, now_ns: u64) {
        // The parser is lent out while its packets are looked at.
        let mut parser = std::mem::replace(&mut self.parser, Parser::placeholder());
        while let Some(packet) = parser.next_packet() {
            match packet {
                Ok(packet) => self.take_packet(&packet, now_ns),
                Err(bad) => self.take_damaged(&bad, now_ns),
            }
        }
        self.parser = parser;
    }

    /// At a deadline: what is behind a packet that never ended, and the beginning of a fast reply that broke off.
    fn drop_half_packets(&mut self, now_ns: u64) {
        let mut parser = std::mem::replace(&mut self.parser, Parser::placeholder());
        loop {
            if self.pass.kind == Kind::Fast && !self.pass.fast_done {
                self.take_fast(parser.incomplete(), now_ns);
            }
            if !parser.give_up() {
                break;
            }
            while let Some(packet) = parser.next_packet() {
                match packet {
                    Ok(packet) => self.take_packet(&packet, now_ns),
                    Err(bad) => self.take_damaged(&bad, now_ns),
                }
            }
        }
        self.parser = parser;
    }

    fn is_awaiting(&self) -> bool {
        self.pass_active && self.pass.sent_ns.is_some()
    }

    fn take_packet(&mut self, packet: &Packet<'_>, now_ns: u64) {
        if packet.instruction != Instruction::Status as u8 {
            // Our own request, from an adapter that echoes.
            return;
        }
        if packet.id == BROADCAST_ID {
            if !self.take_fast(packet.raw, now_ns) {
                self.counters.late_fast += 1;
            }
            return;
        }
        let Some(servo) = self.by_id[usize::from(packet.id)].map(usize::from) else {
            self.counters.foreign += 1;
            return;
        };
        let Some((error, data)) = packet.parameters.split_first() else {
            self.servos[servo].state.counters.late += 1;
            return;
        };
        let status = StatusByte(*error);
        let position = self.is_awaiting().then(|| self.pass.position_of(servo)).flatten();
        let fits = status.error().is_some() || data.len() == usize::from(self.pass.data_bytes);
        let Some(position) = position.filter(|_| fits && self.pass.kind != Kind::Fast) else {
            if self.is_awaiting() && self.pass.kind == Kind::Fast && status.error().is_some() {
                // Firmware that does not know the instruction says so by itself.
                self.pass.fast_refused = true;
            } else {
                self.servos[servo].state.counters.late += 1;
            }
            return;
        };
        self.revoke_before(position);
        if self.pass.answers[position] == Answer::Got {
            // The first was late, or this one is double; the newer one is taken.
            self.servos[servo].state.counters.late += 1;
        }
        self.pass.answers[position] = Answer::Got;
        match self.pass.kind {
            Kind::Plain | Kind::Fast => self.take_present(position, status, data, packet.raw.len(), now_ns),
            Kind::Slow(task) => {
                if status.error().is_none() {
                    task.take(&mut self.servos[servo], data);
                }
            }
            Kind::Write => {
                if status.error().is_some() {
                    self.counters.writes_failed += 1;
                    self.call_off_torque_of_current();
                } else {
                    self.counters.writes_ok += 1;
                }
            }
        }
    }

    /// The write that has just been refused stands at the front; those that build on it follow.
    fn call_off_torque_of_current(&mut self) {
        if let Some(refused) = self.writes.pop_front() {
            self.call_off_torque(Some(refused));
            // Ended by `end_pass`, which takes the front away.
            self.writes.push_front(refused);
        }
    }

    /// Servos answer in the order of the request, so what came of those behind `position` was late.
    fn revoke_before(&mut self, position: usize) {
        if self.pass.kind != Kind::Plain {
            return;
        }
        for behind in position + 1..self.pass.order.len() {
            if self.pass.answers[behind] == Answer::Got {
                let i = self.pass.order[behind];
                self.pass.answers[behind] = Answer::Awaited;
                self.results[i] = Err(NoReading::Silent);
                self.servos[i].state.counters.late += 1;
                self.servos[i].state.counters.ok = self.servos[i].state.counters.ok.saturating_sub(1);
            }
        }
    }

    fn take_damaged(&mut self, bad: &BadCrc<'_>, now_ns: u64) {
        if !self.is_awaiting() {
            return;
        }
        if self.pass.kind == Kind::Fast {
            self.take_fast(bad.raw, now_ns);
            return;
        }
        let Some(servo) = self.by_id[usize::from(bad.id)].map(usize::from) else {
            return;
        };
        let Some(position) = self.pass.position_of(servo) else {
            return;
        };
        if self.pass.answers[position] == Answer::Awaited && bad.raw.len() == self.pass.answer_bytes() {
            self.damaged(position);
        }
    }

    fn damaged(&mut self, position: usize) {
        let i = self.pass.order[position];
        self.pass.answers[position] = Answer::Damaged;
        self.servos[i].state.counters.bad_crc += 1;
        if matches!(self.pass.kind, Kind::Plain | Kind::Fast) {
            self.results[i] = Err(NoReading::BadCrc);
        }
    }

    /// Takes the reply to the fast sync read that is out, whole or broken off; `false` if it answers another one.
    fn take_fast(&mut self, raw: &[u8], now_ns: u64) -> bool {
        let asked = self.pass.order.len();
        let length = 1 + asked * (usize::from(self.pass.data_bytes) + FAST_BLOCK_OVERHEAD);
        let awaited = self.is_awaiting() && self.pass.kind == Kind::Fast && !self.pass.fast_done;
        let says = raw
            .get(5..7)
            .map(|l| usize::from(u16::from_le_bytes([l[0], l[1]])));
        if !awaited || says != Some(length) {
            return false;
        }
        let Some(blocks) = FastBlocks::new(raw, self.pass.data_bytes) else {
            return false;
        };
        self.pass.fast_done = true;
        for (position, block) in blocks.enumerate().take(asked) {
            self.take_block(position, &block, now_ns);
        }
        true
    }

    fn take_block(&mut self, position: usize, block: &FastBlock<'_>, now_ns: u64) {
        let servo = self.pass.order[position];
        if !block.crc_ok || self.servos[servo].id != block.id {
            self.damaged(position);
            self.servos[servo].answered();
            return;
        }
        self.pass.answers[position] = Answer::Got;
        self.take_present(position, block.status, block.data, 0, now_ns);
    }

    /// Takes the answer of the servo at this position of the request, which ended its packet of `bytes` at `now_ns`.
    fn take_present(&mut self, position: usize, status: StatusByte, data: &[u8], bytes: usize, now_ns: u64) {
        let i = self.pass.order[position];
        let t_ns = self.answer_begun_ns(position, bytes, now_ns);
        let lead = usize::from(self.pass.data_bytes) - PRESENT_BYTES;
        let servo = &mut self.servos[i];
        servo.answered();
        self.results[i] = if let Some(error) = status.error() {
            servo.state.counters.refused += 1;
            Err(NoReading::Refused(error))
        } else if let Some(present) = data.get(lead..).and_then(|d| d.first_chunk()) {
            servo.state.counters.ok += 1;
            servo.state.counters.alerts += u64::from(status.alert());
            servo.alert = status.alert();
            if !status.alert() {
                servo.state.hardware_error = servo.state.hardware_error.map(|_| Default::default());
            }
            let unit = servo.current_unit_a();
            Ok(JointReading::decode(
                present,
                &self.config[i],
                unit,
                status.alert(),
                t_ns,
            ))
        } else {
            Err(NoReading::BadCrc)
        };
    }

    /// When the answer at a position began on the wire: after the request and the answers before it, and no later than
    /// its last byte came less its own time on the wire.
    fn answer_begun_ns(&self, position: usize, bytes: usize, now_ns: u64) -> u64 {
        let sent_ns = self.pass.sent_ns.unwrap_or(now_ns);
        let delays: u64 = self.pass.order[..=position]
            .iter()
            .map(|i| self.servos[*i].return_delay_ns())
            .sum();
        let begun = sent_ns + wire_ns(self.pass.bytes_before(position), self.baud) + delays;
        begun
            .min(now_ns.saturating_sub(wire_ns(bytes, self.baud)))
            .max(sent_ns)
    }
}

fn load(request: &mut Vec<u8>, packet: Option<&[u8]>) {
    request.clear();
    // At most 64 servos are asked, so every request fits in a packet.
    request.extend_from_slice(packet.unwrap_or_default());
}

const _: () = assert!(
    STATUS_OVERHEAD + PRESENT_BYTES == 23,
    "the reply of protocols.md 4.2"
);
