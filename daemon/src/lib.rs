//! The taxeld daemon as a library: tick thread, sockets and supervision around an engine.
//!
//! `taxeld` is this and a `main`; `taxel demo` runs the same daemon inside its own process, and
//! `taxel compress` runs the same [`taxel_engine::Engine`] without any of the rest.

mod arguments;
mod clients;
mod control;
mod descriptors;
mod gather;
mod image_maker;
mod joints;
pub mod log;
mod out_of_use;
mod realtime;
mod reload;
mod snapshot;
mod sockets;
mod sources;
mod start_error;
mod state;
mod status;
pub mod stdout;
mod supervise;
mod tick;

pub use arguments::Arguments;
pub use sources::open_array;
pub use start_error::{StartError, check, left_to_service};
pub use taxel_config::{self as config, Config, ConfigError};
pub use taxel_serve::SocketPathError;

use crate::descriptors::Descriptors;
use crate::image_maker::{ImageMaker, check_profile};
use crate::snapshot::Snapshot;
use crate::sockets::{Sockets, Which};
use crate::state::State;
use crate::tick::{PipelineClock, Shared, TickThread};
use std::rc::Rc;
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, mpsc};
use std::thread::JoinHandle;
use taxel_can::monotonic_ns;
use taxel_engine::Engine;
use taxel_joints::JointReader;
use taxel_serve::{Limits, Server, ServerSeed};
use taxel_wire::Clock;
use tokio::net::UnixListener;
use tokio::sync::oneshot;
use tokio_seqpacket::UnixSeqpacketListener;

/// A running daemon. Dropping it stops it.
#[derive(Debug)]
pub struct Daemon {
    shared: Arc<Shared>,
    tick: Option<JoinHandle<()>>,
    images: Option<JoinHandle<()>>,
    control: Option<JoinHandle<()>>,
    /// The threads that read joints.
    joints: Option<JointReader>,
    /// Dropped to end the control thread, which ends that of the images with it.
    stop: Option<oneshot::Sender<()>>,
    /// Configurations to be taken up by the control thread.
    reload: tokio::sync::mpsc::UnboundedSender<reload::Reread>,
    /// Gone when nobody serves any more.
    _sockets: Arc<Mutex<Sockets>>,
}

impl Daemon {
    /// Opens the buses and sockets of `config` and starts.
    ///
    /// An interface that does not exist yet is no error: the daemon waits for it. When this
    /// returns, subscribers can connect.
    pub fn start(config: Config) -> Result<Self, StartError> {
        let layout = &config.layout;
        check_profile(layout, &config.profile).map_err(StartError::ProfileUnfit)?;
        let system = |what| {
            move |error: nix::Error| StartError::System {
                what,
                error: error.into(),
            }
        };
        if let Some(sentence) = config.unread_joints() {
            tracing::warn!("{sentence}");
        }
        let mut sockets = Sockets::take(&config)?;
        let listen = |error| StartError::System {
            what: "listen on a socket",
            error,
        };
        let control = sockets.listen(Which::Control)?;
        let status = sockets.listen(Which::Status)?;

        let recorded = sources::are_recorded(&config);
        let clock = PipelineClock {
            offset_ns: if recorded { monotonic_ns() } else { 0 },
            live: !recorded,
        };
        // A recording's time starts at exactly zero, or its images would bear other times in every run.
        let start_ns = if recorded { 0 } else { monotonic_ns() };
        let sources = sources::open(&config, start_ns)?;
        let (commands, obeyed) = mpsc::sync_channel(tick::COMMANDS);
        let shared = Arc::new(Shared {
            stop: false.into(),
            heartbeat: 0.into(),
            finished: false.into(),
            snapshot: Mutex::new(Snapshot::new(
                layout.buses.len(),
                layout.modules.len(),
                layout.len(),
                config
                    .joints
                    .as_ref()
                    .map_or(0, |joints| joints.joint_names().len()),
            )),
            wake: nix::sys::eventfd::EventFd::from_flags(
                nix::sys::eventfd::EfdFlags::EFD_NONBLOCK | nix::sys::eventfd::EfdFlags::EFD_CLOEXEC,
            )
            .map_err(system("make an eventfd"))?,
        });
        let joint_reader = start_joint_reader(&config)?;
        let joints = joint_reader.clone();
        let engine = Engine::new(&config.engine(joint_reader.is_some())?, start_ns)?;
        let live = if recorded {
            Clock::Recording
        } else {
            Clock::Monotonic
        };
        let Descriptors { subscribers, clients } = Descriptors::take(config.socket.max_subscribers.into());
        let limits = Limits {
            max_subscribers: subscribers,
            stall_ms: config.socket.stall_ms,
        };
        let maker = ImageMaker::new(&config, live, shared.clone());
        let wake = {
            let shared = shared.clone();
            move || {
                let _ = shared.wake.write(1);
            }
        };
        let (seed, outputs) = ServerSeed::new(maker, limits, config.profiles, config.profile.clone(), wake)
            .map_err(StartError::Profile)?;
        let thread = TickThread {
            engine,
            joint_reader: joint_reader.clone(),
            joints_seen: [0; JointReader::SOURCES],
            outputs,
            clock,
            commands: obeyed,
            shared: shared.clone(),
            gather: gather::Gather::new(&config.tick),
            sources,
        };

        let realtime = config.realtime;
        if realtime.lock_memory
            && let Err(error) = realtime::lock_memory()
        {
            tracing::warn!(%error, "memory is not locked; LimitMEMLOCK=infinity in the unit allows it");
        }
        let spawn = |error| StartError::System {
            what: "start a thread",
            error,
        };
        let tick = std::thread::Builder::new()
            .name("tick".into())
            .spawn(move || {
                if realtime.priority > 0
                    && let Err(error) = realtime::set_fifo(realtime.priority)
                {
                    tracing::info!(%error, "the tick thread has no real-time priority; LimitRTPRIO=20 in the unit allows it");
                }
                thread.run();
            })
            .map_err(spawn)?;

        // Sending images must not wait for an answer to somebody, so each has a thread.
        let server = seed.handle();
        let (ready, is_ready) = mpsc::channel();
        let (stop_images, stopped) = oneshot::channel::<()>();
        let images = sockets.listen(Which::Images)?;
        let images = serving_thread("images", ready.clone(), async move || {
            let images = UnixSeqpacketListener::try_from(images).map_err(listen)?;
            // Below the tick thread and that of the joints; the former has said why, if it is refused.
            let priority = realtime.priority.saturating_sub(2);
            if priority > 0 {
                let _ = realtime::set_fifo(priority);
            }
            Ok(async move {
                tokio::select! {
                    _ = stopped => {}
                    () = Server::new(seed).serve(images) => {}
                }
            })
        })?;
        let (stop, stopped) = oneshot::channel();
        let (reload, changed) = tokio::sync::mpsc::unbounded_channel();
        let sockets = Arc::new(Mutex::new(sockets));
        let control = {
            let (shared, sockets) = (shared.clone(), sockets.clone());
            serving_thread("control", ready, async move || {
                let control = UnixListener::from_std(control.into()).map_err(listen)?;
                let status = UnixListener::from_std(status.into()).map_err(listen)?;
                // Not FIFO: what clients ask of it may take long. But torque off waits for no compiler.
                if realtime.priority > 0 {
                    let _ = realtime::set_nice();
                }
                Ok(async move {
                    let _stop_images = stop_images;
                    let state = Rc::new(State::new(
                        config,
                        server,
                        shared,
                        clock,
                        commands,
                        joint_reader,
                        clients,
                    ));
                    tokio::task::spawn_local(sockets::serve(sockets, control, status, state.clone()));
                    tokio::task::spawn_local(reload::take_up(changed, state.clone()));
                    tokio::select! {
                        _ = stopped => {}
                        () = supervise::watch(state) => {}
                    }
                })
            })?
        };
        let daemon = Self {
            shared,
            tick: Some(tick),
            images: Some(images),
            control: Some(control),
            joints,
            stop: Some(stop),
            reload,
            _sockets: sockets,
        };
        for _ in [&daemon.images, &daemon.control] {
            is_ready.recv().unwrap_or_else(|_| {
                let error = std::io::Error::other("a thread ended at once");
                Err(StartError::System { what: "serve", error })
            })?;
        }
        Ok(daemon)
    }

    /// Whether it still works: false once every recording has been played to its end and the last
    /// image was sent, or a thread has died.
    pub fn is_running(&self) -> bool {
        let runs = |thread: &Option<JoinHandle<()>>| thread.as_ref().is_some_and(|t| !t.is_finished());
        // At the end of the recordings the tick thread ends first, and the control thread when
        // images have reached their subscribers.
        let finished = self.shared.finished.load(Ordering::Acquire);
        (finished || runs(&self.tick)) && runs(&self.images) && runs(&self.control)
    }

    /// Reads the configuration again by `read`, here and now, and takes up what can be changed while the hand is read, the
    /// display profile; says in the log what cannot. No subscriber is let go. Where the configuration cannot be read, even
    /// where `read` panics, that is a problem until another one is taken up.
    pub fn reload(&self, read: impl FnOnce() -> Result<Config, ConfigError>) {
        let _ = self.reload.send(reload::reread(read));
    }

    /// Switches off the motors that were switched on, stops the boards, lets every subscriber go, and removes the sockets.
    ///
    /// Returns an error where a thread panicked, which is a fault of the program, or is left behind.
    pub fn stop(mut self) -> Result<(), String> {
        self.shut_down()
    }

    fn shut_down(&mut self) -> Result<(), String> {
        // Motors are switched off whatever the other threads do meanwhile.
        if let Some(joints) = &self.joints {
            joints.stop();
        }
        self.shared.stop.store(true, Ordering::Relaxed);
        let _ = self.shared.wake.write(1);
        let tick = self.tick.take().map(JoinHandle::join);
        drop(self.stop.take());
        let control = self.control.take().map(JoinHandle::join);
        let images = self.images.take().map(JoinHandle::join);
        let joints = self.joints.take().map_or(Ok(()), |joints| {
            let ended = joints.end();
            for name in joints.motors_not_off() {
                tracing::error!(
                    "joints: taxeld ends and nobody knows whether the motor of {name} is off; one that taxeld has switched on \
                     stops by its own watchdog"
                );
            }
            ended
        });
        match (tick, images, control) {
            (Some(Err(_)), ..) => Err("the tick thread panicked".into()),
            (_, Some(Err(_)), _) => Err("the thread that sends images panicked".into()),
            (.., Some(Err(_))) => Err("the control thread panicked".into()),
            _ => joints.map_err(|error| error.to_string()),
        }
    }
}

impl Drop for Daemon {
    fn drop(&mut self) {
        let _ = self.shut_down();
    }
}

/// Starts a thread that runs `main` in a runtime of its own: first what may fail, whose outcome it
/// tells, then what that gives, to its end.
fn serving_thread<Run: Future<Output = ()>>(
    name: &'static str,
    ready: mpsc::Sender<Result<(), StartError>>,
    main: impl AsyncFnOnce() -> Result<Run, StartError> + Send + 'static,
) -> Result<JoinHandle<()>, StartError> {
    let system = |what| move |error| StartError::System { what, error };
    let run = move || {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
        let runtime = match runtime {
            Ok(runtime) => runtime,
            Err(error) => {
                let _ = ready.send(Err(system("start a runtime")(error)));
                return;
            }
        };
        let local = tokio::task::LocalSet::new();
        runtime.block_on(local.run_until(async move {
            match main().await {
                Ok(run) => {
                    let _ = ready.send(Ok(()));
                    run.await;
                }
                Err(error) => {
                    let _ = ready.send(Err(error));
                }
            }
        }));
    };
    let thread = std::thread::Builder::new().name(name.into());
    thread.spawn(run).map_err(system("start a thread"))
}

/// Starts the thread that reads joints, one step of priority below the tick thread, where their
/// source needs one.
fn start_joint_reader(config: &Config) -> Result<Option<JointReader>, StartError> {
    let Some(joints) = &config.joints else {
        return Ok(None);
    };
    let priority = config.realtime.priority.saturating_sub(1);
    Ok(JointReader::start(joints, move || {
        // The tick thread has said why, if it is refused.
        if priority > 0 {
            let _ = realtime::set_fifo(priority);
        }
    })?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fmt::Write;
    use std::path::Path;
    use std::time::{Duration, Instant};
    use taxel_joints::{AllegroConfig, AllegroSource, JointSource, JointsConfig};
    use taxel_skin::Layout;

    const PATIENCE: Duration = Duration::from_secs(20);

    fn config(folder: &Path, skin: &str) -> Config {
        let layout = Layout::builtin("allegro-uskin-15").unwrap();
        let sources = layout.buses.iter().map(|_| skin.parse().unwrap()).collect();
        let mut config = Config::new(layout, sources);
        config.socket.images = folder.join("images.sock");
        config.socket.control = folder.join("control.sock");
        config
    }

    /// A recording of one finger of an Allegro hand with a frame per millisecond.
    fn recorded_hand(folder: &Path, ms: u32) -> String {
        let mut text = String::new();
        for t_ms in 0..ms {
            let (s, ms) = (t_ms / 1000, t_ms % 1000);
            writeln!(text, "({s}.{ms:03}000) can2 080#0000000000000000").unwrap();
        }
        let path = folder.join("hand.log");
        std::fs::write(&path, text).unwrap();
        format!("log:{}", path.display())
    }

    #[test]
    fn a_hand_whose_frames_are_due_during_a_pause_does_not_keep_the_tick_thread_spinning() {
        let folder = tempfile::tempdir().unwrap();
        let mut config = config(folder.path(), "sim:idle");
        config.joints = Some(JointsConfig::new(JointSource::Allegro(AllegroSource {
            bus: recorded_hand(folder.path(), 60_000).parse().unwrap(),
            hand: Some(AllegroConfig::new(4)),
        })));
        let rate_hz = config.tick.rate_hz;
        let daemon = Daemon::start(config).unwrap();
        let seen = || {
            let images = daemon.shared.snapshot.lock().unwrap().images;
            (images, daemon.shared.heartbeat.load(Ordering::Relaxed))
        };
        let (first, rounds) = seen();
        let deadline = Instant::now() + PATIENCE;
        while seen().0 < first + 30 {
            assert!(Instant::now() < deadline, "{:?} images", seen());
            std::thread::sleep(Duration::from_millis(10));
        }
        let (images, after) = seen();
        // Pauses are 10 ms, so that there are 4 to an image, and two rounds to a pause are plenty.
        let per_image = (after - rounds) as f64 / (images - first) as f64;
        let most = 4.0 * 100.0 / rate_hz;
        assert!(per_image < most, "{per_image} rounds per image");
        daemon.stop().unwrap();
    }

    #[test]
    fn a_daemon_runs_until_subscribers_had_their_time_to_take_the_last_image() {
        let folder = tempfile::tempdir().unwrap();
        let recording = recorded_hand(folder.path(), 50);
        let daemon = Daemon::start(config(folder.path(), &recording)).unwrap();
        let deadline = Instant::now() + PATIENCE;
        while daemon.is_running() {
            assert!(Instant::now() < deadline, "still running");
            std::thread::yield_now();
        }
        assert!(daemon.shared.finished.load(Ordering::Acquire));
        // The control thread ends of itself, and that of the images with it.
        let ended = |thread: &Option<JoinHandle<()>>| thread.as_ref().unwrap().is_finished();
        while !(ended(&daemon.control) && ended(&daemon.images)) {
            assert!(Instant::now() < deadline, "a thread goes on");
            std::thread::yield_now();
        }
        daemon.stop().unwrap();
    }
}
