//! Who is connected to a control socket, and who has to go when there are too many.

use super::asker::Process;
use std::cell::{Cell, RefCell};
use std::rc::Rc;
use taxel_serve::most_crowding;
use taxel_wire::status::ControlStatus;
use tokio::sync::Notify;
use tokio::time::Instant;

/// Most connections to one control socket at once: so many that one which has just come is heard before as many others
/// have. Fewer where fewer files may be open.
pub(crate) const MOST_CLIENTS: usize = 128;

/// What a client is doing, in the order in which they have to go.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Doing {
    /// It asks more than it may, and has to wait.
    Waiting,
    /// It asks nothing, or does not take its reply.
    Nothing,
    /// What it asked for is being done.
    Obeying,
    /// A motor is being switched off for it.
    Releasing,
}

/// The connections to one control socket, and counts since the start.
#[derive(Debug)]
pub(crate) struct Places {
    most: usize,
    clients: RefCell<Vec<Rc<Client>>>,
    made_room: Cell<u64>,
    slowed: Cell<u64>,
}

#[derive(Debug)]
struct Client {
    process: Process,
    doing: Cell<(Doing, Instant)>,
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
        }
    }

    /// A place for a new connection of this process; where there is none, another one loses its own.
    pub(crate) fn enter(self: &Rc<Self>, process: Process, now: Instant) -> Place {
        if self.clients.borrow().len() >= self.most {
            self.make_room();
        }
        let client = Rc::new(Client {
            process,
            doing: Cell::new((Doing::Nothing, now)),
            leave: Notify::new(),
        });
        self.clients.borrow_mut().push(client.clone());
        Place {
            places: self.clone(),
            client,
        }
    }

    /// Has the client go that has done nothing for longest: of the process that crowds the others, where one does, or
    /// what it does without end would keep out whoever has not been heard yet.
    pub(crate) fn make_room(&self) {
        let mut clients = self.clients.borrow_mut();
        let crowding = most_crowding(self.most, clients.iter().map(|client| client.process));
        let goes = |client: &Client| crowding.is_none_or(|(process, _)| client.process == process);
        let oldest = (0..clients.len())
            .filter(|i| goes(&clients[*i]))
            .min_by_key(|i| clients[*i].doing.get());
        if let Some(oldest) = oldest {
            clients.remove(oldest).leave.notify_one();
            self.made_room.set(self.made_room.get() + 1);
        }
    }

    /// Adds its counts to a status report.
    pub(crate) fn add_to(&self, status: &mut ControlStatus) {
        status.clients += self.clients.borrow().len();
        status.made_room += self.made_room.get();
        status.slowed += self.slowed.get();
    }
}

impl Place {
    /// Notes what its client does from now on.
    pub(crate) fn set(&self, doing: Doing, now: Instant) {
        self.client.doing.set((doing, now));
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
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    const MOST: usize = MOST_CLIENTS;

    fn has_to_go(place: &Place) -> bool {
        let clients = place.places.clients.borrow();
        !clients.iter().any(|client| Rc::ptr_eq(client, &place.client))
    }

    #[test]
    fn the_oldest_idle_connection_makes_room_and_one_that_releases_a_motor_goes_last() {
        let places = Rc::new(Places::new(MOST));
        let start = Instant::now();
        let at = |ms| start + Duration::from_millis(ms);
        let held: Vec<Place> = (0..MOST as u64).map(|n| places.enter(None, at(n))).collect();
        // The two oldest are at work, the third has asked something since, and the fourth too much.
        held[0].set(Doing::Releasing, at(500));
        held[1].set(Doing::Obeying, at(500));
        held[2].set(Doing::Nothing, at(500));
        held[3].slowed(at(500));
        let mut order = Vec::new();
        let mut newer = Vec::new();
        for n in 0..MOST as u64 {
            let place = places.enter(None, at(1000 + n));
            // A motor's release is asked for by each that comes.
            place.set(Doing::Releasing, at(1000 + n));
            newer.push(place);
            order.extend(
                (0..MOST)
                    .filter(|i| has_to_go(&held[*i]) && !order.contains(i))
                    .collect::<Vec<_>>(),
            );
        }
        let expected: Vec<usize> = [3].into_iter().chain(4..MOST).chain([2, 1, 0]).collect();
        assert_eq!(order, expected);
        assert!(!newer.iter().any(has_to_go));

        let mut status = ControlStatus::default();
        places.add_to(&mut status);
        assert_eq!((status.clients, status.made_room), (MOST, MOST as u64));
    }

    #[test]
    fn who_has_not_been_heard_stays_where_one_process_fills_all_places_with_releases_without_end() {
        let places = Rc::new(Places::new(MOST));
        let now = Instant::now();
        let (crowding, other) = (Some((1000, Some(1))), Some((1000, Some(2))));
        let enter = || {
            let place = places.enter(crowding, now);
            place.set(Doing::Releasing, now);
            place
        };
        let _held: Vec<Place> = (0..MOST).map(|_| enter()).collect();
        let new = places.enter(other, now);
        // Whose place is taken connects again.
        let _again: Vec<Place> = (0..3 * MOST).map(|_| enter()).collect();
        assert!(!has_to_go(&new));
    }

    #[test]
    fn who_leaves_gives_the_place_back_and_nobody_has_to_go() {
        let places = Rc::new(Places::new(MOST));
        let now = Instant::now();
        let held: Vec<Place> = (0..MOST).map(|_| places.enter(None, now)).collect();
        let mut held = held.into_iter();
        drop(held.next());
        let new = places.enter(None, now);
        assert!(!has_to_go(&new) && !held.any(|place| has_to_go(&place)));
    }
}
