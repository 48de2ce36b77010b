//! The steps of a start: what the tick thread drives, and each of the threads.

use crate::config::RealtimeConfig;
use crate::descriptors::Descriptors;
use crate::image_maker::ImageMaker;
use crate::snapshot::Snapshot;
use crate::sockets::ArraySocket;
use crate::sources::Sources;
use crate::tick::{self, Command, PipelineClock, Shared, TickThread};
use crate::{Config, StartError, gather, realtime, sources};
use std::os::fd::OwnedFd;
use std::sync::{Arc, mpsc};
use std::thread::JoinHandle;
use taxel_can::monotonic_ns;
use taxel_engine::Engine;
use taxel_joints::JointReader;
use taxel_serve::{Limits, Server, ServerSeed};
use taxel_wire::Clock;
use tokio::net::UnixListener;
use tokio::sync::{oneshot, watch};
use tokio_seqpacket::UnixSeqpacketListener;

/// What is told by a thread that serves: whether it can.
type Ready = mpsc::Sender<Result<(), StartError>>;

/// What it is told: whether it is to serve.
type Go = watch::Receiver<bool>;

/// A hand that can be read, and what there is for those who are to be served.
pub(crate) struct Pipeline {
    pub(crate) thread: TickThread,
    pub(crate) arrays: Vec<ArraySocket>,
    pub(crate) seed: ServerSeed<ImageMaker>,
    pub(crate) clock: PipelineClock,
    pub(crate) commands: mpsc::SyncSender<Command>,
    /// Clients that each of the control sockets may have.
    pub(crate) clients: usize,
}

fn system(what: &'static str) -> impl Fn(std::io::Error) -> StartError {
    move |error| StartError::System { what, error }
}

/// What the tick thread is to share with the others.
pub(crate) fn shared(config: &Config) -> Result<Arc<Shared>, StartError> {
    let layout = &config.layout;
    let joints = config.joints.as_ref();
    let snapshot = Snapshot::new(
        layout.buses.len(),
        layout.modules.len(),
        layout.len(),
        joints.map_or(0, |joints| joints.joint_names().len()),
    );
    let shared = Shared::new(snapshot).map_err(|errno| system("make an eventfd")(errno.into()))?;
    Ok(Arc::new(shared))
}

/// Starts the thread that reads joints, one step of priority below the tick thread, where their
/// source needs one.
fn joint_reader(config: &Config) -> Result<Option<JointReader>, StartError> {
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

/// Opens the buses and the ports of joints, and makes what reads them.
pub(crate) fn open_pipeline(config: &Config, shared: &Arc<Shared>) -> Result<Pipeline, StartError> {
    let recorded = sources::are_recorded(config);
    let clock = PipelineClock {
        offset_ns: if recorded { monotonic_ns() } else { 0 },
        live: !recorded,
    };
    // A recording's time starts at exactly zero, or its images would bear other times in every run.
    let start_ns = if recorded { 0 } else { monotonic_ns() };
    let Sources {
        buses: sources,
        arrays,
    } = sources::open(config, start_ns)?;
    let joint_reader = joint_reader(config)?;
    let engine = Engine::new(&config.engine(joint_reader.is_some())?, start_ns)?;
    let wire_clock = match recorded {
        true => Clock::Recording,
        false => Clock::Monotonic,
    };
    let Descriptors { subscribers, clients } = Descriptors::take(config.socket.max_subscribers.into());
    let limits = Limits {
        max_subscribers: subscribers,
        stall_ms: config.socket.stall_ms,
    };
    let maker = ImageMaker::new(config, wire_clock, shared.clone());
    let wake = {
        let shared = shared.clone();
        move || {
            let _ = shared.wake.write(1);
        }
    };
    let (seed, outputs) = ServerSeed::new(maker, limits, config.profiles, config.profile.clone(), wake)
        .map_err(StartError::Profile)?;
    let (commands, obeyed) = mpsc::sync_channel(tick::COMMANDS);
    let thread = TickThread {
        engine,
        joint_reader,
        joints_seen: [0; JointReader::SOURCES],
        outputs,
        clock,
        commands: obeyed,
        shared: shared.clone(),
        gather: gather::Gather::new(&config.tick),
        sources,
    };
    Ok(Pipeline {
        thread,
        arrays,
        seed,
        clock,
        commands,
        clients,
    })
}

/// Starts the tick thread.
pub(crate) fn spawn_tick(thread: TickThread, realtime: RealtimeConfig) -> Result<JoinHandle<()>, StartError> {
    let run = move || {
        if realtime.priority > 0
            && let Err(error) = realtime::set_fifo(realtime.priority)
        {
            tracing::info!(%error, "the tick thread has no real-time priority; LimitRTPRIO=20 in the unit allows it");
        }
        thread.run();
    };
    let tick = std::thread::Builder::new().name("tick".into());
    tick.spawn(run).map_err(system("start a thread"))
}

/// Starts the thread that sends images, until it is stopped.
pub(crate) fn spawn_images(
    listener: OwnedFd,
    seed: ServerSeed<ImageMaker>,
    realtime: RealtimeConfig,
    stopped: oneshot::Receiver<()>,
    (ready, go): (Ready, Go),
) -> Result<JoinHandle<()>, StartError> {
    serving_thread("images", (ready, go), async move || {
        let listener = UnixSeqpacketListener::try_from(listener).map_err(system("listen on a socket"))?;
        // Below the tick thread and that of the joints; the former has said why, if it is refused.
        let be_urgent = move || {
            let priority = realtime.priority.saturating_sub(2);
            if priority > 0 {
                let _ = realtime::set_fifo(priority);
            }
        };
        be_urgent();
        let seed = seed.with_second_hand(be_urgent);
        Ok(async move {
            tokio::select! {
                _ = stopped => {}
                () = Server::new(seed).serve(listener) => {}
            }
        })
    })
}

/// Starts the thread that answers at the control sockets, as `serve` does.
pub(crate) fn spawn_control(
    listeners: [OwnedFd; 2],
    realtime: RealtimeConfig,
    (ready, go): (Ready, Go),
    serve: impl AsyncFnOnce(UnixListener, UnixListener) + Send + 'static,
) -> Result<JoinHandle<()>, StartError> {
    serving_thread("control", (ready, go), async move || {
        let open =
            |listener: OwnedFd| UnixListener::from_std(listener.into()).map_err(system("listen on a socket"));
        let [control, status] = listeners;
        let (control, status) = (open(control)?, open(status)?);
        // Not FIFO: what clients ask of it may take long. But torque off waits for no compiler.
        if realtime.priority > 0 {
            let _ = realtime::set_nice();
        }
        Ok(serve(control, status))
    })
}

/// Starts a thread that runs `main` in a runtime of its own: first what may fail, whose outcome it
/// tells, then, on the word to go, what that gives, to its end.
fn serving_thread<Run: Future<Output = ()>>(
    name: &'static str,
    (ready, mut go): (Ready, Go),
    main: impl AsyncFnOnce() -> Result<Run, StartError> + Send + 'static,
) -> Result<JoinHandle<()>, StartError> {
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
                    // Or nobody would notice that another thread has ended without a word.
                    drop(ready);
                    if go.wait_for(|go| *go).await.is_ok() {
                        run.await;
                    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc::RecvTimeoutError;
    use std::time::Duration;

    #[test]
    fn a_thread_that_dies_before_it_serves_is_noticed_though_the_other_serves() {
        let (ready, is_ready) = mpsc::channel();
        let (_go, going) = watch::channel(true);
        let (stop, stopped) = oneshot::channel::<()>();
        let serves = serving_thread("serves", (ready.clone(), going.clone()), async move || {
            Ok(async move {
                let _ = stopped.await;
            })
        });
        let dies = serving_thread(
            "dies",
            (ready, going),
            async || -> Result<std::future::Ready<()>, StartError> { panic!("as the test wants it") },
        );
        let patience = Duration::from_secs(200);
        assert!(is_ready.recv_timeout(patience).unwrap().is_ok());
        let other = is_ready.recv_timeout(patience).unwrap_err();
        assert_eq!(other, RecvTimeoutError::Disconnected);
        stop.send(()).unwrap();
        serves.unwrap().join().unwrap();
        dies.unwrap().join().unwrap_err();
    }
}
