//! Motors that run only as long as the client is there that has had them switched on.

use super::Releases;
use crate::clients::{Asker, Motors};
use std::cell::{Cell, RefCell};
use std::time::Duration;
use taxel_joints::JointReader;
use taxel_joints::bus::WriteCommand;
use tokio::sync::Notify;
use tokio::time::{Instant, sleep_until};

/// Which connection holds which motor, at most one each.
#[derive(Debug, Default)]
pub(crate) struct Holders {
    held: RefCell<Vec<Held>>,
    connections: Cell<u64>,
}

#[derive(Debug)]
struct Held {
    joint: usize,
    /// How long its client may be silent.
    patience: Duration,
    /// Number of the connection.
    by: u64,
    asker: Asker,
    /// It is known what became of what its client has had the motor told last.
    is_told: bool,
    /// Those of its connection, while this one is among them.
    _motors: Motors,
}

/// The motors that a connection holds. When it is dropped, however the connection ends, they are switched off.
pub(crate) struct Hold<'a> {
    pub(super) reader: Option<&'a JointReader>,
    pub(super) releases: &'a Releases,
    holders: &'a Holders,
    /// Its number among the connections.
    number: u64,
    asker: Asker,
    /// Since when it is the client's turn; `None` where it waits for an answer.
    awaited: Cell<Option<Instant>>,
    /// Whether it has asked for more meanwhile.
    is_pressed: Cell<bool>,
    has_let_go: Cell<bool>,
    motors: Motors,
    changed: Notify,
}

/// Why it has not been done.
#[derive(Debug)]
pub(crate) struct NotDone {
    pub(crate) why: String,
    /// Another client that holds the motor.
    pub(crate) held_by: Option<Asker>,
}

impl From<String> for NotDone {
    fn from(why: String) -> Self {
        let held_by = None;
        Self { why, held_by }
    }
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
    pub(crate) fn new(
        reader: Option<&'a JointReader>,
        releases: &'a Releases,
        holders: &'a Holders,
        asker: Asker,
    ) -> Self {
        let number = holders.connections.get();
        holders.connections.set(number + 1);
        Self {
            reader,
            releases,
            holders,
            number,
            asker,
            awaited: Cell::default(),
            is_pressed: Cell::default(),
            has_let_go: Cell::default(),
            motors: Motors::default(),
            changed: Notify::new(),
        }
    }

    /// The motors that it holds, whoever ends its hold of one.
    pub(crate) fn motors(&self) -> &Motors {
        &self.motors
    }

    /// How long the client may be silent; `None` where it holds nothing.
    pub(crate) fn patience(&self) -> Option<Duration> {
        let held = self.holders.held.borrow();
        let own = held.iter().filter(|held| held.by == self.number);
        own.map(|held| held.patience).min()
    }

    /// Whether it holds this motor.
    pub(super) fn holds(&self, joint: usize) -> bool {
        let held = self.holders.held.borrow();
        held.iter()
            .any(|held| held.by == self.number && held.joint == joint)
    }

    /// The client that holds this motor, if it is another one: a program may have several connections.
    fn other_holder(&self, joint: usize) -> Option<Asker> {
        let held = self.holders.held.borrow();
        let is_own = |held: &Held| held.by == self.number || held.asker.is_process_of(&self.asker);
        let mut others = held.iter().filter(|held| !is_own(held));
        others.find(|held| held.joint == joint).map(|held| held.asker)
    }

    /// Refuses to have the motor of a joint of this name told something where another client drives it.
    pub(super) fn refuse_other(&self, joint: usize, name: &str) -> Result<(), NotDone> {
        let servos = self.reader.and_then(|reader| reader.servos.as_deref());
        if servos.is_some_and(|servos| servos.is_off(joint)) {
            self.end_others(joint);
        }
        self.other_holder(joint).map_or(Ok(()), |holder| {
            Err(NotDone {
                why: format!(
                    "{name}: it is driven by {holder}, until that lets go, ends or falls silent, or somebody has the motor \
                     switched off"
                ),
                held_by: Some(holder),
            })
        })
    }

    /// Ends another client's hold of a motor that is off, unless that may be about to be switched on.
    fn end_others(&self, joint: usize) {
        if self.other_holder(joint).is_some() {
            let mut held = self.holders.held.borrow_mut();
            held.retain(|held| held.joint != joint || !held.is_told);
        }
    }

    /// It is known what became of what the client has had this motor told.
    pub(super) fn is_told(&self, joint: usize) {
        let mut held = self.holders.held.borrow_mut();
        let own = held
            .iter_mut()
            .filter(|held| held.by == self.number && held.joint == joint);
        own.for_each(|held| held.is_told = true);
    }

    /// When the client will have been silent for too long; `None` where it holds nothing, or waits for an answer.
    fn lapses(&self) -> Option<Instant> {
        Some(self.awaited.get()? + self.patience()?)
    }

    /// The client has asked something. It may wait for as long as the answer takes.
    pub(crate) fn serve(&self) {
        self.awaited.set(None);
        self.is_pressed.set(false);
    }

    /// The client asks for more while it waits for an answer.
    pub(crate) fn press(&self) {
        self.is_pressed.set(true);
    }

    /// Whether it does: it is not to wait for that answer for long.
    pub(super) fn is_pressed(&self) -> bool {
        self.is_pressed.get()
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
        let mut joints = Vec::new();
        self.holders.held.borrow_mut().retain(|held| {
            let is_own = held.by == self.number;
            joints.extend(is_own.then_some(held.joint));
            !is_own
        });
        let Some(servos) = self.reader.and_then(|reader| reader.servos.as_deref()) else {
            return;
        };
        for joint in joints {
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

    /// Notes what a servo is being told, once that was taken: whether it is confirmed or not, the motor may run. Who has it
    /// switched off ends whosever hold there is.
    pub(super) fn note(&self, joint: usize, command: WriteCommand, hold_ms: Option<f64>) {
        let mut held = self.holders.held.borrow_mut();
        if command == WriteCommand::Torque(false) || hold_ms.is_some() {
            held.retain(|held| held.joint != joint);
        }
        for own in held.iter_mut().filter(|held| held.joint == joint) {
            own.is_told = false;
        }
        held.extend(hold_ms.map(|ms| Held {
            joint,
            patience: Duration::from_secs_f64(ms / 1e3),
            by: self.number,
            asker: self.asker,
            is_told: false,
            _motors: self.motors.clone(),
        }));
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
    use crate::clients::{Doing, Places};
    use std::future::pending;
    use std::rc::Rc;
    use tokio::time::timeout;

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
            let (releases, holders) = Default::default();
            let hold = Hold::new(None, &releases, &holders, Asker::nobody());
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
            let (releases, holders) = Default::default();
            let hold = Hold::new(None, &releases, &holders, Asker::nobody());
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
        let (releases, holders) = Default::default();
        let hold = Hold::new(None, &releases, &holders, Asker::nobody());
        let (why, ()) = tokio::join!(hold.deserted(async {}), async {
            assert!(hold.patience().is_none());
            ask(&hold, (0, ON, Some(10_000.0)));
        });
        assert_eq!(why, Deserted::Gone);
        hold.let_go();
        assert!(hold.has_let_go() && hold.patience().is_none());
    }

    #[tokio::test]
    async fn a_motor_is_held_by_one_client_until_it_lets_go_or_anybody_has_it_switched_off() {
        let (releases, holders) = Default::default();
        let one = Hold::new(None, &releases, &holders, Asker::nobody());
        let other = Hold::new(None, &releases, &holders, Asker::nobody());
        let is_free = |joint| [&one, &other].map(|hold| is_free_of(hold, joint));
        ask(&one, (0, ON, Some(200.0)));
        assert_eq!((is_free(0), is_free(1)), ([true, false], [true, true]));
        ask(&other, (1, ON, Some(300.0)));
        assert_eq!(is_free(1), [false, true]);
        // What somebody else has switched off is held by nobody, and not switched off again when its holder goes.
        ask(&other, (0, OFF, None));
        assert_eq!((one.patience(), is_free(0)), (None, [true, true]));
        ask(&other, (0, ON, Some(400.0)));
        one.let_go();
        assert_eq!(is_free(0), [false, true]);
        drop(other);
        assert_eq!((is_free_of(&one, 0), is_free_of(&one, 1)), (true, true));
    }

    #[test]
    fn the_hold_of_a_motor_that_is_off_ends_unless_it_may_be_about_to_be_switched_on() {
        let (releases, holders) = Default::default();
        let one = Hold::new(None, &releases, &holders, Asker::nobody());
        let other = Hold::new(None, &releases, &holders, Asker::nobody());
        let ends = || {
            other.end_others(0);
            one.patience().is_none()
        };
        ask(&one, (0, ON, Some(200.0)));
        other.is_told(0);
        assert!(!ends(), "it may be on its way");
        one.is_told(0);
        ask(&one, (0, ON, None));
        assert!(!ends(), "it is started anew");
        one.is_told(0);
        other.end_others(1);
        one.end_others(0);
        assert!(
            one.holds(0),
            "another motor is off, and its own it may start anew"
        );
        assert!(ends() && is_free_of(&other, 0));
    }

    #[tokio::test(start_paused = true)]
    async fn whose_hold_another_has_ended_keeps_its_place_no_longer_than_who_is_idle() {
        type End = fn(&Hold<'_>);
        let ends: [(&str, End); 3] = [
            ("off", |other| other.note(0, OFF, None)),
            ("held by another", |other| other.note(0, ON, Some(200.0))),
            ("found off", |other| other.end_others(0)),
        ];
        for (what, end) in ends {
            let (releases, holders) = Default::default();
            let [one, other] = [(); 2].map(|()| Hold::new(None, &releases, &holders, Asker::nobody()));
            let places = Rc::new(Places::new(3));
            // The others have just come, and may stay until they are heard.
            let [place, _second, _third] =
                [1, 2, 3].map(|pid| places.enter(Some((1000, Some(pid))), Instant::now()));
            place.hold(one.motors());
            ask(&one, (0, ON, Some(10_000.0)));
            one.is_told(0);
            place.set(Doing::Nothing, Instant::now());
            let has_room = async || timeout(Duration::from_millis(30), places.room()).await.is_ok();
            assert!(!has_room().await, "{what}: it drives");
            end(&other);
            assert!(has_room().await, "{what}");
        }
    }

    #[test]
    fn the_connections_of_one_process_drive_each_other_s_motors_and_those_of_nobody_knows_whom_do_not() {
        let known = Asker::process(1000, Some(7));
        for (one, other, wanted) in [
            (known, known, true),
            (known, Asker::process(1000, Some(8)), false),
            (known, Asker::process(1001, Some(7)), false),
            (Asker::process(1000, None), Asker::process(1000, None), false),
            (Asker::nobody(), Asker::nobody(), false),
        ] {
            let (releases, holders) = Default::default();
            let [holder, other] = [one, other].map(|asker| Hold::new(None, &releases, &holders, asker));
            ask(&holder, (0, ON, Some(200.0)));
            assert_eq!(
                is_free_of(&other, 0),
                wanted,
                "{:?} {:?}",
                holder.asker,
                other.asker
            );
            // What it may drive it does not hold.
            ask(&other, (0, ON, None));
            assert_eq!((holder.patience().is_some(), other.patience()), (true, None));
        }
    }

    fn is_free_of(hold: &Hold<'_>, joint: usize) -> bool {
        hold.other_holder(joint).is_none()
    }
}
