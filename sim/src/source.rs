//! A simulated bus as a CAN source, in real time.

use crate::bus::Bus;
use crate::random::bits;
use crate::scene::{Scene, SceneError};
use crate::simulator::Simulator;
use taxel_can::{CanFrame, CanSource, Received, SendError, SourceCounters, Wakeup};
use taxel_skin::Layout;

/// Random numbers of delays, one stream per bus.
const JITTER_STREAM: u64 = 0x6A69;

/// How a [`SimSource`] plays its scene.
#[derive(Debug, Clone, Copy)]
pub struct SimOptions {
    /// The caller's time at which the scene begins, nanoseconds.
    pub start_ns: u64,
    /// Seed; the scene's own where `None`. Every bus of one hand needs the same.
    pub seed: Option<u64>,
    /// Boards stream without a start command, as if somebody else had given it.
    pub autostart: bool,
    /// Play the scene again and again; otherwise the source is finished at its end.
    pub looping: bool,
    /// Most that a frame's receive time is late, nanoseconds, drawn evenly from 0; as through a USB adapter.
    pub jitter_ns: u64,
    /// Least time between two wake-ups, nanoseconds. Frames wait for the wake-up and keep the time
    /// at which they ended, so this is latency against load on the machine.
    pub coalesce_ns: u64,
}

impl Default for SimOptions {
    /// From time 0, with the scene's seed, waiting for start commands, again and again, without
    /// jitter, with at most 2,000 wake-ups a second.
    fn default() -> Self {
        Self {
            start_ns: 0,
            seed: None,
            autostart: false,
            looping: true,
            jitter_ns: 0,
            coalesce_ns: 500_000,
        }
    }
}

/// One bus of a simulated hand. Commands sent to it reach the boards.
#[derive(Debug)]
pub struct SimSource {
    bus: Bus,
    index: u8,
    seed: u64,
    start_ns: u64,
    jitter_ns: u64,
    coalesce_ns: u64,
    /// A frame that is on its way through the adapter.
    pending: Option<Received>,
    last_frame_ns: u64,
    last_receive_ns: u64,
    popped: u64,
    counters: SourceCounters,
}

impl SimSource {
    /// Opens bus `bus` of the layout in a scene; [`SceneError::Layout`] where the layout has no such bus.
    pub fn new(scene: &Scene, layout: &Layout, bus: u8, options: SimOptions) -> Result<Self, SceneError> {
        let missing = || SceneError::Layout {
            layout: layout.name.clone(),
            problem: format!("it has {} buses; there is no bus {bus}", layout.buses.len()),
        };
        if bus as usize >= layout.buses.len() {
            return Err(missing());
        }
        let seed = options.seed.unwrap_or(scene.seed);
        let simulator = Simulator::with_buses(scene, layout, seed, options.looping, std::iter::once(bus))?;
        let mut simulated = simulator.into_bus().ok_or_else(missing)?;
        if options.autostart {
            simulated.start_all();
        }
        Ok(Self {
            bus: simulated,
            index: bus,
            seed,
            start_ns: options.start_ns,
            jitter_ns: options.jitter_ns,
            coalesce_ns: options.coalesce_ns,
            pending: None,
            last_frame_ns: 0,
            last_receive_ns: options.start_ns,
            popped: 0,
            counters: SourceCounters::default(),
        })
    }

    /// Opens what `sim:SCENE` names: bus `bus` of the scene on this layout, or on the scene's own,
    /// begun at `start_ns` of the caller's time, and else as [`SimOptions::default`] says.
    pub fn open(scene: &str, layout: Option<&Layout>, bus: u8, start_ns: u64) -> Result<Self, SceneError> {
        let scene = Scene::resolve(scene)?;
        let options = SimOptions {
            start_ns,
            ..SimOptions::default()
        };
        if let Some(layout) = layout {
            return Self::new(&scene, layout, bus, options);
        }
        let own = Layout::resolve(scene.layout()).map_err(|problem| SceneError::Layout {
            layout: scene.layout().into(),
            problem: problem.to_string(),
        })?;
        Self::new(&scene, &own, bus, options)
    }

    /// The next frame with the time at which the adapter hands it over.
    fn next_frame(&mut self, now_ns: u64) -> Option<Received> {
        if self.pending.is_none() {
            let mut received = self.bus.pop(now_ns.checked_sub(self.start_ns)?)?;
            received.t_ns += self.start_ns;
            if self.jitter_ns > 0 {
                let stream = JITTER_STREAM << 32 | u64::from(self.index);
                let delay_ns = bits(self.seed, stream, self.popped) % self.jitter_ns.saturating_add(1);
                received.t_ns = received.t_ns.saturating_add(delay_ns).max(self.last_frame_ns);
            }
            self.popped += 1;
            self.last_frame_ns = received.t_ns;
            self.pending = Some(received);
        }
        self.pending.take_if(|r| r.t_ns <= now_ns)
    }
}

impl CanSource for SimSource {
    fn wakeup(&self) -> Wakeup<'_> {
        let next_ns = match &self.pending {
            Some(received) => Some(received.t_ns),
            None => self.bus.next_event_ns().map(|t| t.saturating_add(self.start_ns)),
        };
        Wakeup {
            fd: None,
            at_ns: next_ns.map(|t| t.max(self.last_receive_ns.saturating_add(self.coalesce_ns))),
        }
    }

    fn receive(&mut self, now_ns: u64, batch: &mut Vec<Received>) -> bool {
        self.last_receive_ns = self.last_receive_ns.max(now_ns);
        while batch.len() < batch.capacity() {
            let Some(received) = self.next_frame(now_ns) else {
                return false;
            };
            self.counters.count(&received.frame);
            batch.push(received);
        }
        true
    }

    /// The frame competes for the bus from the time of the latest `receive` on.
    fn send(&mut self, frame: &CanFrame) -> Result<(), SendError> {
        let sent = self.bus.command(frame, self.last_receive_ns - self.start_ns);
        let result = sent.map_err(|_| SendError::QueueFull);
        self.counters.count_sent(&result);
        result
    }

    fn counters(&self) -> &SourceCounters {
        &self.counters
    }

    fn is_finished(&self) -> bool {
        self.pending.is_none() && self.bus.is_finished()
    }
}
