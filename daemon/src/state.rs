//! What the control thread knows of the hand and of who is shown it, and what it can ask of the other
//! threads.

use crate::clients::{Asker, ChangeLog, Places, Reports};
use crate::joints::{Hold, Holders, NotDone, Releases, ServoRequest, ServosRequest, Told};
use crate::recent::Recent;
use crate::snapshot::Snapshot;
use crate::tick::{Command, PipelineClock, Shared};
use std::cell::{Cell, Ref, RefCell};
use std::rc::Rc;
use std::sync::atomic::Ordering;
use std::sync::{Arc, mpsc};
use std::time::{Duration, Instant};
use taxel_config::Config;
use taxel_diagnose::{JointsView, NotReloaded, Problems, Severity, Starting};
use taxel_engine::TickMode;
use taxel_joints::JointReader;
use taxel_serve::{Roster, ServerHandle};
use taxel_skin::{BoardState, BoardsMode};
use taxel_wire::{Event, EventKind, MAX_MARK};

/// The thread that sends images answers within this time, or is stuck.
const ROSTER_PATIENCE: Duration = Duration::from_secs(1);

/// The hand as the control thread sees it. Lives on that thread alone.
pub(crate) struct State {
    pub(crate) config: Config,
    pub(crate) shared: Arc<Shared>,
    /// Subscribers, and what they are given.
    pub(crate) server: ServerHandle,
    /// Who was connected when it was asked last.
    roster: RefCell<Roster>,
    /// The times of the last minute.
    pub(crate) recent: RefCell<Recent>,
    /// What is wrong with buses, boards and joints.
    pub(crate) problems: RefCell<Problems>,
    /// Why the configuration that was read last is not the one that runs.
    pub(crate) reload_refused: RefCell<Option<NotReloaded>>,
    /// The sockets that nobody can connect to, and why.
    pub(crate) sockets_lost: RefCell<Option<String>>,
    /// Of each bus, the process of another taxeld that reads it, in words.
    pub(crate) other_daemons: RefCell<Vec<Option<String>>>,
    /// Who is connected to the socket that only tells, and to the one for changes.
    pub(crate) looking: Rc<Places>,
    pub(crate) changing: Rc<Places>,
    /// Says in the log who has changed something.
    pub(crate) changes: ChangeLog,
    /// Replies to `status`.
    pub(crate) reports: Reports,
    /// Motors that are to be off and were not confirmed to be.
    releases: Releases,
    /// Who holds which motors.
    holders: Holders,
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
        server: ServerHandle,
        shared: Arc<Shared>,
        clock: PipelineClock,
        commands: mpsc::SyncSender<Command>,
        joint_reader: Option<JointReader>,
        most_clients: usize,
    ) -> Self {
        Self {
            clock,
            shared,
            server,
            roster: RefCell::default(),
            recent: RefCell::default(),
            problems: RefCell::default(),
            reload_refused: RefCell::default(),
            sockets_lost: RefCell::default(),
            other_daemons: RefCell::default(),
            looking: Rc::new(Places::new(most_clients)),
            changing: Rc::new(Places::new(most_clients)),
            changes: ChangeLog::default(),
            reports: Reports::default(),
            releases: Releases::default(),
            holders: Holders::default(),
            commands,
            joint_reader,
            started: Instant::now(),
            rate: Cell::new(Rate::new()),
            joint_rate: Cell::new(Rate::new()),
            config,
        }
    }

    /// Measures the baseline anew; the hand must not be touched meanwhile. Returns how many taxels were in contact in the
    /// newest frame before.
    pub(crate) fn rezero(&self) -> Result<usize, String> {
        let contacts = {
            let snapshot = self.shared.snapshot.lock().unwrap_or_else(|e| e.into_inner());
            snapshot.contacts
        };
        self.command(Command::Rezero).map(|()| contacts)
    }

    /// Lets every display go, or takes up again.
    pub(crate) fn pause(&self, paused: bool) -> Result<(), String> {
        self.command(Command::Pause(paused))
    }

    /// Has a servo told something for a client, whose motors are noted in `hold`.
    pub(crate) async fn write(&self, request: &ServoRequest, hold: &Hold<'_>) -> Result<Told, NotDone> {
        crate::joints::write(self.config.joints.as_ref(), hold, request).await
    }

    /// Has a servo's motor switched off for a client that does not wait for it.
    pub(crate) fn release(&self, request: &ServoRequest, hold: &Hold<'_>) -> Result<(), String> {
        crate::joints::release(self.config.joints.as_ref(), hold, request)
    }

    /// Has several servos told something at once for a client.
    pub(crate) async fn write_together(
        &self,
        request: &ServosRequest,
        hold: &Hold<'_>,
    ) -> Result<Told, NotDone> {
        crate::joints::write_together(self.config.joints.as_ref(), hold, request).await
    }

    /// For the motors that a client holds.
    pub(crate) fn hold(&self, asker: Asker) -> Hold<'_> {
        Hold::new(self.joint_reader.as_ref(), &self.releases, &self.holders, asker)
    }

    /// What has become of motors that were to be off: sentences for the log.
    pub(crate) fn released(&self) -> Vec<(Option<Severity>, String)> {
        let servos = self
            .joint_reader
            .as_ref()
            .and_then(|reader| reader.servos.as_ref());
        servos.map_or_else(Vec::new, |servos| self.releases.news(servos))
    }

    /// Asks who is connected now; says whether the thread that sends images has answered.
    pub(crate) async fn call_roster(&self) -> bool {
        match tokio::time::timeout(ROSTER_PATIENCE, self.server.roster()).await {
            Ok(Some(roster)) => {
                self.roster.replace(roster);
                true
            }
            _ => false,
        }
    }

    /// Who was connected when it was asked last.
    pub(crate) fn roster(&self) -> Ref<'_, Roster> {
        self.roster.borrow()
    }

    /// Tells every subscriber what somebody marks at this instant, and returns the number of the
    /// newest frame and the instant, nanoseconds.
    pub(crate) fn mark(&self, text: &str) -> Result<(u64, u64), String> {
        if text.is_empty() || text.len() > MAX_MARK {
            return Err(format!(
                "a mark has 1 to {MAX_MARK} bytes of text; this one has {}",
                text.len()
            ));
        }
        // It is told on terminals.
        if text.contains(char::is_control) {
            return Err(
                "a mark is one line of text; this one has a line break or another control character".into(),
            );
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
                .and_then(|reader| reader.servos.as_ref())
                .map(|servos| (servos.snapshot(), servos.port())),
            analogue: (self.joint_reader.as_ref())
                .and_then(|reader| Some(reader.analogue.as_ref()?.snapshot())),
        })
    }

    /// What the tick thread has told last.
    pub(crate) fn snapshot(&self) -> Snapshot {
        let snapshot = self.shared.snapshot.lock();
        snapshot.unwrap_or_else(|e| e.into_inner()).clone()
    }

    /// What is done about boards that are silent.
    pub(crate) fn starting(&self) -> Starting {
        match self.config.boards.mode {
            BoardsMode::Passive => Starting::ByOthers,
            BoardsMode::FreeRunning | BoardsMode::Triggered => Starting::Repeated,
        }
    }

    /// Seconds since the start.
    pub(crate) fn uptime_s(&self) -> f64 {
        self.started.elapsed().as_secs_f64()
    }

    /// When images are made, in a word.
    pub(crate) fn tick_mode(&self) -> &'static str {
        match self.config.tick.mode {
            TickMode::Sweep => "sweep",
            TickMode::Timer => "timer",
        }
    }

    /// One line for `systemctl status` and the log.
    pub(crate) fn summary(&self) -> String {
        let (images, overruns, missing, faulty, calibrating, recent, links, boards, lost, joints) = {
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
            let recent = self.recent.borrow().status(&s, &self.roster());
            (
                s.images,
                s.overruns,
                s.missing,
                s.faulty,
                s.force.calibrating,
                recent,
                links,
                alive,
                lost,
                crate::joints::summary(&s.joints),
            )
        };
        let rate = self.rate_hz(images);
        let mode = self.tick_mode();
        format!(
            "{rate:.1} Hz ({mode}), tick p99 {:.2} ms, sent p99 {:.2} ms, {overruns} overruns, {}, {lost} lost, {boards}/{} boards, \
             {missing} missing, {faulty} faulty{joints}, {} subscribers{}{}",
            recent.lateness_us.p99 / 1e3,
            recent.age_us.p99 / 1e3,
            links.join(", "),
            self.config.layout.modules.len() - self.config.layout.without_board().count(),
            self.roster().subscribers(),
            (self.problems.borrow().summary()).map_or(String::new(), |problems| format!(", {problems}")),
            if calibrating {
                ", calibrating: do not touch the hand"
            } else {
                ""
            },
        )
    }

    /// Images per second over the last second or so.
    pub(crate) fn rate_hz(&self, images: u64) -> f64 {
        Rate::update(&self.rate, images)
    }

    /// Looks at the joints' rate, so that the status has that of the last second however seldom it
    /// is asked for.
    pub(crate) fn count_joints(&self, view: &JointsView) -> f64 {
        Rate::update(&self.joint_rate, view.cycles())
    }

    /// Sign of life of the tick thread.
    pub(crate) fn heartbeat(&self) -> u64 {
        self.shared.heartbeat.load(Ordering::Relaxed)
    }
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
