//! What becomes of the answers.

use super::{Bus, LEFT_ON_BYTES};
use crate::dynamixel::bus::pass::{Answer, Kind};
use crate::dynamixel::bus::reading::{JointReading, NoReading, PRESENT_BYTES};
use crate::dynamixel::bus::slow::Task;
use crate::dynamixel::bus::wire_ns;
use crate::dynamixel::protocol2::{
    BROADCAST_ID, BadCrc, FAST_BLOCK_OVERHEAD, FastBlock, FastBlocks, Instruction, Packet, Parser, StatusByte,
};

impl Bus {
    pub(super) fn take_packets(&mut self, now_ns: u64) {
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

    /// At a deadline: what is behind a packet that never ended, and the beginning of a fast reply
    /// that broke off.
    pub(super) fn drop_half_packets(&mut self, now_ns: u64) {
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
                self.counters.late_fast += u64::from(now_ns > self.in_time_until_ns);
            }
            return;
        }
        let Some(servo) = self.by_id[usize::from(packet.id)].map(usize::from) else {
            self.counters.foreign += 1;
            return;
        };
        let Some((error, data)) = packet.parameters.split_first() else {
            self.take_late(servo, now_ns);
            return;
        };
        let status = StatusByte(*error);
        let position = self.is_awaiting().then(|| self.pass.position_of(servo)).flatten();
        let fits = status.error().is_some() || data.len() == usize::from(self.pass.data_bytes);
        let Some(position) = position.filter(|_| fits && self.pass.kind != Kind::Fast) else {
            if self.is_awaiting() && self.pass.kind == Kind::Fast && status.error().is_some() {
                // Firmware that does not know the instruction says so by itself.
                self.pass.fast_refused = true;
            } else if self.servos[servo].told_bytes() == Some(data.len()) {
                self.take_double(servo);
            } else {
                self.take_late(servo, now_ns);
            }
            return;
        };
        if self.pass.answers[position] == Answer::Got {
            if self.servos[servo].told_bytes().is_some() {
                self.take_double(servo);
                if self.pass.kind == Kind::Plain {
                    return;
                }
            } else {
                // The first was late: the newer one is taken. Or it is of another servo with this id.
                self.take_late(servo, now_ns);
                self.servos[servo].left_armed_cycle = None;
            }
        }
        self.revoke_before(position, now_ns);
        self.pass.answers[position] = Answer::Got;
        let took_ns = self.beyond_wire_ns(position + 1, now_ns);
        self.servos[servo].took(took_ns);
        self.servos[servo].take_status(status);
        if !matches!(self.pass.kind, Kind::Plain | Kind::Fast) {
            self.servos[servo].lives(now_ns);
        }
        match self.pass.kind {
            Kind::Plain | Kind::Fast => {
                self.take_present(position, status, data, packet.raw.len(), now_ns);
                // What stands before Torque Enable only gives the answer a length of its own.
                if let Some(data) = data.last_chunk::<LEFT_ON_BYTES>() {
                    self.take_left_on(servo, data);
                }
            }
            Kind::Slow(Task::LeftOn) if status.error().is_none() => match self.ends {
                true => self.take_armed(servo, data),
                false => self.take_left_on(servo, data),
            },
            Kind::Slow(task) => {
                if status.error().is_none() {
                    self.take_told(servo, task, data);
                }
            }
            Kind::Watchdog => match status.error() {
                None => self.take_told(servo, Task::Watchdog, data),
                refused => self.pass.refused = refused,
            },
            Kind::ReadBack => self.take_held(position, status.error(), data),
            Kind::Told => {}
        }
    }

    /// An answer to an earlier request: late, unless that was left before its time for motors that are to be off.
    fn take_late(&mut self, servo: usize, now_ns: u64) {
        let servo = &mut self.servos[servo];
        servo.state.counters.late += u64::from(now_ns > self.in_time_until_ns);
        servo.was_late(now_ns);
    }

    /// Two servos have this id: one request has had two answers, of which this is the second. Nobody knows whose the first
    /// was, so the angle of neither is taken; nor is the next, whose second answer may come when the cycle is over.
    fn take_double(&mut self, servo: usize) {
        self.servos[servo].was_double(self.begun_ns);
        if self.results[servo].is_ok() {
            self.results[servo] = Err(NoReading::Double);
        }
    }

    /// Servos answer in the order of the request, so what came of those behind `position` was late, or the second answer to
    /// the request before.
    fn revoke_before(&mut self, position: usize, now_ns: u64) {
        if self.pass.kind != Kind::Plain {
            return;
        }
        for behind in position + 1..self.pass.order.len() {
            if self.pass.answers[behind] == Answer::Got {
                let i = self.pass.order[behind];
                self.pass.answers[behind] = Answer::Awaited;
                if self.servos[i].told_bytes().is_some() {
                    self.take_double(i);
                    continue;
                }
                self.results[i] = Err(NoReading::Silent);
                self.take_late(i, now_ns);
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

    /// Takes the reply to the fast sync read that is out, whole or broken off; `false` if it
    /// answers another one.
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
            self.servos[servo].answered(now_ns);
            return;
        }
        self.pass.answers[position] = Answer::Got;
        let took_ns = self.beyond_wire_ns(self.pass.order.len(), now_ns);
        self.servos[servo].took(took_ns);
        self.servos[servo].take_status(block.status);
        self.take_present(position, block.status, block.data, 0, now_ns);
    }

    /// Takes the answer of the servo at this position of the request, which ended its packet of
    /// `bytes` at `now_ns`.
    fn take_present(&mut self, position: usize, status: StatusByte, data: &[u8], bytes: usize, now_ns: u64) {
        let i = self.pass.order[position];
        let t_ns = self.answer_begun_ns(position, bytes, now_ns);
        let lead = usize::from(self.pass.data_bytes) - PRESENT_BYTES;
        let is_fast = self.pass.kind == Kind::Fast;
        let servo = &mut self.servos[i];
        servo.answered(now_ns);
        servo.state.counters.alerts += u64::from(status.alert());
        servo.state.refusal = status.error();
        self.results[i] = if let Some(error) = status.error() {
            servo.state.counters.refused += 1;
            Err(NoReading::Refused(error))
        } else if std::mem::take(&mut servo.withhold) || is_fast && servo.is_shared(now_ns) {
            // In one packet only one of two has its place, or only one knows the instruction.
            Err(NoReading::Double)
        } else if let Some(present) = data.get(lead..).and_then(|d| d.first_chunk()) {
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

    /// How long after so many answers should have been over on the wire it is now.
    fn beyond_wire_ns(&self, answers: usize, now_ns: u64) -> u64 {
        let sent_ns = self.pass.sent_ns.unwrap_or(now_ns);
        now_ns.saturating_sub(sent_ns + self.answers_ns(answers))
    }

    /// When the answer at a position began on the wire: after the request and the answers before
    /// it, and no later than its last byte came less its own time on the wire.
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
