//! Watches the hand from the socket thread: says in the log what changed, feeds systemd's watchdog, tells
//! subscribers, and lets display profiles go that nobody needs.
//!
//! The tick thread itself never logs, so that a slow terminal or journal cannot hold up an image.

use crate::hand::Hand;
use crate::joints::{JointsView, Told, Weight};
use crate::problems::News;
use crate::snapshot::Snapshot;
use sd_notify::NotifyState;
use std::rc::Rc;
use std::time::Duration;
use taxel_can::LinkState;
use taxel_hand::Fault;
use taxel_skin::BoardState;
use taxel_wire::{Event, EventKind};
use tokio::time::{Instant, MissedTickBehavior, interval};

const LOOK: Duration = Duration::from_millis(100);
/// How long after the start every board should have been heard.
const ROLL_CALL: Duration = Duration::from_secs(2);
const STATUS: Duration = Duration::from_secs(1);

/// Runs until every recording has been played to its end, and images have reached their subscribers.
pub(crate) async fn watch(hand: Rc<Hand>) {
    let mut look = interval(LOOK);
    look.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut before: Option<Snapshot> = None;
    let mut joints = Told::default();
    let mut last_heartbeat = 0;
    let mut status_at = Instant::now();
    let mut roll_call_at = Some(Instant::now() + ROLL_CALL);
    loop {
        look.tick().await;
        let now = hand
            .shared
            .snapshot
            .lock()
            .unwrap_or_else(|e| e.into_inner())
            .clone();
        if !now.written {
            continue;
        }
        tell_changes(&hand, before.as_ref(), &now);
        let view = hand.joints(&now);
        tell_problems(&hand, &now, view.as_ref(), roll_call_at.is_none());
        tell_joints(&hand, view.as_ref(), &mut joints);
        before = Some(now);
        hand.profiles.tidy();

        let heartbeat = hand.heartbeat();
        if heartbeat != last_heartbeat {
            last_heartbeat = heartbeat;
            let _ = sd_notify::notify(&[NotifyState::Watchdog]);
        }
        if status_at <= Instant::now() {
            status_at += STATUS;
            let _ = sd_notify::notify(&[NotifyState::Status(&hand.summary())]);
        }
        if roll_call_at.take_if(|at| *at <= Instant::now()).is_some() {
            call_roll(&hand, before.as_ref());
        }
        if hand.shared.finished.load(std::sync::atomic::Ordering::Acquire) {
            tracing::info!("every recording has been played to its end");
            tokio::time::sleep(LOOK).await;
            return;
        }
    }
}

/// Says what is different between two looks at the hand.
fn tell_changes(hand: &Hand, before: Option<&Snapshot>, now: &Snapshot) {
    let layout = &hand.config.layout;
    for (i, bus) in now.buses.iter().enumerate() {
        let was_up =
            before.is_some_and(|b| b.buses[i].source.reopens > 0 || b.buses[i].link == LinkState::Up);
        if bus.link == LinkState::Up && !was_up {
            let source = hand.config.sources[i].to_string();
            tracing::info!(bus = layout.buses[i], source, "bus is up");
        }
    }
    let Some(before) = before else { return };
    for (taxel, (old, new)) in before.force.faults.iter().zip(&now.force.faults).enumerate() {
        let newly: Vec<_> = new
            .iter()
            .filter(|f| !old.contains(*f) && *f != Fault::Missing)
            .map(Fault::name)
            .collect();
        if !newly.is_empty() {
            let module = layout.module_of(taxel);
            let k = layout.k[taxel];
            tracing::warn!(
                taxel,
                module = module.name,
                k,
                "taxel is out of use: {}",
                newly.join(", ")
            );
        }
    }
    if now.overruns > before.overruns {
        tracing::warn!(
            ticks = now.overruns - before.overruns,
            "ticks given up: the daemon was held up"
        );
    }
    if now.force.calibrating != before.force.calibrating {
        let (kind, text) = if now.force.calibrating {
            (
                EventKind::Calibrating,
                "measuring the baseline; do not touch the hand".to_string(),
            )
        } else {
            (
                EventKind::Calibrated,
                format!("baseline measured, contact threshold {:.1}", now.force.threshold),
            )
        };
        tracing::info!("{text}");
        let _ = hand.events.send(Event::new(kind, text));
    }
    if now.paused != before.paused {
        let (kind, text) = if now.paused {
            (
                EventKind::Paused,
                "paused: images show no contact until told to resume",
            )
        } else {
            (EventKind::Resumed, "images show contacts again")
        };
        tracing::info!("{text}");
        let _ = hand.events.send(Event::new(kind, text));
    }
}

/// Says what is new of the joints.
fn tell_joints(hand: &Hand, view: Option<&JointsView>, told: &mut Told) {
    let (Some(config), Some(view)) = (&hand.config.joints, view) else {
        return;
    };
    hand.count_joints(view);
    for (weight, text) in told.news(config, view) {
        match weight {
            Weight::Info => tracing::info!("{text}"),
            Weight::Warn => tracing::warn!("{text}"),
        }
    }
}

/// Says which problems came and which are over, in the log and to every subscriber.
fn tell_problems(hand: &Hand, now: &Snapshot, joints: Option<&JointsView>, boards_due: bool) {
    let mut problems = hand.problems.borrow_mut();
    for news in problems.look(&hand.config, now, joints, boards_due) {
        let sentence = match news {
            News::Came { severe, sentence } => {
                match severe {
                    true => tracing::error!("{sentence}"),
                    false => tracing::warn!("{sentence}"),
                }
                sentence
            }
            News::Over { sentence } => {
                tracing::info!("{sentence}");
                sentence
            }
        };
        let _ = hand.events.send(Event::new(EventKind::Notice, sentence));
    }
}

/// Says once, some time after the start, how many boards were heard.
fn call_roll(hand: &Hand, now: Option<&Snapshot>) {
    let Some(now) = now else { return };
    let layout = &hand.config.layout;
    let heard = (now.boards.iter())
        .filter(|board| board.state != BoardState::Unheard)
        .count();
    match layout.modules.len() {
        boards if boards == heard => tracing::info!("all {boards} boards speak"),
        boards => tracing::warn!("{heard} of {boards} boards speak so far"),
    }
}
