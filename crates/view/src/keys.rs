//! What keys do.

use crate::screen::{Right, Screen, Way};
use crate::seen::Seen;
use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use taxel_hand::{Method, Profile};

/// What a key asks of whoever has the connection.
#[derive(Debug, Clone, PartialEq)]
pub enum Action {
    /// Nothing.
    None,
    /// End.
    Quit,
    /// Measure the baseline anew.
    Rezero,
    /// Have displays let go, or go on.
    Pause(bool),
    /// Make a mark.
    Mark(String),
    /// Record what the daemon sends, or end that.
    Record,
    /// Show images of this profile; `None` for the daemon's own.
    Profile(Option<Box<Profile>>),
    /// Halt a recording, or go on.
    Halt,
    /// Go on so many seconds in a recording.
    Skip(f64),
    /// Play a recording from its start.
    Again,
    /// Play a recording so many times as fast as before.
    Speed(f64),
}

/// The keys and what they do, for people; those of a daemon, those of a recording, those of both.
pub(crate) const KEYS: [&[(&str, &str)]; 3] = [
    &[
        ("z", "measure the baseline anew: hands off"),
        ("p", "pause: every display lets go; again: go on"),
        ("m", "make a mark, with a text"),
        ("r", "record into a file of its own here; again: end it"),
        ("o", "method of the images, for this view alone"),
        ("- +", "force levels K_D, for this view alone"),
        ("{ }", "actuators K_A, for this view alone"),
        ("0", "the daemon's own profile again"),
    ],
    &[
        ("p", "halt, go on"),
        (">", "5 s on"),
        ("0", "from the start"),
        ("- +", "half, twice as fast"),
    ],
    &[
        ("arrows", "look at a taxel; Esc: at the strongest"),
        ("Enter", "show it over time, or no longer"),
        ("c", "clear the taxels shown over time"),
        ("Tab", "tactile image, force over time, problems"),
        ("a", "arrows of shear"),
        ("s", "hold the scale of colours, let it follow"),
        ("[ ]", "brighter, darker"),
        ("q", "quit"),
    ],
];

impl Screen {
    /// Takes a key. What it does to the screen is done; what it asks of others is returned.
    pub fn key(&mut self, key: KeyEvent, seen: &Seen) -> Action {
        if key.kind == KeyEventKind::Release {
            return Action::None;
        }
        if key.code == KeyCode::Char('c') && key.modifiers.contains(KeyModifiers::CONTROL) {
            return Action::Quit;
        }
        if let Some(text) = &mut self.prompt {
            match key.code {
                KeyCode::Enter => {
                    let text = self.prompt.take().unwrap_or_default();
                    return if text.is_empty() {
                        Action::None
                    } else {
                        Action::Mark(text)
                    };
                }
                KeyCode::Esc => self.prompt = None,
                KeyCode::Backspace => drop(text.pop()),
                KeyCode::Char(letter) if text.len() < 200 => text.push(letter),
                _ => {}
            }
            return Action::None;
        }
        if self.help && key.code != KeyCode::Char('q') {
            self.help = false;
            return Action::None;
        }
        if let Some(hand) = seen.hand() {
            let way = match key.code {
                KeyCode::Left => Some(Way::Left),
                KeyCode::Right => Some(Way::Right),
                KeyCode::Up => Some(Way::Up),
                KeyCode::Down => Some(Way::Down),
                _ => None,
            };
            if let Some(way) = way {
                self.go(way, hand, seen.strongest());
                return Action::None;
            }
        }
        match key.code {
            KeyCode::Char('q') => return Action::Quit,
            KeyCode::Char('?' | 'h') => self.help = true,
            KeyCode::Esc => self.cursor = None,
            KeyCode::Enter => {
                if let Some(taxel) = self.cursor.or_else(|| seen.strongest()) {
                    self.choose(taxel);
                }
            }
            KeyCode::Char('c') => self.chosen.clear(),
            KeyCode::Tab => {
                self.right = match self.right {
                    Right::Image => Right::Traces,
                    Right::Traces => Right::Problems,
                    Right::Problems => Right::Image,
                }
            }
            KeyCode::Char('a') => self.no_arrows = !self.no_arrows,
            KeyCode::Char('s') => self.held = self.held.xor(Some(seen.scale())),
            KeyCode::Char('[') => self.held = Some(self.held.unwrap_or(seen.scale()) / 1.5),
            KeyCode::Char(']') => self.held = Some(self.held.unwrap_or(seen.scale()) * 1.5),
            KeyCode::Char(key) if self.recording => return playback(key),
            KeyCode::Char('z') => return Action::Rezero,
            KeyCode::Char('p') => return Action::Pause(!seen.is_paused()),
            KeyCode::Char('m') => self.prompt = Some(String::new()),
            KeyCode::Char('r') => return Action::Record,
            KeyCode::Char('0') => return Action::Profile(None),
            KeyCode::Char(key) => return profile(key, seen),
            _ => {}
        }
        Action::None
    }
}

fn playback(key: char) -> Action {
    match key {
        'p' | ' ' => Action::Halt,
        '>' | '.' => Action::Skip(5.0),
        '0' => Action::Again,
        '+' | '=' => Action::Speed(2.0),
        '-' => Action::Speed(0.5),
        _ => Action::None,
    }
}

/// The profile shown with one thing changed.
fn profile(key: char, seen: &Seen) -> Action {
    let Some(shown) = seen.hello().map(|hello| &hello.profile) else {
        return Action::None;
    };
    let mut profile = seen.profile();
    match key {
        'o' => {
            profile.method = match profile.method {
                Method::Paper => Method::Optimal,
                Method::Optimal => Method::Paper,
            };
            // What the method has to say of these is what is wanted.
            (profile.force_fit, profile.placement, profile.actuator_force) = (None, None, None);
        }
        '+' | '=' => profile.levels = (shown.levels + 1).min(255),
        '-' => profile.levels = shown.levels.saturating_sub(1).max(1),
        '}' => profile.actuators = (shown.actuators + 1).min(1024),
        '{' => profile.actuators = shown.actuators.saturating_sub(1).max(1),
        _ => return Action::None,
    }
    Action::Profile(Some(Box::new(profile)))
}
