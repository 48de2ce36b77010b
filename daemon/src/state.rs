//! What the socket thread knows of the hand, and what can be asked of the tick thread.

use crate::config::Config;
use crate::image_maker::ImageMaker;
use crate::joints::{JointsView, ServoRequest};
use crate::problems::{Place, Problems};
use crate::snapshot::Snapshot;
use crate::tick::{Command, PipelineClock, Shared};
use hdrhistogram::Histogram;
use serde_json::{Value, json};
use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::sync::atomic::Ordering;
use std::sync::{Arc, mpsc};
use std::time::Instant;
use taxel_engine::TickMode;
use taxel_hand::Fault;
use taxel_joints::JointReader;
use taxel_serve::{Server, ServerSeed};
use taxel_skin::{BoardState, BoardStatus};
use taxel_wire::{Event, EventKind, MAX_MARK};

/// The hand as the socket thread sees it. Lives on that thread alone.
pub(crate) struct State {
    pub(crate) config: Config,
    pub(crate) shared: Arc<Shared>,
    /// Subscribers, and what they are given.
    pub(crate) server: Rc<Server<ImageMaker>>,
    /// What is wrong with buses, boards and joints.
    pub(crate) problems: RefCell<Problems>,
    clock: PipelineClock,
    commands: mpsc::SyncSender<Command>,
    /// The thread that reads joints, where there is one.
    joint_reader: Option<JointReader>,
    started: Instant,
    rate: Cell<Rate>,
    joint_rate: Cell<Rate>,
}

/// Images, or cycles of the joints, per second over the last second or so.
#[derive(Debug, Clone, Copy)]
struct Rate {
    at: Instant,
    count: u64,
    hz: f64,
}

impl State {
    pub(crate) fn new(
        config: Config,
        seed: ServerSeed<ImageMaker>,
        shared: Arc<Shared>,
        clock: PipelineClock,
        commands: mpsc::SyncSender<Command>,
        joint_reader: Option<JointReader>,
    ) -> Self {
        Self {
            clock,
            shared,
            server: Server::new(seed),
            problems: RefCell::default(),
            commands,
            joint_reader,
            started: Instant::now(),
            rate: Cell::new(Rate::new()),
            joint_rate: Cell::new(Rate::new()),
            config,
        }
    }

    /// Measures the baseline anew; the hand must not be touched meanwhile.
    pub(crate) fn rezero(&self) -> Result<(), String> {
        self.command(Command::Rezero)
    }

    /// Lets every display go, or takes up again.
    pub(crate) fn pause(&self, paused: bool) -> Result<(), String> {
        self.command(Command::Pause(paused))
    }

    /// Has a servo told something.
    pub(crate) async fn write(&self, request: &ServoRequest) -> Result<(), String> {
        crate::joints::write(self.config.joints.as_ref(), self.joint_reader.as_ref(), request).await
    }

    /// Tells every subscriber what somebody marks at this instant, and returns the number of the newest frame and the
    /// instant, nanoseconds.
    pub(crate) fn mark(&self, text: &str) -> Result<(u64, u64), String> {
        if text.is_empty() || text.len() > MAX_MARK {
            return Err(format!(
                "a mark has 1 to {MAX_MARK} bytes of text; this one has {}",
                text.len()
            ));
        }
        let images = {
            let snapshot = self.shared.snapshot.lock().unwrap_or_else(|e| e.into_inner());
            snapshot.images
        };
        let (seq, t_ns) = (images.saturating_sub(1), self.clock.now_ns());
        self.server
            .announce_at(&Event::new(EventKind::Mark, text), seq, t_ns);
        Ok((seq, t_ns))
    }

    fn command(&self, command: Command) -> Result<(), String> {
        crate::tick::command(&self.commands, &self.shared, command)
    }

    /// What is known of the joints; `None` where none are read.
    pub(crate) fn joints(&self, snapshot: &Snapshot) -> Option<JointsView> {
        self.config.joints.as_ref()?;
        Some(JointsView {
            now_ns: snapshot.now_ns,
            tick: snapshot.joints.clone(),
            source: snapshot.joints_source,
            link: snapshot.joints_link,
            servos: (self.joint_reader.as_ref())
                .map(|JointReader::Servos(servos)| (servos.snapshot(), servos.port())),
        })
    }

    /// Everything there is to know, as JSON; the `status` reply of `docs/wire.md`.
    pub(crate) fn status(&self) -> Value {
        let snapshot = self
            .shared
            .snapshot
            .lock()
            .unwrap_or_else(|e| e.into_inner())
            .clone();
        let layout = &self.config.layout;
        let problems = self.problems.borrow();
        let shared_with_joints = (self.config.joints_bus())
            .filter(|bus| bus.shared)
            .map(|bus| usize::from(bus.index));
        let buses: Vec<Value> = (layout.buses.iter().enumerate())
            .zip(&self.config.sources)
            .zip(&snapshot.buses)
            .map(|(((index, name), source), bus)| {
                let boards = (layout.wiring.iter().zip(&snapshot.boards))
                    .filter(|(wiring, _)| usize::from(wiring.bus) == index)
                    .map(|(_, counters)| counters);
                let sum = |count: fn(&BoardStatus) -> u64| boards.clone().map(count).sum::<u64>();
                json!({
                    "name": name,
                    "source": source.to_string(),
                    "link": bus.link.to_string(),
                    "state": bus.source.bus_state.to_string(),
                    "state_changes": bus.source.state_changes,
                    "error_counters": { "tx": bus.source.error_counters[0], "rx": bus.source.error_counters[1] },
                    "frames_hz": bus.load.frames_hz,
                    "load_percent": 100.0 * bus.load.share,
                    "load_percent_most": 100.0 * bus.load.share_most,
                    "problems": problems.kinds(Place::Bus(index)),
                    "received": bus.source.received,
                    "used": sum(|b| b.used),
                    "unknown": bus.decoder.unknown,
                    "not_data": bus.decoder.not_data,
                    "commands": bus.decoder.commands,
                    "joints": if shared_with_joints == Some(index) { snapshot.joints.frames } else { 0 },
                    "partial": bus.decoder.partial,
                    "abandoned": bus.decoder.abandoned,
                    "malformed": sum(|b| b.malformed),
                    "queue_overflows": sum(|b| b.queue_overflows),
                    "duplicate": sum(|b| b.duplicate),
                    "late": sum(|b| b.late),
                    "settling": sum(|b| b.settling),
                    "lost_in_kernel": bus.source.lost_in_kernel,
                    "undecodable": bus.source.undecodable,
                    "reopens": bus.source.reopens,
                    "link_losses": bus.source.link_losses,
                    "sent": bus.source.sent,
                    "send_failures": bus.source.send_failures,
                    "remote": bus.source.remote,
                    "errors": error_frames(&bus.source.errors),
                })
            })
            .collect();
        let boards: Vec<Value> = (layout.boards().zip(&snapshot.boards))
            .map(|((index, module, wiring), b)| {
                json!({
                    "module": module.name,
                    "bus": layout.buses[usize::from(wiring.bus)],
                    "board": wiring.board,
                    "state": b.state.name(),
                    "problems": problems.kinds(Place::Module(index.into())),
                    "used": b.used,
                    "malformed": b.malformed,
                    "queue_overflows": b.queue_overflows,
                    "duplicate": b.duplicate,
                    "late": b.late,
                    "missed": b.missed,
                    "settling": b.settling,
                    "sweeps": b.sweeps,
                    "status_errors": b.status_errors,
                    "restarts": b.restarts,
                    "recalibrations": b.recalibrations,
                    "period_ms": b.period_ns.map(|period| period as f64 / 1e6),
                    "silent_ms": b.last_ns.map(|last| snapshot.now_ns.saturating_sub(last) / 1_000_000),
                })
            })
            .collect();
        let faults: Vec<Value> = (snapshot.force.faults.iter().enumerate())
            .filter(|(_, faults)| !faults.is_empty())
            .map(|(taxel, faults)| {
                let module = layout.module_of(taxel);
                json!({
                    "taxel": taxel,
                    "module": module.name,
                    "k": layout.k[taxel],
                    "reasons": faults.iter().map(Fault::name).collect::<Vec<_>>(),
                })
            })
            .collect();
        let joints = (self.config.joints.as_ref().zip(self.joints(&snapshot))).map(|(config, view)| {
            let hz = Rate::update(&self.joint_rate, view.cycles());
            let kinds = |joint: Option<usize>| problems.kinds(joint.map_or(Place::Joints, Place::Joint));
            crate::joints::status(config, &view, hz, &kinds)
        });
        json!({
            "version": env!("CARGO_PKG_VERSION"),
            "uptime_s": self.started.elapsed().as_secs_f64(),
            "layout": layout.name,
            "tick": { "mode": self.config.tick.mode, "rate_hz": self.config.tick.rate_hz },
            "images": {
                "made": snapshot.images,
                "rate_hz": self.rate_hz(snapshot.images),
                "overruns": snapshot.overruns,
                "unpublished": snapshot.unpublished,
                "latency_us": quantiles(&snapshot.latency_ns),
                "lateness_us": quantiles(&snapshot.lateness_ns),
            },
            "paused": snapshot.paused,
            "calibrating": snapshot.force.calibrating,
            "threshold": snapshot.force.threshold,
            "contacts": snapshot.contacts,
            "missing": snapshot.missing,
            "faulty": snapshot.faulty,
            "profile": self.server.own_profile(),
            "profiles": self.server.profile_status(),
            "profile_budget": self.server.profile_budget(),
            "problems": problems.status(&self.config),
            "buses": buses,
            "boards": boards,
            "joints": joints,
            "faults": faults,
            "subscribers": self.server.subscriber_status(),
        })
    }

    /// One line for `systemctl status` and the log.
    pub(crate) fn summary(&self) -> String {
        let (images, overruns, missing, faulty, calibrating, p99, links, boards, lost, joints) = {
            let s = self.shared.snapshot.lock().unwrap_or_else(|e| e.into_inner());
            let links: Vec<String> = (self.config.layout.buses.iter().zip(&s.buses))
                .map(|(name, bus)| match bus.link {
                    taxel_can::LinkState::Up => format!("{name} up {}", bus.source.bus_state),
                    link => format!("{name} {link}"),
                })
                .collect();
            let alive = s
                .boards
                .iter()
                .filter(|b| b.state == BoardState::Streaming)
                .count();
            let lost: u64 = s.buses.iter().map(|b| b.source.lost_in_kernel).sum();
            let p99 = s.lateness_ns.value_at_quantile(0.99);
            (
                s.images,
                s.overruns,
                s.missing,
                s.faulty,
                s.force.calibrating,
                p99,
                links,
                alive,
                lost,
                crate::joints::summary(&s.joints),
            )
        };
        let rate = self.rate_hz(images);
        let mode = if self.config.tick.mode == TickMode::Sweep {
            "sweep"
        } else {
            "timer"
        };
        format!(
            "{rate:.1} Hz ({mode}), tick p99 {:.2} ms, {overruns} overruns, {}, {lost} lost, {boards}/{} boards, \
             {missing} missing, {faulty} faulty{joints}, {} subscribers{}{}",
            p99 as f64 / 1e6,
            links.join(", "),
            self.config.layout.modules.len(),
            self.server.subscribers(),
            (self.problems.borrow().summary()).map_or(String::new(), |problems| format!(", {problems}")),
            if calibrating {
                ", calibrating: do not touch the hand"
            } else {
                ""
            },
        )
    }

    fn rate_hz(&self, images: u64) -> f64 {
        Rate::update(&self.rate, images)
    }

    /// Looks at the joints' rate, so that the status has that of the last second however seldom it is asked for.
    pub(crate) fn count_joints(&self, view: &JointsView) {
        Rate::update(&self.joint_rate, view.cycles());
    }

    /// Sign of life of the tick thread.
    pub(crate) fn heartbeat(&self) -> u64 {
        self.shared.heartbeat.load(Ordering::Relaxed)
    }
}

/// What a bus's error frames told, of one bus in the `status` reply.
fn error_frames(errors: &taxel_can::ErrorCauses) -> Value {
    json!({
        "frames": errors.frames,
        "tx_timeout": errors.tx_timeout,
        "lost_arbitration": errors.lost_arbitration,
        "controller": errors.controller,
        "controller_overflow": errors.controller_overflow,
        "protocol": errors.protocol,
        "transceiver": errors.transceiver,
        "no_acknowledge": errors.no_acknowledge,
        "bus_off": errors.bus_off,
        "bus_error": errors.bus_error,
        "restarted": errors.restarted,
    })
}

impl Rate {
    fn new() -> Self {
        Self {
            at: Instant::now(),
            count: 0,
            hz: 0.0,
        }
    }

    /// The rate, measured anew where the last time is long enough ago.
    fn update(rate: &Cell<Self>, count: u64) -> f64 {
        let before = rate.get();
        let seconds = before.at.elapsed().as_secs_f64();
        if seconds < 0.5 {
            return before.hz;
        }
        let hz = count.saturating_sub(before.count) as f64 / seconds;
        rate.set(Self {
            at: Instant::now(),
            count,
            hz,
        });
        hz
    }
}

fn quantiles(histogram: &Histogram<u64>) -> Value {
    let us = |ns: u64| ns as f64 / 1000.0;
    json!({
        "p50": us(histogram.value_at_quantile(0.5)),
        "p99": us(histogram.value_at_quantile(0.99)),
        "p999": us(histogram.value_at_quantile(0.999)),
        "max": us(histogram.max()),
    })
}
