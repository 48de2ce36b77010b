//! One board under supervision: what it is told next, and why.

use super::misplaced_boards::Search;
use crate::protocol::commands::{BoardCommand, Sequences, Step};

/// A silent board that never answered a question is started from the beginning with every twentieth attempt.
const BLINDLY_EVERY: u32 = 20;

#[derive(Debug, Clone)]
pub(super) struct Pace {
    /// Period of the triggers, and the time of the first; later ones are whole periods after it.
    pub(super) trigger: Option<(u64, Option<u64>)>,
    pub(super) silence_ns: u64,
    pub(super) first_pause_ns: u64,
    pub(super) longest_pause_ns: u64,
}

#[derive(Debug, Clone)]
pub(super) struct Board {
    /// Its module; of a hub, all its modules.
    pub(super) modules: Vec<u16>,
    pub(super) bus: u8,
    pub(super) sequences: Sequences,
    /// The sequence under way, of more than one step.
    pub(super) under_way: Option<UnderWay>,
    /// When to see again whether it is silent.
    pub(super) due_ns: u64,
    /// When the last command to it was handed out.
    pub(super) sent_ns: Option<u64>,
    /// When it was started, other than for its silence: silence is not counted from before.
    pub(super) started_ns: Option<u64>,
    /// It is silent: when to try again, and the pause after that.
    pub(super) retry: Option<Retry>,
    /// When it answered a question last, and how many questions it has not answered since.
    pub(super) answered_ns: Option<u64>,
    pub(super) unanswered: u32,
    /// When the sequence under way began.
    pub(super) begun_ns: u64,
    /// It is silent and has answered: when to start it from the beginning, unless it is heard before.
    pub(super) start_again_ns: Option<u64>,
    pub(super) stopped: bool,
    pub(super) restarts: u64,
    pub(super) search: Search,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Retry {
    pub(super) at_ns: u64,
    pub(super) pause_ns: u64,
    /// How often it was tried.
    pub(super) tries: u32,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Sequence {
    Start,
    /// A restart because of silence, of a board that may still be configured.
    Wake,
    /// ... of one that seems not to be.
    StartAgain,
    /// Whether a silent board is there.
    Ask,
    Stop,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct UnderWay {
    pub(super) sequence: Sequence,
    /// The step that comes next, and when.
    pub(super) step: usize,
    pub(super) at_ns: u64,
}

/// What is due for a board.
pub(super) enum Due {
    Nothing,
    Start(Sequence),
}

impl Pace {
    /// When to see after a board again after `now_ns` if nothing else is due: at the next trigger,
    /// or after the silence that is allowed.
    pub(super) fn next_check_ns(&mut self, now_ns: u64, triggered: bool, silence_ns: u64) -> u64 {
        match &mut self.trigger {
            Some((period_ns, first_ns)) if triggered => {
                let first_ns = *first_ns.get_or_insert(now_ns);
                let periods = now_ns.saturating_sub(first_ns) / *period_ns + 1;
                first_ns + periods * *period_ns
            }
            _ => now_ns + silence_ns,
        }
    }
}

impl Board {
    pub(super) fn new(modules: Vec<u16>, bus: u8, sequences: Sequences) -> Self {
        Self {
            modules,
            bus,
            sequences,
            under_way: None,
            due_ns: 0,
            sent_ns: None,
            started_ns: None,
            retry: None,
            answered_ns: None,
            unanswered: 0,
            begun_ns: 0,
            start_again_ns: None,
            stopped: false,
            restarts: 0,
            search: Search::default(),
        }
    }

    /// When the next command can be handed out, given what was sent before; `None` once it is stopped.
    pub(super) fn ready_ns(&self, bus_free_ns: &[u64]) -> Option<u64> {
        let due_ns = self.under_way.map_or(self.due_ns, |u| u.at_ns);
        let gap_ends_ns = self.sent_ns.map_or(0, |sent| sent + self.sequences.gap_ns);
        (!self.stopped).then(|| due_ns.max(bus_free_ns[self.bus as usize]).max(gap_ends_ns))
    }

    /// With which sequence a silent board is tried: it is woken first. After that it is asked
    /// whether it is there, or started from the beginning where it cannot be asked or seems to know
    /// no questions.
    pub(super) fn restart_sequence(&self, tries: u32) -> Sequence {
        let blindly = self.answered_ns.is_none() && tries.is_multiple_of(BLINDLY_EVERY);
        if tries <= 1 {
            Sequence::Wake
        } else if self.sequences.ask.is_empty() || blindly {
            Sequence::StartAgain
        } else {
            Sequence::Ask
        }
    }

    /// Passes over a question to a board that has answered since the sequence began.
    pub(super) fn skips_question(&mut self, under_way: &UnderWay) -> bool {
        let step = &self.steps(under_way.sequence)[under_way.step];
        let ends = under_way.step + 1 == self.steps(under_way.sequence).len();
        let known = self.answered_ns.is_some_and(|t| t >= self.begun_ns);
        if ends || !known || !step.command.is_question() {
            return false;
        }
        self.under_way = Some(UnderWay {
            sequence: under_way.sequence,
            step: under_way.step + 1,
            at_ns: under_way.at_ns + step.pause_ns,
        });
        true
    }

    pub(super) fn steps(&self, sequence: Sequence) -> &[Step] {
        match sequence {
            Sequence::Start | Sequence::StartAgain => &self.sequences.start,
            Sequence::Wake => &self.sequences.wake,
            Sequence::Ask => &self.sequences.ask,
            Sequence::Stop => &self.sequences.stop,
        }
    }

    /// It has answered a question.
    pub(super) fn handle_answer(&mut self, t_ns: u64) {
        let came_up = self.unanswered > 1;
        let before = self.answered_ns.replace(t_ns);
        self.unanswered = 0;
        let starting = self.under_way.map(|u| u.sequence);
        if let Some(sequence @ (Sequence::Start | Sequence::StartAgain)) = starting {
            if came_up && before.is_none_or(|t| t < self.begun_ns) {
                // It was not there when this sequence began, and cannot have heard all of it.
                self.begun_ns = t_ns;
                self.under_way = Some(UnderWay {
                    sequence,
                    step: 1,
                    at_ns: t_ns,
                });
            }
        } else if self.retry.is_some() {
            let start_ns = t_ns + self.sequences.grace_ns;
            self.start_again_ns.get_or_insert(start_ns);
            self.due_ns = self.due_ns.min(start_ns);
        }
    }

    /// Hands out a step of a sequence, and notes what comes after it.
    pub(super) fn take_step(
        &mut self,
        sequence: Sequence,
        step: usize,
        now_ns: u64,
        pace: &Pace,
    ) -> BoardCommand {
        let steps = self.steps(sequence);
        let (command, pause_ns) = (steps[step].command, steps[step].pause_ns);
        let ends = step + 1 == steps.len();
        // A waking that is a start and a question is waited for like any other attempt.
        let long = steps.len() > 1 && (sequence != Sequence::Wake || self.sequences.ask.is_empty());
        self.sent_ns = Some(now_ns);
        if step == 0 {
            self.begun_ns = now_ns;
        }
        if command.is_question() {
            self.unanswered = self.unanswered.saturating_add(1);
        }
        self.under_way = (!ends).then(|| UnderWay {
            sequence,
            step: step + 1,
            at_ns: now_ns + pause_ns,
        });
        if ends && sequence == Sequence::Stop {
            self.stopped = true;
        } else if ends && long {
            // Silence counts from the end of the sequence.
            let check_ns = now_ns + self.silence_ns(pace);
            self.started_ns = Some(now_ns);
            if let Some(retry) = &mut self.retry {
                retry.at_ns = retry.at_ns.max(check_ns);
            }
            self.due_ns = check_ns;
        }
        command
    }

    pub(super) fn silence_ns(&self, pace: &Pace) -> u64 {
        pace.silence_ns.max(self.sequences.silence_ns)
    }

    /// Decides whether a start is due now, and sets when to see again.
    pub(super) fn poll_sequence(&mut self, now_ns: u64, heard_ns: Option<u64>, pace: &mut Pace) -> Due {
        let silence_ns = self.silence_ns(pace);
        let triggered = pace.trigger.is_some() && self.sequences.triggered;
        let next_check_ns = pace.next_check_ns(now_ns, triggered, silence_ns);
        let Some(started_ns) = self.started_ns else {
            self.started_ns = Some(now_ns);
            self.due_ns = next_check_ns;
            return Due::Start(Sequence::Start);
        };
        if heard_ns > self.sent_ns {
            self.retry = None;
            self.start_again_ns = None;
        }
        let quiet_from_ns = heard_ns.unwrap_or(0).max(started_ns);
        if self.retry.is_none() && now_ns.saturating_sub(quiet_from_ns) < silence_ns {
            if triggered {
                self.due_ns = next_check_ns;
                return Due::Start(Sequence::Start);
            }
            self.due_ns = quiet_from_ns + silence_ns;
            return Due::Nothing;
        }
        let retry = self.retry.get_or_insert(Retry {
            at_ns: now_ns,
            pause_ns: pace.first_pause_ns,
            tries: 0,
        });
        let answered = self.start_again_ns.take_if(|t| *t <= now_ns).is_some();
        if !answered && now_ns < retry.at_ns {
            let sooner_ns = self.start_again_ns.unwrap_or(u64::MAX);
            self.due_ns = retry.at_ns.min(next_check_ns).min(sooner_ns);
            return Due::Nothing;
        }
        retry.at_ns = now_ns + retry.pause_ns;
        retry.tries = retry.tries.saturating_add(1);
        if self.sequences.ask.is_empty() {
            retry.pause_ns = (2 * retry.pause_ns).min(pace.longest_pause_ns);
        }
        let (at_ns, tries) = (retry.at_ns, retry.tries);
        self.due_ns = at_ns.min(next_check_ns);
        let sequence = if answered {
            Sequence::StartAgain
        } else {
            self.restart_sequence(tries)
        };
        self.restarts += u64::from(sequence != Sequence::Ask);
        Due::Start(sequence)
    }

    pub(super) fn start_at(&mut self, t_ns: u64) {
        self.started_ns = None;
        self.retry = None;
        self.start_again_ns = None;
        self.under_way = None;
        self.due_ns = t_ns;
    }
}
