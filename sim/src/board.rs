//! One simulated MTB3 (or XELA controller): its timer, its sweep, its transmit stack, its ears.

use crate::clock::Span;
use crate::fault::BoardFault;
use crate::random::{between, bits};
use crate::scene::Boards;
use crate::skin_model::SkinModel;
use taxel_can::CanFrame;
use taxel_skin::Protocol;

/// Entries of the transmit stack (`can_interface.h`, protocols.md 1.9).
const STACK: usize = 20;
/// Entries of the receive buffer, which is handled newest first (protocols.md 1.9).
const RECEIVE: usize = 5;
/// Time between two groups of a sweep: the four sensor lines are read at once, the chips of a line one after another.
const GROUP_NS: u64 = 1_500_000;
/// Random numbers of a board's timer.
const TIMER_STREAM: u64 = 0x746D;

/// Board type of an MTB (`iCubCanProto_types.h`), firmware 2.17.0, CAN protocol 1.0 (protocols.md 1.1, 1.5).
const BOARD_TYPE: u8 = 5;
const FIRMWARE: [u8; 3] = [2, 17, 0];
const CAN_PROTOCOL: [u8; 2] = [1, 0];

/// What a board is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    /// Without power.
    Off,
    /// Running, its sampling timer disabled: the state after power-up.
    Stopped,
    /// Sampling and sending.
    Streaming,
    /// Reset into the bootloader; only power brings it back.
    Bootloader,
}

#[derive(Debug)]
pub(crate) struct Board {
    address: u8,
    protocol: Protocol,
    /// `(k, taxel)` of each group of chips that is read at once.
    groups: Vec<Vec<(u8, u16)>>,
    faults: Vec<(Span, BoardFault)>,
    options: Boards,
    period_ns: u64,
    phase_ns: u64,
    group_ns: u64,
    autostart: bool,
    state: State,
    next_tick_ns: Option<u64>,
    /// Group to read next, and when.
    sweep: Option<(usize, u64)>,
    /// A tick came during a sweep: the next one follows at once.
    queued: bool,
    /// When a class 7 frame disabled the timer's interrupt. The timer runs on, and a tick meanwhile stays pending
    /// until the board is started: why a start before every sweep keeps boards going that stop each other.
    disabled_ns: Option<u64>,
    sweeps: u32,
    /// What the CAN controller is sending or trying to send.
    register: Option<CanFrame>,
    stack: [Option<CanFrame>; STACK],
    depth: usize,
    overflows: u64,
    /// What it heard while it was reading its chips.
    heard: [Option<CanFrame>; RECEIVE],
    heard_depth: usize,
}

impl Board {
    /// A board at time 0, under power. `taxels` are `(k, taxel)`; `number` tells its timer from those of others.
    pub(crate) fn new(
        number: u64,
        address: u8,
        protocol: Protocol,
        taxels: &[(u8, u16)],
        faults: Vec<(Span, BoardFault)>,
        options: Boards,
        seed: u64,
    ) -> Self {
        let chip = |k: u8| match protocol {
            Protocol::UskinL3 => k & 15,
            _ => k & 3,
        };
        let mut chips: Vec<u8> = taxels.iter().map(|(k, _)| chip(*k)).collect();
        chips.sort_unstable();
        chips.dedup();
        let groups: Vec<Vec<(u8, u16)>> = chips
            .iter()
            .map(|c| {
                let mut group: Vec<_> = taxels.iter().copied().filter(|(k, _)| chip(*k) == *c).collect();
                group.sort_unstable();
                group
            })
            .collect();
        let nominal_ns = 1_000_000_000 / u64::from(options.rate_hz);
        let drift_ppm =
            between(bits(seed, TIMER_STREAM, number << 1), -1.0, 1.0) * f64::from(options.drift_ppm);
        let period_ns =
            nominal_ns.saturating_add_signed((nominal_ns as f64 * drift_ppm / 1e6).floor() as i64);
        let phase_ns = bits(seed, TIMER_STREAM, number << 1 | 1) % period_ns;
        let group_ns = GROUP_NS.min(period_ns / (groups.len() as u64 + 2));
        let mut board = Self {
            address,
            protocol,
            groups,
            faults,
            options,
            period_ns,
            phase_ns,
            group_ns,
            autostart: false,
            state: State::Off,
            next_tick_ns: None,
            sweep: None,
            queued: false,
            disabled_ns: None,
            sweeps: 0,
            register: None,
            stack: [None; STACK],
            depth: 0,
            overflows: 0,
            heard: [None; RECEIVE],
            heard_depth: 0,
        };
        if !board.has(0, |f| f == BoardFault::Silent) {
            board.power_up(0);
        }
        board
    }

    /// Stretches of scene time in which something is wrong with the board.
    pub(crate) fn fault_spans(&self) -> impl Iterator<Item = Span> {
        self.faults.iter().map(|(span, _)| *span)
    }

    /// When it next does something by itself.
    pub(crate) fn next_event_ns(&self) -> Option<u64> {
        match (self.sweep, self.next_tick_ns) {
            (Some((_, at)), Some(tick)) => Some(at.min(tick)),
            (Some((_, at)), None) => Some(at),
            (None, tick) => tick,
        }
    }

    /// Does what is due at `t_ns`: begins a sweep, reads a group of chips, follows its power.
    pub(crate) fn run(&mut self, t_ns: u64, skin: &SkinModel) {
        let scene_ns = skin.clock().scene_ns(t_ns);
        let powered = !self.has(scene_ns, |f| f == BoardFault::Silent);
        match (self.state, powered) {
            (State::Off, true) => self.power_up(t_ns),
            (State::Off, false) => {}
            (_, false) => self.power_down(),
            (_, true) => {}
        }
        if self.next_tick_ns == Some(t_ns) {
            self.next_tick_ns = Some(self.tick_after(t_ns)).filter(|t| !skin.clock().is_over(*t));
            if !skin.clock().is_over(t_ns) {
                self.begin_sweep(t_ns);
            }
        }
        if let Some((group, at)) = self.sweep
            && at == t_ns
        {
            let address = self.sending_address(scene_ns);
            for i in 0..self.groups[group].len() {
                let (k, taxel) = self.groups[group][i];
                let (counts, status) = if self.sweeps <= self.options.boot_sweeps {
                    ([0xFFFF; 3], 0xFF)
                } else {
                    skin.reading(taxel, t_ns)
                };
                if let Some(frame) = self.protocol.frame(address, k, counts, status) {
                    self.push(frame);
                }
            }
            self.sweep = (group + 1 < self.groups.len()).then_some((group + 1, t_ns + self.group_ns));
            if self.sweep.is_none() && std::mem::take(&mut self.queued) {
                self.begin_sweep(t_ns);
            }
            while self.heard_depth > 0 {
                self.heard_depth -= 1;
                if let Some(frame) = self.heard[self.heard_depth].take() {
                    self.obey(&frame, t_ns);
                }
            }
        }
    }

    /// The frame with which it takes part in arbitration.
    pub(crate) fn offer(&self, scene_ns: u64) -> Option<CanFrame> {
        let frame = self.register?;
        (!self.has(scene_ns, |f| f == BoardFault::Overflow)).then_some(frame)
    }

    /// Its frame is through: the newest of the stack is next.
    pub(crate) fn sent(&mut self) {
        self.register = None;
        if self.depth > 0 {
            self.depth -= 1;
            self.register = self.stack[self.depth].take();
        }
    }

    /// A frame of another node went over the bus. `by_board` says whether that was a board: uSkin firmware's filter
    /// is not public, so boards hear each other only in scenes with `class7_hazard`.
    ///
    /// Between sweeps a frame is obeyed at once; during one, when the next group of chips has been read, the newest
    /// frame first. Those that find the buffer full are lost.
    pub(crate) fn hear(&mut self, frame: &CanFrame, by_board: bool, t_ns: u64) {
        let Some(id) = frame.standard_id() else { return };
        let hears = self.protocol.takes_commands() && (!by_board || self.options.class7_hazard);
        if !hears || self.state == State::Off {
            return;
        }
        // The acceptance filters 0x20Y, 0x70Y and 0x70F, which leave the source open (protocols.md 1.9).
        let own = (id & 15) as u8 == self.address;
        if !matches!((id >> 8, own, id & 15), (2 | 7, true, _) | (7, _, 15)) {
            return;
        }
        if self.sweep.is_none() {
            self.obey(frame, t_ns);
        } else if self.heard_depth < RECEIVE {
            self.heard[self.heard_depth] = Some(*frame);
            self.heard_depth += 1;
        }
    }

    /// Does what an accepted frame says.
    fn obey(&mut self, frame: &CanFrame, t_ns: u64) {
        let id = frame.id() as u16;
        let (source, own) = ((id >> 4 & 15) as u8, (id & 15) as u8 == self.address);
        if id >> 8 == 2 {
            self.configure(frame.data(), source, t_ns);
            return;
        }
        if self.state == State::Streaming {
            self.disabled_ns = Some(t_ns);
        }
        self.stop();
        self.manage(frame.data(), source, own);
    }

    /// Starts it, now and after each power-up.
    pub(crate) fn set_autostart(&mut self, t_ns: u64) {
        self.autostart = true;
        self.start(t_ns);
    }

    /// How often its transmit stack overflowed.
    pub(crate) fn overflows(&self) -> u64 {
        self.overflows
    }

    /// Whether it is sampling.
    pub(crate) fn is_streaming(&self) -> bool {
        self.state == State::Streaming
    }

    /// Class 2 (protocols.md 1.4): start, stop, firmware version. The rest has no effect on uSkin boards.
    fn configure(&mut self, data: &[u8], source: u8, t_ns: u64) {
        if self.state == State::Bootloader {
            return;
        }
        match *data {
            [0x07, 0x00, ..] => self.start(t_ns),
            [0x07, 0x01, ..] => {
                self.stop();
                self.disabled_ns = None;
            }
            [0x1C, major, minor, ..] => {
                let same = u8::from([major, minor] == CAN_PROTOCOL);
                let [f0, f1, f2] = FIRMWARE;
                let reply = [
                    0x1C,
                    BOARD_TYPE,
                    f0,
                    f1,
                    f2,
                    CAN_PROTOCOL[0],
                    CAN_PROTOCOL[1],
                    same,
                ];
                self.reply(0x200, source, &reply);
            }
            _ => {}
        }
    }

    /// Class 7 (protocols.md 1.5). That the sampling timer is off already happened, whatever the command.
    fn manage(&mut self, data: &[u8], source: u8, own: bool) {
        let [f0, f1, f2] = FIRMWARE;
        match (data.first(), self.state) {
            (Some(0xFF), State::Bootloader) => self.reply(0x700, source, &[0xFF, BOARD_TYPE, f0, f1]),
            (_, State::Bootloader) => {}
            (Some(0xFF), _) => self.reply(0x700, source, &[0xFF, BOARD_TYPE, f0, f1, f2]),
            (Some(0x00), _) if own => {
                self.sweep = None;
                self.state = State::Bootloader;
                self.reply(0x700, source, &[0x00, 0x01]);
            }
            (Some(0x04), _) if own => self.reply(0x700, source, &[0x04, 0x01]),
            (Some(0x0C), _) if own => {
                for part in 0..8 {
                    self.reply(0x700, source, &[0x0C, part, b' ', b' ', b' ', b' ']);
                }
            }
            _ => {}
        }
    }

    fn reply(&mut self, class: u16, to: u8, data: &[u8]) {
        let id = class | u16::from(self.address & 15) << 4 | u16::from(to);
        if let Ok(frame) = CanFrame::standard(id, data) {
            self.push(frame);
        }
    }

    /// Puts a frame on the transmit stack. A full stack is emptied, the frame with it, and an empty frame
    /// `0x700 | board << 4 | 5` says so (protocols.md 1.9).
    fn push(&mut self, frame: CanFrame) {
        if self.register.is_none() {
            self.register = Some(frame);
        } else if self.depth < STACK {
            self.stack[self.depth] = Some(frame);
            self.depth += 1;
        } else {
            self.stack = [None; STACK];
            self.overflows += 1;
            self.stack[0] = CanFrame::standard(0x700 | u16::from(self.address & 15) << 4 | 5, &[]).ok();
            self.depth = 1;
        }
    }

    fn start(&mut self, t_ns: u64) {
        if self.state == State::Stopped {
            self.state = State::Streaming;
            self.next_tick_ns = Some(self.tick_after(t_ns));
            if self
                .disabled_ns
                .take()
                .is_some_and(|t| self.tick_after(t) <= t_ns)
            {
                self.begin_sweep(t_ns);
            }
        }
    }

    fn begin_sweep(&mut self, t_ns: u64) {
        if self.sweep.is_some() {
            self.queued = true;
        } else {
            self.sweeps = self.sweeps.saturating_add(1);
            self.sweep = Some((0, t_ns + self.group_ns));
        }
    }

    /// The timer no longer begins sweeps; one in progress completes.
    fn stop(&mut self) {
        if self.state == State::Streaming {
            self.state = State::Stopped;
        }
        self.next_tick_ns = None;
    }

    fn power_up(&mut self, t_ns: u64) {
        self.state = State::Stopped;
        self.sweeps = 0;
        let mtb = self.protocol.takes_commands();
        if mtb && self.options.boot_replies {
            // Replies to the configuration of the sensor chips, one per chip of a line, in frames that look like data.
            for chip in 0..4 {
                self.reply(0x700, chip, &[0; 8]);
            }
        }
        if self.autostart || !mtb {
            self.start(t_ns);
        }
    }

    fn power_down(&mut self) {
        self.state = State::Off;
        self.next_tick_ns = None;
        self.sweep = None;
        self.queued = false;
        self.disabled_ns = None;
        self.register = None;
        self.stack = [None; STACK];
        self.depth = 0;
        self.heard = [None; RECEIVE];
        self.heard_depth = 0;
    }

    /// The next tick of the free-running sampling timer.
    fn tick_after(&self, t_ns: u64) -> u64 {
        if t_ns < self.phase_ns {
            self.phase_ns
        } else {
            self.phase_ns + ((t_ns - self.phase_ns) / self.period_ns + 1) * self.period_ns
        }
    }

    fn sending_address(&self, scene_ns: u64) -> u8 {
        self.faults
            .iter()
            .find_map(|(span, fault)| match fault {
                BoardFault::WrongId { board } if span.contains(scene_ns) => Some(*board),
                _ => None,
            })
            .unwrap_or(self.address)
    }

    fn has(&self, scene_ns: u64, wanted: impl Fn(BoardFault) -> bool) -> bool {
        self.faults
            .iter()
            .any(|(span, fault)| span.contains(scene_ns) && wanted(*fault))
    }
}
