//! Everything known of one board, from the stages that each know a part.

use crate::board_status::BoardStatus;
use crate::boards::BoardSupervisor;
use crate::decoder::Decoder;
use crate::sweep::SweepAssembler;

impl BoardStatus {
    /// Everything known of one board (module index), from the stages that each know a part.
    pub fn gather(
        board: u16,
        assembler: &SweepAssembler,
        decoders: &[Decoder],
        supervisor: Option<&BoardSupervisor>,
    ) -> Self {
        let mut status = assembler.board(board);
        for decoder in decoders {
            decoder.add_to(board, &mut status);
        }
        if let Some(supervisor) = supervisor {
            status.restarts += supervisor.restarts(board);
        }
        status
    }
}
