//! What every servo on a bus says of itself: pings and reads, nothing is written.

use super::serial_bus::usual_margin_ns;
use crate::dynamixel::bus::{ServoIdentity, wire_ns};
use crate::dynamixel::protocol2::{BROADCAST_ID, Encoder, Instruction, MAX_ID, Parser, StatusByte};
use crate::dynamixel::registers::{HardwareError, address, volts};
use crate::serial::{Port, PortError, PortLatency};
use std::path::Path;
use std::time::Duration;
use taxel_can::monotonic_ns;

/// How long each id may take to answer a broadcast ping, as in ROBOTIS's SDK.
const PER_ID_NS: u64 = 3_000_000;
const PING_ANSWER_BYTES: usize = 14;
/// How long one servo may take to answer beyond its time on the wire; an FTDI adapter's timer is 16 ms.
const MARGIN_NS: u64 = 40_000_000;
/// On a busy machine an answer may take so long: it is waited for where something says that it may still come.
const BUSY_NS: u64 = 500_000_000;
/// Bytes that a servo says to a ping.
const PING_BYTES: usize = 3;
/// How often a question is repeated.
const TRIES: usize = 3;
/// How often one is read again whose answers were all late: a busy machine makes some of them late.
const MORE_READS: usize = 3;

/// A servo that answered, and what it told.
#[derive(Debug, Clone, PartialEq)]
pub struct SurveyedServo {
    /// Its id.
    pub id: u8,
    /// Its Model Number, as its answer to a ping has it.
    pub model_number: u16,
    /// Its Firmware Version.
    pub firmware: u8,
    /// How many answers to one ping came with this id, damaged ones included; more than one is two
    /// servos with one id.
    pub answers: u32,
    /// Model, firmware, baud rate, return delay time and drive mode; `None` where the servo did not
    /// answer a read.
    pub identity: Option<ServoIdentity>,
    /// Whether its motor is on.
    pub torque_enabled: Option<bool>,
    /// What it answers to: 0 pings, 1 pings and reads, 2 everything.
    pub status_return_level: Option<u8>,
    /// Its Hardware Error Status.
    pub hardware_error: Option<HardwareError>,
    /// Its supply, volts.
    pub voltage_v: Option<f64>,
    /// Its temperature, degrees Celsius.
    pub temperature_c: Option<u8>,
    /// How long each of its answers to a read took beyond its time on the wire, nanoseconds.
    pub answers_ns: Vec<u64>,
}

/// What was found on a servo bus.
#[derive(Debug, Clone, PartialEq)]
pub struct BusSurvey {
    /// The servos, by id.
    pub servos: Vec<SurveyedServo>,
    /// Answers with a wrong checksum, whosever they were: two servos that answer at once, or a bad cable.
    pub damaged: u32,
    /// How fast the port hands over what it has received.
    pub latency: PortLatency,
}

impl BusSurvey {
    /// How long a [`super::ServoReader`] waits here for an answer beyond its time on the wire, nanoseconds, where
    /// `answer_margin_ms` does not say.
    pub fn usual_margin_ns(&self) -> u64 {
        usual_margin_ns(self.latency)
    }
}

/// What came of a servo that was asked.
#[derive(Debug, PartialEq, Eq)]
enum Answer {
    /// What it holds.
    Data(Vec<u8>),
    /// A refusal, or the answer to a ping.
    Other,
    None,
}

struct Surveyor {
    port: Port,
    baud: u32,
    encoder: Encoder,
    parser: Parser,
    damaged: u32,
    /// When a servo was asked last.
    sent_ns: u64,
}

/// Asks a bus who is on it (a ping to everybody, then one to each of `expected` that did not
/// answer) and reads what each servo says of itself. It takes one to two seconds, and an eighth of one more for each servo
/// that answers pings and no reads; nothing else may use the port meanwhile.
pub fn survey(path: &Path, baud: u32, expected: &[u8]) -> Result<BusSurvey, PortError> {
    let port = Port::open(path, baud, None)?;
    let latency = port.latency();
    let mut surveyor = Surveyor {
        port,
        baud,
        encoder: Encoder::default(),
        parser: Parser::new(64),
        damaged: 0,
        sent_ns: 0,
    };
    let mut servos = Vec::new();
    surveyor.ping(BROADCAST_ID, &mut servos)?;
    for id in expected {
        if servos.iter().all(|s: &SurveyedServo| s.id != *id) {
            surveyor.ping(*id, &mut servos)?;
        }
    }
    servos.sort_unstable_by_key(|s| s.id);
    for servo in &mut servos {
        surveyor.ask(servo)?;
        for _ in 0..MORE_READS {
            if servo
                .answers_ns
                .iter()
                .any(|took| *took > usual_margin_ns(latency))
            {
                surveyor.read(servo, address::TORQUE_ENABLE, 7)?;
            }
        }
    }
    Ok(BusSurvey {
        servos,
        damaged: surveyor.damaged,
        latency,
    })
}

impl Surveyor {
    fn ping(&mut self, id: u8, servos: &mut Vec<SurveyedServo>) -> Result<(), PortError> {
        let answers = if id == BROADCAST_ID {
            usize::from(MAX_ID) + 1
        } else {
            1
        };
        let slack_ns = if id == BROADCAST_ID {
            answers as u64 * PER_ID_NS
        } else {
            MARGIN_NS
        };
        self.port.write(self.encoder.ping(id))?;
        let end_ns = monotonic_ns() + slack_ns + wire_ns(answers * PING_ANSWER_BYTES, self.baud);
        let mut damaged_ids = Vec::new();
        while let Some(n) = self.read_until(end_ns)? {
            self.parser.take_bytes(n);
            while let Some(packet) = self.parser.next_packet() {
                let packet = match packet {
                    Ok(packet) => packet,
                    Err(bad) => {
                        self.damaged += 1;
                        damaged_ids.push(bad.id);
                        continue;
                    }
                };
                let [_, lo, hi, firmware] = *packet.parameters else {
                    continue;
                };
                if packet.instruction != Instruction::Status as u8 {
                    continue;
                }
                match servos.iter_mut().find(|s| s.id == packet.id) {
                    Some(known) => known.answers += 1,
                    None => servos.push(SurveyedServo {
                        id: packet.id,
                        model_number: u16::from_le_bytes([lo, hi]),
                        firmware,
                        answers: 1,
                        identity: None,
                        torque_enabled: None,
                        status_return_level: None,
                        hardware_error: None,
                        voltage_v: None,
                        temperature_c: None,
                        answers_ns: Vec::new(),
                    }),
                }
            }
        }
        for id in damaged_ids {
            if let Some(servo) = servos.iter_mut().find(|s| s.id == id) {
                servo.answers += 1;
            }
        }
        Ok(())
    }

    fn ask(&mut self, servo: &mut SurveyedServo) -> Result<(), PortError> {
        let identity = self.first_read(servo, address::MODEL_NUMBER, 11)?;
        let Some([m0, m1, _, _, _, _, firmware, _, baud, delay, mode]) = identity.as_deref() else {
            return Ok(());
        };
        servo.identity = Some(ServoIdentity {
            model_number: u16::from_le_bytes([*m0, *m1]),
            firmware: *firmware,
            baud_register: *baud,
            return_delay_us: 2 * u16::from(*delay),
            drive_mode: *mode,
        });
        let state = self.read(servo, address::TORQUE_ENABLE, 7)?;
        if let Some([torque, _, _, _, level, _, error]) = state.as_deref() {
            servo.torque_enabled = Some(*torque != 0);
            servo.status_return_level = Some(*level);
            servo.hardware_error = Some(HardwareError(*error));
        }
        let power = self.read(servo, address::PRESENT_INPUT_VOLTAGE, 3)?;
        if let Some([v0, v1, celsius]) = power.as_deref() {
            servo.voltage_v = Some(volts(u16::from_le_bytes([*v0, *v1])));
            servo.temperature_c = Some(*celsius);
        }
        Ok(())
    }

    /// Reads what comes by `end_ns`, or what has come by then although this thread was held up;
    /// `None` if nothing has.
    fn read_until(&mut self, end_ns: u64) -> Result<Option<usize>, PortError> {
        let left_ns = end_ns.saturating_sub(monotonic_ns());
        let n = self
            .port
            .read(self.parser.space(), Duration::from_nanos(left_ns))?;
        Ok((n > 0 || left_ns > 0).then_some(n))
    }

    /// So many bytes of the control table of a servo that answers reads; `None` if no good answer came.
    fn read(
        &mut self,
        servo: &mut SurveyedServo,
        at: u16,
        length: u16,
    ) -> Result<Option<Vec<u8>>, PortError> {
        for _ in 0..TRIES {
            self.send_read(servo.id, at, length)?;
            if let Answer::Data(data) = self.answer(servo, length, BUSY_NS)? {
                return Ok(Some(data));
            }
        }
        Ok(None)
    }

    fn send_read(&mut self, id: u8, at: u16, length: u16) -> Result<(), PortError> {
        self.parser.clear();
        self.port.write(self.encoder.read(id, at, length))?;
        self.sent_ns = monotonic_ns();
        Ok(())
    }

    /// The same of a servo that may answer pings alone. Behind a read without answer it is pinged: as long as it does not
    /// answer that, the machine is busy, and the answer to the read may still come, which comes first.
    fn first_read(
        &mut self,
        servo: &mut SurveyedServo,
        at: u16,
        length: u16,
    ) -> Result<Option<Vec<u8>>, PortError> {
        for _ in 0..TRIES {
            self.send_read(servo.id, at, length)?;
            let mut answer = self.answer(servo, length, MARGIN_NS)?;
            if answer == Answer::None {
                self.port.write(self.encoder.ping(servo.id))?;
                answer = self.answer(servo, length, BUSY_NS)?;
            }
            if let Answer::Data(data) = answer {
                return Ok(Some(data));
            }
        }
        Ok(None)
    }

    /// What a servo answers to a read of so many bytes, beyond its time on the wire by so long.
    fn answer(
        &mut self,
        servo: &mut SurveyedServo,
        length: u16,
        margin_ns: u64,
    ) -> Result<Answer, PortError> {
        let wire_ns = wire_ns(usize::from(length) + PING_ANSWER_BYTES * 2, self.baud);
        let end_ns = monotonic_ns() + margin_ns + wire_ns;
        while let Some(n) = self.read_until(end_ns)? {
            self.parser.take_bytes(n);
            while let Some(packet) = self.parser.next_packet() {
                let Ok(packet) = packet else {
                    self.damaged += 1;
                    continue;
                };
                if packet.id != servo.id || packet.instruction != Instruction::Status as u8 {
                    continue;
                }
                match packet.parameters {
                    [_, data @ ..] if data.len() == usize::from(length) => {
                        let took_ns = monotonic_ns().saturating_sub(self.sent_ns + wire_ns);
                        servo.answers_ns.push(took_ns);
                        return Ok(Answer::Data(data.to_vec()));
                    }
                    [error, data @ ..]
                        if StatusByte(*error).error().is_some() || data.len() == PING_BYTES =>
                    {
                        return Ok(Answer::Other);
                    }
                    _ => {}
                }
            }
        }
        Ok(Answer::None)
    }
}
