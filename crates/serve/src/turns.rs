//! Whose subscription is looked at next: all clients have one allowance together, counted in bytes.
//!
//! Those who wait are served in the order in which they would be done if the bytes of all were read side
//! by side (weighted fair queueing; Demers, Keshav, Shenker, SIGCOMM 1989): who sends a short subscription
//! waits for no more than one long one of the others, and who sends them without end waits for itself.

use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;
use std::rc::Rc;
use std::time::Duration;
use taxel_wire::MAX_SUBSCRIBE;
use tokio::sync::Notify;
use tokio::time::{Instant, sleep_until};

/// What a subscription costs beside its bytes, as bytes: it is answered with a HELLO.
const ANSWER: u64 = 4096;
/// Bytes in a second, answers included: some five hundred subscriptions of ordinary length, or sixty of
/// the longest there may be, which are a few percent of a core.
const BYTES_PER_SECOND: u64 = 2 << 20;
/// What is looked at at once after a pause, as the time that it is worth.
const BURST: Duration = Duration::from_millis(20);

/// The order in which subscriptions are looked at.
#[derive(Debug)]
pub(crate) struct Turns {
    waiting: RefCell<BTreeMap<Rank, Rc<Notify>>>,
    /// Bytes that were read by now of each who always waited, were all read side by side.
    level: Cell<u64>,
    /// When what was looked at so far would be over, evenly.
    due: Cell<Instant>,
    clients: Cell<u64>,
}

/// Where the bytes of a client's subscription end, and the client's number.
type Rank = (u64, u64);

/// What is kept of one client.
#[derive(Debug)]
pub(crate) struct Account {
    number: u64,
    /// Where its last subscription ended.
    served: Cell<u64>,
    /// Where the one that waits ends.
    claim: Cell<Option<u64>>,
}

impl Turns {
    pub(crate) fn new() -> Self {
        Self {
            waiting: RefCell::default(),
            level: Cell::new(0),
            due: Cell::new(Instant::now()),
            clients: Cell::new(0),
        }
    }

    /// That of a client that has just come.
    pub(crate) fn account(&self) -> Account {
        self.clients.set(self.clients.get() + 1);
        Account {
            number: self.clients.get(),
            served: Cell::new(0),
            claim: Cell::new(None),
        }
    }

    /// Waits until a packet of so many bytes may be looked at, of which no more are read than a subscription may have, and
    /// one. Where the future is dropped before, the client keeps its place for the next time.
    pub(crate) async fn wait(&self, account: &Account, bytes: usize) {
        let cost = ANSWER + bytes.min(MAX_SUBSCRIBE + 1) as u64;
        let end = (account.claim.get()).unwrap_or(account.served.get().max(self.level.get()) + cost);
        account.claim.set(Some(end));
        let waiting = self.enter((end, account.number));
        loop {
            if !waiting.is_first() {
                waiting.moved.notified().await;
            } else if self.due.get() > Instant::now() {
                sleep_until(self.due.get()).await;
            } else {
                break;
            }
        }
        let clients = self.waiting.borrow().len() as u64;
        drop(waiting);
        account.claim.set(None);
        account.served.set(end);
        // Where nobody waits any more, nobody has had more than another.
        self.level.set(match clients {
            1 => self.level.get().max(end),
            _ => self.level.get() + cost / clients,
        });
        let since = (Instant::now().checked_sub(BURST)).map_or(self.due.get(), |at| at.max(self.due.get()));
        self.due
            .set(since + Duration::from_nanos(cost * 1_000_000_000 / BYTES_PER_SECOND));
    }

    fn enter(&self, rank: Rank) -> Waiting<'_> {
        let moved = Rc::new(Notify::new());
        self.waiting.borrow_mut().insert(rank, moved.clone());
        Waiting {
            turns: self,
            rank,
            moved,
        }
    }
}

/// One that waits, until it is dropped.
struct Waiting<'a> {
    turns: &'a Turns,
    rank: Rank,
    /// Told when it has become the first.
    moved: Rc<Notify>,
}

impl Waiting<'_> {
    fn is_first(&self) -> bool {
        let waiting = self.turns.waiting.borrow();
        waiting
            .first_key_value()
            .is_some_and(|(rank, _)| *rank == self.rank)
    }
}

impl Drop for Waiting<'_> {
    fn drop(&mut self) {
        let mut waiting = self.turns.waiting.borrow_mut();
        waiting.remove(&self.rank);
        if let Some((_, moved)) = waiting.first_key_value() {
            moved.notify_one();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::future::poll_fn;
    use std::pin::pin;
    use std::task::Poll;
    use tokio::task::LocalSet;

    const LONG: usize = 32_768;
    const SHORT: usize = 200;

    /// Clients that each have so many subscriptions of so many bytes looked at: who was served, in order.
    async fn order(turns: &Rc<Turns>, clients: &[(&'static str, usize, usize)]) -> Vec<&'static str> {
        let served = Rc::new(RefCell::new(Vec::new()));
        let local = LocalSet::new();
        for &(name, subscriptions, bytes) in clients {
            let (turns, served) = (turns.clone(), served.clone());
            local.spawn_local(async move {
                let account = turns.account();
                for _ in 0..subscriptions {
                    turns.wait(&account, bytes).await;
                    served.borrow_mut().push(name);
                }
            });
        }
        local.await;
        served.take()
    }

    #[tokio::test(start_paused = true)]
    async fn all_clients_together_are_read_at_one_pace_however_many_there_are() {
        for clients in [1, 10, 120] {
            let turns = Rc::new(Turns::new());
            let begin = Instant::now();
            let served = order(&turns, &vec![("long", 360 / clients, LONG); clients]).await;
            let bytes = served.len() as u64 * (ANSWER + LONG as u64);
            let least = Duration::from_nanos(bytes * 1_000_000_000 / BYTES_PER_SECOND) - 2 * BURST;
            assert_eq!(served.len(), 360);
            assert!(begin.elapsed() >= least, "{clients}: {:?}", begin.elapsed());
        }
    }

    #[tokio::test(start_paused = true)]
    async fn a_short_subscription_waits_for_few_of_a_hundred_long_ones_whenever_it_comes() {
        for before in [0, 1, 50, 99, 100, 101, 250] {
            let turns = Rc::new(Turns::new());
            let served = Rc::new(Cell::new(0_usize));
            let is_over = Rc::new(Cell::new(false));
            let local = LocalSet::new();
            for _ in 0..100 {
                let (turns, served, is_over) = (turns.clone(), served.clone(), is_over.clone());
                local.spawn_local(async move {
                    let account = turns.account();
                    while !is_over.get() {
                        turns.wait(&account, LONG).await;
                        served.set(served.get() + 1);
                    }
                });
            }
            let waited = local.run_until(async {
                while served.get() < before {
                    tokio::task::yield_now().await;
                    tokio::time::sleep(Duration::from_millis(1)).await;
                }
                let came = served.get();
                turns.wait(&turns.account(), SHORT).await;
                is_over.set(true);
                served.get() - came
            });
            let waited = waited.await;
            assert!(waited <= 2, "{waited} after {before}");
        }
    }

    #[tokio::test(start_paused = true)]
    async fn who_asks_without_end_waits_for_those_who_ask_once() {
        let turns = Rc::new(Turns::new());
        let mut clients = vec![("without end", 50, SHORT)];
        clients.extend([("once", 1, SHORT); 20]);
        let served = order(&turns, &clients).await;
        let last = served.iter().rposition(|name| *name == "once").unwrap();
        assert!(last <= 22, "{served:?}");
    }

    #[tokio::test(start_paused = true)]
    async fn a_packet_that_is_too_long_takes_no_more_time_than_is_read_of_it() {
        let waited = async |bytes: usize| {
            let turns = Turns::new();
            turns.wait(&turns.account(), bytes).await;
            let begin = Instant::now();
            turns.wait(&turns.account(), SHORT).await;
            begin.elapsed()
        };
        let longest = waited(MAX_SUBSCRIBE + 1).await;
        assert_eq!(waited(400_000).await, longest);
        assert_eq!(waited(usize::MAX).await, longest);
    }

    #[tokio::test(start_paused = true)]
    async fn who_is_held_up_by_an_image_keeps_its_place_and_holds_up_nobody() {
        let turns = Turns::new();
        let (first, second) = (turns.account(), turns.account());
        turns.wait(&turns.account(), LONG).await;
        turns.wait(&turns.account(), LONG).await;
        {
            let mut given_up = pin!(turns.wait(&first, LONG));
            poll_fn(|cx| Poll::Ready(given_up.as_mut().poll(cx).is_pending())).await;
        }
        turns.wait(&second, SHORT).await;
        assert!(turns.waiting.borrow().is_empty());
        let claim = first.claim.get();
        turns.wait(&first, LONG).await;
        assert_eq!(Some(first.served.get()), claim);
    }
}
