//! Watches the hand from the socket thread: says in the log what changed, feeds systemd's watchdog, tells
//! subscribers, and lets display profiles go that nobody needs.
//!
//! The tick thread itself never logs, so that a slow terminal or journal cannot hold up an image.

use crate::hand::Hand;
use crate::joints::{Told, Weight};
use crate::snapshot::Snapshot;
use sd_notify::NotifyState;
use std::rc::Rc;
use std::time::Duration;
use taxel_can::{BusState, LinkState};
use taxel_skin::{BoardState, Fault};
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
        tell_changes(&hand, before.as_ref(), &now);
        tell_joints(&hand, &now, &mut joints);
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
        let name = &layout.buses[i];
        let source = hand.config.sources[i].to_string();
        let old = before.map(|b| &b.buses[i]);
        if old.map_or(LinkState::default(), |o| o.link) != bus.link || before.is_none() {
            match bus.link {
                LinkState::Up => {
                    tracing::info!(bus = name, source, reopens = bus.source.reopens, "bus is up")
                }
                link => tracing::warn!(bus = name, source, "bus is {link}; waiting for it"),
            }
        }
        let old_state = old.map_or(BusState::ErrorActive, |o| o.source.bus_state);
        if old_state != bus.source.bus_state {
            match bus.source.bus_state {
                BusState::ErrorActive => tracing::info!(bus = name, "controller is error-active again"),
                BusState::BusOff => tracing::error!(
                    bus = name,
                    "controller is bus-off: check wiring, termination and bit rate; `ip link set {name} type can restart-ms 100` lets the kernel restart it"
                ),
                state => tracing::warn!(bus = name, "controller is {state}"),
            }
        }
        let lost = bus.source.lost_in_kernel - old.map_or(0, |o| o.source.lost_in_kernel);
        if lost > 0 {
            tracing::warn!(
                bus = name,
                lost,
                "frames lost in the kernel; `sysctl net.core.rmem_max=4194304` lets the queue be larger"
            );
        }
    }
    tell_boards(hand, before, now);
    let Some(before) = before else { return };
    for (taxel, (old, new)) in before.force.faults.iter().zip(&now.force.faults).enumerate() {
        let newly: Vec<_> = new
            .iter()
            .filter(|f| !old.contains(*f) && *f != Fault::Missing)
            .map(Fault::name)
            .collect();
        if !newly.is_empty() {
            let module = layout.module_of(taxel);
            let k = layout.taxels[taxel].k;
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
fn tell_joints(hand: &Hand, now: &Snapshot, told: &mut Told) {
    let (Some(config), Some(view)) = (&hand.config.joints, hand.joints(now)) else {
        return;
    };
    hand.count_joints(&view);
    for (weight, text) in told.news(config, &view) {
        match weight {
            Weight::Info => tracing::info!("{text}"),
            Weight::Warn => tracing::warn!("{text}"),
            Weight::Error => tracing::error!("{text}"),
        }
    }
}

/// Says which boards fell silent and which came back. Boards that speak up at the start are told of by the roll call.
fn tell_boards(hand: &Hand, before: Option<&Snapshot>, now: &Snapshot) {
    let Some(before) = before else { return };
    let layout = &hand.config.layout;
    for ((module, old), board) in layout.modules.iter().zip(&before.boards).zip(&now.boards) {
        let bus = &layout.buses[usize::from(module.bus)];
        if old.state != BoardState::Silent && board.state == BoardState::Silent {
            tracing::warn!(
                module = module.name,
                bus,
                board = module.board,
                "board is silent; starting it again"
            );
        } else if old.state == BoardState::Silent && board.state != BoardState::Silent {
            tracing::info!(
                module = module.name,
                bus,
                board = module.board,
                "board speaks again"
            );
        }
    }
}

/// Says once, some time after the start, which boards were never heard.
fn call_roll(hand: &Hand, now: Option<&Snapshot>) {
    let Some(now) = now else { return };
    let layout = &hand.config.layout;
    let unheard: Vec<String> = (layout.modules.iter().zip(&now.boards))
        .filter(|(_, board)| board.state == BoardState::Unheard)
        .map(|(m, _)| {
            format!(
                "{} ({} board {})",
                m.name,
                layout.buses[usize::from(m.bus)],
                m.board
            )
        })
        .collect();
    let (boards, heard) = (layout.modules.len(), layout.modules.len() - unheard.len());
    if unheard.is_empty() {
        tracing::info!("all {boards} boards speak");
    } else {
        tracing::warn!(
            "{heard} of {boards} boards speak; not heard so far: {}. Check their power, their wiring and their addresses in the layout",
            unheard.join(", ")
        );
    }
}
