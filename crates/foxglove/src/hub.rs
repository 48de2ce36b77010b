//! Between the thread that reads the daemon and the clients: what each is to be sent.

use crate::counts::{Counters, add};
use crate::protocol::{self, Level, Subscription, topic_of};
use crate::queue::{Message, Next, Queue, is_state};
use crate::remarks::Remarks;
use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use taxel_journal::Priority;
use taxel_recorder::Topic;
use tokio::sync::Notify;

/// Between two remarks to a client that it is too slow.
const SLOW_AGAIN: Duration = Duration::from_secs(1);

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn bit(topic: Topic) -> u32 {
    1 << topic as u32
}

/// Tells people something, and how much it matters.
pub(crate) type Say = Box<dyn Fn(Priority, &str) + Send + Sync>;

/// What the threads share. No lock is held but to put something in or take it out.
pub(crate) struct Hub {
    say: Say,
    remarks: Mutex<Remarks>,
    pub(crate) counters: Counters,
    inner: Mutex<Inner>,
    /// A bit for each topic that a client is subscribed to.
    wanted: AtomicU32,
    has_ended: AtomicBool,
}

#[derive(Default)]
struct Inner {
    clients: Vec<Arc<Client>>,
    /// Of each state the newest, for who subscribes later.
    states: Vec<Arc<Message>>,
    /// Why there is no daemon.
    gone: Option<String>,
}

/// A client as others see it.
pub(crate) struct Client {
    pub(crate) address: SocketAddr,
    state: Mutex<ClientState>,
    /// Told when there is something to send.
    pub(crate) wake: Notify,
}

struct ClientState {
    queue: Queue,
    /// By topic, the client's number of its subscription.
    subscriptions: [Option<u32>; Topic::ALL.len()],
    told_lost: u64,
    told_lost_at: Instant,
}

impl Hub {
    pub(crate) fn new(say: Say) -> Self {
        Self {
            say,
            remarks: Mutex::new(Remarks::new(Instant::now())),
            counters: Counters::default(),
            inner: Mutex::default(),
            wanted: AtomicU32::new(0),
            has_ended: AtomicBool::new(false),
        }
    }

    /// Tells people something of a client, as often as it is good for them.
    pub(crate) fn remark(&self, line: String) {
        if let Some(line) = lock(&self.remarks).of(line, Instant::now()) {
            self.say(Priority::Info, &line);
        }
    }

    pub(crate) fn say(&self, priority: Priority, line: &str) {
        (self.say)(priority, line);
    }

    pub(crate) fn end(&self) {
        self.has_ended.store(true, Ordering::Relaxed);
        lock(&self.inner)
            .clients
            .iter()
            .for_each(|client| client.wake.notify_one());
    }

    pub(crate) fn has_ended(&self) -> bool {
        self.has_ended.load(Ordering::Relaxed)
    }

    /// Whether messages of this topic are to be made: those that a client is subscribed to, and what one that comes later
    /// is to be told.
    pub(crate) fn wants(&self, topic: Topic) -> bool {
        is_state(topic) || self.wanted.load(Ordering::Relaxed) & bit(topic) != 0
    }

    /// Lets a client in, and tells it what there is.
    pub(crate) fn join(&self, address: SocketAddr, greeting: &[String]) -> Arc<Client> {
        let now = Instant::now();
        let mut queue = Queue::default();
        greeting.iter().for_each(|text| queue.push_text(text.clone()));
        let mut inner = lock(&self.inner);
        if let Some(why) = &inner.gone {
            queue.push_text(protocol::gone(why));
        }
        let client = Arc::new(Client {
            address,
            state: Mutex::new(ClientState {
                queue,
                subscriptions: Default::default(),
                told_lost: 0,
                told_lost_at: now,
            }),
            wake: Notify::new(),
        });
        inner.clients.push(client.clone());
        add(&self.counters.clients, 1);
        client
    }

    /// A client is gone. How many messages it has lost is counted.
    pub(crate) fn leave(&self, client: &Arc<Client>) -> u64 {
        let mut inner = lock(&self.inner);
        inner.clients.retain(|other| !Arc::ptr_eq(other, client));
        self.count_wanted(&inner);
        let lost = lock(&client.state).queue.lost();
        add(&self.counters.lost, lost);
        lost
    }

    fn count_wanted(&self, inner: &Inner) {
        let mut wanted = 0;
        for client in &inner.clients {
            let state = lock(&client.state);
            let of_client = std::iter::zip(Topic::ALL, state.subscriptions).filter(|(_, id)| id.is_some());
            wanted |= of_client
                .map(|(topic, _)| bit(topic))
                .fold(0, |all, one| all | one);
        }
        self.wanted.store(wanted, Ordering::Relaxed);
    }

    /// Subscribes a client; of what is refused, the first is told why.
    pub(crate) fn subscribe(&self, client: &Client, subscriptions: &[Subscription]) -> Result<(), String> {
        let inner = lock(&self.inner);
        let now = Instant::now();
        let (mut refused, mut first) = (0, None);
        {
            let mut state = lock(&client.state);
            for subscription in subscriptions {
                match state.subscribe(*subscription) {
                    Ok(topic) => {
                        let newest = inner.states.iter().find(|message| message.topic == topic);
                        newest.into_iter().for_each(|state_of| {
                            state.queue.push(state_of.clone(), now);
                        });
                    }
                    Err(why) => {
                        refused += 1;
                        first.get_or_insert(why);
                    }
                }
            }
        }
        self.count_wanted(&inner);
        first.map_or(Ok(()), |why| {
            Err(format!(
                "{refused} of {} subscriptions are refused: {why}",
                subscriptions.len()
            ))
        })
    }

    /// Ends subscriptions of a client.
    pub(crate) fn unsubscribe(&self, client: &Client, ids: &[u32]) -> Result<(), String> {
        let inner = lock(&self.inner);
        let mut unknown = None;
        {
            let mut state = lock(&client.state);
            for id in ids {
                let mut subscriptions = state.subscriptions.iter_mut();
                match subscriptions.find(|subscription| **subscription == Some(*id)) {
                    Some(subscription) => *subscription = None,
                    None => unknown = Some(*id),
                }
            }
        }
        self.count_wanted(&inner);
        unknown.map_or(Ok(()), |id| {
            Err(format!("there is no subscription {id} to be ended"))
        })
    }

    /// Counts what a client said that cannot be done, and tells it.
    pub(crate) fn fault(&self, client: &Client, why: &str) {
        add(&self.counters.faults, 1);
        lock(&client.state)
            .queue
            .push_text(protocol::status(Level::Error, why));
    }

    /// Gives messages to whom they are for.
    pub(crate) fn publish(&self, messages: Vec<Message>) {
        let now = Instant::now();
        let messages: Vec<Arc<Message>> = messages.into_iter().map(Arc::new).collect();
        let mut inner = lock(&self.inner);
        for message in messages.iter().filter(|message| is_state(message.topic)) {
            inner.states.retain(|older| older.topic != message.topic);
            inner.states.push(message.clone());
        }
        for client in &inner.clients {
            let mut state = lock(&client.state);
            let mut any = false;
            for message in &messages {
                if state.subscriptions[message.topic as usize].is_some() {
                    state.queue.push(message.clone(), now);
                    any = true;
                }
            }
            any |= state.tell_lost(now);
            drop(state);
            if any {
                client.wake.notify_one();
            }
        }
    }

    /// Whether this is what is known already.
    pub(crate) fn is_known(&self, topic: Topic, data: &[u8]) -> bool {
        let inner = lock(&self.inner);
        inner
            .states
            .iter()
            .any(|message| message.topic == topic && message.data == data)
    }

    /// Tells every client that the daemon is gone, until it is [`back`](Self::back).
    pub(crate) fn gone(&self, why: &str) {
        let mut inner = lock(&self.inner);
        inner.gone = Some(why.to_owned());
        tell(&inner, &[protocol::gone(why)]);
    }

    /// Tells every client that the daemon is there again.
    pub(crate) fn back(&self, what: &str) {
        let mut inner = lock(&self.inner);
        if inner.gone.take().is_some() {
            tell(&inner, &[protocol::back(), protocol::status(Level::Info, what)]);
        }
    }
}

fn tell(inner: &Inner, texts: &[String]) {
    for client in &inner.clients {
        let mut state = lock(&client.state);
        texts.iter().for_each(|text| state.queue.push_text(text.clone()));
        client.wake.notify_one();
    }
}

impl ClientState {
    fn subscribe(&mut self, Subscription { id, channel_id }: Subscription) -> Result<Topic, String> {
        let topic = topic_of(channel_id).ok_or_else(|| format!("there is no channel {channel_id}"))?;
        if self.subscriptions.contains(&Some(id)) {
            return Err(format!("subscription {id} is there already"));
        }
        let place = &mut self.subscriptions[topic as usize];
        if place.is_some() {
            return Err(format!("channel {channel_id} is subscribed to already"));
        }
        *place = Some(id);
        Ok(topic)
    }

    /// Puts what was lost since it was last told, if it is time to; returns whether it was.
    fn tell_lost(&mut self, now: Instant) -> bool {
        let lost = self.queue.lost();
        let is_due = lost > self.told_lost && now.saturating_duration_since(self.told_lost_at) >= SLOW_AGAIN;
        if is_due {
            (self.told_lost, self.told_lost_at) = (lost, now);
            self.queue.push_text(protocol::too_slow(lost));
        }
        is_due
    }
}

impl Client {
    /// What it is sent next, in the bytes that are sent, but for what it has unsubscribed from since.
    pub(crate) fn next(&self) -> Option<ToSend> {
        let mut state = lock(&self.state);
        loop {
            match state.queue.pop()? {
                Next::Text(text) => return Some(ToSend::Text(text)),
                Next::Data(message) => {
                    if let Some(id) = state.subscriptions[message.topic as usize] {
                        drop(state);
                        let data = protocol::message_data(id, message.wall_ns, &message.data);
                        return Some(ToSend::Data(data));
                    }
                }
            }
        }
    }
}

/// A message as it is sent.
#[derive(Debug)]
pub(crate) enum ToSend {
    Text(String),
    Data(Vec<u8>),
}
