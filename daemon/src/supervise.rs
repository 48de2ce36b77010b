//! Watches the hand and the other threads from the control thread: says in the log what changed, tells
//! subscribers, and feeds systemd's watchdog.
//!
//! The tick thread itself never logs, so that a slow terminal or journal cannot hold up an image.

use crate::out_of_use::OutOfUse;
use crate::overruns::Overruns;
use crate::service_manager;
use crate::snapshot::Snapshot;
use crate::state::State;
use std::rc::Rc;
use std::time::Duration;
use taxel_can::LinkState;
use taxel_diagnose::{
    ANY_CHANGE_IS_CONTACT, BusView, Crowd, DaemonView, HandView, JointsReporter, JointsView, News, Severity,
    feels_little,
};
use taxel_hand::{Fault, plural};
use taxel_serve::{LogLines, and_unsaid};
use taxel_skin::{BoardState, Movement};
use taxel_wire::{Event, EventKind};
use tokio::time::{Instant, MissedTickBehavior, interval};

const PERIOD: Duration = Duration::from_millis(100);
/// How long after the start every board should have been heard.
const ROLL_CALL: Duration = Duration::from_secs(2);
const STATUS: Duration = Duration::from_secs(1);
/// Subscribers that a STATUS message lists: what each costs, it costs everyone who is sent reports.
const MOST_LISTED: usize = 64;

/// Runs until every recording has been played to its end, and images have reached their subscribers.
pub(crate) async fn watch(state: Rc<State>) {
    let mut period = interval(PERIOD);
    period.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut before: Option<Snapshot> = None;
    let mut told = Told::default();
    let mut joints = JointsReporter::default();
    let mut last_heartbeat = 0;
    let mut status_at = Instant::now();
    let mut reports = Reports::default();
    let mut roll_call_at = Some(Instant::now() + ROLL_CALL);
    loop {
        period.tick().await;
        // Asked before the snapshot, which then has all that the recordings held.
        let finished = state.shared.finished.load(std::sync::atomic::Ordering::Acquire);
        let now = state.snapshot();
        if !now.written {
            continue;
        }
        let is_sending = state.call_roster().await;
        report_changes(&state, before.as_ref(), &now, &mut told);
        let view = state.joints(&now);
        if !finished {
            // A recording that is over is no bus that is down.
            report_problems(&state, &now, view.as_ref(), roll_call_at.is_none());
        }
        report_joints(&state, view.as_ref(), &mut joints);
        (state.recent.borrow_mut()).keep(Instant::now().into_std(), &now, &state.roster());
        reports.publish(&state, &now);
        before = Some(now);

        // A sign of life of both: the thread that makes images, and the one that sends them.
        let heartbeat = state.heartbeat();
        if is_sending && heartbeat != last_heartbeat {
            last_heartbeat = heartbeat;
            service_manager::tell("WATCHDOG=1");
        }
        if status_at <= Instant::now() {
            status_at += STATUS;
            service_manager::tell(&format!("STATUS={}", state.summary()));
        }
        if roll_call_at.take_if(|at| *at <= Instant::now()).is_some() {
            call_roll(&state, before.as_ref());
        }
        if finished {
            tracing::info!("every recording has been played to its end");
            tokio::time::sleep(PERIOD).await;
            return;
        }
    }
}

/// The status reports that subscribers are given: made once for all of them, and at once where one asks.
#[derive(Default)]
struct Reports {
    next_at: Option<Instant>,
}

impl Reports {
    fn publish(&mut self, state: &State, now: &Snapshot) {
        if self.is_due(state.roster().wants_status(), Instant::now()) {
            let mut status = state.status();
            status.subscribers.truncate(MOST_LISTED);
            let text = serde_json::to_string(&status).unwrap_or_default();
            state
                .server
                .set_status(text.as_bytes(), now.force.seq, now.force.t_ns);
        }
    }

    /// Whether a report is due where anybody wants one.
    fn is_due(&mut self, is_wanted: bool, now: Instant) -> bool {
        let is_due = is_wanted && self.next_at.is_none_or(|at| at <= now);
        if is_due {
            self.next_at = Some(now + STATUS);
        } else if !is_wanted {
            self.next_at = None;
        }
        is_due
    }
}

/// What the log was told, as far as it is not to be told each time.
#[derive(Default)]
struct Told {
    out_of_use: OutOfUse,
    overruns: Overruns,
    /// That the baseline is measured, and that images are paused: anybody may ask for both as often as they like.
    baselines: LogLines,
    pauses: LogLines,
}

/// Says what is different between two looks at the hand.
fn report_changes(state: &State, before: Option<&Snapshot>, now: &Snapshot, told: &mut Told) {
    report_buses(state, before, now);
    report_unpublished(state, before.map_or(0, |b| b.unpublished), now.unpublished);
    let at = Instant::now();
    report_out_of_use(state, now, &mut told.out_of_use, at);
    if let Some(line) = told.overruns.look(now.overruns, at) {
        tracing::warn!("{line}");
    }
    for event in calibration_events(before, now) {
        told.baselines.say(&event.message, at);
        state.server.announce(event);
    }
    // A busy machine may look for the first time when it was asked for already.
    let was_paused = before.is_some_and(|before| before.paused);
    report_pause(state, was_paused, now.paused, &mut told.pauses, at);
}

/// Says which buses are up, and what is wrong with their recordings.
fn report_buses(state: &State, before: Option<&Snapshot>, now: &Snapshot) {
    for (i, bus) in now.buses.iter().enumerate() {
        let (name, source) = (&state.config.layout.buses[i], &state.config.sources[i]);
        let before = before.map(|before| &before.buses[i]);
        let was_up = before.is_some_and(|b| b.source.reopens > 0 || b.link == LinkState::Up);
        if bus.link == LinkState::Up && !was_up {
            tracing::info!(bus = name, source = source.to_string(), "bus is up");
        }
        let line = bus.source.cut_off_line;
        if line > before.map_or(0, |b| b.source.cut_off_line) {
            tracing::error!(
                bus = name,
                source = source.to_string(),
                "cannot be read past line {line}; it ends there"
            );
        }
        // A damaged recording may have thousands: told each time that there are twice as many.
        let jumps = bus.source.jumps;
        let told = before.map_or(0, |b| b.source.jumps.count());
        if jumps.count().checked_ilog2() != told.checked_ilog2() {
            tracing::warn!(bus = name, source = source.to_string(), "{jumps}");
        }
    }
}

/// Says each time that there are twice as many.
fn report_unpublished(state: &State, told: u64, unpublished: u64) {
    if unpublished.checked_ilog2() != told.checked_ilog2() {
        let sentence = format!(
            "{} could not be handed to subscribers; please report this",
            plural(unpublished, "image")
        );
        tracing::error!("{sentence}");
        state.server.announce(Event::new(EventKind::Notice, sentence));
    }
}

fn report_out_of_use(state: &State, now: &Snapshot, out_of_use: &mut OutOfUse, at: Instant) {
    let layout = &state.config.layout;
    let speaks = |module: usize| {
        let board = now.boards.get(module);
        board.is_some_and(|b| b.state == BoardState::Streaming)
    };
    for (faults, taxels) in out_of_use.look(layout, &now.force.faults, speaks) {
        let module = layout.module_of(taxels[0]);
        // Told as a problem.
        if feels_little(&now.force.faults, module) {
            continue;
        }
        let Some(unsaid) = out_of_use.say(layout.taxels[taxels[0]].module.into(), at) else {
            continue;
        };
        let name = &module.name;
        let mut reasons = faults.iter().map(Fault::name).collect::<Vec<_>>().join(", ");
        reasons += &and_unsaid(unsaid, "line");
        match taxels[..] {
            [taxel] => {
                let k = layout.k[taxel];
                tracing::warn!(taxel, module = name, k, "taxel is out of use: {reasons}");
            }
            _ => tracing::warn!(
                module = name,
                "{} of its {} taxels are out of use: {reasons}; `taxel doctor` shows which",
                taxels.len(),
                module.taxels
            ),
        }
    }
    if let Some(unsaid) = out_of_use.left_out(at) {
        tracing::warn!(
            "lines on taxels out of use that are not in the log: {unsaid}; `taxel doctor` shows which are now"
        );
    }
}

/// What is told where the baseline begins to be measured, and is. Every hand begins with that, and both may be over when it
/// is looked at: `paper` measures two frames.
fn calibration_events(before: Option<&Snapshot>, now: &Snapshot) -> impl Iterator<Item = Event> {
    let was_calibrating = before.is_none_or(|before| before.force.calibrating);
    let is_calibrating = now.force.calibrating;
    let is_measured = now.calibrations > before.map_or(0, |before| before.calibrations);
    let begins = || {
        Event::new(
            EventKind::Calibrating,
            "measuring the baseline; do not touch the hand",
        )
    };
    let unseen = (is_measured && !was_calibrating).then(begins);
    let measured = is_measured.then(|| calibrated_event(now));
    let anew = (is_calibrating && (is_measured || !was_calibrating)).then(begins);
    [unseen, measured, anew].into_iter().flatten()
}

fn calibrated_event(now: &Snapshot) -> Event {
    let threshold = now.force.threshold;
    let mut text = format!("baseline measured, contact threshold {threshold:.1}");
    if threshold == 0.0 {
        text += &format!(": {ANY_CHANGE_IS_CONTACT}");
    }
    text += &match now.moved {
        Movement::None => String::new(),
        Movement::Taxels(count) => format!("; {} moved meanwhile", plural(count as usize, "taxel")),
        Movement::Noise => {
            "; most taxels were out of use as noisy, and their noise is what the threshold is of".into()
        }
        Movement::InOneHalf => "; the hand moved meanwhile, and rests as in the quieter half".into(),
        Movement::InBothHalves => {
            "; the hand moved all the time, and that is what the threshold is of".into()
        }
    };
    Event::new(EventKind::Calibrated, text)
}

fn report_pause(state: &State, was_paused: bool, is_paused: bool, lines: &mut LogLines, at: Instant) {
    if is_paused == was_paused {
        return;
    }
    let text = match is_paused {
        true => "paused: images show no contact until told to resume",
        false => "images show contacts again",
    };
    lines.say(text, at);
    // Images without contacts look like those of a hand that nothing touches.
    if is_paused {
        let paused = Event::new(EventKind::Paused, text);
        state.server.set_standing(Some(paused));
    } else {
        state.server.set_standing(None);
        state.server.announce(Event::new(EventKind::Resumed, text));
    }
}

/// Says what is new of the joints.
fn report_joints(state: &State, view: Option<&JointsView>, reporter: &mut JointsReporter) {
    let (Some(config), Some(view)) = (&state.config.joints, view) else {
        return;
    };
    state.count_joints(view);
    for (severity, sentence) in reporter.handle_view(config, view) {
        log(severity, &sentence);
    }
    report_releases(state);
}

/// Says which motors are off that were to be. What is said of a motor that was switched on since comes behind it.
pub(crate) fn report_releases(state: &State) {
    for (severity, sentence) in state.released() {
        log(severity, &sentence);
    }
}

/// Says which problems came and which are over, in the log and to every subscriber.
fn report_problems(state: &State, now: &Snapshot, joints: Option<&JointsView>, boards_due: bool) {
    let buses: Vec<BusView> = (now.buses.iter())
        .map(|bus| BusView {
            counters: bus.source,
            link: bus.link,
            unknown: bus.decoder.unknown,
            obeyed: bus.decoder.obeyed,
            starting: state.starting(),
        })
        .collect();
    let refused = state.reload_refused.borrow();
    let sockets_lost = state.sockets_lost.borrow();
    let other_daemons = state.other_daemons.borrow();
    let crowd = state.roster().crowd().map(|(places, holders)| Crowd {
        places,
        most: state.config.socket.max_subscribers.into(),
        holders: holders.iter().map(|of| (of.uid, of.pid, of.places)).collect(),
    });
    let view = HandView {
        now_ns: now.now_ns,
        buses: &buses,
        boards: &now.boards,
        findings: &now.findings,
        moved: now.moved,
        faults: &now.force.faults,
        unchanging: &now.unchanging,
        joints,
        boards_due,
        daemon: DaemonView {
            reload_refused: refused.as_ref(),
            sockets_lost: sockets_lost.as_deref(),
            other_daemons: &other_daemons,
            crowd: crowd.as_ref(),
        },
    };
    let news = (state.problems.borrow_mut()).handle_view(&state.config.hand_setup(), &view);
    for news in news {
        let (severity, sentence) = match news {
            News::Came { severity, sentence } => (Some(severity), sentence),
            News::Over { sentence } => (None, sentence),
        };
        log(severity, &sentence);
        state.server.announce(Event::new(EventKind::Notice, sentence));
    }
}

fn log(severity: Option<Severity>, sentence: &str) {
    match severity {
        Some(Severity::Error) => tracing::error!("{sentence}"),
        Some(Severity::Warning) => tracing::warn!("{sentence}"),
        None => tracing::info!("{sentence}"),
    }
}

/// Says once, some time after the start, how many boards were heard.
fn call_roll(state: &State, now: Option<&Snapshot>) {
    let Some(now) = now else { return };
    let layout = &state.config.layout;
    let heard = (now.boards.iter())
        .filter(|board| board.state != BoardState::NeverSeen)
        .count();
    match layout.modules.len() - layout.without_board().count() {
        0 => {}
        1 if heard == 1 => tracing::info!("its board speaks"),
        boards if boards == heard => tracing::info!("all {boards} boards speak"),
        boards => tracing::warn!("{heard} of {} speak so far", plural(boards, "board")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_can::Received;
    use taxel_engine::{Engine, EngineConfig};
    use taxel_skin::{ConditionConfig, Layout};

    #[test]
    fn a_baseline_that_is_measured_between_two_looks_is_told() {
        let look = |calibrations, calibrating, threshold| {
            let mut look = Snapshot::new(1, 1, 1, 0);
            look.calibrations = calibrations;
            (look.force.calibrating, look.force.threshold) = (calibrating, threshold);
            look
        };
        let (measuring, measured, of_none) = (look(0, true, 0.0), look(1, false, 12.5), look(1, false, 0.0));
        let mut in_movement = look(1, false, 4508.0);
        in_movement.moved = Movement::InBothHalves;
        let mut touched = look(1, false, 12.5);
        touched.moved = Movement::Taxels(7);
        let begins = "measuring the baseline";
        for (before, now, wanted) in [
            (None, &measuring, vec![]),
            (None, &measured, vec!["baseline measured, contact threshold 12.5"]),
            (None, &of_none, vec!["baseline measured, contact threshold 0.0: "]),
            (
                None,
                &in_movement,
                vec!["baseline measured, contact threshold 4508.0; the hand moved all the time, and"],
            ),
            (
                None,
                &touched,
                vec!["baseline measured, contact threshold 12.5; 7 taxels moved meanwhile"],
            ),
            (Some(&measuring), &measured, vec!["baseline measured"]),
            (Some(&measured), &measured, vec![]),
            (Some(&measured), &look(1, true, 12.5), vec![begins]),
            (
                Some(&measured),
                &look(2, false, 13.5),
                vec![begins, "baseline measured, contact threshold 13.5"],
            ),
            (
                Some(&look(1, true, 12.5)),
                &look(2, true, 13.5),
                vec!["baseline measured, contact threshold 13.5", begins],
            ),
        ] {
            let told: Vec<String> = calibration_events(before, now)
                .map(|event| event.message)
                .collect();
            let is_wanted = |(told, wanted): (&String, &&str)| told.starts_with(wanted);
            assert!(
                told.len() == wanted.len() && told.iter().zip(&wanted).all(is_wanted),
                "{told:?}, not {wanted:?}"
            );
        }
    }

    #[test]
    fn each_baseline_is_told_once_while_frames_have_its_threshold() {
        const TIMES: usize = 12;
        let layout = Layout::builtin("uskin-module").unwrap();
        // Looked at each 100 ms, and measured anew after so many ticks: at each place between two looks.
        for (conditioning, rate_hz, look_ticks, rezero_ticks) in [
            (ConditionConfig::robust(), 10.0, 1, 23),
            (ConditionConfig::robust(), 30.0, 3, 61),
            (ConditionConfig::paper(), 100.0, 10, 31),
        ] {
            let mut config = EngineConfig::new(layout.clone());
            (config.conditioning, config.tick.rate_hz) = (conditioning, rate_hz);
            let mut engine = Engine::new(&config, 0).unwrap();
            let (mut told, mut before) = (Vec::new(), None);
            for tick in 1..=TIMES * rezero_ticks {
                let now_ns = tick as u64 * config.tick.period_ns();
                // Each time it is noisier.
                let most = 20 + 10 * (tick / rezero_ticks) as u16;
                for k in 0..layout.len() as u16 {
                    let counts = 30_000 + (tick as u16) * (7 + k) % most;
                    let wiring = &layout.wiring[0];
                    let frame = wiring.protocol.frame(wiring.board, k, [counts; 3], 0x80);
                    let (t_ns, frame) = (now_ns - 1, frame.unwrap());
                    engine.handle_frame(0, &Received { t_ns, frame });
                    engine.drain(&mut |_| ());
                }
                engine.handle_time(now_ns);
                engine.drain(&mut |_| ());
                if tick % look_ticks == 0 {
                    let mut now = Snapshot::new(1, 1, layout.len(), 0);
                    now.take_felt(engine.frames());
                    told.extend(
                        calibration_events(before.as_ref(), &now).map(|event| (event, now.force.clone())),
                    );
                    before = Some(now);
                }
                if tick % rezero_ticks == 0 {
                    engine.rezero();
                }
            }
            // The first begins before anybody looks.
            let wanted = [EventKind::Calibrated, EventKind::Calibrating]
                .into_iter()
                .cycle();
            let kinds: Vec<EventKind> = told.iter().map(|(event, _)| event.event).collect();
            assert_eq!(
                kinds,
                wanted.take(2 * TIMES - 1).collect::<Vec<_>>(),
                "{rate_hz} Hz"
            );
            for (event, force) in told.iter().step_by(2) {
                let measured = format!("baseline measured, contact threshold {:.1}", force.threshold);
                assert!(
                    event.message.starts_with(&measured) && !force.calibrating,
                    "{rate_hz} Hz: {event:?}, {force:?}"
                );
            }
        }
    }

    #[test]
    fn a_report_is_made_at_once_where_one_asks_and_then_each_second_however_many_do() {
        let start = Instant::now();
        let mut reports = Reports::default();
        // As often as it is looked at, tenths of a second; nobody wants reports before and in between.
        let made: Vec<u32> = (0..60)
            .filter(|at| reports.is_due(!matches!(at, 0..5 | 36..40), start + PERIOD * *at))
            .collect();
        assert_eq!(made, [5, 15, 25, 35, 40, 50]);
    }
}
