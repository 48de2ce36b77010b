//! One line of a candump log.

use super::error::LineProblem;
use super::log_frame::Direction;
use crate::frame::ERROR_FLAG;
use crate::{CanFrame, EXTENDED_FLAG};

/// One frame of a log, its interface still as it stands there.
pub(super) struct Line<'a> {
    /// `None` where the line has no time.
    pub(super) t_ns: Option<u64>,
    pub(super) interface: &'a [u8],
    pub(super) frame: CanFrame,
    pub(super) direction: Option<Direction>,
}

/// A column (from 1) and what is wrong there.
pub(super) type Problem = (usize, LineProblem);

/// A line without what some editors put before the first line of a text (U+FEFF in UTF-8).
pub(super) fn without_mark(line: &[u8], number: u64) -> &[u8] {
    let marked = line.strip_prefix(b"\xEF\xBB\xBF").filter(|_| number == 1);
    marked.unwrap_or(line)
}

/// Reads one line; `None` if there is nothing on it.
pub(super) fn parse_line(bytes: &[u8]) -> Result<Option<Line<'_>>, Problem> {
    let mut cursor = Cursor { bytes, at: 0 };
    cursor.skip_blanks();
    if cursor.peek().is_none() {
        return Ok(None);
    }
    let before_the_time = cursor.expected("`(` before the time");
    let t_ns = match cursor.peek() {
        Some(b'(') => {
            let t_ns = cursor.time()?;
            cursor.blanks("a blank after the time")?;
            Some(t_ns)
        }
        _ => None,
    };
    let interface = cursor.word();
    if interface.is_empty() {
        return Err(cursor.expected("an interface name"));
    }
    let started = cursor.blanks("a blank after the interface name");
    let (frame, direction) = match started.and_then(|()| cursor.frame_and_direction(t_ns.is_some())) {
        Ok(read) => read,
        Err(shown @ (_, LineProblem::Screen { .. })) => return Err(shown),
        // What has no time is a line of candump's screen, or no frame at all.
        Err(_) if t_ns.is_none() => return Err(before_the_time),
        Err(problem) => return Err(problem),
    };
    Ok(Some(Line {
        t_ns,
        interface,
        frame,
        direction,
    }))
}

const BITS: LineProblem = screen("-i", "bits");
const SWAPPED: LineProblem = screen("-S", "the bytes in reverse");
const DATES: LineProblem = screen("-tA", "the local date, and not which zone it is of");
const RAW_LENGTHS: LineProblem = screen("-8", "length codes over 8");

const fn screen(option: &'static str, shows: &'static str) -> LineProblem {
    LineProblem::Screen { option, shows }
}

fn hex(digit: u8) -> Option<u32> {
    char::from(digit).to_digit(16)
}

struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Cursor<'a> {
    fn peek(&self) -> Option<u8> {
        self.bytes.get(self.at).copied()
    }

    fn eat(&mut self, byte: u8) -> bool {
        let found = self.peek() == Some(byte);
        self.at += usize::from(found);
        found
    }

    fn expected(&self, expected: &'static str) -> Problem {
        let found = self.peek();
        (self.at + 1, LineProblem::Expected { expected, found })
    }

    fn expected_at(&self, column: usize, expected: &'static str) -> Problem {
        let found = self.bytes.get(column - 1).copied();
        (column, LineProblem::Expected { expected, found })
    }

    fn skip_blanks(&mut self) -> bool {
        let start = self.at;
        while self.peek().is_some_and(|b| b.is_ascii_whitespace()) {
            self.at += 1;
        }
        self.at > start
    }

    fn blanks(&mut self, expected: &'static str) -> Result<(), Problem> {
        if self.skip_blanks() {
            Ok(())
        } else {
            Err(self.expected(expected))
        }
    }

    fn word(&mut self) -> &'a [u8] {
        let start = self.at;
        while self.peek().is_some_and(|b| !b.is_ascii_whitespace()) {
            self.at += 1;
        }
        &self.bytes[start..self.at]
    }

    fn decimal_digit(&mut self) -> Option<u64> {
        let digit = self.peek().filter(u8::is_ascii_digit)?;
        self.at += 1;
        Some(u64::from(digit - b'0'))
    }

    fn hex_digit(&mut self) -> Option<u32> {
        let digit = hex(self.peek()?)?;
        self.at += 1;
        Some(digit)
    }

    /// `(SECONDS.FRACTION)` with any number of digits; those after the ninth are cut off.
    fn time(&mut self) -> Result<u64, Problem> {
        if !self.eat(b'(') {
            return Err(self.expected("`(` before the time"));
        }
        self.skip_blanks();
        let start = self.at + 1;
        let too_large = (start, LineProblem::TimeTooLarge);
        let mut seconds = self
            .decimal_digit()
            .ok_or_else(|| self.expected("the seconds of the time"))?;
        while let Some(digit) = self.decimal_digit() {
            seconds = seconds
                .checked_mul(10)
                .and_then(|s| s.checked_add(digit))
                .ok_or(too_large)?;
        }
        let mut nanoseconds = 0;
        if self.eat(b'.') {
            let mut unit = 100_000_000;
            let mut digits = 0;
            while let Some(digit) = self.decimal_digit() {
                nanoseconds += digit * unit;
                unit /= 10;
                digits += 1;
            }
            if digits == 0 {
                return Err(self.expected("digits after the decimal point of the time"));
            }
        }
        if seconds < 10_000 && self.peek() == Some(b'-') {
            return Err((start, DATES));
        }
        if !self.eat(b')') {
            return Err(self.expected("`)` after the time"));
        }
        seconds
            .checked_mul(1_000_000_000)
            .and_then(|s| s.checked_add(nanoseconds))
            .ok_or(too_large)
    }

    /// The frame as in a log, or, which alone may be without a time, as on candump's screen.
    fn frame_and_direction(&mut self, timed: bool) -> Result<(CanFrame, Option<Direction>), Problem> {
        let shown = self.shown_direction()?;
        let start = self.at;
        if self.word().contains(&b':') {
            return Err((start + 1, LineProblem::CanXl));
        }
        self.at = start;
        let raw_id = self.id()?;
        let after_id = self.at;
        self.skip_blanks();
        if self.eat(b'[') {
            return Ok((self.shown_frame(raw_id)?, shown));
        }
        if self.peek() == Some(b'{') {
            return Err((self.at + 1, RAW_LENGTHS));
        }
        self.at = after_id;
        match timed {
            true => Ok((self.logged_frame(raw_id)?, self.direction()?)),
            false => Err(self.expected("`[` before the length")),
        }
    }

    /// `RX - -`, which `candump -x` shows before the identifier.
    fn shown_direction(&mut self) -> Result<Option<Direction>, Problem> {
        let start = self.at;
        let direction = match self.word() {
            b"RX" => Direction::Received,
            b"TX" => Direction::Transmitted,
            _ => {
                self.at = start;
                return Ok(None);
            }
        };
        for flags in [b"B", b"E"] {
            self.skip_blanks();
            if !matches!(self.word(), word if word == flags || word == b"-") {
                return Err(self.expected("`- -` after `RX` or `TX`"));
            }
        }
        self.blanks("a blank after `- -`")?;
        Ok(Some(direction))
    }

    /// `[LENGTH]  DATA`, its bytes apart, as candump shows them. What it shows behind them, such as their text, is passed over.
    fn shown_frame(&mut self, raw_id: u32) -> Result<CanFrame, Problem> {
        let length = self.at;
        let len = match self.decimal_digit() {
            Some(_) if self.peek().is_some_and(|b| b.is_ascii_digit()) => {
                return Err((self.at, LineProblem::CanFd));
            }
            Some(len) if len <= 8 && self.eat(b']') => len as u8,
            _ => {
                self.at = length;
                return Err(self.expected("a length of 0 to 8 in brackets"));
            }
        };
        self.skip_blanks();
        if self.bytes[self.at..].starts_with(b"remote request") {
            let frame = CanFrame::remote(raw_id & 0x1FFF_FFFF, raw_id & EXTENDED_FLAG != 0, len);
            return Ok(frame.unwrap_or_else(|_| frame_of_checked_parts(raw_id, &[])));
        }
        let mut data = [0; 8];
        let too_few = "as many data bytes of two hexadecimal digits as the length says";
        for byte in &mut data[..usize::from(len)] {
            self.skip_blanks();
            let column = self.at + 1;
            *byte = match self.word() {
                [high, low] => match (hex(*high), hex(*low)) {
                    (Some(high), Some(low)) => (high << 4 | low) as u8,
                    _ => return Err(self.expected_at(column, too_few)),
                },
                word if word.contains(&b'`') => return Err((column, SWAPPED)),
                word if word.len() == 8 && word.iter().all(|bit| matches!(bit, b'0' | b'1')) => {
                    return Err((column, BITS));
                }
                _ => return Err(self.expected_at(column, too_few)),
            };
        }
        self.skip_blanks();
        let column = self.at + 1;
        if let [high, low] = self.word()
            && hex(*high).is_some()
            && hex(*low).is_some()
        {
            return Err(self.expected_at(column, "no more data bytes than the length says"));
        }
        Ok(if raw_id & ERROR_FLAG != 0 {
            CanFrame::error(raw_id, data)
        } else {
            frame_of_checked_parts(raw_id, &data[..usize::from(len)])
        })
    }

    fn logged_frame(&mut self, raw_id: u32) -> Result<CanFrame, Problem> {
        if !self.eat(b'#') {
            return Err(self.expected("`#` after the CAN id of 3 or 8 hexadecimal digits"));
        }
        if self.peek() == Some(b'#') {
            return Err((self.at + 1, LineProblem::CanFd));
        }
        if matches!(self.peek(), Some(b'R' | b'r')) {
            if raw_id & ERROR_FLAG != 0 {
                return Err(self.expected("data, since an error frame cannot be a remote frame"));
            }
            self.at += 1;
            return self.remote(raw_id);
        }
        let mut data = [0; 8];
        let mut len = 0;
        while len < 8 {
            if len > 0 {
                self.eat(b'.');
            }
            let Some(high) = self.hex_digit() else { break };
            let low = self
                .hex_digit()
                .ok_or_else(|| self.expected("the second hexadecimal digit of a data byte"))?;
            data[len] = (high << 4 | low) as u8;
            len += 1;
        }
        if len == 8 {
            self.raw_dlc()?;
        }
        self.end_of_frame("up to 8 data bytes of two hexadecimal digits")?;
        Ok(if raw_id & ERROR_FLAG != 0 {
            CanFrame::error(raw_id, data)
        } else {
            frame_of_checked_parts(raw_id, &data[..len])
        })
    }

    /// The identifier with its flag bits.
    fn id(&mut self) -> Result<u32, Problem> {
        let column = self.at + 1;
        let (mut id, mut digits) = (0, 0);
        while digits < 8 {
            let Some(digit) = self.hex_digit() else { break };
            id = id << 4 | digit;
            digits += 1;
        }
        let too_large = Err((column, LineProblem::IdTooLarge { id }));
        match digits {
            3 if id > 0x7FF => too_large,
            3 => Ok(id),
            8 if id & !(ERROR_FLAG | 0x1FFF_FFFF) != 0 => too_large,
            8 if id & ERROR_FLAG != 0 => Ok(id),
            8 => Ok(id | EXTENDED_FLAG),
            _ => Err(self.expected("a CAN id of 3 or 8 hexadecimal digits")),
        }
    }

    fn remote(&mut self, raw_id: u32) -> Result<CanFrame, Problem> {
        let mut len = 0;
        if let Some(digit @ b'0'..=b'8') = self.peek() {
            self.at += 1;
            len = digit - b'0';
        }
        if len == 8 {
            self.raw_dlc()?;
        }
        self.end_of_frame("a length of 0 to 8 or nothing after `R`")?;
        let extended = raw_id & EXTENDED_FLAG != 0;
        let frame = CanFrame::remote(raw_id & 0x1FFF_FFFF, extended, len);
        Ok(frame.unwrap_or_else(|_| frame_of_checked_parts(raw_id, &[])))
    }

    /// `_9` to `_F`: the length code that was on the wire of a frame of 8 bytes. The frame has no
    /// room for it.
    fn raw_dlc(&mut self) -> Result<(), Problem> {
        if self.eat(b'_') && self.hex_digit().is_none_or(|dlc| dlc <= 8) {
            return Err(self.expected("a raw length code of 9 to F after `_`"));
        }
        Ok(())
    }

    fn end_of_frame(&self, expected: &'static str) -> Result<(), Problem> {
        match self.peek() {
            None => Ok(()),
            Some(byte) if byte.is_ascii_whitespace() => Ok(()),
            Some(_) => Err(self.expected(expected)),
        }
    }

    fn direction(&mut self) -> Result<Option<Direction>, Problem> {
        self.skip_blanks();
        let direction = match self.peek() {
            None => return Ok(None),
            Some(b'R' | b'r') => Direction::Received,
            Some(b'T' | b't') => Direction::Transmitted,
            Some(_) => return Err(self.expected("`R`, `T` or the end of the line")),
        };
        self.at += 1;
        self.skip_blanks();
        match self.peek() {
            None => Ok(Some(direction)),
            Some(_) => Err(self.expected("the end of the line")),
        }
    }
}

/// A frame whose identifier and length have been checked, so that making it cannot fail.
fn frame_of_checked_parts(raw_id: u32, data: &[u8]) -> CanFrame {
    match CanFrame::from_raw(raw_id, data) {
        Ok(frame) => frame,
        Err(_) => CanFrame::error(0, [0; 8]),
    }
}
