//! The display profiles at work: who asks for which, whether it can be afforded, and when it is no
//! longer needed.
//!
//! Lives on the serving thread. A profile that several ask for is made once; the thread that has
//! the frames knows nothing of who reads.

pub(crate) mod active_profile;
pub(crate) mod output_slots;
pub(crate) mod profile_maker;

use crate::config::ProfilesConfig;
use crate::delivery::stream::{OverTicks, StreamEnd, stream};
use crate::log_lines::LogLines;
use active_profile::{ActiveProfile, Lease, ProfileRecord, Started, us};
use output_slots::{Output, SlotControl, cost_per_tick};
use profile_maker::{Cost, DisplayProfile, ProfileMaker};
use std::cell::{Cell, RefCell};
use std::collections::HashMap;
use std::rc::Rc;
use std::sync::Arc;
use std::time::{Duration, Instant};
use taxel_hand::Profile;
use taxel_wire::status::ProfilesBudget;
use tokio::sync::watch;

/// A profile goes on being made for this long after its last reader left without a word, so that a
/// driver that reconnects finds its actuators where they were.
const GRACE: Duration = Duration::from_secs(2);
/// A candidate whose first image takes this many times what is set aside for all is not measured further.
const HOPELESS: u64 = 4;

/// The table of profiles.
pub(crate) struct Profiles<M: ProfileMaker> {
    pub(crate) maker: M,
    pub(crate) slots: SlotControl<M::Frames>,
    active: RefCell<Vec<Rc<ActiveProfile>>>,
    own: watch::Sender<Rc<ActiveProfile>>,
    /// One candidate is measured at a time, also where nobody waits for the result any more.
    admission: Arc<tokio::sync::Mutex<()>>,
    next_id: Cell<u32>,
    /// Lines that tell which came and went.
    changes: RefCell<LogLines>,
    max: usize,
    budget_ns: u64,
    percent: f64,
}

impl<M: ProfileMaker> Profiles<M> {
    /// The table with the profile of whoever states none in it.
    pub(crate) fn new(
        maker: M,
        slots: SlotControl<M::Frames>,
        config: ProfilesConfig,
        wanted: DisplayProfile,
        own: Started,
    ) -> Self {
        let budget_ns = budget_ns(&maker, &config);
        let own = Rc::new(own.activate(&maker, wanted, 0));
        own.own.set(true);
        let reserved_ns = own.reserved.reserved_ns();
        if reserved_ns > budget_ns {
            tracing::warn!(
                "the daemon's own profile takes {:.1} us of each tick with every taxel in contact, and {:.1} us are set \
                 aside for all profiles; no subscriber can have one of its own unless [profiles] budget_percent is raised",
                us(reserved_ns),
                us(budget_ns)
            );
        }
        Self {
            maker,
            slots,
            active: RefCell::new(vec![own.clone()]),
            own: watch::channel(own).0,
            admission: Arc::default(),
            next_id: Cell::new(1),
            changes: RefCell::default(),
            max: config.max.into(),
            budget_ns,
            percent: config.budget_percent,
        }
    }

    /// The profile of whoever states none.
    pub(crate) fn own(&self) -> Rc<ActiveProfile> {
        self.own.borrow().clone()
    }

    /// Tells when the profile of whoever states none is another.
    pub(crate) fn follow_own(&self) -> watch::Receiver<Rc<ActiveProfile>> {
        self.own.subscribe()
    }

    /// Makes this the profile of whoever states none, from the next tick on.
    pub(crate) async fn set_own(&self, profile: Profile) -> Result<(), String> {
        let wanted = DisplayProfile {
            profile,
            region: None,
        };
        let lease = self.lease(wanted, Some(self.own())).await?;
        let before = self.own();
        before.own.set(false);
        lease.profile().own.set(true);
        self.own.send_replace(lease.profile().clone());
        drop(lease);
        before.idle_since.set(Some(Instant::now()));
        if !before.is_needed() {
            self.remove(&before);
        }
        Ok(())
    }

    /// The parts of a stated region, as a [`DisplayProfile`] has them.
    pub(crate) fn region(&self, stated: Option<&[String]>) -> Result<Option<Vec<String>>, String> {
        stated.map_or(Ok(None), |names| self.maker.region(names))
    }

    /// The profile that is wanted, from the next tick on if nobody has it yet.
    ///
    /// `instead_of` is what whoever asks will give up for it; its cost and place are counted as
    /// free if nobody else needs them. The error is fit for an EVENT.
    pub(crate) async fn lease(
        &self,
        wanted: DisplayProfile,
        instead_of: Option<Rc<ActiveProfile>>,
    ) -> Result<Lease, String> {
        // First, since values that are refused may be those that make no difference to one in use.
        wanted.profile.check().map_err(|e| e.to_string())?;
        if let Some(lease) = self.find(&wanted) {
            return Ok(lease);
        }
        let turn = self.admission.clone().lock_owned().await;
        // It may have been admitted while this one waited for its turn.
        if let Some(lease) = self.find(&wanted) {
            return Ok(lease);
        }
        let measurement = self.maker.measurement(&wanted, HOPELESS * self.budget_ns)?;
        self.find_place(instead_of.as_ref(), 0)
            .map_err(|taken| self.refuse_place(taken))?;
        let measured = move || (measurement(), turn);
        let (reserved, _turn) = tokio::task::spawn_blocking(measured)
            .await
            .map_err(|e| format!("its cost could not be measured: {e}"))?;
        // Others may have left meanwhile, and none can have come.
        self.find_place(instead_of.as_ref(), reserved.reserved_ns())
            .map_err(|taken| self.refuse_cost(taken, reserved))?;

        let id = self.next_id.get();
        let started =
            start(&self.maker, &self.slots, &wanted, reserved)?.ok_or("this program makes no images")?;
        let active = Rc::new(started.activate(&self.maker, wanted, id));
        self.next_id.set(id.wrapping_add(1));
        if let Some(unsaid) = self.changes.borrow_mut().take_line(Instant::now().into()) {
            tracing::info!(
                profile = id,
                reserved_us = us(reserved.reserved_ns()),
                "another display profile: {}{unsaid}",
                serde_json::json!(active.wanted.profile)
            );
        }
        self.active.borrow_mut().push(active.clone());
        Ok(Lease::new(active))
    }

    /// Gives a profile up for another: it is not kept in case its reader comes back.
    pub(crate) fn give_up(&self, lease: Lease) {
        let active = lease.profile().clone();
        drop(lease);
        if !active.is_needed() {
            self.remove(&active);
        }
    }

    /// Removes what nobody has needed for a while, and frees what has come back.
    pub(crate) fn tidy(&self) {
        self.slots.take_back();
        for idle in self.idle(GRACE) {
            self.remove(&idle);
        }
        if let Some(lines) = self.changes.borrow_mut().take_unsaid(Instant::now().into()) {
            tracing::info!("lines on display profiles that came and went that are not in this log: {lines}");
        }
    }

    /// The profiles there are.
    pub(crate) fn records(&self) -> Vec<ProfileRecord> {
        let record = |active: &Rc<ActiveProfile>| ProfileRecord {
            id: active.id,
            own: active.own.get(),
            wanted: active.wanted.clone(),
            reserved: active.reserved,
            cost_ns: active.cost_ns.clone(),
        };
        self.active.borrow().iter().map(record).collect()
    }

    /// For each profile, by its number, [`OverTicks`] of its images.
    pub(crate) fn over_ticks(&self) -> HashMap<u32, OverTicks> {
        let over = |active: &Rc<ActiveProfile>| (active.id, OverTicks::of(&active.stream));
        self.active.borrow().iter().map(over).collect()
    }

    /// What is set aside for all profiles; not what they take of it.
    pub(crate) fn budget(&self) -> ProfilesBudget {
        ProfilesBudget {
            max: self.max,
            tick_us: us(self.maker.period_ns()),
            budget_us: us(self.budget_ns),
            ..ProfilesBudget::default()
        }
    }

    fn find(&self, wanted: &DisplayProfile) -> Option<Lease> {
        let canonical = wanted.canonical();
        let active = self.active.borrow();
        let same = active.iter().find(|active| active.canonical == canonical);
        same.cloned().map(Lease::new)
    }

    /// Makes room for one more profile of this cost, by removing idle ones. The error is how many
    /// profiles are needed, and what they cost together.
    fn find_place(&self, instead_of: Option<&Rc<ActiveProfile>>, cost_ns: u64) -> Result<(), (usize, u64)> {
        let stays = |active: &Rc<ActiveProfile>| {
            let leaves = instead_of.is_some_and(|leaving| {
                Rc::ptr_eq(leaving, active) && active.readers.get() + usize::from(active.own.get()) <= 1
            });
            active.is_needed() && !leaves
        };
        let needed: Vec<Rc<ActiveProfile>> = self
            .active
            .borrow()
            .iter()
            .filter(|m| stays(m))
            .cloned()
            .collect();
        let needed_ns = needed.iter().map(|active| active.cost_ns()).sum::<u64>();
        if needed.len() >= self.max || (cost_ns > 0 && needed_ns.saturating_add(cost_ns) > self.budget_ns) {
            return Err((needed.len(), needed_ns));
        }
        for idle in self.idle(Duration::ZERO) {
            let active_ns = self
                .active
                .borrow()
                .iter()
                .map(|active| active.cost_ns())
                .sum::<u64>();
            if self.active.borrow().len() < self.max && active_ns.saturating_add(cost_ns) <= self.budget_ns {
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
            us(self.maker.period_ns()),
        )
    }

    /// Profiles that nobody has needed for at least this long, the longest idle first.
    fn idle(&self, at_least: Duration) -> Vec<Rc<ActiveProfile>> {
        let idle_for = |active: &Rc<ActiveProfile>| active.idle_since.get().map(|since| since.elapsed());
        let mut idle: Vec<Rc<ActiveProfile>> = (self.active.borrow().iter())
            .filter(|active| !active.is_needed() && idle_for(active).is_some_and(|idle| idle >= at_least))
            .cloned()
            .collect();
        idle.sort_by_key(|active| std::cmp::Reverse(idle_for(active)));
        idle
    }

    fn remove(&self, active: &Rc<ActiveProfile>) {
        // Kept where the table cannot be changed now; `tidy` tries again.
        if active.slot.is_none_or(|slot| self.slots.remove(slot).is_ok()) {
            if let Some(unsaid) = self.changes.borrow_mut().take_line(Instant::now().into()) {
                tracing::info!(profile = active.id, "display profile no longer needed{unsaid}");
            }
            self.active
                .borrow_mut()
                .retain(|other| !Rc::ptr_eq(other, active));
        }
    }
}

/// Has the images of a profile made from the next tick on; `None` where no images are made at all.
fn start<M: ProfileMaker>(
    maker: &M,
    slots: &SlotControl<M::Frames>,
    wanted: &DisplayProfile,
    reserved: Cost,
) -> Result<Option<Started>, String> {
    let Some((encoder, payload_len)) = maker.output(wanted)? else {
        return Ok(None);
    };
    let (publisher, stream) = stream(payload_len, maker.rate_hz());
    let cost_ns = cost_per_tick();
    let output = Output {
        encoder,
        publisher,
        cost_ns: cost_ns.clone(),
    };
    let slot = slots.insert(Box::new(output)).map_err(|e| e.to_string())?;
    Ok(Some(Started {
        slot: Some(slot),
        stream,
        cost_ns,
        reserved,
    }))
}

/// Measures the profile of whoever states none and has it made, before anything else is.
pub(crate) fn start_own<M: ProfileMaker>(
    maker: &M,
    slots: &SlotControl<M::Frames>,
    config: &ProfilesConfig,
    wanted: &DisplayProfile,
) -> Result<Started, String> {
    let reserved = maker.measurement(wanted, HOPELESS * budget_ns(maker, config))?();
    let started = start(maker, slots, wanted, reserved)?;
    Ok(started.unwrap_or_else(|| Started {
        slot: None,
        stream: StreamEnd::silent(),
        cost_ns: cost_per_tick(),
        reserved,
    }))
}

/// Time of each tick that is set aside for all profiles.
fn budget_ns<M: ProfileMaker>(maker: &M, config: &ProfilesConfig) -> u64 {
    (maker.period_ns() as f64 * config.budget_percent / 100.0) as u64
}
