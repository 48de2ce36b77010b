//! The threads that read a hand and write it: one per kind of source, one that writes, one that waits for the disk.
//!
//! None of them holds up the daemon: the buses are read from sockets of their own, and a reader that is slow is passed over.
//! Nor does the disk hold up the readers: what they read waits in a queue of fixed size, and what finds no room there is
//! counted.

mod can;
mod daemon;
mod wall;
mod write;

use self::can::{Buses, read_can};
use self::daemon::read_daemon;
use self::wall::Wall;
use self::write::Writer;
use crate::gone::Gone;
use crate::schema::Topic;
use crate::store::{Around, Split, Store, Written};
use crate::store_error::StoreError;
use crate::writer::{Entry, Preamble};
use std::io;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicI64, AtomicU64, Ordering};
use std::sync::mpsc::{SyncSender, TrySendError, sync_channel};
use std::sync::{Mutex, PoisonError};
use std::thread::{self, Scope};
use std::time::Duration;
use taxel_can::{OpenError, SourceAddress};
use taxel_journal::Priority;
use taxel_wire::Hello;
use taxel_wire::status::ProblemStatus;

/// Messages that wait for a disk: some eight seconds of a hand at 100 Hz.
const QUEUE: usize = 4096;
/// How often to look whether it is over.
const LOOK: Duration = Duration::from_millis(100);

/// A bus to be recorded.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CanInput {
    /// Its name in the recording.
    pub name: String,
    /// Where its frames come from.
    pub address: SourceAddress,
}

/// What came of a bus.
#[derive(Debug, Clone)]
pub struct CanRead {
    /// The bus.
    pub input: CanInput,
    /// Frames read.
    pub frames: u64,
}

/// What the hand that a daemon describes is recorded with.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Described {
    /// What stands at the beginning of every file.
    pub preamble: Preamble,
    /// The buses.
    pub can: Vec<CanInput>,
    /// Why it is not recorded as was asked for; told once.
    pub news: Option<String>,
}

/// What is to be recorded, and where.
#[derive(Debug, Clone)]
pub struct Plan {
    /// The file, or the name that files are named after.
    pub out: PathBuf,
    /// The daemon's image socket; none records CAN alone.
    pub socket: Option<PathBuf>,
    /// The buses.
    pub can: Vec<CanInput>,
    /// When it goes on in another file.
    pub split: Split,
    /// What is kept around triggers; none keeps everything.
    pub around: Option<Around>,
    /// Whether a mark is a trigger.
    pub mark_triggers: bool,
    /// How long it takes; none until it is stopped.
    pub duration: Option<Duration>,
    /// What stands at the beginning of every file.
    pub preamble: Preamble,
}

/// What comes from outside while it records. Whether to stop, and whether there is a trigger, is asked ten times a second.
pub struct Signals<'a> {
    /// Whether to stop.
    pub stop: &'a (dyn Fn() -> bool + Sync),
    /// Whether something happened that is to be kept, since it was last asked.
    pub trigger: &'a (dyn Fn() -> bool + Sync),
    /// Tells people something, and how much it matters.
    pub say: &'a (dyn Fn(Priority, &str) + Sync),
    /// What the hand is recorded with that a daemon describes, asked at the first description of each connection: the next
    /// daemon may run with another configuration. Where that is another than before, another file is begun; none is as
    /// before.
    pub described: &'a (dyn Fn(&Hello) -> Option<Described> + Sync),
}

/// What became of a recording.
#[derive(Debug, Default)]
pub struct Finished {
    /// The files of this recording, without those that were removed to make room, and those that are gone.
    pub files: Vec<PathBuf>,
    /// Files that others removed, renamed or changed while they were recorded into.
    pub gone: Vec<Gone>,
    /// Files that were removed to make room, those of earlier runs too. The counts below are of what this run's
    /// held too.
    pub removed: u32,
    /// What came of each bus: those of the plan, and those read since for another daemon.
    pub can: Vec<CanRead>,
    /// CAN frames that the kernel dropped.
    pub can_lost: u64,
    /// Whether a daemon described its hand.
    pub is_described: bool,
    /// Images recorded.
    pub images: u64,
    /// Images and tactile frames that the daemon passed over.
    pub skipped: u64,
    /// Messages dropped because the disk was too slow.
    pub dropped: u64,
    /// Messages written.
    pub messages: u64,
    /// What the daemon said last that is wrong.
    pub problems: Vec<ProblemStatus>,
    /// Why it could not go on, where it stopped before it was to.
    pub failure: Option<LiveError>,
}

/// Why there is no recording, or only a part of one.
#[derive(Debug, thiserror::Error)]
pub enum LiveError {
    /// A bus cannot be opened.
    #[error("{name}: {source}")]
    Bus {
        /// Its name.
        name: String,
        /// Why.
        source: OpenError,
    },
    /// The files cannot be written.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The disk did not take what was written.
    #[error("{path}: the disk did not take what was written: {source}")]
    Sync {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// No thread can be had.
    #[error("cannot start a thread: {0}")]
    Thread(io::Error),
}

/// What the readers hand to the writer.
enum Message {
    Entry(Entry),
    /// What the recorder itself says.
    Note(Entry),
    Trigger {
        wall_ns: u64,
        why: String,
    },
    /// Another file begins, with this.
    Another(Preamble),
}

/// What the threads share.
struct Shared<'a> {
    signals: &'a Signals<'a>,
    wall: Wall,
    /// How far the wall clock had been set when the file was begun that is written, nanoseconds.
    clock_of_file_ns: AtomicI64,
    ended: AtomicBool,
    can: Mutex<Vec<CanRead>>,
    /// Buses to be read from now on instead of those before.
    other_buses: Mutex<Option<Buses>>,
    can_lost: AtomicU64,
    is_described: AtomicBool,
    images: AtomicU64,
    skipped: AtomicU64,
    dropped: AtomicU64,
    /// What the daemon said last that is wrong.
    problems: Mutex<Vec<ProblemStatus>>,
}

impl<'a> Shared<'a> {
    fn new(signals: &'a Signals<'a>, wall: Wall) -> Self {
        Self {
            signals,
            wall,
            clock_of_file_ns: AtomicI64::new(0),
            ended: AtomicBool::new(false),
            can: Mutex::default(),
            other_buses: Mutex::default(),
            can_lost: AtomicU64::new(0),
            is_described: AtomicBool::new(false),
            images: AtomicU64::new(0),
            skipped: AtomicU64::new(0),
            dropped: AtomicU64::new(0),
            problems: Mutex::default(),
        }
    }

    fn is_over(&self) -> bool {
        self.ended.load(Ordering::Relaxed)
    }

    /// Counts frames of these buses, and knows of each from then on.
    fn count_can(&self, inputs: &[CanInput], frames: &[u64]) {
        let mut can = self.can.lock().unwrap_or_else(PoisonError::into_inner);
        for (input, frames) in inputs.iter().zip(frames) {
            match can.iter_mut().find(|read| read.input == *input) {
                Some(read) => read.frames += frames,
                None => can.push(CanRead {
                    input: input.clone(),
                    frames: *frames,
                }),
            }
        }
    }

    /// A time as it stands in the file that is written.
    fn stamp_ns(&self, wall_ns: u64) -> u64 {
        wall_ns.saturating_add_signed(self.clock_of_file_ns.load(Ordering::Relaxed))
    }

    /// False where it is dropped, and counted, since there is no room.
    fn hand_over(&self, queue: &SyncSender<Message>, message: Message) -> bool {
        let is_full = matches!(queue.try_send(message), Err(TrySendError::Full(_)));
        self.dropped.fetch_add(is_full.into(), Ordering::Relaxed);
        !is_full
    }

    fn entry(&self, queue: &SyncSender<Message>, topic: Topic, wall_ns: u64, data: Vec<u8>) -> bool {
        self.hand_over(queue, Message::Entry(Entry { topic, wall_ns, data }))
    }
}

/// Records until it is stopped, its time is over, or it cannot go on. What was recorded until then is in the files in
/// every case.
///
/// # Errors
/// Where a bus cannot be opened or no file be made: nothing was recorded.
pub fn record(plan: &Plan, signals: &Signals<'_>) -> Result<Finished, LiveError> {
    let buses = Buses::open(&plan.can)?;
    let shared = Shared::new(signals, Wall::now());
    let mut store = Store::new(&plan.out, plan.preamble.clone(), plan.split.clone(), plan.around);
    store.check()?;
    let (queue, messages) = sync_channel(QUEUE);
    // One file on its way to the disk, one behind it; more would only be synced for nothing.
    let (to_sync, syncing) = sync_channel::<Written>(1);
    let (sync_failed, sync_failure) = sync_channel::<LiveError>(1);
    let outcome = thread::scope(|scope| {
        let (shared, store) = (&shared, &mut store);
        let run = || -> Result<(), LiveError> {
            let to_write = queue.clone();
            start(scope, "can", move || read_can(buses, &to_write, shared))?;
            if let Some(socket) = &plan.socket {
                let queue = queue.clone();
                start(scope, "daemon", move || read_daemon(socket, plan, &queue, shared))?;
            }
            start(scope, "disk", move || {
                while let Ok(written) = syncing.recv() {
                    if let Err(error) = sync(written) {
                        let _ = sync_failed.try_send(error);
                    }
                }
            })?;
            drop(queue);
            let written = Writer::new(plan, store, shared).write(&messages, &to_sync, &sync_failure);
            shared.ended.store(true, Ordering::Relaxed);
            written?;
            // What the readers had in hand when they were told.
            for message in &messages {
                match message {
                    Message::Entry(entry) => store.take(entry)?,
                    Message::Note(entry) => store.note(entry)?,
                    Message::Trigger { .. } | Message::Another(_) => {}
                }
            }
            Ok(())
        };
        let outcome = run();
        shared.ended.store(true, Ordering::Relaxed);
        drop((to_sync, messages));
        outcome
    });
    let closed = store.close();
    let mut synced = sync_failure.try_recv().map_or(Ok(()), Err);
    store.hand_out(|written| {
        let this = sync(written);
        if synced.is_ok() {
            synced = this;
        }
        Ok(())
    });
    let failure = outcome.and(closed.map_err(LiveError::from)).and(synced).err();
    Ok(finished(&store, shared, failure))
}

/// Starts a thread of a recording.
fn start<'scope>(
    scope: &'scope Scope<'scope, '_>,
    name: &str,
    run: impl FnOnce() + Send + 'scope,
) -> Result<(), LiveError> {
    let thread = thread::Builder::new().name(name.into());
    let started = thread.spawn_scoped(scope, run);
    started.map(drop).map_err(LiveError::Thread)
}

/// What became of a recording whose threads have ended.
fn finished(store: &Store, shared: Shared<'_>, failure: Option<LiveError>) -> Finished {
    let count = |count: &AtomicU64| count.load(Ordering::Relaxed);
    Finished {
        files: store.files(),
        gone: store.gone().to_vec(),
        removed: store.removed(),
        can_lost: count(&shared.can_lost),
        is_described: shared.is_described.load(Ordering::Relaxed),
        images: count(&shared.images),
        skipped: count(&shared.skipped),
        dropped: count(&shared.dropped),
        messages: store.messages(),
        can: shared.can.into_inner().unwrap_or_else(PoisonError::into_inner),
        problems: (shared.problems.into_inner()).unwrap_or_else(PoisonError::into_inner),
        failure,
    }
}

/// Waits until the disk has a file.
fn sync(Written { path, file }: Written) -> Result<(), LiveError> {
    file.sync_data()
        .map_err(|source| LiveError::Sync { path, source })
}
