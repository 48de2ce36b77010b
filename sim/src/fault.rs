//! What breaks in a scene, where, and for how long.

use crate::clock::{Span, ns_of_seconds};
use serde::Deserialize;

/// How long a board that reboots is without power and in its start-up, seconds.
const REBOOT_S: f64 = 0.15;

/// One fault, its places still names.
#[derive(Debug, Clone)]
pub(crate) struct Fault {
    /// Line of the scene file.
    pub(crate) line: u32,
    /// Modules, parts, or `all`; empty for faults of a bus.
    pub(crate) on: Vec<String>,
    /// The boards' own numbers `k` of the taxels concerned; `None` for all of a module.
    pub(crate) taxels: Option<Vec<u8>>,
    /// Index of the bus concerned; `None` for every bus.
    pub(crate) bus: Option<u8>,
    pub(crate) span: Span,
    pub(crate) kind: FaultKind,
}

/// What is broken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum FaultKind {
    Taxel(TaxelFault),
    Board(BoardFault),
    Bus(BusFault),
}

/// What can be wrong with a taxel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum TaxelFault {
    /// The chip does not answer: all axes read this, and the status byte is 0xFF.
    Dead { value: u16 },
    /// The chip is not there; on an iCub board the whole triangle.
    NotConnected,
    /// Keeps the value it had when the fault began.
    Stuck,
    /// Its noise is this many times as strong.
    Noisy { factor: f64 },
    /// z swings up by this many counts and back, so that it wraps modulo 2^16.
    Wrapping { amplitude: f64, period_ns: u64 },
    /// With this probability, one byte of one reading is wrong.
    Glitch { probability: f64 },
    /// z climbs.
    Drift { counts_per_s: f64 },
    /// The status byte has its error bit set, the value is good.
    Status,
}

/// What can be wrong with a board.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum BoardFault {
    /// Without power; it comes back stopped.
    Silent,
    /// Never wins the bus, so that its transmit stack overflows.
    Overflow,
    /// Sends under the address of another board.
    WrongId { board: u8 },
}

/// What can be wrong with a bus.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum BusFault {
    /// The host's controller reports errors, this often.
    ErrorFrames { error: BusError, period_ns: u64 },
    /// The host's controller is off the bus: it says so, hears nothing, and says when it is back.
    BusOff,
    /// A node floods the bus with this id; without one, the boards named by the fault do with that
    /// of their first taxel.
    Babble { id: Option<u16>, period_ns: u64 },
    /// Frames get lost between the bus and the host.
    Lost { probability: f64 },
    /// Frames reach the host twice.
    Duplicate { probability: f64 },
    /// Frames reach the host after the one that followed them.
    Reorder { probability: f64 },
    /// Data frames reach the host one byte short.
    Short { probability: f64 },
}

/// What an error frame reports (`linux/can/error.h`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum BusError {
    NoAcknowledge,
    BitStuffing,
    ControllerOverflow,
    ErrorWarning,
    ErrorPassive,
    /// Error-passive and error-active in turn.
    Flapping,
}

impl BusError {
    /// Error class and data bytes of the frames that take turns.
    pub(crate) fn frames(self) -> [(u32, [u8; 8]); 2] {
        const ACTIVE: (u32, [u8; 8]) = (0x04, [0, 0x40, 0, 0, 0, 0, 0, 0]);
        let frame = match self {
            BusError::NoAcknowledge => (0x20, [0; 8]),
            BusError::BitStuffing => (0x88, [0, 0, 0x04, 0, 0, 0, 0, 0]),
            BusError::ControllerOverflow => (0x04, [0, 0x01, 0, 0, 0, 0, 0, 0]),
            BusError::ErrorWarning => (0x04, [0, 0x04, 0, 0, 0, 0, 97, 0]),
            BusError::ErrorPassive => (0x04, [0, 0x10, 0, 0, 0, 0, 130, 0]),
            BusError::Flapping => return [(0x04, [0, 0x10, 0, 0, 0, 0, 0, 130]), ACTIVE],
        };
        [frame, frame]
    }
}

/// A fault as the file has it. Which keys go with which kind is checked afterwards, so that the
/// message can say so.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct FaultToml {
    kind: KindToml,
    on: Option<Vec<String>>,
    taxels: Option<Vec<u8>>,
    bus: Option<u8>,
    from: Option<f64>,
    to: Option<f64>,
    value: Option<u16>,
    factor: Option<f64>,
    amplitude: Option<f64>,
    period_s: Option<f64>,
    probability: Option<f64>,
    counts_per_s: Option<f64>,
    board: Option<u8>,
    error: Option<BusError>,
    rate_hz: Option<f64>,
    id: Option<u16>,
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum KindToml {
    Dead,
    NotConnected,
    Stuck,
    Noisy,
    Wrapping,
    Glitch,
    Drift,
    Status,
    Silent,
    Reboot,
    Overflow,
    WrongId,
    ErrorFrames,
    BusOff,
    Babble,
    Lost,
    Duplicate,
    Reorder,
    Short,
}

impl KindToml {
    /// Keys that a fault of this kind may have besides `kind`, `from` and `to`.
    fn keys(self) -> &'static [&'static str] {
        match self {
            KindToml::Dead => &["on", "taxels", "value"],
            KindToml::Stuck | KindToml::Status | KindToml::NotConnected => &["on", "taxels"],
            KindToml::Noisy => &["on", "taxels", "factor"],
            KindToml::Wrapping => &["on", "taxels", "amplitude", "period_s"],
            KindToml::Glitch => &["on", "taxels", "probability"],
            KindToml::Drift => &["on", "taxels", "counts_per_s"],
            KindToml::Silent | KindToml::Reboot | KindToml::Overflow => &["on"],
            KindToml::WrongId => &["on", "board"],
            KindToml::ErrorFrames => &["bus", "error", "rate_hz"],
            KindToml::BusOff => &["bus"],
            KindToml::Babble => &["bus", "id", "on", "rate_hz"],
            KindToml::Lost | KindToml::Duplicate | KindToml::Reorder | KindToml::Short => {
                &["bus", "probability"]
            }
        }
    }
}

impl FaultToml {
    pub(crate) fn check(self, line: u32, length_ns: u64) -> Result<Fault, String> {
        let keys = self.kind.keys();
        let given = [
            ("on", self.on.is_some()),
            ("taxels", self.taxels.is_some()),
            ("bus", self.bus.is_some()),
            ("value", self.value.is_some()),
            ("factor", self.factor.is_some()),
            ("amplitude", self.amplitude.is_some()),
            ("period_s", self.period_s.is_some()),
            ("probability", self.probability.is_some()),
            ("counts_per_s", self.counts_per_s.is_some()),
            ("board", self.board.is_some()),
            ("error", self.error.is_some()),
            ("rate_hz", self.rate_hz.is_some()),
            ("id", self.id.is_some()),
        ];
        if let Some((key, _)) = given.iter().find(|(key, there)| *there && !keys.contains(key)) {
            return Err(format!(
                "a fault of kind {:?} has no `{key}`; it may have {}",
                self.kind,
                keys.join(", ")
            ));
        }
        let babble = matches!(self.kind, KindToml::Babble);
        if babble && self.on.is_some() && (self.id.is_some() || self.bus.is_some()) {
            return Err(
                "a fault of kind Babble has either `on`, the boards that babble, or `id` and `bus`".into(),
            );
        }
        if !babble && keys.contains(&"on") && self.on.as_ref().is_none_or(Vec::is_empty) {
            return Err(format!(
                "a fault of kind {:?} needs `on`: modules, parts, or \"all\"",
                self.kind
            ));
        }
        let kind = self.kind()?;
        let mut to = self.to;
        if matches!(self.kind, KindToml::Reboot) {
            if to.is_some() {
                return Err("a fault of kind Reboot has no `to`: it happens at `from`".into());
            }
            to = Some((self.from.unwrap_or(0.0) + REBOOT_S).min(length_ns as f64 / 1e9));
        }
        Ok(Fault {
            line,
            on: self.on.unwrap_or_default(),
            taxels: self.taxels,
            bus: self.bus,
            span: Span::of_seconds(self.from, to, length_ns)?,
            kind,
        })
    }

    fn kind(&self) -> Result<FaultKind, String> {
        let number = |key: &str, given: Option<f64>, default: f64, from: f64, to: f64| {
            let value = given.unwrap_or(default);
            if value >= from && value <= to {
                Ok(value)
            } else {
                Err(format!("`{key}` is {value}; it must be {from} to {to}"))
            }
        };
        let probability = || match self.probability {
            Some(p) => number("probability", Some(p), p, 0.0, 1.0),
            None => Err(format!(
                "a fault of kind {:?} needs `probability`, 0 to 1",
                self.kind
            )),
        };
        let period_ns = |default_hz: f64| {
            number("rate_hz", self.rate_hz, default_hz, 0.01, 20_000.0).map(|hz| ns_of_seconds(1.0 / hz))
        };
        let small_id = |key: &str, given: Option<u16>, most: u16| match given {
            Some(id) if id > most => Err(format!("`{key}` is {id:#X}; it must be at most {most:#X}")),
            id => Ok(id),
        };
        Ok(match self.kind {
            KindToml::Dead => FaultKind::Taxel(TaxelFault::Dead {
                value: self.value.unwrap_or(0xFFFF),
            }),
            KindToml::NotConnected => FaultKind::Taxel(TaxelFault::NotConnected),
            KindToml::Stuck => FaultKind::Taxel(TaxelFault::Stuck),
            KindToml::Noisy => FaultKind::Taxel(TaxelFault::Noisy {
                factor: number("factor", self.factor, 40.0, 0.0, 10_000.0)?,
            }),
            KindToml::Wrapping => FaultKind::Taxel(TaxelFault::Wrapping {
                amplitude: number("amplitude", self.amplitude, 70_000.0, 0.0, 1e6)?,
                period_ns: ns_of_seconds(number("period_s", self.period_s, 2.0, 0.001, 3600.0)?),
            }),
            KindToml::Glitch => FaultKind::Taxel(TaxelFault::Glitch {
                probability: probability()?,
            }),
            KindToml::Drift => FaultKind::Taxel(TaxelFault::Drift {
                counts_per_s: number("counts_per_s", self.counts_per_s, 20.0, -1e6, 1e6)?,
            }),
            KindToml::Status => FaultKind::Taxel(TaxelFault::Status),
            KindToml::Silent | KindToml::Reboot => FaultKind::Board(BoardFault::Silent),
            KindToml::Overflow => FaultKind::Board(BoardFault::Overflow),
            KindToml::WrongId => match small_id("board", self.board.map(u16::from), 15)? {
                Some(board) => FaultKind::Board(BoardFault::WrongId { board: board as u8 }),
                None => {
                    return Err("a fault of kind WrongId needs `board`: the address it sends under".into());
                }
            },
            KindToml::ErrorFrames => FaultKind::Bus(BusFault::ErrorFrames {
                error: self.error.unwrap_or(BusError::BitStuffing),
                period_ns: period_ns(10.0)?,
            }),
            KindToml::BusOff => FaultKind::Bus(BusFault::BusOff),
            KindToml::Babble => FaultKind::Bus(BusFault::Babble {
                id: match self.on {
                    Some(_) => None,
                    None => Some(small_id("id", self.id, 0x7FF)?.unwrap_or(0)),
                },
                period_ns: period_ns(2000.0)?,
            }),
            KindToml::Lost => FaultKind::Bus(BusFault::Lost {
                probability: probability()?,
            }),
            KindToml::Duplicate => FaultKind::Bus(BusFault::Duplicate {
                probability: probability()?,
            }),
            KindToml::Reorder => FaultKind::Bus(BusFault::Reorder {
                probability: probability()?,
            }),
            KindToml::Short => FaultKind::Bus(BusFault::Short {
                probability: probability()?,
            }),
        })
    }
}
