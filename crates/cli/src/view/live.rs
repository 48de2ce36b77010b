//! The hand of a running daemon.

use super::recorder::Recorder;
use super::{GLANCE_S, Sheet, Source, lock, look, request_of, summary};
use crate::client::reconnect::{PATIENCE, SAYS_NOTHING};
use crate::client::{control, hands};
use crate::terminal;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use taxel_hand::Profile;
use taxel_playback::interrupt::Interrupt;
use taxel_playback::remarks::Remarks;
use taxel_view::{Action, Heading, Screen, Seen};
use taxel_wire::{ReadError, Subscribe, Subscriber};

/// Images and raw frames asked for, per second: as many as are drawn.
const RATE_HZ: f64 = 20.0;
/// Between two looks whether the daemon is back, or whether a key was pressed.
const LOOK: Duration = Duration::from_millis(300);

/// A connection that is made again, and what is asked of it.
struct Daemon {
    images: PathBuf,
    control: PathBuf,
    seen: Arc<Mutex<Seen>>,
    recorder: Recorder,
    /// The profile of this view alone.
    profile: Mutex<Option<Box<Profile>>>,
    /// Whether it is to be asked for.
    asks: AtomicBool,
    over: AtomicBool,
}

/// Looks at a daemon; its sockets are those of images and of control, where they were named.
pub(super) fn run(
    [socket, control]: [Option<&Path>; 2],
    limit: Option<Duration>,
    sheet: Option<&Sheet<'_>>,
    as_json: bool,
) -> anyhow::Result<()> {
    let images = socket.map_or_else(|| taxeld::config::running_socket("images.sock"), Path::to_owned);
    let control = match (control, socket) {
        (Some(control), _) => control.to_owned(),
        (None, Some(socket)) => socket.with_file_name("control.sock"),
        (None, None) => taxeld::config::running_socket("control.sock"),
    };
    let interrupt = Interrupt::install()?;
    let daemon = Arc::new(Daemon {
        images,
        control,
        seen: Arc::default(),
        recorder: Recorder::default(),
        profile: Mutex::new(None),
        asks: AtomicBool::new(false),
        over: AtomicBool::new(false),
    });
    // Nobody to wait for at the start is an error; later the daemon may come back.
    let subscriber = daemon.connect().map_err(|error| hands::told(error.into()))?;
    let reader = daemon.clone();
    let reader = std::thread::Builder::new()
        .name("reader".into())
        .spawn(move || reader.read(subscriber))?;
    let began_ns = taxel_can::monotonic_ns();
    let glance =
        || interrupt.sleep_until(Instant::now() + limit.unwrap_or(Duration::from_secs_f64(GLANCE_S)));
    let outcome = match sheet {
        Some(sheet) => {
            glance();
            sheet.draw(&daemon.seen, &*daemon, &Screen::new())
        }
        None if terminal::can_draw() && !as_json => {
            let remarks = Remarks::gather();
            let deadline = limit.map(|limit| Instant::now() + limit);
            look(
                &daemon.seen,
                &*daemon,
                Screen::new(),
                &interrupt,
                deadline,
                remarks,
            )
        }
        None => {
            glance();
            let seen = lock(&daemon.seen);
            let name = seen.hello().map_or("taxeld".into(), |hello| hello.daemon.clone());
            let now_ns = taxel_can::monotonic_ns();
            summary::print(&seen, &name, (began_ns, Some(now_ns)), as_json)
        }
    };
    daemon.over.store(true, Ordering::Relaxed);
    let _ = reader.join();
    for line in daemon.recorder.finish() {
        say!("{line}");
    }
    outcome
}

impl Daemon {
    fn connect(&self) -> Result<Subscriber, ReadError> {
        let mut subscriber = Subscriber::connect(&self.images)?;
        self.subscribe(&mut subscriber)?;
        Ok(subscriber)
    }

    fn subscribe(&self, subscriber: &mut Subscriber) -> Result<(), ReadError> {
        self.asks.store(false, Ordering::Relaxed);
        let profile = lock(&self.profile).clone();
        subscriber.subscribe(&Subscribe {
            raw: true,
            status: true,
            max_rate_hz: Some(RATE_HZ),
            profile: profile.map(|profile| *profile),
            ..Subscribe::default()
        })
    }

    /// Takes what the daemon publishes, and waits for it when it is gone, until the view is over.
    fn read(&self, subscriber: Subscriber) {
        let mut subscriber = Some(subscriber);
        let mut since = Instant::now();
        while !self.over.load(Ordering::Relaxed) {
            let failure = match &mut subscriber {
                Some(connected) => self.take(connected, since).err(),
                None => match self.connect() {
                    Ok(connected) => {
                        (subscriber, since) = (Some(connected), Instant::now());
                        None
                    }
                    Err(_) => {
                        std::thread::sleep(LOOK);
                        None
                    }
                },
            };
            match failure {
                None => {}
                Some(error) if error.is_end() => {
                    subscriber = None;
                    lock(&self.seen).set_gone(error.to_string());
                }
                // The next message may be read.
                Some(error) => lock(&self.seen).tell(error.to_string(), taxel_can::monotonic_ns()),
            }
        }
    }

    /// Takes the next message of a daemon that is connected to since then.
    fn take(&self, subscriber: &mut Subscriber, since: Instant) -> Result<(), ReadError> {
        if self.asks.load(Ordering::Relaxed) {
            self.subscribe(subscriber)?;
        }
        let Some(received) = subscriber.next_timeout(LOOK)? else {
            if subscriber.hello().is_none() && since.elapsed() > PATIENCE {
                lock(&self.seen).set_gone(SAYS_NOTHING);
            }
            return Ok(());
        };
        let now_ns = taxel_can::monotonic_ns();
        lock(&self.seen).see(received, now_ns);
        Ok(())
    }

    fn request(&self, request: &Value) -> Option<String> {
        let error = control::request(&self.control, request).err()?;
        Some(match self.control.try_exists() {
            // The daemon is there, whose images are shown: its control socket has another name.
            Ok(false) => format!(
                "there is no control socket at {}; name this daemon's with `taxel view --control PATH`",
                self.control.display()
            ),
            _ => format!("{error:#}"),
        })
    }
}

impl Source for Daemon {
    fn heading(&self, seen: &Seen) -> Heading {
        let Some(hello) = seen.hello() else {
            return Heading {
                name: self.images.display().to_string(),
                ..Heading::default()
            };
        };
        let rate = match hello.rate.hz {
            Some(hz) => format!("{} {hz:.0} Hz", hello.rate.mode),
            None => hello.rate.mode.clone(),
        };
        Heading {
            name: hello.daemon.clone(),
            detail: hello.layout.clone(),
            about: match self.recorder.file() {
                Some(file) => format!("{rate}, recording {file}"),
                None => rate,
            },
        }
    }

    fn now_ns(&self, _: &Seen) -> u64 {
        taxel_can::monotonic_ns()
    }

    fn act(&self, action: Action) -> Option<String> {
        match action {
            Action::Record => self.recorder.toggle(&self.images, &self.seen),
            Action::Profile(profile) => {
                *lock(&self.profile) = profile;
                self.asks.store(true, Ordering::Relaxed);
                None
            }
            action => {
                let refused = self.request(&request_of(&action)?);
                if let (Action::Pause(pause), None) = (action, &refused) {
                    lock(&self.seen).set_paused(pause);
                }
                refused
            }
        }
    }
}
