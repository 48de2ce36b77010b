//! `taxel view`: one's own hand on the terminal, live or recorded.

mod live;
mod recorder;
mod recording;
mod summary;

use crate::recordings::offline::OfflineArgs;
use crate::seconds::seconds;
use crate::terminal::{self, Shown};
use anyhow::Context;
use clap::error::ErrorKind;
use clap::parser::ValueSource;
use clap::{Arg, ArgMatches, Command, FromArgMatches};
use ratatui::Frame;
use ratatui::buffer::Buffer;
use ratatui::crossterm::event::KeyEvent;
use ratatui::layout::Rect;
use ratatui::widgets::{Paragraph, Wrap};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard};
use std::time::{Duration, Instant};
pub(crate) use summary::object;
use taxel_playback::interrupt::Interrupt;
use taxel_playback::output_file::OutputFile;
use taxel_playback::remarks::Remarks;
use taxel_view::{Action, Heading, Palette, Screen, Seen, draw, svg};
use taxeld::stdout;

/// Without a terminal a daemon is looked at for so long.
const GLANCE_S: f64 = 2.0;

/// Draw the hand of a running daemon, or of a recording, on this terminal.
///
/// Left is the skin, laid flat, coloured by force, with arrows where it is pulled aside; right the tactile image with
/// the actuators' levels. Below: one taxel in words, and where there is room force over time and what is wrong.
/// `?` lists the keys: look at a taxel, show it over time, hold the scale; change method, levels and actuators for
/// this view alone; measure the baseline anew, pause, make a mark, record. The view waits for a daemon that was restarted.
///
/// Without a terminal, or where TERM is dumb, it prints a summary. That, --json and --svg end with 1 where no image came,
/// or the daemon is gone at the end. With NO_COLOR it draws shades.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
With --json, it prints one object instead:
  {\"name\",\"layout\",\"taxels\",\"method\",\"levels\",\"actuators\",\"images\",\"seconds\",\"hz\",\"longest_gap_s\",
   \"age_s\",\"received\",\"max_rate_hz\",\"skipped\",\"latency_p50_us\",\"latency_p99_us\",\"latency_max_us\",
   \"contact_ratio\",\"most_contacts\",\"most_actuators\",\"calibrating\",\"calibrated_s\",\"paused\",\"gone\",
   \"missing\",\"faulty\",\"joints\",\"joints_known\",\"joints_known_ratio\",\"problems\",
   \"out_of_use\":[sentences],\"raw_bits_per_s\",\"image_bits_per_s\",\"compression_ratio\"}
images counts those made, received those that came: of a daemon at most max_rate_hz are asked for.
longest_gap_s is the longest between two that came, age_s how long ago the newest came at the end.
Null are rates and the gap where one image came alone, age_s of a recording, latencies where images
have no time of this machine's clock, calibrated_s where the end of a calibration was not seen,
joints_known_ratio without joints, gone while the daemon is there (else why it is not), and paused
and problems where nobody has told; else problems are those of `taxel status --json`, of a
recording that alone of a hand that moved while it was calibrated.

Examples:
  taxel view                           the daemon on this machine
  taxel view grasp.log                 a recording
  taxel view sim:faulty-hand           a scene as a recording
  taxel view --seconds 10 | cat        a summary of ten seconds
  taxel view grasp.log --json          the same of a recording, for scripts
  taxel view sim:ball-grasp --seconds 8 --svg grasp.svg
                                       a picture of the eighth second")]
pub(crate) struct Args {
    #[command(flatten)]
    recording: Recording,
    /// The daemon's image socket [default: where the daemon of this user, or of the system, puts it]
    #[arg(long, value_name = "PATH", conflicts_with = "path")]
    socket: Option<PathBuf>,
    /// Its control socket, for z, p and m [default: control.sock beside --socket, or where the daemon puts it]
    #[arg(long, value_name = "PATH", conflicts_with = "path")]
    control: Option<PathBuf>,
    /// Stop after so long, of a recording from its first image on [default: never; without a terminal a daemon is looked at
    /// for 2 s]
    #[arg(long, value_name = "S", value_parser = seconds(0.001..=1e9))]
    seconds: Option<Duration>,
    /// Draw into this SVG file what is to be seen at the end, instead of on the terminal; - for stdout
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
    /// Do not draw; print one JSON object in the end
    #[arg(long, conflicts_with_all = ["svg", "size"])]
    json: bool,
    /// With --svg: columns and rows of that picture, each 20 to 1000
    #[arg(long, value_name = "WxH", default_value = "120x40", value_parser = size, requires = "svg")]
    size: (u16, u16),
}

/// What is drawn into, where it is no terminal.
struct Sheet<'a> {
    path: &'a Path,
    size: (u16, u16),
}

fn size(text: &str) -> Result<(u16, u16), String> {
    let sides = text.split_once('x');
    let side = |text: &str| text.parse().ok().filter(|side| (20..=1000).contains(side));
    sides
        .and_then(|(width, height)| Some((side(width)?, side(height)?)))
        .ok_or_else(|| format!("{text} is no size; give columns x rows, each 20 to 1000, such as 120x40"))
}

impl Sheet<'_> {
    /// Draws what is to be seen now.
    ///
    /// # Errors
    /// Where no hand was described, and, once it is drawn, those of [`summary::ended`].
    fn draw(&self, seen: &Mutex<Seen>, source: &dyn Source, screen: &Screen) -> anyhow::Result<()> {
        let area = Rect::new(0, 0, self.size.0, self.size.1);
        let mut buffer = Buffer::empty(area);
        let mut seen = lock(seen);
        let (now_ns, heading) = (source.now_ns(&seen), source.heading(&seen));
        let picture = seen
            .picture(screen, now_ns)
            .context("no description of a hand came; give it more --seconds")?;
        draw(
            &mut buffer,
            area,
            &picture,
            screen,
            &heading,
            Palette::True,
            false,
        );
        match self.path.as_os_str() == "-" {
            true => stdout::print(&svg(&buffer))?,
            false => OutputFile::write(self.path, svg(&buffer))?,
        }
        summary::ended(&seen, &heading.name)
    }
}

/// A recording, where one is named.
#[derive(Debug)]
struct Recording(Option<OfflineArgs>);

impl clap::Args for Recording {
    fn augment_args(command: Command) -> Command {
        OfflineArgs::augment_args(command).mut_arg("path", |path| path.required(false))
    }

    fn augment_args_for_update(command: Command) -> Command {
        OfflineArgs::augment_args_for_update(command)
    }
}

impl FromArgMatches for Recording {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        if matches.contains_id("path") {
            return OfflineArgs::from_arg_matches(matches).map(|recording| Self(Some(recording)));
        }
        let of_recordings = <OfflineArgs as clap::Args>::augment_args(Command::new("recording"));
        let is_given =
            |arg: &&Arg| matches.value_source(arg.get_id().as_str()) == Some(ValueSource::CommandLine);
        match of_recordings.get_arguments().find(is_given) {
            Some(arg) => Err(clap::Error::raw(
                ErrorKind::MissingRequiredArgument,
                format!(
                    "--{} is for a recording; name one\n",
                    arg.get_long().unwrap_or_default()
                ),
            )),
            None => Ok(Self(None)),
        }
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let sheet = args.svg.as_deref().map(|path| Sheet {
        path,
        size: args.size,
    });
    match &args.recording.0 {
        Some(recording) => recording::run(recording, args.seconds, sheet.as_ref(), args.json),
        None => live::run(
            [&args.socket, &args.control].map(Option::as_deref),
            args.seconds,
            sheet.as_ref(),
            args.json,
        ),
    }
}

pub(crate) fn lock<T>(seen: &Mutex<T>) -> MutexGuard<'_, T> {
    // A reader that panicked leaves numbers that can still be read.
    seen.lock().unwrap_or_else(|e| e.into_inner())
}

/// What a daemon is asked at its control socket for a key; `None` where that is no matter of the daemon's.
pub(crate) fn request_of(action: &Action) -> Option<Value> {
    match action {
        Action::Rezero => Some(json!({ "cmd": "rezero" })),
        Action::Pause(true) => Some(json!({ "cmd": "pause" })),
        Action::Pause(false) => Some(json!({ "cmd": "resume" })),
        Action::Mark(text) => Some(json!({ "cmd": "mark", "text": text })),
        _ => None,
    }
}

/// Where a picture comes from, and who does what a key asks.
pub(crate) trait Source {
    fn heading(&self, seen: &Seen) -> Heading;
    /// Now, on the clock of the images' times, nanoseconds.
    fn now_ns(&self, seen: &Seen) -> u64;
    /// Whether there is nothing more to look at.
    fn is_over(&self) -> bool {
        false
    }
    /// Does it; a sentence is for whoever pressed the key.
    fn act(&self, action: Action) -> Option<String>;
    /// Whether it has one more pane, right of the hand.
    fn has_pane(&self) -> bool {
        false
    }
    /// Draws that pane, where there is room for it.
    fn draw_pane(&self, _: &mut Buffer, _: Rect, _: Palette) {}
}

struct View<'a> {
    seen: &'a Mutex<Seen>,
    source: &'a dyn Source,
    screen: Screen,
    palette: Palette,
}

impl Shown for View<'_> {
    fn draw(&mut self, frame: &mut Frame<'_>) -> bool {
        let (picture, heading, waiting) = {
            let mut seen = lock(self.seen);
            if let Some(hand) = seen.hand() {
                self.screen.fit(hand);
            }
            let now_ns = self.source.now_ns(&seen);
            let waiting = seen.gone().unwrap_or("waiting for the hand").to_owned();
            let picture = seen.picture(&self.screen, now_ns);
            (picture, self.source.heading(&seen), waiting)
        };
        let area = frame.area();
        match picture {
            Some(picture) => {
                let (screen, palette, has_pane) = (&self.screen, self.palette, self.source.has_pane());
                let buffer = frame.buffer_mut();
                let pane = draw(buffer, area, &picture, screen, &heading, palette, has_pane);
                if let Some(pane) = pane {
                    self.source.draw_pane(buffer, pane, palette);
                }
            }
            None => {
                let words = Paragraph::new(format!(" {}: {waiting}; q quits", heading.name));
                frame.render_widget(words.wrap(Wrap { trim: false }), area);
            }
        }
        !self.source.is_over()
    }

    fn key(&mut self, key: KeyEvent) -> bool {
        let action = {
            let mut seen = lock(self.seen);
            // Who has pressed a key has read it.
            seen.hush();
            self.screen.key(key, &seen)
        };
        match action {
            Action::Quit => return false,
            Action::None => {}
            action => {
                if let Some(words) = self.source.act(action) {
                    let mut seen = lock(self.seen);
                    let now_ns = self.source.now_ns(&seen);
                    seen.say(words, now_ns);
                }
            }
        }
        true
    }

    fn tell(&mut self, words: String) {
        let mut seen = lock(self.seen);
        let now_ns = self.source.now_ns(&seen);
        seen.tell(words, now_ns);
    }
}

/// Draws until the person there has seen enough.
pub(crate) fn look(
    seen: &Mutex<Seen>,
    source: &dyn Source,
    screen: Screen,
    interrupt: &Interrupt,
    deadline: Option<Instant>,
    remarks: Remarks,
) -> anyhow::Result<()> {
    let mut view = View {
        seen,
        source,
        screen,
        palette: Palette::of_terminal(),
    };
    terminal::show(&mut view, interrupt, deadline, remarks)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ratatui::crossterm::event::{KeyCode, KeyModifiers};
    use taxel_hand::Profile;
    use taxel_skin::Layout;
    use taxel_wire::{Clock, Hello, HelloRate};

    /// Answers each key.
    struct Answering;

    impl Source for Answering {
        fn heading(&self, _: &Seen) -> Heading {
            Heading {
                name: "hand".into(),
                detail: String::new(),
                about: String::new(),
            }
        }

        fn now_ns(&self, _: &Seen) -> u64 {
            1
        }

        fn act(&self, _: Action) -> Option<String> {
            Some("may not be paused".into())
        }
    }

    /// What was seen of a daemon that has described its hand.
    fn seen() -> Mutex<Seen> {
        let (mode, hz) = ("timer".into(), Some(50.0));
        let hello = Hello::new(
            "taxeld 0.1.0",
            &Layout::builtin("uskin-module").unwrap(),
            &Profile::default(),
            HelloRate { mode, hz },
            Clock::Monotonic,
        );
        let seen = Mutex::new(Seen::default());
        lock(&seen).see_hello(&hello, 0);
        seen
    }

    #[test]
    fn a_picture_of_a_daemon_that_is_gone_is_drawn_and_ends_with_why() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("hand.svg");
        let sheet = Sheet {
            path: &path,
            size: (80, 24),
        };
        let seen = seen();
        lock(&seen).set_gone("it ended");
        let outcome = sheet.draw(&seen, &Answering, &Screen::new());
        assert_eq!(outcome.unwrap_err().to_string(), "hand: it ended");
        let drawn = std::fs::read_to_string(&path).unwrap();
        assert!(drawn.contains("the daemon is gone (it ended)"), "{drawn}");
    }

    #[test]
    fn what_happens_by_itself_does_not_hide_what_became_of_a_key() {
        let seen = seen();
        let mut view = View {
            seen: &seen,
            source: &Answering,
            screen: Screen::default(),
            palette: Palette::True,
        };
        let shown = |view: &View<'_>| {
            let area = Rect::new(0, 0, 120, 40);
            let mut buffer = Buffer::empty(area);
            let picture = lock(&seen).picture(&view.screen, 1).unwrap();
            let heading = Answering.heading(&lock(&seen));
            draw(
                &mut buffer,
                area,
                &picture,
                &view.screen,
                &heading,
                Palette::True,
                false,
            );
            buffer
                .content
                .iter()
                .map(|cell| cell.symbol())
                .collect::<String>()
        };
        view.tell("a file is damaged".into());
        assert!(shown(&view).contains("a file is damaged"));
        view.key(KeyEvent::new(KeyCode::Char('p'), KeyModifiers::NONE));
        view.tell("a file is damaged".into());
        assert!(shown(&view).contains("may not be paused"), "{}", shown(&view));
    }
}
