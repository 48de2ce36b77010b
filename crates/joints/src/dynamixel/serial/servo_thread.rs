//! The thread that reads servos: cycle after cycle, and a port that goes away is opened again.

use super::serial_bus::SerialBus;
use super::shared_servos::Shared;
use crate::dynamixel::bus::{Bus, WriteCommand};
use crate::serial::{PortError, lock};
use crate::synchrony::JointMotion;
use nix::errno::Errno;
use nix::sys::prctl;
use nix::sys::time::TimeSpec;
use nix::time::{ClockId, ClockNanosleepFlags, clock_nanosleep};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use taxel_can::monotonic_ns;

/// Pause before a port is opened again, first and longest.
const FIRST_PAUSE: Duration = Duration::from_millis(50);
const LONGEST_PAUSE: Duration = Duration::from_millis(500);
/// How often a sleeping thread looks whether it shall end.
const LOOK_NS: u64 = 20_000_000;
/// How often the adapter's latency timer is looked at.
const LATENCY_NS: u64 = 1_000_000_000;
/// Between two cycles in which motors are told at the end to be off.
const RELEASE_PAUSE: Duration = Duration::from_millis(1);

/// What an urgent command does while the thread sleeps.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Urgent {
    Wakes,
    /// The port is away.
    Waits,
}

/// The thread, before it runs.
pub(super) struct Thread {
    pub(super) bus: Bus,
    pub(super) path: PathBuf,
    pub(super) baud: u32,
    pub(super) margin_ns: Option<u64>,
    pub(super) period_ns: u64,
    pub(super) shared: Arc<Mutex<Shared>>,
    pub(super) published: Arc<AtomicU64>,
    pub(super) steps: Arc<AtomicU64>,
    pub(super) stop: Arc<AtomicBool>,
    pub(super) urgent: Arc<AtomicBool>,
    pub(super) commands: Vec<(u64, usize, WriteCommand)>,
}

impl Thread {
    /// Runs until it shall end; motors that it has switched on are switched off then.
    pub(super) fn run(mut self) {
        // Wake up on the microsecond, not within the 50 that a thread may oversleep by default.
        let _ = prctl::set_timerslack(1);
        let mut pause = FIRST_PAUSE;
        let mut lost = None;
        while !self.stopped() {
            match SerialBus::open_again(&self.path, self.baud, self.margin_ns, &mut self.bus, lost) {
                Ok(mut port) => {
                    pause = FIRST_PAUSE;
                    lock(&self.shared).port.opened(port.device(), port.latency());
                    if let Err(error) = self.cycles(&mut port) {
                        lost = port.terminal();
                        self.away(&error);
                    }
                }
                Err(error) => self.away(&error),
            }
            self.sleep_until(monotonic_ns() + pause.as_nanos() as u64, Urgent::Waits);
            pause = (2 * pause).min(LONGEST_PAUSE);
        }
        // A motor that could not be told to be off is one of which nobody knows whether it is.
        self.bus.release_motors();
        self.bus.port_lost();
        self.publish();
    }

    /// Cycle after cycle until the port is lost or the thread shall end.
    fn cycles(&mut self, port: &mut SerialBus) -> Result<(), PortError> {
        let mut next_ns = monotonic_ns();
        let mut latency_due_ns = next_ns + LATENCY_NS;
        while !self.stopped() {
            let done = self.cycle(port);
            lock(&self.shared).port.taken_ns = port.taken_ns();
            done?;
            self.publish();
            let now = monotonic_ns();
            if now >= latency_due_ns {
                latency_due_ns = now + LATENCY_NS;
                let latency = port.look_at_latency(&mut self.bus);
                lock(&self.shared).port.latency = Some(latency);
            }
            // A bus that is slower than its rate does not catch up.
            next_ns = (next_ns + self.period_ns).max(monotonic_ns());
            self.sleep_until(next_ns, Urgent::Wakes);
        }
        self.bus.release_motors();
        while self.bus.is_releasing(monotonic_ns()) {
            port.cycle_while(&mut self.bus, |bus| bus.is_releasing(monotonic_ns()))?;
            // Where every servo rests a cycle takes no time.
            std::thread::sleep(RELEASE_PAUSE);
        }
        Ok(())
    }

    /// One cycle; between its requests what became of commands is shown, and what is urgent is taken. It has no more of them once
    /// the thread shall end.
    fn cycle(&mut self, port: &mut SerialBus) -> Result<(), PortError> {
        let Self {
            bus,
            shared,
            stop,
            urgent,
            commands,
            steps,
            ..
        } = self;
        port.cycle_while(bus, |bus| {
            steps.fetch_add(1, Ordering::Relaxed);
            if bus.has_outcomes() {
                // Whoever waits for it does not wait for the rest of the cycle.
                lock(shared).take_servos(bus);
            }
            if urgent.swap(false, Ordering::Acquire) {
                // The rest waits for the end of the cycle, or it might have none.
                let mut shared = lock(shared);
                let is_urgent = |(_, _, command): &&_| *command == WriteCommand::Torque(false);
                let offs = shared.commands.iter().take_while(is_urgent).count();
                commands.extend(shared.commands.drain(..offs));
                drop(shared);
                bus.take(commands);
                commands.clear();
            }
            let stops = stop.load(Ordering::Relaxed);
            if stops {
                bus.hurry();
            }
            !stops
        })
    }

    fn publish(&mut self) {
        self.steps.fetch_add(1, Ordering::Relaxed);
        {
            let mut shared = lock(&self.shared);
            let shared = &mut *shared;
            std::mem::swap(&mut shared.commands, &mut self.commands);
            shared.snapshot.results.copy_from_slice(self.bus.results());
            shared.take_servos(&mut self.bus);
            shared.snapshot.fast = self.bus.fast_state();
            for (joint, result) in self.bus.results().iter().enumerate() {
                if let Ok(reading) = result {
                    shared.history.push(joint, reading.t_ns, reading.angle_rad);
                    let motion = JointMotion {
                        velocity_rad_s: reading.velocity_rad_s as f32,
                        current_a: reading.current_a.map_or(f32::NAN, |current| current as f32),
                    };
                    shared.history.set_motion(joint, motion);
                }
            }
            self.published.fetch_add(1, Ordering::Release);
        }
        self.hand_over();
    }

    fn hand_over(&mut self) {
        self.bus.take(&self.commands);
        self.commands.clear();
    }

    /// The port is away: no command is taken any more, and of those that wait it is told that they are forgotten.
    fn away(&mut self, error: &PortError) {
        {
            let mut shared = lock(&self.shared);
            shared.port.lost(error);
            std::mem::swap(&mut shared.commands, &mut self.commands);
        }
        self.hand_over();
        self.bus.port_lost();
        self.publish();
    }

    fn stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    fn sleep_until(&self, until_ns: u64, urgent: Urgent) {
        let is_called = || urgent == Urgent::Wakes && self.urgent.load(Ordering::Relaxed);
        while !self.stopped() && !is_called() {
            let now = monotonic_ns();
            if now >= until_ns {
                return;
            }
            let t = until_ns.min(now + LOOK_NS);
            let spec = TimeSpec::from(Duration::from_nanos(t));
            match clock_nanosleep(
                ClockId::CLOCK_MONOTONIC,
                ClockNanosleepFlags::TIMER_ABSTIME,
                &spec,
            ) {
                Ok(_) | Err(Errno::EINTR) => {}
                Err(_) => std::thread::sleep(Duration::from_nanos(t - now)),
            }
        }
    }
}
