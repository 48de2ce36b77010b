//! Frames of and to MTBs that carry no taxels: commands, answers, and what a board says of its transmit queue
//! (docs/protocols.md, "MTB ids", "MTB commands" and "MTB3 firmware").

use taxel_can::{CanFrame, IdFilter};

/// `SET_TXMODE`, first data byte of a start or stop command.
pub(super) const SET_TXMODE: u8 = 0x07;
/// `GET_FW_VERSION`, first data byte of the request and of its answer.
pub(crate) const GET_FW_VERSION: u8 = 0x1C;
pub(super) const SET_BRD_CFG: u8 = 0x4D;
pub(super) const SET_TRIANG_CFG: u8 = 0x50;

/// Commands by first data byte and length, to tell those of another program from frames of unknown boards.
const COMMANDS: [(u8, usize); 9] = [
    (SET_TXMODE, 2),
    (0x08, 2),
    (GET_FW_VERSION, 3),
    (0x32, 2),
    (0x4C, 8),
    (SET_BRD_CFG, 4),
    (0x4E, 8),
    (0x4F, 3),
    (SET_TRIANG_CFG, 7),
];
const NOBODY: u16 = u16::MAX;

/// Whether this is the data of a command to an MTB.
pub(super) fn is_command(data: &[u8]) -> bool {
    data.first()
        .is_some_and(|first| COMMANDS.contains(&(first & 0x7F, data.len())))
}

/// The board that answers a question of ours, by the answer: `0x200 | address << 4`, eight bytes.
#[inline]
pub(crate) fn answering(frame: &CanFrame) -> Option<u8> {
    let id = frame.standard_id().filter(|id| id & 0x70F == 0x200)?;
    (frame.data().len() == 8 && frame.data()[0] == GET_FW_VERSION).then_some((id >> 4 & 15) as u8)
}

/// Standard id of a board's answer.
pub(crate) fn answer_id(address: u8) -> u16 {
    0x200 | u16::from(address & 15) << 4
}

/// What passes a board's answer.
pub(crate) fn answer_filter(address: u8) -> IdFilter {
    IdFilter::standard(answer_id(address), 0x7FF)
}

/// The MTBs of a bus, by address.
#[derive(Debug, Clone)]
pub(crate) struct MtbBoards {
    /// Module index of each.
    modules: [u16; 16],
    /// Those that take more commands than start and stop, and answer.
    configured: [bool; 16],
}

/// A frame of or to an MTB that carries no taxels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum MtbFrame {
    /// The board of this module threw its transmit queue away.
    QueueOverflow(u16),
    /// A command that a board obeys: to start, to stop, to set itself up.
    Command,
    /// The question who is there, or the answer to it.
    Question,
}

impl MtbBoards {
    pub(crate) fn new() -> Self {
        Self {
            modules: [NOBODY; 16],
            configured: [false; 16],
        }
    }

    pub(crate) fn add(&mut self, address: u8, module: u16, configured: bool) {
        let address = usize::from(address & 15);
        (self.modules[address], self.configured[address]) = (module, configured);
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.modules == [NOBODY; 16]
    }

    /// What a standard data frame is that carries no taxel.
    pub(crate) fn frame(&self, id: u16, data: &[u8]) -> Option<MtbFrame> {
        let [to, from] = [id & 15, id >> 4 & 15].map(usize::from);
        if data.is_empty() && id & 0x70F == 0x705 && self.modules[from] != NOBODY {
            return Some(MtbFrame::QueueOverflow(self.modules[from]));
        }
        let start_or_stop = matches!(data, [SET_TXMODE, 0 | 1]);
        let to_configured = self.configured[to] || (to == 15 && self.configured.contains(&true));
        let command = id & 0x7F0 == 0x200 && (start_or_stop || (to_configured && is_command(data)));
        let answer = data.len() == 8 && data[0] == GET_FW_VERSION;
        let answers = id & 0x70F == 0x200 && answer && self.configured[from];
        match command && data[0] & 0x7F != GET_FW_VERSION {
            true => Some(MtbFrame::Command),
            false => (command || answers).then_some(MtbFrame::Question),
        }
    }
}
