//! A daemon that runs: started, asked whether it goes on, told to read its configuration again, stopped.

use crate::check::check_boards;
use crate::image_maker::check_profile;
use crate::sockets::{Listeners, Sockets};
use crate::start::Pipeline;
use crate::state::State;
use crate::tick::Shared;
use crate::{
    Config, ConfigError, StartError, claims, descriptors, realtime, reload, service_manager, sockets, start,
    supervise,
};
use std::rc::Rc;
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, mpsc};
use std::thread::JoinHandle;
use taxel_joints::JointReader;
use tokio::sync::{oneshot, watch};

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
    reload: tokio::sync::mpsc::UnboundedSender<reload::Reading>,
    /// The thread that reads one, or has.
    reading: Option<JoinHandle<()>>,
    /// Gone when nobody serves any more.
    _sockets: Arc<Mutex<Sockets>>,
}

impl Daemon {
    /// Opens the buses and sockets of `config` and starts.
    ///
    /// An interface that does not exist yet is no error: the daemon waits for it. When this
    /// returns, subscribers can connect.
    pub fn start(config: Config) -> Result<Self, StartError> {
        check_boards(&config)?;
        check_profile(&config.layout, &config.profile).map_err(StartError::ProfileUnfit)?;
        descriptors::raise_limit();
        if let Some(sentence) = config.boardless_modules() {
            tracing::warn!("{sentence}");
        }
        if let Some(sentence) = config.unread_joints() {
            tracing::warn!("{sentence}");
        }
        let mut sockets = Sockets::take(&config)?;
        let listeners = sockets.listen()?;
        let shared = start::shared(&config)?;
        Self::start_at(config, sockets, listeners, shared)
    }

    /// Starts with sockets that listen.
    fn start_at(
        config: Config,
        sockets: Sockets,
        listeners: Listeners,
        shared: Arc<Shared>,
    ) -> Result<Self, StartError> {
        let sockets = Arc::new(Mutex::new(sockets));
        let (reload, changed) = tokio::sync::mpsc::unbounded_channel();
        // Dropped where a step fails, it ends what the steps before have begun: boards are not left started.
        let mut daemon = Self {
            shared: shared.clone(),
            tick: None,
            images: None,
            control: None,
            joints: None,
            stop: None,
            reload,
            reading: None,
            _sockets: sockets.clone(),
        };
        let realtime = config.realtime;
        let Pipeline {
            thread,
            arrays,
            seed,
            clock,
            commands,
            clients,
        } = start::open_pipeline(&config, &shared)?;
        sockets::lock(&sockets).arrays = arrays;
        let joint_reader = thread.joint_reader.clone();
        daemon.joints = joint_reader.clone();
        if realtime.lock_memory
            && let Err(error) = realtime::lock_memory()
        {
            tracing::warn!(%error, "memory is not locked; LimitMEMLOCK=infinity in the unit allows it");
        }
        daemon.tick = Some(start::spawn_tick(thread, realtime)?);

        // Sending images must not wait for an answer to somebody, so each has a thread.
        let server = seed.handle();
        let (ready, is_ready) = mpsc::channel();
        let (go, going) = watch::channel(false);
        let (stop_images, images_stopped) = oneshot::channel();
        daemon.images = Some(start::spawn_images(
            listeners.images,
            seed,
            realtime,
            images_stopped,
            (ready.clone(), going.clone()),
        )?);
        let (stop, stopped) = oneshot::channel();
        daemon.stop = Some(stop);
        let state = move || State::new(config, server, shared, clock, commands, joint_reader, clients);
        daemon.control = Some(start::spawn_control(
            [listeners.control, listeners.status],
            realtime,
            (ready, going),
            async move |control, status| {
                let _stop_images = stop_images;
                let state = Rc::new(state());
                tokio::task::spawn_local(sockets::serve(sockets, control, status, state.clone()));
                tokio::task::spawn_local(reload::take_up(changed, state.clone()));
                tokio::task::spawn_local(claims::watch(state.clone()));
                tokio::select! {
                    _ = stopped => {}
                    () = supervise::watch(state) => {}
                }
            },
        )?);
        for _ in [&daemon.images, &daemon.control] {
            is_ready.recv().unwrap_or_else(|_| {
                let error = std::io::Error::other("a thread ended at once");
                Err(StartError::System { what: "serve", error })
            })?;
        }
        // Whoever waits to be let in, as the displays do after a restart, is not counted.
        descriptors::check()?;
        go.send_replace(true);
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

    /// Reads the configuration again by `read`, on a thread of its own, and takes up what can be changed while the hand is
    /// read, the display profile; says in the log what cannot. No subscriber is let go. Where the configuration cannot be
    /// read, even where `read` panics or does not return, that is a problem until another one is taken up.
    pub fn reload(&mut self, read: impl FnOnce() -> Result<Config, ConfigError> + Send + 'static) {
        let (sender, reading) = oneshot::channel();
        let _ = self.reload.send(reading);
        let thread = std::thread::Builder::new().name("reload".into());
        self.reading = thread.spawn(move || drop(sender.send(reload::reread(read)))).ok();
    }

    /// Whether a configuration is being read again: who waits for the end of that never has two threads that hang.
    pub fn is_reloading(&self) -> bool {
        self.reading.as_ref().is_some_and(|thread| !thread.is_finished())
    }

    /// Switches off the motors that were switched on, stops the boards, lets every subscriber go, and removes the sockets.
    ///
    /// Returns an error where a thread panicked, which is a fault of the program, or is left behind.
    pub fn stop(mut self) -> Result<(), String> {
        self.shut_down()
    }

    fn shut_down(&mut self) -> Result<(), String> {
        // Motors are switched off whatever the other threads do meanwhile.
        let joints = self.joints.take();
        let ran = joints.as_ref().map_or_else(Vec::new, |joints| {
            let ran = joints.motors_on();
            joints.stop();
            ran
        });
        self.shared.stop.store(true, Ordering::Relaxed);
        let _ = self.shared.wake.write(1);
        // Before what may take long: its watchdog, which nobody feeds any more, is then no end.
        if self.stop.is_some() {
            service_manager::tell("STOPPING=1");
        }
        let tick = self.tick.take().map(JoinHandle::join);
        drop(self.stop.take());
        let control = self.control.take().map(JoinHandle::join);
        let images = self.images.take().map(JoinHandle::join);
        let joints = joints.as_ref().map_or(Ok(()), |joints| {
            let ended = joints.end();
            let (on, not_off) = (joints.motors_on(), joints.motors_not_off());
            for name in ran.iter().filter(|name| !on.contains(name) && !not_off.contains(name)) {
                tracing::info!("joints: torque of {name} is off, since taxeld ends");
            }
            for name in not_off {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sockets::Which;
    use std::fmt::Write;
    use std::path::Path;
    use std::time::{Duration, Instant};
    use taxel_joints::{AllegroConfig, AllegroSource, JointSource, JointsConfig};
    use taxel_skin::Layout;

    const PATIENCE: Duration = Duration::from_secs(200);

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
    fn a_start_that_fails_at_its_end_leaves_no_thread_behind() {
        let spoilt = || std::fs::File::open("/dev/null").unwrap().into();
        for which in [Which::Images, Which::Control] {
            let folder = tempfile::tempdir().unwrap();
            let config = config(folder.path(), "sim:idle");
            let mut sockets = Sockets::take(&config).unwrap();
            let mut listeners = sockets.listen().unwrap();
            match which {
                Which::Images => listeners.images = spoilt(),
                _ => listeners.control = spoilt(),
            }
            let shared = start::shared(&config).unwrap();
            let started = Daemon::start_at(config, sockets, listeners, shared.clone());
            assert!(matches!(started, Err(StartError::System { .. })), "{started:?}");
            // Whoever still ran would hold it.
            assert_eq!(Arc::strong_count(&shared), 1, "{which:?}");
        }
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
