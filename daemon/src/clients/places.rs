//! Who is connected to a control socket, and who has to go when there are too many.
//!
//! A connection is kept for 100 ms until its first line is read, and while motors are switched off for it, with 100 ms behind
//! each for the next; but for no longer than 400 ms from its coming or, once a second, from such a motor on. Where somebody
//! comes, one that is not kept goes: one that has gone or asks too much, then one that is idle, and where more than half of the
//! places are busy with requests and motors that are driven, one of these, drivers last.
//!
//! So where nobody can go at once, at least half of the places are kept, and none of them for longer than 400 ms. In that time
//! half as many as there are places are let in, whatever the others do, and each has its place until it is heard.

use super::asker::Process;
use std::cell::{Cell, OnceCell, RefCell};
use std::rc::{Rc, Weak};
use std::time::Duration;
use taxel_serve::most_crowding;
use taxel_wire::status::ControlStatus;
use tokio::sync::Notify;
use tokio::time::{Instant, timeout};

/// Most connections to one control socket at once: so many that one which has just come is heard before as many others
/// have. Fewer where fewer files may be open.
pub(crate) const MOST_CLIENTS: usize = 128;

/// So long the next line of a connection may be on its way: the first one, or that of the next motor to be switched off.
const UNHEARD: Duration = Duration::from_millis(100);
/// For how long a connection is kept, and once in which time.
const KEPT: Duration = Duration::from_millis(400);
const KEPT_INTERVAL: Duration = Duration::from_secs(1);
/// How often it is looked whether somebody has become idle without a word.
const LOOK: Duration = Duration::from_millis(10);

/// What a client is doing, in the order in which they have to go; the last two are kept, but for others of their own process.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Doing {
    /// It hears no answer any more.
    Gone,
    /// It asks more than it may, and has to wait.
    Waiting,
    /// It asks nothing, or does not take its reply.
    Nothing,
    /// What it asked for is being done.
    Obeying,
    /// It holds a motor: so it does, whatever it does besides, unless it asks too much or has gone.
    Driving,
    /// A motor is being switched off for it.
    Releasing,
    /// It has just come, or a motor was switched off for it, and nothing of it was read since.
    Unheard,
}

/// The motors that a connection holds: there is a copy of this for each of them.
#[derive(Debug, Clone, Default)]
pub(crate) struct Motors(Rc<()>);

/// The connections to one control socket, and counts since the start.
#[derive(Debug)]
pub(crate) struct Places {
    most: usize,
    clients: RefCell<Vec<Rc<Client>>>,
    made_room: Cell<u64>,
    slowed: Cell<u64>,
    /// Told when a client may have become one that makes room.
    changed: Notify,
}

#[derive(Debug)]
struct Client {
    process: Process,
    /// What it was noted to do, beside holding motors.
    doing: Cell<(Doing, Instant)>,
    motors: OnceCell<Weak<()>>,
    /// Since when it has been kept, perhaps no longer.
    kept: Cell<Instant>,
    leave: Notify,
}

/// A connection's place, which is free again when it is dropped.
#[derive(Debug)]
pub(crate) struct Place {
    places: Rc<Places>,
    client: Rc<Client>,
}

impl Places {
    /// So many places, all of them free.
    pub(crate) fn new(most: usize) -> Self {
        Self {
            most,
            clients: RefCell::default(),
            made_room: Cell::new(0),
            slowed: Cell::new(0),
            changed: Notify::new(),
        }
    }

    /// A place for a new connection of this process; where there is none, another one loses its own.
    pub(crate) fn enter(self: &Rc<Self>, process: Process, now: Instant) -> Place {
        if self.clients.borrow().len() >= self.most {
            self.make_room(now);
        }
        let client = Rc::new(Client {
            process,
            doing: Cell::new((Doing::Unheard, now)),
            motors: OnceCell::new(),
            kept: Cell::new(now),
            leave: Notify::new(),
        });
        self.clients.borrow_mut().push(client.clone());
        Place {
            places: self.clone(),
            client,
        }
    }

    /// Waits until there is a place, or somebody would make room.
    pub(crate) async fn room(&self) {
        while !self.has_room(Instant::now()) {
            // That one which has come and said nothing is idle by now is told by nobody.
            let _ = timeout(LOOK, self.changed.notified()).await;
        }
    }

    fn has_room(&self, now: Instant) -> bool {
        let clients = self.clients.borrow();
        clients.len() < self.most || self.leaving(&clients, now).is_some()
    }

    /// Has the client go that has done nothing for longest, where there is one that may be put out.
    pub(crate) fn make_room(&self, now: Instant) {
        let mut clients = self.clients.borrow_mut();
        if let Some(leaving) = self.leaving(&clients, now) {
            clients.remove(leaving).leave.notify_one();
            self.made_room.set(self.made_room.get() + 1);
        }
    }

    /// Who goes: of the process that crowds the others, where one does, or what it does without end would keep out whoever
    /// has not been heard yet. Who drives a motor crowds nobody: there are no more of them than motors.
    fn leaving(&self, clients: &[Rc<Client>], now: Instant) -> Option<usize> {
        let drives = |client: &Client| client.doing(now).0 == Doing::Driving;
        let others = clients.iter().filter(|client| !drives(client));
        let crowding = most_crowding(self.most, others.map(|client| client.process));
        let is_busy = |client: &&Rc<Client>| matches!(client.doing(now).0, Doing::Obeying | Doing::Driving);
        let last = match clients.iter().filter(is_busy).count() > clients.len() / 2 {
            true => Doing::Driving,
            false => Doing::Nothing,
        };
        let goes = |client: &Client| match crowding {
            Some((process, _)) => client.process == process && !drives(client),
            None => client.doing(now).0 <= last,
        };
        (0..clients.len())
            .filter(|i| goes(&clients[*i]))
            .min_by_key(|i| clients[*i].doing(now))
    }

    /// Adds its counts to a status report.
    pub(crate) fn add_to(&self, status: &mut ControlStatus) {
        status.clients += self.clients.borrow().len();
        status.made_room += self.made_room.get();
        status.slowed += self.slowed.get();
    }
}

impl Client {
    /// What it does, and since when; what it is kept for is over in time.
    fn doing(&self, now: Instant) -> (Doing, Instant) {
        let (doing, since) = self.doing.get();
        if !matches!(doing, Doing::Gone | Doing::Waiting) && self.drives() {
            return (Doing::Driving, since);
        }
        let end = self.kept.get() + KEPT;
        let (end, then) = match doing {
            Doing::Unheard => (end.min(since + UNHEARD), Doing::Nothing),
            Doing::Releasing => (end, Doing::Obeying),
            _ => return (doing, since),
        };
        match now < end {
            true => (doing, since),
            false => (then, end.max(since)),
        }
    }

    /// Whether it holds a motor now: another may end that unasked.
    fn drives(&self) -> bool {
        // Beside the one of the connection itself.
        self.motors.get().is_some_and(|motors| motors.strong_count() > 1)
    }
}

impl Place {
    /// The motors that its client will hold.
    pub(crate) fn hold(&self, motors: &Motors) {
        let _ = self.client.motors.set(Rc::downgrade(&motors.0));
    }

    /// Notes what its client does from now on.
    pub(crate) fn set(&self, doing: Doing, now: Instant) {
        let client = &self.client;
        // Who has gone does not come back.
        if client.doing.get().0 == Doing::Gone {
            return;
        }
        if doing == Doing::Releasing && now >= client.kept.get() + KEPT_INTERVAL {
            client.kept.set(now);
        }
        client.doing.set((doing, now));
        self.places.changed.notify_one();
    }

    /// Counts a request that has to wait, and notes that its client does.
    pub(crate) fn slowed(&self, now: Instant) {
        self.set(Doing::Waiting, now);
        self.places.slowed.set(self.places.slowed.get() + 1);
    }

    /// Waits until another connection has taken it.
    pub(crate) async fn lost(&self) {
        self.client.leave.notified().await;
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        let mut clients = self.places.clients.borrow_mut();
        clients.retain(|client| !Rc::ptr_eq(client, &self.client));
        self.places.changed.notify_one();
    }
}

#[cfg(test)]
mod tests;
