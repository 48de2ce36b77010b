//! The servos on one wire: requests go in, answers come out with the times at which they are on the wire.

use super::device::{Reply, ServoBuild, SimServo};
use super::fault::ServoFault;
use crate::random::bits;
use std::collections::BTreeMap;
use taxel_joints::bus::wire_ns;
use taxel_joints::protocol2::{BROADCAST_ID, Encoder, Instruction, Parser, encode_fast_reply};

/// What the servos behind a silent one do in a sync or bulk read; ROBOTIS does not say.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub enum AfterSilence {
    /// They wait as long as its answer would have taken, and answer.
    #[default]
    Answer,
    /// They wait for it for ever.
    Stop,
}

/// What has gone over a wire since the bus was made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ServoTraffic {
    /// Bytes that came from the host.
    pub heard_bytes: u64,
    /// Bytes that were given to the host.
    pub said_bytes: u64,
    /// Bytes of answers that wait for their time.
    pub due_bytes: u64,
    /// Whether the last host has hung up and none has said anything since.
    pub hung_up: bool,
}

/// Longest request that is taken, and most bytes of answers that wait for their time.
const LONGEST: usize = 4096;

/// Simulated servos on one wire, with time as an argument.
///
/// ```
/// use taxel_sim::servo::{ServoBuild, ServoBus};
///
/// let mut bus = ServoBus::new([ServoBuild::new(1)], 1_000_000);
/// let ping = [0xFF, 0xFF, 0xFD, 0x00, 0x01, 0x03, 0x00, 0x01, 0x19, 0x4E];
/// bus.receive(&ping, 0);
/// let mut answer = Vec::new();
/// // Ten bytes there and fourteen back, ten microseconds each.
/// assert_eq!(bus.next_due_ns(), Some(240_000));
/// bus.take_due(240_000, &mut answer);
/// assert_eq!(answer[..8], [0xFF, 0xFF, 0xFD, 0x00, 0x01, 0x07, 0x00, 0x55]);
/// let traffic = bus.traffic();
/// assert_eq!((traffic.heard_bytes, traffic.said_bytes, traffic.due_bytes), (10, 14, 0));
/// ```
#[derive(Debug)]
pub struct ServoBus {
    servos: Vec<SimServo>,
    baud: u32,
    after_silence: AfterSilence,
    parser: Parser,
    encoder: Encoder,
    /// Answers by the time at which their last byte is on the wire.
    due: BTreeMap<(u64, u64), Vec<u8>>,
    due_bytes: usize,
    heard_bytes: u64,
    said_bytes: u64,
    hung_up: bool,
    number: u64,
    /// When the last byte of the requests so far has come.
    heard_ns: u64,
    seed: u64,
}

/// A request, copied out of the parser.
struct Request {
    id: u8,
    instruction: u8,
    parameters: Vec<u8>,
}

impl ServoBus {
    /// Servos on a wire of so many bits per second, which their Baud Rate registers say too where
    /// there is a value for it.
    pub fn new(servos: impl IntoIterator<Item = ServoBuild>, baud: u32) -> Self {
        Self {
            servos: servos
                .into_iter()
                .map(|build| SimServo::new(build, baud))
                .collect(),
            baud: baud.max(1),
            after_silence: AfterSilence::default(),
            parser: Parser::new(LONGEST),
            encoder: Encoder::default(),
            due: BTreeMap::new(),
            due_bytes: 0,
            heard_bytes: 0,
            said_bytes: 0,
            hung_up: true,
            number: 0,
            heard_ns: 0,
            seed: 1,
        }
    }

    /// What the servos behind a silent one do.
    pub fn set_after_silence(&mut self, after: AfterSilence) {
        self.after_silence = after;
    }

    /// A servo, by its id.
    pub fn servo(&self, id: u8) -> Option<&SimServo> {
        self.servos.iter().find(|s| s.id() == id)
    }

    /// A servo, by its id.
    pub fn servo_mut(&mut self, id: u8) -> Option<&mut SimServo> {
        self.servos.iter_mut().find(|s| s.id() == id)
    }

    /// Has a servo do something wrong at every `every`-th of its answers (1: always); `None` mends
    /// it. Says whether there is such a servo.
    pub fn set_fault(&mut self, id: u8, fault: Option<ServoFault>, every: u32) -> bool {
        let Some(servo) = self.servo_mut(id) else {
            return false;
        };
        servo.fault = fault.map(|f| (f, every.max(1)));
        servo.answers = 0;
        true
    }

    /// From now on no time passes for any bus watchdog, whoever is silent: none acts since this machine is held up.
    pub fn hold_watchdogs(&mut self) {
        self.servos.iter_mut().for_each(SimServo::hold_watchdog);
    }

    /// Time passes again for them, from `now_ns`: silence counts from there.
    pub fn run_watchdogs(&mut self, now_ns: u64) {
        self.servos
            .iter_mut()
            .for_each(|servo| servo.run_watchdog(now_ns));
    }

    /// Takes bytes that the host sent, which came from the host at `t_ns`.
    pub fn receive(&mut self, bytes: &[u8], t_ns: u64) {
        self.heard_bytes += bytes.len() as u64;
        self.hung_up = false;
        let mut rest = bytes;
        while !rest.is_empty() {
            let taken = self.parser.push(rest);
            rest = &rest[taken..];
            self.heard_ns = self.heard_ns.max(t_ns) + wire_ns(taken, self.baud);
            loop {
                let request = match self.parser.next_packet() {
                    None => break,
                    Some(Ok(p)) => Ok(Request {
                        id: p.id,
                        instruction: p.instruction,
                        parameters: p.parameters.to_vec(),
                    }),
                    Some(Err(bad)) => Err(bad.id),
                };
                match request {
                    Ok(request) => self.carry_out(&request),
                    Err(id) => self.complain(id),
                }
            }
            if taken == 0 {
                // Cannot be: the parser always has room for its longest packet.
                self.parser.clear();
            }
        }
    }

    /// When the next answer has come in whole.
    pub fn next_due_ns(&self) -> Option<u64> {
        self.due.keys().next().map(|(t, _)| *t)
    }

    /// Time has come to `now_ns`: servos whose bus watchdog is over stop, whether somebody speaks or not.
    pub fn handle_time(&mut self, now_ns: u64) {
        for servo in &mut self.servos {
            servo.handle_time(now_ns);
        }
    }

    /// Appends what has come in by `now_ns` to `out`.
    pub fn take_due(&mut self, now_ns: u64, out: &mut Vec<u8>) {
        while let Some(entry) = self.due.first_entry() {
            if entry.key().0 > now_ns {
                break;
            }
            let bytes = entry.remove();
            self.due_bytes -= bytes.len();
            self.said_bytes += bytes.len() as u64;
            out.extend_from_slice(&bytes);
        }
    }

    /// Forgets requests and answers that are under way: the host has hung up.
    pub fn hang_up(&mut self) {
        self.parser.clear();
        self.due.clear();
        self.due_bytes = 0;
        self.hung_up = true;
    }

    /// What has gone over the wire. The bus is silent when all that was sent to it is heard,
    /// nothing is due, and all that it said has been read.
    pub fn traffic(&self) -> ServoTraffic {
        ServoTraffic {
            heard_bytes: self.heard_bytes,
            said_bytes: self.said_bytes,
            due_bytes: self.due_bytes as u64,
            hung_up: self.hung_up,
        }
    }

    fn carry_out(&mut self, request: &Request) {
        let t_ns = self.heard_ns;
        for servo in &mut self.servos {
            servo.handle_traffic(t_ns);
        }
        let broadcast = request.id == BROADCAST_ID;
        match Instruction::from_byte(request.instruction) {
            // The answer of a servo to somebody else.
            Some(Instruction::Status) => {}
            Some(Instruction::SyncRead) => {
                let asked = same_span(&request.parameters);
                self.answer_in_order(&asked);
            }
            Some(Instruction::BulkRead) => self.answer_in_order(&own_spans(&request.parameters)),
            Some(Instruction::FastSyncRead) => self.answer_in_one(&same_span(&request.parameters)),
            Some(Instruction::FastBulkRead) => self.answer_in_one(&own_spans(&request.parameters)),
            Some(Instruction::SyncWrite) => self.sync_write(&request.parameters),
            Some(Instruction::BulkWrite) => self.bulk_write(&request.parameters),
            Some(Instruction::Ping) if broadcast => {
                let mut ids: Vec<u8> = self.servos.iter().map(SimServo::id).collect();
                ids.sort_unstable();
                let mut line_ns = t_ns;
                for id in ids {
                    line_ns = self.handle_request(id, request, false, line_ns);
                }
            }
            _ if broadcast => {
                let ids: Vec<u8> = self.servos.iter().map(SimServo::id).collect();
                for id in ids {
                    self.handle_request(id, request, true, t_ns);
                }
            }
            _ => {
                self.handle_request(request.id, request, false, t_ns);
            }
        }
    }

    /// One servo answers on a wire that is free from `line_ns` on; gives when it is free again.
    fn handle_request(&mut self, id: u8, request: &Request, broadcast: bool, line_ns: u64) -> u64 {
        let Some(i) = self.servos.iter().position(|s| s.id() == id) else {
            return line_ns;
        };
        let servo = &mut self.servos[i];
        if !servo.is_up(line_ns) {
            return line_ns;
        }
        let begin_ns = line_ns + servo.return_delay_ns();
        match servo.handle_request(request.instruction, &request.parameters, broadcast, begin_ns) {
            Some(reply) => self.put_on_wire(i, id, &reply, begin_ns).unwrap_or(line_ns),
            None => line_ns,
        }
    }

    fn complain(&mut self, id: u8) {
        let line_ns = self.heard_ns;
        let Some(i) = self.servos.iter().position(|s| s.id() == id) else {
            return;
        };
        if self.servos[i].is_up(line_ns) {
            let reply = self.servos[i].complain_of_crc();
            let begin_ns = line_ns + self.servos[i].return_delay_ns();
            self.put_on_wire(i, id, &reply, begin_ns);
        }
    }

    /// Every servo asked answers with its own packet, one after the other.
    fn answer_in_order(&mut self, asked: &[(u8, u16, u16)]) {
        let mut line_ns = self.heard_ns;
        for (id, at, length) in asked.iter().copied() {
            let here = self.servos.iter().position(|s| s.id() == id);
            let begun = here.filter(|i| self.servos[*i].is_up(line_ns)).and_then(|i| {
                let begin_ns = line_ns + self.servos[i].return_delay_ns();
                let reply = self.servos[i].share(at, length, begin_ns)?;
                self.put_on_wire(i, id, &reply, begin_ns)
            });
            line_ns = match (begun, self.after_silence) {
                (Some(end_ns), _) => end_ns,
                (None, AfterSilence::Answer) => line_ns + wire_ns(11 + usize::from(length), self.baud),
                (None, AfterSilence::Stop) => return,
            };
        }
    }

    /// All servos asked answer in one packet, which ends where one is missing.
    fn answer_in_one(&mut self, asked: &[(u8, u16, u16)]) {
        let mut blocks: Vec<(u8, Reply)> = Vec::new();
        let mut ends = Vec::new();
        let mut bytes = 8;
        let mut line_ns = self.heard_ns;
        let mut damage = Vec::new();
        let mut cut = None;
        let mut garbage = 0;
        for (id, at, length) in asked.iter().copied() {
            let Some(servo) = self.servo_mut(id) else { break };
            if !servo.is_up(line_ns) || !servo.knows_fast() {
                break;
            }
            line_ns += servo.return_delay_ns();
            let Some(mut reply) = servo.share(at, length, line_ns).filter(|(_, d)| !d.is_empty()) else {
                break;
            };
            match servo.next_fault() {
                Some(ServoFault::Silent | ServoFault::Late { .. } | ServoFault::Noise { .. }) => break,
                Some(ServoFault::BadCrc | ServoFault::Twice) => damage.push(bytes + 2),
                // In one packet with others its data is there all the same.
                Some(ServoFault::Refuse { number }) => reply.0 = refused(reply.0, number),
                Some(ServoFault::Truncated { bytes: n }) => cut = Some(bytes + n),
                Some(ServoFault::Garbage { bytes: n }) if blocks.is_empty() => garbage = n,
                Some(ServoFault::Garbage { .. }) | None => {}
            }
            let from = if blocks.is_empty() { 0 } else { bytes };
            bytes += usize::from(length) + 4;
            line_ns += wire_ns(bytes - from, self.baud);
            ends.push((line_ns, bytes));
            blocks.push((id, reply));
            if cut.is_some() {
                break;
            }
        }
        if blocks.is_empty() {
            return;
        }
        let mut packet = Vec::with_capacity(bytes);
        let parts = blocks.iter().map(|(id, (error, data))| (*id, *error, &data[..]));
        let lengths: Vec<u16> = asked.iter().map(|(_, _, length)| *length).collect();
        encode_fast_reply(&mut packet, &lengths, parts);
        for at in damage {
            packet[at] ^= 0x04;
        }
        packet.truncate(cut.unwrap_or(packet.len()));
        let noise = self.noise(garbage);
        self.schedule(self.heard_ns, noise);
        let mut from = 0;
        for (end_ns, end) in ends {
            let end = end.min(packet.len());
            self.schedule(end_ns, packet[from..end].to_vec());
            from = end;
        }
    }

    fn sync_write(&mut self, parameters: &[u8]) {
        let t_ns = self.heard_ns;
        if parameters.len() < 4 {
            return;
        }
        let (at, length) = (word(parameters, 0), usize::from(word(parameters, 2)));
        for row in parameters[4..].chunks_exact(length + 1) {
            if let Some(servo) = self.servo_mut(row[0]).filter(|s| s.is_up(t_ns)) {
                // Nobody answers a sync write, so a refusal is not seen either.
                let _ = servo.write(at, &row[1..], t_ns);
            }
        }
    }

    fn bulk_write(&mut self, parameters: &[u8]) {
        let t_ns = self.heard_ns;
        let mut rest = parameters;
        while let [id, place @ ..] = rest
            && place.len() >= 4
            && let Some((data, after)) = place[4..].split_at_checked(usize::from(word(place, 2)))
        {
            if let Some(servo) = self.servo_mut(*id).filter(|s| s.is_up(t_ns)) {
                // As with a sync write.
                let _ = servo.write(word(place, 0), data, t_ns);
            }
            rest = after;
        }
    }

    /// Puts an answer on the wire, as its servo's fault has it; gives when the wire is free again,
    /// `None` if it stays silent.
    fn put_on_wire(&mut self, servo: usize, id: u8, (error, data): &Reply, mut begin_ns: u64) -> Option<u64> {
        let fault = self.servos[servo].next_fault();
        let mut bytes = match fault {
            Some(ServoFault::Refuse { number }) => self.encoder.status(id, refused(*error, number), &[]),
            _ => self.encoder.status(id, *error, data),
        }?
        .to_vec();
        let mut late_ns = 0;
        match fault {
            None | Some(ServoFault::Refuse { .. }) => {}
            Some(ServoFault::Silent) => return None,
            Some(ServoFault::BadCrc) => {
                if let Some(last) = bytes.last_mut() {
                    *last ^= 0x5A;
                }
            }
            Some(ServoFault::Truncated { bytes: n }) => bytes.truncate(n),
            Some(ServoFault::Twice) => {
                begin_ns += wire_ns(bytes.len(), self.baud);
                self.schedule(begin_ns, bytes.clone());
            }
            Some(ServoFault::Late { by_ns }) => late_ns = by_ns,
            Some(ServoFault::Garbage { bytes: n }) => {
                let mut noise = self.noise(n);
                noise.append(&mut bytes);
                bytes = noise;
            }
            Some(ServoFault::Noise { bytes: n }) => bytes = self.noise(n),
        }
        let end_ns = begin_ns + wire_ns(bytes.len(), self.baud);
        self.schedule(end_ns + late_ns, bytes);
        (late_ns == 0).then_some(end_ns)
    }

    fn schedule(&mut self, end_ns: u64, bytes: Vec<u8>) {
        if bytes.is_empty() || self.due_bytes + bytes.len() > 1 << 20 {
            return;
        }
        self.number += 1;
        self.due_bytes += bytes.len();
        self.due.insert((end_ns, self.number), bytes);
    }

    /// Random bytes, the same in every run.
    fn noise(&mut self, bytes: usize) -> Vec<u8> {
        self.seed += 1;
        (0..bytes as u64).map(|i| bits(self.seed, 77, i) as u8).collect()
    }
}

/// An answer's first byte with another error number and the alert that it had.
fn refused(error: u8, number: u8) -> u8 {
    error & 0x80 | number
}

fn word(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes([bytes[at], bytes[at + 1]])
}

/// Id, address and length of everybody who is asked for a span of their own.
fn own_spans(parameters: &[u8]) -> Vec<(u8, u16, u16)> {
    let each = parameters.chunks_exact(5);
    each.map(|p| (p[0], word(p, 1), word(p, 3))).collect()
}

/// Id, address and length of everybody who is asked for the same span.
fn same_span(parameters: &[u8]) -> Vec<(u8, u16, u16)> {
    if parameters.len() < 4 {
        return Vec::new();
    }
    let (at, length) = (word(parameters, 0), word(parameters, 2));
    parameters[4..].iter().map(|id| (*id, at, length)).collect()
}
