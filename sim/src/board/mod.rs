//! One simulated board: its power, its timer, its sweeps, its queues in and out. What it does with
//! its chips and with what it is sent is one kind of [`Firmware`] each; `kinds/` has the list of
//! them.

mod firmware;
mod kinds;
mod module;
mod mtb;
mod plan;
mod queue;

pub(crate) use kinds::nature_of;
pub(crate) use plan::{Plan, plans};

use crate::clock::Span;
use crate::fault::BoardFault;
use crate::random::{between, bits};
use crate::scene::Boards;
use crate::skin_model::SkinModel;
use firmware::{Effect, Firmware, Moment};
use module::ModuleOfBoard;
use queue::Queue;
use taxel_can::CanFrame;

/// Entries of the receive buffer, which is handled newest first (docs/protocols.md, "MTB3 firmware").
const RECEIVE: usize = 5;
/// Time between two groups of a sweep.
const GROUP_NS: u64 = 1_500_000;
/// A board that waits for room in its queue looks again after this time.
const ROOM_NS: u64 = 100_000;
/// Random numbers of a board's timer.
const TIMER_STREAM: u64 = 0x746D;

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
    /// Tells its timer from those of others.
    number: u64,
    address: u8,
    modules: Vec<ModuleOfBoard>,
    firmware: Box<dyn Firmware>,
    options: Boards,
    seed: u64,
    period_ns: u64,
    phase_ns: u64,
    autostart: bool,
    state: State,
    next_tick_ns: Option<u64>,
    /// Group to read next, and when.
    sweep: Option<(usize, u64)>,
    /// A tick came during a sweep: the next one follows at once.
    queued: bool,
    /// When a class 7 frame disabled the timer's interrupt. The timer runs on, and a tick meanwhile
    /// stays pending until the board is started: why a start before every sweep keeps boards going
    /// that stop each other.
    disabled_ns: Option<u64>,
    /// It takes no start before this time.
    busy_until_ns: u64,
    sweeps: u32,
    queue: Queue,
    /// What it heard while it was reading its chips.
    heard: [Option<CanFrame>; RECEIVE],
    heard_depth: usize,
}

impl Board {
    /// A board at time 0, under power.
    pub(crate) fn new(plan: Plan, options: Boards, seed: u64) -> Self {
        let mut board = Self {
            number: plan.number,
            address: plan.modules.first().map_or(0, |m| m.address),
            modules: plan.modules,
            queue: plan.firmware.queue(),
            firmware: plan.firmware,
            options,
            seed,
            period_ns: 0,
            phase_ns: 0,
            autostart: false,
            state: State::Off,
            next_tick_ns: None,
            sweep: None,
            queued: false,
            disabled_ns: None,
            busy_until_ns: 0,
            sweeps: 0,
            heard: [None; RECEIVE],
            heard_depth: 0,
        };
        board.set_period(plan.period_ns);
        if board.has_power(0) {
            board.power_up(0);
        }
        board
    }

    /// Stretches of scene time in which something is wrong with the board.
    pub(crate) fn fault_spans(&self) -> impl Iterator<Item = Span> {
        self.modules
            .iter()
            .flat_map(|m| m.faults.iter().map(|(span, _)| *span))
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
        match (self.state, self.has_power(scene_ns)) {
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
            self.read(group, t_ns, scene_ns, skin);
        }
    }

    fn read(&mut self, group: usize, t_ns: u64, scene_ns: u64, skin: &SkinModel) {
        let room = self.firmware.needs_room().unwrap_or(0);
        if !self.queue.has_room(room) && !self.cannot_send(scene_ns) {
            self.sweep = Some((group, t_ns + ROOM_NS));
            return;
        }
        if group < self.firmware.groups() {
            let modules = &self.modules;
            let moment = Moment {
                t_ns,
                skin,
                booting: self.sweeps <= self.options.boot_sweeps,
                address: &|module| modules.get(module)?.address_at(scene_ns),
            };
            let (queue, notice) = (&mut self.queue, overflow_notice(self.address));
            self.firmware
                .read(group, &moment, &mut |frame| queue.push(frame, || notice));
        }
        self.sweep = (group + 1 < self.firmware.groups()).then(|| (group + 1, t_ns + self.group_ns()));
        if self.sweep.is_none() && std::mem::take(&mut self.queued) {
            self.begin_sweep(t_ns);
        }
        while self.heard_depth > 0 {
            self.heard_depth -= 1;
            if let Some(frame) = self.heard[self.heard_depth].take() {
                self.handle_command(&frame, t_ns, skin);
            }
        }
    }

    /// The frame with which it takes part in arbitration.
    pub(crate) fn offer(&self, scene_ns: u64) -> Option<CanFrame> {
        let frame = self.queue.front()?;
        (!self.cannot_send(scene_ns)).then_some(frame)
    }

    /// Its frame is through.
    pub(crate) fn sent(&mut self) {
        self.queue.sent();
    }

    /// A frame of another node went over the bus. `by_board` says whether that was a board: uSkin
    /// firmware's filter is not public, so boards hear each other only in scenes with
    /// `class7_hazard`.
    ///
    /// Between sweeps a frame is obeyed at once; during one, an MTB obeys when the next group of
    /// chips has been read, the newest frame first. Those that find the buffer full are lost.
    pub(crate) fn handle_frame(&mut self, frame: &CanFrame, by_board: bool, t_ns: u64, skin: &SkinModel) {
        if self.state == State::Off {
            return;
        }
        if self.firmware.identity().is_none() {
            if !by_board {
                let effect = self.firmware.handle_frame(frame);
                self.follow(effect, t_ns);
            }
            return;
        }
        let Some(id) = frame.standard_id() else { return };
        if (by_board && !self.options.class7_hazard) || !self.accepts(id) {
            return;
        }
        if self.sweep.is_none() {
            self.handle_command(frame, t_ns, skin);
        } else if self.heard_depth < RECEIVE {
            self.heard[self.heard_depth] = Some(*frame);
            self.heard_depth += 1;
        }
    }

    /// Starts it, set up, now and after each power-up.
    pub(crate) fn set_autostart(&mut self, t_ns: u64) {
        self.autostart = true;
        if self.state == State::Stopped {
            self.firmware.set_up();
        }
        self.start(t_ns);
    }

    /// How often its transmit queue overflowed.
    pub(crate) fn overflows(&self) -> u64 {
        self.queue.overflows()
    }

    /// Whether it is sampling.
    pub(crate) fn is_streaming(&self) -> bool {
        self.state == State::Streaming
    }

    /// Whether any of its modules is the cause that it never wins the bus.
    fn cannot_send(&self, scene_ns: u64) -> bool {
        self.modules.iter().any(|m| m.has(scene_ns, BoardFault::Overflow))
    }

    /// Without power are MTBs that a scene makes silent, and hubs all of whose modules are.
    fn has_power(&self, scene_ns: u64) -> bool {
        self.modules.iter().any(|m| !m.has(scene_ns, BoardFault::Silent))
    }

    fn push(&mut self, frame: CanFrame) {
        let notice = overflow_notice(self.address);
        self.queue.push(frame, || notice);
    }

    fn follow(&mut self, effect: Effect, t_ns: u64) {
        self.busy_until_ns = self.busy_until_ns.max(effect.busy_until_ns);
        if let Some(period_ns) = effect.period_ns {
            self.set_period(period_ns);
            if self.state == State::Streaming {
                self.next_tick_ns = Some(self.tick_after(t_ns));
            }
        }
        if effect.stops {
            self.stop();
            self.disabled_ns = None;
        }
        if effect.starts {
            self.start(t_ns);
        }
    }

    /// Its own timer is off by a part of what the scene allows, and in a phase of its own.
    fn set_period(&mut self, nominal_ns: u64) {
        let drift_ppm = between(bits(self.seed, TIMER_STREAM, self.number << 1), -1.0, 1.0)
            * f64::from(self.options.drift_ppm);
        self.period_ns =
            nominal_ns.saturating_add_signed((nominal_ns as f64 * drift_ppm / 1e6).floor() as i64);
        self.phase_ns = bits(self.seed, TIMER_STREAM, self.number << 1 | 1) % self.period_ns;
    }

    fn group_ns(&self) -> u64 {
        GROUP_NS.min(self.period_ns / (self.firmware.groups() as u64 + 2))
    }

    fn start(&mut self, t_ns: u64) {
        if self.state == State::Stopped && t_ns >= self.busy_until_ns {
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
            self.sweep = Some((0, t_ns + self.group_ns()));
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
        self.boot();
        if self.autostart {
            self.firmware.set_up();
        }
        if self.autostart || self.firmware.starts_itself() {
            self.start(t_ns);
        }
    }

    fn power_down(&mut self) {
        self.state = State::Off;
        self.firmware.forget();
        self.next_tick_ns = None;
        self.sweep = None;
        self.queued = false;
        self.disabled_ns = None;
        self.busy_until_ns = 0;
        self.queue.clear();
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
}

/// What an MTB3 says when its stack was full: an empty frame `0x700 | board << 4 | 5` (docs/protocols.md,
/// "MTB3 firmware").
fn overflow_notice(address: u8) -> Option<CanFrame> {
    CanFrame::standard(0x700 | u16::from(address & 15) << 4 | 5, &[]).ok()
}
