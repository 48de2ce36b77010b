//! "Press the index tip": places boards by touch, while they are started and heard as a daemon would.

use super::answers::{Answers, Line, STOPPED, prompt, say};
use super::hand::Heard;
use super::touch::{Touch, TouchWatch};
use crate::doctor::bus_listener::{BusListener, Listener};
use anyhow::{Context, bail};
use std::time::Duration;
use taxel_can::Received;
use taxel_engine::{Engine, Frames};
use taxel_playback::interrupt::Interrupt;
use taxel_skin::{BoardsMode, Layout};
use taxeld::Config;

const RECEIVE_BUFFER: usize = 4 << 20;
const S: u64 = 1_000_000_000;
/// Boards have started and their baseline is measured by then, or something is wrong.
const CALIBRATED_NS: u64 = 20 * S;
/// Time to hand over the stop commands.
const STOP_NS: u64 = S / 2;
/// How often a hand that was touched while its baseline was measured is asked to be let alone.
const ATTEMPTS: usize = 3;

/// The hand while it is pressed.
pub(super) struct Pressing<'a> {
    heard: &'a Heard,
    answers: &'a Answers,
    engine: Engine,
    watch: TouchWatch,
    buses: BusListener,
    /// How long a script waits for a press, nanoseconds; a person takes the time it takes.
    patience_ns: Option<u64>,
    /// No more lines come.
    is_unanswered: bool,
}

/// What came first.
enum Reply {
    Pressed { module: usize, lead: f64 },
    Line(String),
}

/// What is waited for.
#[derive(Clone, Copy)]
struct Awaited {
    touch: bool,
    line: bool,
}

impl<'a> Pressing<'a> {
    /// Opens the buses, starts the boards and measures their baseline.
    pub(super) fn begin(
        heard: &'a Heard,
        answers: &'a Answers,
        listen_only: bool,
        patience: Duration,
        interrupt: Interrupt,
    ) -> anyhow::Result<Self> {
        let (buses, failures) = BusListener::open(&heard.sources, None, RECEIVE_BUFFER, interrupt);
        if let Some((bus, error)) = failures.into_iter().next() {
            return Err(error.context(heard.sources[bus].to_string()));
        }
        let mut config = Config::new(heard.layout.clone(), heard.sources.clone());
        if listen_only {
            config.boards.mode = BoardsMode::Passive;
        }
        let mut pressing = Self {
            heard,
            answers,
            engine: Engine::new(&config.engine(false)?, buses.now_ns())?,
            watch: TouchWatch::new(&heard.layout),
            buses,
            patience_ns: (!answers.are_typed()).then_some(patience.as_nanos() as u64),
            is_unanswered: false,
        };
        for _ in 0..ATTEMPTS {
            say("Do not touch the hand for two seconds: its baseline is being measured.");
            pressing.calibrate()?;
            let report = pressing.engine.conditioner().report();
            if !report.is_some_and(|report| report.is_touched()) {
                return Ok(pressing);
            }
            say("The hand was touched meanwhile.");
            pressing.engine.rezero();
        }
        say("What was touched may not be told from the rest.");
        Ok(pressing)
    }

    fn calibrate(&mut self) -> anyhow::Result<()> {
        let until_ns = self.buses.now_ns() + CALIBRATED_NS;
        let mut calibrating = Calibrating {
            engine: &mut self.engine,
            until_ns,
            is_done: false,
        };
        if !self.buses.attend(&mut calibrating) {
            bail!(STOPPED);
        }
        if !calibrating.is_done {
            bail!(
                "the boards fell silent: no baseline in {} s; `taxel doctor` says what is wrong with them",
                CALIBRATED_NS / S
            );
        }
        Ok(())
    }

    /// A press or a line; `None` where only a line is awaited and no more come.
    fn wait(&mut self, awaited: Awaited) -> anyhow::Result<Option<Reply>> {
        self.watch.begin();
        let patience_ns = self.patience_ns.filter(|_| awaited.touch);
        let mut turn = Turn {
            engine: &mut self.engine,
            watch: &mut self.watch,
            heard: self.heard,
            answers: self.answers,
            awaited,
            until_ns: patience_ns.map(|patience| self.buses.now_ns() + patience),
            told: None,
            outcome: None,
        };
        if !self.buses.attend(&mut turn) {
            bail!(STOPPED);
        }
        match turn.outcome {
            Some(Outcome::Reply(reply)) => Ok(Some(reply)),
            Some(Outcome::Ended) => Ok(None),
            Some(Outcome::Late) | None => {
                bail!("nothing was pressed in time (--patience); nothing was written")
            }
        }
    }

    /// A press, or what was said instead. A script has a line for each press, an empty one to wait for it; behind its
    /// end presses alone count. It has no line for a press that is asked for `again`.
    fn press(&mut self, again: bool) -> anyhow::Result<Reply> {
        let is_typed = self.answers.are_typed();
        let line = Awaited {
            touch: is_typed,
            line: true,
        };
        if is_typed || !(again || self.is_unanswered) {
            match self.wait(line)? {
                Some(Reply::Line(text)) if text.is_empty() && !is_typed => {}
                Some(reply) => return Ok(reply),
                None => self.is_unanswered = true,
            }
        }
        let touch = Awaited {
            touch: true,
            line: false,
        };
        self.wait(touch)?.context("a press")
    }

    /// Has the modules of a hand pressed one after the other; the board of each, where it has one.
    pub(super) fn place(&mut self, hand: &Layout) -> anyhow::Result<Vec<Option<usize>>> {
        let count = hand.modules.len();
        let mut places: Vec<Option<usize>> = vec![None; count];
        say(
            "Press each module in turn and hold it until its board is named. Or type: s to skip it, b to go back, q to \
             leave the rest out, or its board, such as can0/3.",
        );
        let (mut next, mut again) = (0, false);
        while next < count {
            let name = &hand.modules[next].name;
            prompt(&format!("Press the {name} ({} of {count}): ", next + 1));
            let reply = self.press(again)?;
            let is_pressed = matches!(reply, Reply::Pressed { .. });
            again = false;
            let (board, why) = match reply {
                Reply::Pressed { module, lead } => {
                    let why = match lead < 100.0 {
                        true => format!(", which rose {lead:.0} times as much as any other"),
                        false => ", which alone rose".into(),
                    };
                    (module, why)
                }
                Reply::Line(text) => match text.as_str() {
                    "" => continue,
                    "s" | "skip" => {
                        places[next] = None;
                        next += 1;
                        continue;
                    }
                    "b" | "back" => {
                        next = next.saturating_sub(1);
                        places[next] = None;
                        continue;
                    }
                    "q" | "quit" => break,
                    _ => match self.typed(&text)? {
                        Some(board) => (board, String::new()),
                        None => continue,
                    },
                },
            };
            let called = self.heard.board(board);
            if let Some(other) = places.iter().position(|place| *place == Some(board)) {
                let other = &hand.modules[other].name;
                say!("");
                let why = format!("That is {called}, which is the {other} already.");
                again = self.refuse(is_pressed, &why)?;
            } else if !self.heard.can_be(board, hand, next) {
                say!("");
                let why = format!("That is {}.", self.heard.misfit(board, hand, next));
                again = self.refuse(is_pressed, &why)?;
            } else {
                say!("{called}{why}");
                places[next] = Some(board);
                next += 1;
            }
        }
        Ok(places)
    }

    /// A board that cannot be the one; says whether it was pressed, which whoever presses does again. One that a script
    /// names is wrong for good.
    fn refuse(&self, is_pressed: bool, why: &str) -> anyhow::Result<bool> {
        match is_pressed {
            true => say(why),
            false => self.answers.refuse(why)?,
        }
        Ok(is_pressed)
    }

    /// The board that was typed; `None`, and said, where none of that name was heard.
    fn typed(&self, text: &str) -> anyhow::Result<Option<usize>> {
        let board = self.heard.named(text);
        if board.is_none() {
            self.answers.refuse(&format!(
                "`{text}` is no board that was heard; they are {}",
                self.boards()
            ))?;
        }
        Ok(board)
    }

    /// Has modules named and pressed until no more are named; boards and names in that order.
    pub(super) fn name(&mut self) -> anyhow::Result<Vec<(usize, String)>> {
        let mut named: Vec<(usize, String)> = Vec::new();
        say(
            "Name each module and press it, from the fingertips down; the first word of a name is the part of the hand \
             that it belongs to, such as `index` of `index tip`.",
        );
        'names: while named.len() < self.heard.layout.modules.len() {
            prompt("Name of the next module (empty: no more): ");
            let line = Awaited {
                touch: false,
                line: true,
            };
            let name = match self.wait(line)? {
                Some(Reply::Line(name)) if !name.is_empty() => name,
                _ => break,
            };
            if named.iter().any(|(_, other)| *other == name) {
                self.answers
                    .refuse(&format!("There is a module {name} already."))?;
                continue;
            }
            let mut again = false;
            let board = loop {
                prompt(&format!("Press the {name}: "));
                let reply = self.press(again)?;
                let is_pressed = matches!(reply, Reply::Pressed { .. });
                let board = match reply {
                    Reply::Pressed { module, .. } => module,
                    Reply::Line(text) => match self.typed(&text)? {
                        Some(board) => board,
                        None => continue 'names,
                    },
                };
                let called = self.heard.board(board);
                say!("{called}");
                let Some((_, other)) = named.iter().find(|(other, _)| *other == board) else {
                    break board;
                };
                let why = format!("That is {called}, which is the {other} already.");
                again = self.refuse(is_pressed, &why)?;
                if !again {
                    continue 'names;
                }
            };
            named.push((board, name));
        }
        Ok(named)
    }

    fn boards(&self) -> String {
        let boards = (0..self.heard.layout.modules.len()).map(|module| self.heard.address(module));
        boards.collect::<Vec<_>>().join(", ")
    }
}

impl Drop for Pressing<'_> {
    /// The boards are as silent as they were found.
    fn drop(&mut self) {
        self.engine.stop();
        self.buses.finish(STOP_NS, &mut Stopping(&mut self.engine));
    }
}

/// Sends what is due to the boards.
fn send_commands(engine: &mut Engine, buses: &mut BusListener, now_ns: u64) {
    while let Some(command) = engine.poll_command(now_ns) {
        if !buses.send(command.bus, &command.frame) {
            engine.handle_unsent(&command, now_ns);
        }
    }
}

struct Stopping<'a>(&'a mut Engine);

impl Listener for Stopping<'_> {
    fn handle_frame(&mut self, _: u8, _: &Received) {}

    fn handle_turn(&mut self, buses: &mut BusListener, now_ns: u64) -> bool {
        send_commands(self.0, buses, now_ns);
        !self.0.boards().is_stopped()
    }
}

struct Calibrating<'a> {
    engine: &'a mut Engine,
    until_ns: u64,
    is_done: bool,
}

impl Calibrating<'_> {
    fn drain(&mut self) {
        while let Some(frames) = self.engine.poll_output() {
            self.is_done = !frames.force.calibrating;
        }
    }
}

impl Listener for Calibrating<'_> {
    fn handle_frame(&mut self, bus: u8, received: &Received) {
        self.engine.handle_frame(bus, received);
        self.drain();
    }

    fn handle_turn(&mut self, buses: &mut BusListener, now_ns: u64) -> bool {
        self.engine.handle_time(now_ns);
        self.drain();
        send_commands(self.engine, buses, now_ns);
        !self.is_done && now_ns < self.until_ns
    }
}

/// How a turn ended.
enum Outcome {
    Reply(Reply),
    /// No more lines come.
    Ended,
    /// Nothing was pressed in time.
    Late,
}

struct Turn<'a> {
    engine: &'a mut Engine,
    watch: &'a mut TouchWatch,
    heard: &'a Heard,
    answers: &'a Answers,
    awaited: Awaited,
    until_ns: Option<u64>,
    /// The two modules that were last told to be pressed together.
    told: Option<[usize; 2]>,
    outcome: Option<Outcome>,
}

impl Turn<'_> {
    fn drain(&mut self) {
        while let Some(Frames { force, .. }) = self.engine.poll_output() {
            let touch = self.watch.handle_frame(force);
            if !self.awaited.touch || self.outcome.is_some() {
                continue;
            }
            match touch {
                Touch::None => {}
                Touch::Module { module, lead } => {
                    self.outcome = Some(Outcome::Reply(Reply::Pressed { module, lead }));
                }
                Touch::Two(modules) if self.told != Some(modules) => {
                    let [a, b] = modules.map(|module| self.heard.board(module));
                    say!("");
                    prompt(&format!("{a} and {b} are both pressed; press one alone: "));
                    self.told = Some(modules);
                }
                Touch::Two(_) => {}
            }
        }
    }
}

impl Listener for Turn<'_> {
    fn handle_frame(&mut self, bus: u8, received: &Received) {
        self.engine.handle_frame(bus, received);
        self.drain();
    }

    fn handle_turn(&mut self, buses: &mut BusListener, now_ns: u64) -> bool {
        self.engine.handle_time(now_ns);
        self.drain();
        send_commands(self.engine, buses, now_ns);
        if self.awaited.line && self.outcome.is_none() {
            match self.answers.poll() {
                Line::Text(text) => self.outcome = Some(Outcome::Reply(Reply::Line(text))),
                Line::Ended if !self.awaited.touch => self.outcome = Some(Outcome::Ended),
                Line::Ended | Line::NotYet => {}
            }
        }
        if self.outcome.is_none() && self.until_ns.is_some_and(|until| now_ns >= until) {
            self.outcome = Some(Outcome::Late);
        }
        self.outcome.is_none()
    }
}
