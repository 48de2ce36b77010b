//! What every MTB hears and answers: commands of classes 2 and 7 (docs/protocols.md, "MTB commands",
//! "MTB discovery", "MTB3 firmware" and "uSkin commands").

use super::firmware::Identity;
use super::{Board, State};
use crate::skin_model::SkinModel;
use taxel_can::CanFrame;

const SET_TXMODE: u8 = 0x07;
const GET_FW_VERSION: u8 = 0x1C;

impl Board {
    /// Whether an MTB takes this frame: the acceptance filters 0x20Y, 0x70Y and 0x70F, which leave
    /// the source open.
    pub(super) fn accepts(&self, id: u16) -> bool {
        let own = (id & 15) as u8 == self.address;
        matches!((id >> 8, own, id & 15), (2 | 7, true, _) | (7, _, 15))
    }

    /// Does what an accepted frame says.
    pub(super) fn handle_command(&mut self, frame: &CanFrame, t_ns: u64, skin: &SkinModel) {
        let Some(identity) = self.firmware.identity() else {
            return;
        };
        let id = frame.id() as u16;
        let (source, own) = ((id >> 4 & 15) as u8, (id & 15) as u8 == self.address);
        if id >> 8 == 2 {
            self.analog(frame.data(), source, t_ns, identity, skin);
            return;
        }
        if self.state == State::Streaming {
            self.disabled_ns = Some(t_ns);
        }
        self.stop();
        self.manage(frame.data(), source, own, identity);
    }

    /// Class 2: start, stop, firmware version, and what the board's own firmware adds.
    fn analog(&mut self, data: &[u8], source: u8, t_ns: u64, identity: Identity, skin: &SkinModel) {
        if self.state == State::Bootloader {
            return;
        }
        match *data {
            [SET_TXMODE, 0x00, ..] => self.start(t_ns),
            [SET_TXMODE, 0x01, ..] => {
                self.stop();
                self.disabled_ns = None;
            }
            [GET_FW_VERSION, major, minor, ..] => {
                let same = u8::from([major, minor] == identity.can_protocol);
                let [f0, f1, f2] = identity.firmware;
                let [p0, p1] = identity.can_protocol;
                let board_type = identity.board_type;
                self.reply(
                    0x200,
                    source,
                    &[GET_FW_VERSION, board_type, f0, f1, f2, p0, p1, same],
                );
            }
            _ => {
                let effect = self.firmware.configure(data, t_ns, skin);
                self.follow(effect, t_ns);
            }
        }
    }

    /// Class 7. That the sampling timer is off already happened, whatever the command.
    fn manage(&mut self, data: &[u8], source: u8, own: bool, identity: Identity) {
        let [f0, f1, f2] = identity.firmware;
        let board_type = identity.board_type;
        match (data.first(), self.state) {
            (Some(0xFF), State::Bootloader) => self.reply(0x700, source, &[0xFF, board_type, f0, f1]),
            (_, State::Bootloader) => {}
            (Some(0xFF), _) => self.reply(0x700, source, &[0xFF, board_type, f0, f1, f2]),
            (Some(0x00), _) if own => {
                self.sweep = None;
                self.state = State::Bootloader;
                self.reply(0x700, source, &[0x00, 0x01]);
            }
            (Some(0x04), _) if own => self.reply(0x700, source, &[0x04, 0x01]),
            (Some(0x0C), _) if own => {
                for part in 0..8 {
                    self.reply(0x700, source, &[0x0C, part, b' ', b' ', b' ', b' ']);
                }
            }
            _ => {}
        }
    }

    fn reply(&mut self, class: u16, to: u8, data: &[u8]) {
        let id = class | u16::from(self.address & 15) << 4 | u16::from(to);
        if let Ok(frame) = CanFrame::standard(id, data) {
            self.push(frame);
        }
    }

    /// Frames a board sends when it gets power, before anything is configured.
    pub(super) fn boot(&mut self) {
        let mut frames = Vec::new();
        self.firmware.boot(&mut |to, data| frames.push((to, data)));
        for (to, data) in frames {
            self.reply(0x700, to, &data);
        }
    }
}
