//! The display profiles at work: who asks for which, whether it can be afforded, and when it is no longer needed.
//!
//! Lives on the socket thread. A profile that several ask for is made once; the tick thread knows nothing of who
//! reads.

use crate::config::{Config, TickMode};
use crate::cost::{Cost, measure};
use crate::display::{Display, resolve_region};
use crate::displays::{CostPerTick, Returned, Stream, cost_per_tick};
use crate::hub::{self, Newest};
use crate::tick::{Command, Shared};
use serde_json::{Value, json};
use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::sync::{Arc, mpsc};
use std::time::{Duration, Instant};
use taxel_hand::Profile;
use taxel_skin::Layout;
use taxel_wire::Hello;
use tokio::sync::watch;

/// A profile goes on being made for this long after its last reader left without a word, so that a driver that
/// reconnects finds its actuators where they were.
const GRACE: Duration = Duration::from_secs(2);
/// A candidate whose first image takes this many times what is set aside for all is not measured further.
const HOPELESS: u64 = 4;

/// What makes a profile distinct: two displays that state the same are given the same bytes.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct DisplayProfile {
    pub(crate) profile: Profile,
    /// Parts of the hand, each once and in the layout's order; `None` for all of it.
    pub(crate) region: Option<Vec<String>>,
}

impl DisplayProfile {
    /// Whether both give the same images, however they are written.
    fn is(&self, other: &Self) -> bool {
        self.region == other.region && self.profile.canonical() == other.profile.canonical()
    }
}

/// A profile that the tick thread makes images for.
#[derive(Debug)]
pub(crate) struct Made {
    /// Number for the status report, never used twice.
    pub(crate) id: u32,
    pub(crate) wanted: DisplayProfile,
    pub(crate) newest: Newest,
    /// The packets of its HELLO message.
    pub(crate) hello: Vec<Vec<u8>>,
    slot: usize,
    reserved: Cost,
    cost_ns: CostPerTick,
    /// Subscribers that stated it.
    readers: Cell<usize>,
    /// Whether it is the daemon's own.
    own: Cell<bool>,
    /// Since when nobody has needed it.
    idle_since: Cell<Option<Instant>>,
}

/// A profile that a subscriber stated; it is made at least as long as this lives.
#[derive(Debug)]
pub(crate) struct Lease(Rc<Made>);

/// The table of profiles.
#[derive(Debug)]
pub(crate) struct Profiles {
    made: RefCell<Vec<Rc<Made>>>,
    own: watch::Sender<Rc<Made>>,
    /// One candidate is measured at a time, also where nobody waits for the result any more.
    admission: Arc<tokio::sync::Mutex<()>>,
    free_slots: RefCell<Vec<usize>>,
    next_id: Cell<u32>,
    max: usize,
    budget_ns: u64,
    layout: Layout,
    /// The description of the hand, for any display.
    hello: Hello,
    percent: f64,
    period_ns: u64,
    commands: mpsc::SyncSender<Command>,
    returned: Returned,
    shared: Arc<Shared>,
}

/// Slots of the tick thread's table for so many profiles. Twice as many, so that one can come while another is
/// still on its way back.
pub(crate) fn slots(config: &Config) -> usize {
    2 * usize::from(config.profiles.max)
}

/// The daemon's own profile at the start, in slot 0.
pub(crate) struct Own {
    newest: Newest,
    reserved: Cost,
    cost_ns: CostPerTick,
}

/// Makes the stream of the daemon's own profile, and what the socket thread has to know of it.
pub(crate) fn own_stream(config: &Config) -> Result<(Box<Stream>, Own), taxel_hand::ProfileError> {
    let layout = &config.layout;
    let display = || Display::new(config.profile.clone(), None, layout);
    let untouched = taxel_hand::ForceFrame::new(layout.len());
    let reserved = measure(display()?, untouched, HOPELESS * budget_ns(config));
    let (stream, newest, cost_ns) = stream(display()?, layout, &config.profile);
    let own = Own {
        newest,
        reserved,
        cost_ns,
    };
    Ok((stream, own))
}

fn stream(display: Display, layout: &Layout, profile: &Profile) -> (Box<Stream>, Newest, CostPerTick) {
    let (publisher, newest) = hub::channel(crate::payload_lens(layout, profile).0);
    let cost_ns = cost_per_tick();
    let stream = Stream {
        display,
        publisher,
        cost_ns: cost_ns.clone(),
    };
    (Box::new(stream), newest, cost_ns)
}

/// Time between two images: in `sweep` mode a sweep of the boards.
fn period_ns(config: &Config) -> u64 {
    match config.tick.mode {
        TickMode::Timer => config.tick.period_ns(),
        TickMode::Sweep => config.sweep.board_period_ns(),
    }
}

fn budget_ns(config: &Config) -> u64 {
    (period_ns(config) as f64 * config.profiles.budget_percent / 100.0) as u64
}

impl Profiles {
    /// The table with the daemon's own profile in it. `hello` describes the hand; its display is filled in here.
    pub(crate) fn new(
        config: &Config,
        own: Own,
        hello: Hello,
        commands: mpsc::SyncSender<Command>,
        returned: Returned,
        shared: Arc<Shared>,
    ) -> Self {
        let wanted = DisplayProfile {
            profile: config.profile.clone(),
            region: None,
        };
        let own = Rc::new(Made {
            id: 0,
            hello: describe(&hello, &wanted),
            wanted,
            newest: own.newest,
            slot: 0,
            reserved: own.reserved,
            cost_ns: own.cost_ns,
            readers: Cell::new(0),
            own: Cell::new(true),
            idle_since: Cell::new(None),
        });
        let (budget_ns, reserved_ns) = (budget_ns(config), own.reserved.reserved_ns());
        if reserved_ns > budget_ns {
            tracing::warn!(
                "the daemon's own profile takes {:.1} us of each tick with every taxel in contact, and {:.1} us are set \
                 aside for all profiles; no subscriber can have one of its own unless [profiles] budget_percent is raised",
                us(reserved_ns),
                us(budget_ns)
            );
        }
        Self {
            made: RefCell::new(vec![own.clone()]),
            own: watch::channel(own).0,
            admission: Arc::default(),
            free_slots: RefCell::new((1..slots(config)).rev().collect()),
            next_id: Cell::new(1),
            max: config.profiles.max.into(),
            budget_ns,
            layout: config.layout.clone(),
            hello,
            percent: config.profiles.budget_percent,
            period_ns: period_ns(config),
            commands,
            returned,
            shared,
        }
    }

    /// The daemon's own profile.
    pub(crate) fn own(&self) -> Rc<Made> {
        self.own.borrow().clone()
    }

    /// Tells when the daemon's own profile is another.
    pub(crate) fn follow_own(&self) -> watch::Receiver<Rc<Made>> {
        self.own.subscribe()
    }

    /// Makes this the daemon's own profile from the next tick on.
    pub(crate) async fn set_own(&self, profile: Profile) -> Result<(), String> {
        let wanted = DisplayProfile {
            profile,
            region: None,
        };
        let lease = self.lease(wanted, Some(self.own())).await?;
        let before = self.own();
        before.own.set(false);
        lease.0.own.set(true);
        self.own.send_replace(lease.0.clone());
        drop(lease);
        before.idle_since.set(Some(Instant::now()));
        if !before.is_needed() {
            self.remove(&before);
        }
        Ok(())
    }

    /// The parts of a stated region, as a [`DisplayProfile`] has them.
    pub(crate) fn region(&self, stated: Option<&[String]>) -> Result<Option<Vec<String>>, String> {
        match stated {
            None => Ok(None),
            Some(names) => resolve_region(names, &self.layout).map_err(|e| e.to_string()),
        }
    }

    /// The profile that is wanted, from the next tick on if nobody has it yet.
    ///
    /// `instead_of` is what whoever asks will give up for it; its cost and place are counted as free if nobody else needs
    /// them. The error is fit for an EVENT.
    pub(crate) async fn lease(
        &self,
        wanted: DisplayProfile,
        instead_of: Option<Rc<Made>>,
    ) -> Result<Lease, String> {
        if let Some(lease) = self.find(&wanted) {
            return Ok(lease);
        }
        let turn = self.admission.clone().lock_owned().await;
        // It may have been admitted while this one waited for its turn.
        if let Some(lease) = self.find(&wanted) {
            return Ok(lease);
        }
        crate::check_message_size(&self.layout, &wanted.profile).map_err(|e| e.to_string())?;
        let display = || Display::new(wanted.profile.clone(), wanted.region.as_deref(), &self.layout);
        let (candidate, display) = display()
            .and_then(|candidate| Ok((candidate, display()?)))
            .map_err(|e| e.to_string())?;
        self.find_place(instead_of.as_ref(), 0)
            .map_err(|taken| self.refuse_place(taken))?;
        let newest = {
            let snapshot = self.shared.snapshot.lock().unwrap_or_else(|e| e.into_inner());
            snapshot.force.clone()
        };
        let hopeless_ns = HOPELESS * self.budget_ns;
        let measured = move || (measure(candidate, newest, hopeless_ns), turn);
        let (reserved, _turn) = tokio::task::spawn_blocking(measured)
            .await
            .map_err(|e| format!("its cost could not be measured: {e}"))?;
        // Others may have left meanwhile, and none can have come.
        self.find_place(instead_of.as_ref(), reserved.reserved_ns())
            .map_err(|taken| self.refuse_cost(taken, reserved))?;

        let too_fast = || "profiles change too fast; ask again in a second".to_string();
        let slot = self.take_slot().ok_or_else(too_fast)?;
        let (stream, newest, cost_ns) = stream(display, &self.layout, &wanted.profile);
        if let Err(error) = self.command(Command::Insert(slot, stream)) {
            self.free_slots.borrow_mut().push(slot);
            return Err(error);
        }
        let id = self.next_id.replace(self.next_id.get().wrapping_add(1));
        tracing::info!(
            profile = id,
            reserved_us = us(reserved.reserved_ns()),
            "another display profile: {}",
            json!(wanted.profile)
        );
        let made = Rc::new(Made {
            id,
            slot,
            hello: describe(&self.hello, &wanted),
            wanted,
            newest,
            reserved,
            cost_ns,
            readers: Cell::new(0),
            own: Cell::new(false),
            idle_since: Cell::new(None),
        });
        self.made.borrow_mut().push(made.clone());
        Ok(Lease::new(made))
    }

    /// Gives a profile up for another: it is not kept in case its reader comes back.
    pub(crate) fn give_up(&self, lease: Lease) {
        let made = lease.0.clone();
        drop(lease);
        if !made.is_needed() {
            self.remove(&made);
        }
    }

    /// Removes what nobody has needed for a while, and frees what the tick thread has given back.
    pub(crate) fn tidy(&self) {
        self.take_back();
        for made in self.idle(GRACE) {
            self.remove(&made);
        }
    }

    /// The profiles, for the status report; `subscribers` tells how many are shown a profile.
    pub(crate) fn status(&self, subscribers: impl Fn(u32) -> usize) -> Vec<Value> {
        let made = self.made.borrow();
        let status = |made: &Rc<Made>| {
            let cost_ns = made.cost_ns.lock().unwrap_or_else(|e| e.into_inner());
            json!({
                "id": made.id,
                "own": made.own.get(),
                "profile": made.wanted.profile,
                "region": made.wanted.region,
                "subscribers": subscribers(made.id),
                "images": cost_ns.len(),
                "cost_us": {
                    "p50": us(cost_ns.value_at_quantile(0.5)),
                    "p99": us(cost_ns.value_at_quantile(0.99)),
                    "reserved": us(made.reserved.reserved_ns()),
                },
            })
        };
        made.iter().map(status).collect()
    }

    /// What is set aside for all profiles and what they take of it, for the status report.
    pub(crate) fn budget(&self) -> Value {
        json!({
            "max": self.max,
            "tick_us": us(self.period_ns),
            "budget_us": us(self.budget_ns),
            "spent_us": us(self.made.borrow().iter().map(|made| made.cost_ns()).sum()),
        })
    }

    /// How many profiles are made.
    pub(crate) fn len(&self) -> usize {
        self.made.borrow().len()
    }

    fn find(&self, wanted: &DisplayProfile) -> Option<Lease> {
        let made = self.made.borrow();
        made.iter()
            .find(|made| made.wanted.is(wanted))
            .cloned()
            .map(Lease::new)
    }

    /// Makes room for one more profile that costs so much, by removing idle ones. The error is how many profiles are
    /// needed, and what they cost together.
    fn find_place(&self, instead_of: Option<&Rc<Made>>, cost_ns: u64) -> Result<(), (usize, u64)> {
        let stays = |made: &Rc<Made>| {
            let leaves = instead_of.is_some_and(|leaving| {
                Rc::ptr_eq(leaving, made) && made.readers.get() + usize::from(made.own.get()) <= 1
            });
            made.is_needed() && !leaves
        };
        let needed: Vec<Rc<Made>> = self.made.borrow().iter().filter(|m| stays(m)).cloned().collect();
        let needed_ns = needed.iter().map(|made| made.cost_ns()).sum::<u64>();
        if needed.len() >= self.max || (cost_ns > 0 && needed_ns.saturating_add(cost_ns) > self.budget_ns) {
            return Err((needed.len(), needed_ns));
        }
        for idle in self.idle(Duration::ZERO) {
            let made_ns = self.made.borrow().iter().map(|made| made.cost_ns()).sum::<u64>();
            if self.len() < self.max && made_ns.saturating_add(cost_ns) <= self.budget_ns {
                break;
            }
            self.remove(&idle);
        }
        Ok(())
    }

    fn refuse_place(&self, (needed, _): (usize, u64)) -> String {
        format!(
            "{needed} different profiles are in use, and [profiles] max = {}; ask for one of those in use, or raise it",
            self.max
        )
    }

    fn refuse_cost(&self, (needed, needed_ns): (usize, u64), cost: Cost) -> String {
        format!(
            "the profile costs too much: {:.1} us per tick with every taxel in contact ({:.1} us with what the hand feels now), \
             beside {:.1} us for the {needed} in use. Together that may be {:.1} us, {} % of a tick of {:.1} us; ask for \
             fewer levels, actuators or iterations, or raise [profiles] budget_percent",
            us(cost.worst_ns),
            us(cost.newest_ns),
            us(needed_ns),
            us(self.budget_ns),
            self.percent,
            us(self.period_ns),
        )
    }

    /// Profiles that nobody has needed for so long, the longest idle first.
    fn idle(&self, at_least: Duration) -> Vec<Rc<Made>> {
        let idle_for = |made: &Rc<Made>| made.idle_since.get().map(|since| since.elapsed());
        let mut idle: Vec<Rc<Made>> = (self.made.borrow().iter())
            .filter(|made| !made.is_needed() && idle_for(made).is_some_and(|idle| idle >= at_least))
            .cloned()
            .collect();
        idle.sort_by_key(|made| std::cmp::Reverse(idle_for(made)));
        idle
    }

    fn remove(&self, made: &Rc<Made>) {
        // Kept where the tick thread cannot be told now; `tidy` tries again.
        if self.command(Command::Remove(made.slot)).is_ok() {
            tracing::info!(profile = made.id, "display profile no longer needed");
            self.made.borrow_mut().retain(|other| !Rc::ptr_eq(other, made));
        }
    }

    fn take_slot(&self) -> Option<usize> {
        self.take_back();
        self.free_slots.borrow_mut().pop()
    }

    fn take_back(&self) {
        while let Ok((slot, stream)) = self.returned.try_recv() {
            drop(stream);
            self.free_slots.borrow_mut().push(slot);
        }
    }

    fn command(&self, command: Command) -> Result<(), String> {
        crate::tick::command(&self.commands, &self.shared, command)
    }
}

impl Made {
    fn is_needed(&self) -> bool {
        self.own.get() || self.readers.get() > 0
    }

    /// What it takes of each tick: what was set aside for it, or what it has turned out to take if that is more.
    fn cost_ns(&self) -> u64 {
        let measured = self.cost_ns.lock().unwrap_or_else(|e| e.into_inner());
        self.reserved.reserved_ns().max(measured.value_at_quantile(0.5))
    }
}

impl Lease {
    fn new(made: Rc<Made>) -> Self {
        made.readers.set(made.readers.get() + 1);
        made.idle_since.set(None);
        Self(made)
    }

    pub(crate) fn made(&self) -> &Rc<Made> {
        &self.0
    }
}

impl Drop for Lease {
    fn drop(&mut self) {
        let readers = self.0.readers.get() - 1;
        self.0.readers.set(readers);
        if readers == 0 {
            self.0.idle_since.set(Some(Instant::now()));
        }
    }
}

fn describe(hand: &Hello, wanted: &DisplayProfile) -> Vec<Vec<u8>> {
    let hello = Hello {
        profile: (&wanted.profile).into(),
        region: wanted.region.clone(),
        ..hand.clone()
    };
    hello.to_packets(0, 0)
}

fn us(ns: u64) -> f64 {
    ns as f64 / 1000.0
}
