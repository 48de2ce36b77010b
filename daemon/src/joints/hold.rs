//! Motors that run only as long as the client is there that has had them switched on.

use super::Releases;
use std::cell::{Cell, RefCell};
use std::time::Duration;
use taxel_joints::JointReader;
use taxel_joints::bus::WriteCommand;
use tokio::sync::Notify;
use tokio::time::{Instant, sleep_until};

/// The motors that a connection holds. When it is dropped, however the connection ends, they are switched off.
pub(crate) struct Hold<'a> {
    pub(super) reader: Option<&'a JointReader>,
    pub(super) releases: &'a Releases,
    joints: RefCell<Vec<usize>>,
    patience: Cell<Option<Duration>>,
    /// When the client has been silent for too long; `None` where it holds nothing, or waits for an answer.
    lapses: Cell<Option<Instant>>,
    has_let_go: Cell<bool>,
    changed: Notify,
}

/// Why a client is let go.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Deserted {
    /// It has asked nothing for so long.
    Silent(Duration),
    /// It has gone.
    Gone,
}

impl<'a> Hold<'a> {
    /// None yet.
    pub(crate) fn new(reader: Option<&'a JointReader>, releases: &'a Releases) -> Self {
        Self {
            reader,
            releases,
            joints: RefCell::default(),
            patience: Cell::default(),
            lapses: Cell::default(),
            has_let_go: Cell::default(),
            changed: Notify::new(),
        }
    }

    /// How long the client may be silent; `None` where it holds nothing.
    pub(crate) fn patience(&self) -> Option<Duration> {
        self.patience.get()
    }

    /// The client has asked something. It may wait for as long as the answer takes.
    pub(crate) fn serve(&self) {
        self.lapses.set(None);
    }

    /// It is its turn: to take its answer, or to ask something.
    pub(crate) fn await_client(&self) {
        self.lapses
            .set(self.patience().map(|patience| Instant::now() + patience));
        self.changed.notify_waiters();
    }

    /// Waits until the client holds motors and is silent for too long, or has gone: whatever it has sent before, and
    /// whatever is done about that now. `gone` waits for its connection to be closed.
    pub(crate) async fn deserted(&self, gone: impl Future<Output = ()>) -> Deserted {
        let silent = async {
            loop {
                match self.lapses.get() {
                    Some(at) if at <= Instant::now() => return,
                    Some(at) => sleep_until(at).await,
                    None => self.changed.notified().await,
                }
            }
        };
        let gone = async {
            gone.await;
            while self.patience().is_none() {
                self.changed.notified().await;
            }
        };
        tokio::select! {
            () = silent => Deserted::Silent(self.patience().unwrap_or_default()),
            () = gone => Deserted::Gone,
        }
    }

    /// Has the motors switched off: who held them has gone, and is to hold no others.
    pub(crate) fn let_go(&self) {
        self.has_let_go.set(true);
        self.patience.set(None);
        self.lapses.set(None);
        let Some(servos) = self.reader.and_then(|reader| reader.servos.as_deref()) else {
            return;
        };
        for joint in self.joints.take() {
            // Refused only where writing is, and then nothing was switched on.
            if let Ok(number) = servos.command(joint, WriteCommand::Torque(false)) {
                self.releases.let_go(joint, number);
            }
        }
    }

    /// Whether the client has gone that held motors.
    pub(crate) fn has_let_go(&self) -> bool {
        self.has_let_go.get()
    }

    /// Notes what a servo is being told, once that was taken: whether it is confirmed or not, the motor may run.
    pub(super) fn note(&self, joint: usize, command: WriteCommand, hold_ms: Option<f64>) {
        let mut joints = self.joints.borrow_mut();
        match (command, hold_ms) {
            (WriteCommand::Torque(false), _) => joints.retain(|held| *held != joint),
            (_, Some(ms)) => {
                if !joints.contains(&joint) {
                    joints.push(joint);
                }
                let patience = Duration::from_secs_f64(ms / 1e3);
                let shortest = self.patience.get().map_or(patience, |other| other.min(patience));
                self.patience.set(Some(shortest));
            }
            _ => {}
        }
        if joints.is_empty() {
            self.patience.set(None);
        }
        self.changed.notify_waiters();
    }
}

impl Drop for Hold<'_> {
    fn drop(&mut self) {
        self.let_go();
    }
}
