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
    /// With how long the client may be silent for each.
    joints: RefCell<Vec<(usize, Duration)>>,
    /// Since when it is the client's turn; `None` where it waits for an answer.
    awaited: Cell<Option<Instant>>,
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
            awaited: Cell::default(),
            has_let_go: Cell::default(),
            changed: Notify::new(),
        }
    }

    /// How long the client may be silent; `None` where it holds nothing.
    pub(crate) fn patience(&self) -> Option<Duration> {
        self.joints.borrow().iter().map(|(_, patience)| *patience).min()
    }

    /// When the client will have been silent for too long; `None` where it holds nothing, or waits for an answer.
    fn lapses(&self) -> Option<Instant> {
        Some(self.awaited.get()? + self.patience()?)
    }

    /// The client has asked something. It may wait for as long as the answer takes.
    pub(crate) fn serve(&self) {
        self.awaited.set(None);
    }

    /// It is its turn: to take its answer, or to ask something.
    pub(crate) fn await_client(&self) {
        self.awaited.set(Some(Instant::now()));
        self.changed.notify_waiters();
    }

    /// Waits until the client holds motors and is silent for too long, or has gone: whatever it has sent before, and
    /// whatever is done about that now. `gone` waits for its connection to be closed.
    pub(crate) async fn deserted(&self, gone: impl Future<Output = ()>) -> Deserted {
        let silent = async {
            loop {
                let changed = self.changed.notified();
                match self.lapses() {
                    Some(at) if at <= Instant::now() => return,
                    // Meanwhile another motor may be held, for less long, or one be held no longer.
                    Some(at) => tokio::select! {
                        () = sleep_until(at) => {}
                        () = changed => {}
                    },
                    None => changed.await,
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
        let joints = self.joints.take();
        let Some(servos) = self.reader.and_then(|reader| reader.servos.as_deref()) else {
            return;
        };
        for (joint, _) in joints {
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
        if command == WriteCommand::Torque(false) || hold_ms.is_some() {
            joints.retain(|(held, _)| *held != joint);
        }
        joints.extend(hold_ms.map(|ms| (joint, Duration::from_secs_f64(ms / 1e3))));
        self.changed.notify_waiters();
    }
}

impl Drop for Hold<'_> {
    fn drop(&mut self) {
        self.let_go();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::future::pending;

    const ON: WriteCommand = WriteCommand::Torque(true);
    const OFF: WriteCommand = WriteCommand::Torque(false);

    /// What a client asks: of which joint, what, and for how long it may be silent then, milliseconds.
    type Asked = (usize, WriteCommand, Option<f64>);

    fn ask(hold: &Hold<'_>, (joint, command, hold_ms): Asked) {
        hold.serve();
        hold.note(joint, command, hold_ms);
        hold.await_client();
    }

    #[tokio::test(start_paused = true)]
    async fn who_holds_several_motors_may_be_silent_for_the_shortest_of_their_times() {
        let cases: [(&str, &[Asked], u64); 6] = [
            ("one", &[(0, ON, Some(200.0))], 200),
            ("shorter", &[(0, ON, Some(8000.0)), (1, ON, Some(200.0))], 200),
            ("longer", &[(0, ON, Some(200.0)), (1, ON, Some(8000.0))], 200),
            (
                "the newest of one motor",
                &[(0, ON, Some(200.0)), (0, ON, Some(300.0))],
                300,
            ),
            (
                "one that is not held",
                &[(0, ON, Some(200.0)), (1, ON, None), (0, ON, None)],
                200,
            ),
            (
                "the shortest is off",
                &[(0, ON, Some(10_000.0)), (1, ON, Some(100.0)), (1, OFF, None)],
                10_000,
            ),
        ];
        for (what, asked, wanted_ms) in cases {
            let releases = Releases::default();
            let hold = Hold::new(None, &releases);
            let begun = Instant::now();
            // It is waited for its silence from its first request on.
            let (why, ()) = tokio::join!(biased; hold.deserted(pending()), async {
                for one in asked {
                    ask(&hold, *one);
                    tokio::task::yield_now().await;
                }
            });
            let wanted = Duration::from_millis(wanted_ms);
            assert_eq!(why, Deserted::Silent(wanted), "{what}");
            // The clock is that of the test, which goes on where nothing else is to be done, by whole milliseconds.
            assert_eq!(begun.elapsed().as_millis(), u128::from(wanted_ms), "{what}");
        }
    }

    #[tokio::test(start_paused = true)]
    async fn who_holds_nothing_or_waits_for_an_answer_may_be_silent_for_ever() {
        let cases: [(&str, &[Asked], bool); 3] = [
            ("nothing", &[], false),
            ("no longer", &[(0, ON, Some(20.0)), (0, OFF, None)], false),
            ("an answer", &[(0, ON, Some(20.0))], true),
        ];
        for (what, asked, waits) in cases {
            let releases = Releases::default();
            let hold = Hold::new(None, &releases);
            let rest = async {
                for one in asked {
                    ask(&hold, *one);
                }
                if waits {
                    hold.serve();
                }
                sleep_until(Instant::now() + Duration::from_secs(100)).await;
            };
            tokio::select! {
                why = hold.deserted(pending()) => panic!("{what}: {why:?}"),
                () = rest => {}
            }
        }
    }

    #[tokio::test(start_paused = true)]
    async fn who_has_gone_is_let_go_once_it_holds_something() {
        let releases = Releases::default();
        let hold = Hold::new(None, &releases);
        let (why, ()) = tokio::join!(hold.deserted(async {}), async {
            assert!(hold.patience().is_none());
            ask(&hold, (0, ON, Some(10_000.0)));
        });
        assert_eq!(why, Deserted::Gone);
        hold.let_go();
        assert!(hold.has_let_go() && hold.patience().is_none());
    }
}
