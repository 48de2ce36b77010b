//! From bytes of a serial port to angles: no I/O and no clock, and nothing allocates.

use super::config::{AnalogueConfig, AnalogueJointConfig, Channel};

/// Longest line, bytes.
const LONGEST: usize = 512;

/// What happened on the port.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub struct AnalogueCounters {
    /// Lines that could be read.
    pub lines: u64,
    /// Lines that could not: too long, no numbers, or a name without a number. The one that was under way when the port was
    /// opened is not counted.
    pub malformed: u64,
    /// When the newest good line came, nanoseconds; `None` before any.
    pub heard_ns: Option<u64>,
}

/// Why a joint has no angle in the newest good line.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum NoAngle {
    /// No good line has come yet.
    #[error("never heard")]
    NeverHeard,
    /// Its channel is not in the line.
    #[error("its channel is not in the lines")]
    Missing,
    /// The count is at an end of the converter, or beyond.
    #[error("stands at an end ({0} counts)")]
    AtEnd(f64),
}

/// What the newest good line that has a joint's channel says of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeardChannel {
    /// When it came, nanoseconds.
    pub t_ns: u64,
    /// The angle, radians, or why there is none.
    pub angle: Result<f64, NoAngle>,
}

/// Lines as they come in pieces, and what the newest one says of each joint.
#[derive(Debug)]
pub struct AnalogueLines {
    joints: Vec<AnalogueJointConfig>,
    ends: [f64; 2],
    line: Vec<u8>,
    /// The rest of this line is thrown away.
    lost: bool,
    /// Whether its throwing away is counted.
    counted: bool,
    angles: Vec<Result<f64, NoAngle>>,
    heard: Vec<Option<HeardChannel>>,
    counters: AnalogueCounters,
}

impl AnalogueLines {
    /// For a configuration that has been checked.
    pub fn new(config: &AnalogueConfig) -> Self {
        Self {
            angles: vec![Err(NoAngle::NeverHeard); config.joint.len()],
            heard: vec![None; config.joint.len()],
            joints: config.joint.clone(),
            ends: config.ends,
            line: Vec::with_capacity(LONGEST),
            lost: true,
            counted: false,
            counters: AnalogueCounters::default(),
        }
    }

    /// The port has been opened: the first line may have begun before.
    pub fn port_opened(&mut self) {
        self.line.clear();
        (self.lost, self.counted) = (true, false);
    }

    /// What happened so far.
    pub fn counters(&self) -> AnalogueCounters {
        self.counters
    }

    /// Each joint's angle in the newest good line, radians, or why there is none.
    pub fn angles(&self) -> &[Result<f64, NoAngle>] {
        &self.angles
    }

    /// What the newest good line that has its channel says of each joint; `None` where none has had it.
    pub fn heard(&self) -> &[Option<HeardChannel>] {
        &self.heard
    }

    /// Takes bytes that came at `t_ns`; `each` is called for each joint of each good line that has an angle, with its
    /// number and the angle, radians.
    pub fn push(&mut self, bytes: &[u8], t_ns: u64, mut each: impl FnMut(usize, f64)) {
        for byte in bytes {
            match byte {
                b'\n' | b'\r' => self.end_line(t_ns, &mut each),
                _ if self.lost => {}
                _ if self.line.len() == LONGEST => (self.lost, self.counted) = (true, true),
                byte => self.line.push(*byte),
            }
        }
    }

    fn end_line(&mut self, t_ns: u64, each: &mut impl FnMut(usize, f64)) {
        let lost = std::mem::replace(&mut self.lost, false);
        let counted = std::mem::replace(&mut self.counted, true);
        if lost {
            self.counters.malformed += u64::from(counted);
        } else if self.read_line(t_ns) {
            self.counters.lines += 1;
            self.counters.heard_ns = Some(t_ns);
            for (joint, angle) in self.angles.iter().enumerate() {
                if let Ok(angle) = angle {
                    each(joint, *angle);
                }
            }
        } else if !self.line.iter().all(u8::is_ascii_whitespace) {
            self.counters.malformed += 1;
        }
        self.line.clear();
    }

    /// Reads a whole line; where it is none, nothing changes.
    fn read_line(&mut self, t_ns: u64) -> bool {
        let Ok(text) = std::str::from_utf8(&self.line) else {
            return false;
        };
        if !is_well_formed(text) {
            return false;
        }
        let [low, high] = self.ends;
        for ((joint, angle), heard) in self.joints.iter().zip(&mut self.angles).zip(&mut self.heard) {
            *angle = match counts_of(text, &joint.channel) {
                None => Err(NoAngle::Missing),
                Some(counts) if counts <= low || counts >= high => Err(NoAngle::AtEnd(counts)),
                Some(counts) => Ok(joint.angle_rad(counts)),
            };
            if *angle != Err(NoAngle::Missing) {
                *heard = Some(HeardChannel { t_ns, angle: *angle });
            }
        }
        true
    }
}

fn words(text: &str) -> impl Iterator<Item = &str> {
    text.split(|c: char| c.is_ascii_whitespace() || ",;:=".contains(c))
        .filter(|word| !word.is_empty())
}

fn number(word: &str) -> Option<f64> {
    let number: f64 = word.parse().ok()?;
    // `nan` and `inf` would be names of channels.
    (number.is_finite() && word.bytes().any(|b| b.is_ascii_digit())).then_some(number)
}

fn is_name(word: &str) -> bool {
    word.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_')
        && !word.starts_with(|c: char| c.is_ascii_digit())
}

/// Numbers alone, or names each with a number behind it.
fn is_well_formed(text: &str) -> bool {
    let mut all = words(text).peekable();
    match all.peek() {
        None => false,
        Some(first) if number(first).is_some() => all.all(|word| number(word).is_some()),
        Some(_) => loop {
            match (all.next(), all.next()) {
                (None, _) => return true,
                (Some(name), Some(value)) if is_name(name) && number(value).is_some() => {}
                _ => return false,
            }
        },
    }
}

/// The number of a channel in a well-formed line.
fn counts_of(text: &str, channel: &Channel) -> Option<f64> {
    let named = words(text).next().is_some_and(|first| number(first).is_none());
    let word = match channel {
        Channel::Place(place) if named => words(text).nth(2 * usize::from(*place) + 1),
        Channel::Place(place) => words(text).nth(usize::from(*place)),
        Channel::Name(name) => {
            let mut all = words(text);
            loop {
                let (word, value) = (all.next()?, all.next());
                if word == name {
                    break value;
                }
            }
        }
    };
    number(word?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn config(channels: &[&str]) -> AnalogueConfig {
        let joints: String = channels
            .iter()
            .map(|channel| {
                format!("[[joint]]\nname = \"of {}\"\nchannel = {channel}\ncounts = [100, 900]\ndegrees = [0, 80]\n", channel.trim_matches('"'))
            })
            .collect();
        let config: AnalogueConfig = toml::from_str(&format!("device = \"/dev/x\"\n{joints}")).unwrap();
        config.check().unwrap();
        config
    }

    /// Angles in degrees of the joints that the lines have, in order.
    fn degrees(lines: &mut AnalogueLines, bytes: &[u8]) -> Vec<(usize, f64)> {
        let mut out = Vec::new();
        lines.push(bytes, 7, |joint, angle| {
            out.push((joint, angle.to_degrees().round()))
        });
        out
    }

    #[test]
    fn counts_become_degrees_on_the_line_through_two_points() {
        let by_name = &["\"p0\"", "\"p1\""][..];
        for (text, channels) in [
            ("p0 500 p1 300\n", by_name),
            ("p1:300,p0:500\r\n", by_name),
            ("p0=500;x=-1.5;p1=300\n", by_name),
            ("500,300\n", &["0", "1"]),
            (" 500\t300 7\r", &["0", "1"]),
            ("p0 500 p1 300\n", &["0", "1"]),
        ] {
            let mut lines = AnalogueLines::new(&config(channels));
            // The line under way when the port was opened is not taken.
            assert_eq!(degrees(&mut lines, b"00 p1 300\n"), [], "{text}");
            assert_eq!(
                degrees(&mut lines, text.as_bytes()),
                [(0, 40.0), (1, 20.0)],
                "{text}"
            );
            assert_eq!(
                (lines.counters().lines, lines.counters().malformed),
                (1, 0),
                "{text}"
            );
            assert_eq!(lines.counters().heard_ns, Some(7));
        }
    }

    #[test]
    fn a_joint_whose_count_is_missing_or_at_an_end_has_no_angle_and_hides_no_other() {
        let mut lines = AnalogueLines::new(&config(&["\"p0\"", "\"p1\""]));
        assert_eq!(lines.angles(), [Err(NoAngle::NeverHeard); 2]);
        lines.push(b"\n", 0, |_, _| panic!("an angle"));
        for (text, first) in [
            (&b"p0 0 p1 300\n"[..], NoAngle::AtEnd(0.0)),
            (b"p0 1023 p1 300\n", NoAngle::AtEnd(1023.0)),
            (b"p0 -5 p1 300\n", NoAngle::AtEnd(-5.0)),
            (b"p1 300\n", NoAngle::Missing),
        ] {
            assert_eq!(degrees(&mut lines, text), [(1, 20.0)]);
            assert_eq!(lines.angles()[0], Err(first));
        }
        assert_eq!(lines.counters().malformed, 0);
    }

    #[test]
    fn what_a_joint_said_last_is_kept_while_other_lines_have_not_its_channel() {
        let mut lines = AnalogueLines::new(&config(&["\"p0\"", "\"p1\""]));
        lines.push(b"\n", 0, |_, _| panic!("an angle"));
        assert_eq!(lines.heard(), [None; 2]);
        lines.push(b"p0 1023\n", 3, |_, _| panic!("an angle"));
        let mut angles = Vec::new();
        lines.push(b"p1 300\n", 4, |joint, _| angles.push(joint));
        assert_eq!(angles, [1], "what is old is given as no new reading");
        let at_end = Err(NoAngle::AtEnd(1023.0));
        assert_eq!(
            lines.heard()[0],
            Some(HeardChannel {
                t_ns: 3,
                angle: at_end
            })
        );
        assert_eq!(
            lines.heard()[1].map(|heard| (heard.t_ns, heard.angle)),
            Some((4, lines.angles()[1]))
        );
    }

    #[test]
    fn lines_that_cannot_be_read_are_counted_and_change_nothing() {
        let mut lines = AnalogueLines::new(&config(&["\"p0\""]));
        assert_eq!(degrees(&mut lines, b"\np0 500\n"), [(0, 40.0)]);
        let long = [b"p0 500 ".repeat(100), b"\n".to_vec()].concat();
        let bad: [&[u8]; 8] = [
            b"hello\n",
            b"p0\n",
            b"p0 p1 500\n",
            b"500 p0\n",
            b"p0 50 0\n",
            b"p0 nan\n",
            b"p0 \xff\xfe\n",
            &long,
        ];
        for (n, text) in bad.iter().enumerate() {
            assert_eq!(degrees(&mut lines, text), [], "{text:?}");
            assert_eq!(lines.counters().malformed, n as u64 + 1, "{text:?}");
        }
        assert_eq!(degrees(&mut lines, b"\r\n  \r\np0 300\n"), [(0, 20.0)]);
        assert_eq!((lines.counters().lines, lines.counters().malformed), (2, 8));
    }

    proptest! {
        #[test]
        fn however_the_bytes_come_the_angles_are_the_same(
            bytes in proptest::collection::vec(prop_oneof![Just(b'\n'), Just(b' '), b'0'..=b'9', Just(b'p'), any::<u8>()], 0..600),
            piece in 1_usize..50,
        ) {
            let config = config(&["\"p\"", "1"]);
            let (mut whole, mut pieces) = (AnalogueLines::new(&config), AnalogueLines::new(&config));
            let (mut a, mut b) = (Vec::new(), Vec::new());
            whole.push(&bytes, 1, |joint, angle| a.push((joint, angle)));
            for part in bytes.chunks(piece) {
                pieces.push(part, 1, |joint, angle| b.push((joint, angle)));
            }
            prop_assert_eq!(a, b);
            prop_assert_eq!(whole.counters(), pieces.counters());
        }
    }
}
