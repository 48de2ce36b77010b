//! Sessions, and what is said of them before anything is made of them.

use std::path::Path;
use taxel_forearm::{ForearmError, Session};
use taxel_hand::plural;

/// Reads a session; what of its folder is no part of it, and what is there twice, is said.
pub(super) fn open(path: &Path) -> Result<Session, ForearmError> {
    let session = Session::open(path)?;
    if let Some(first) = session.passed_over.first() {
        remark!(
            "taxel: {}: {} of the folder {} no part of this session, by place or name, as {}; squeezes are \
             PLACE/distancePLACE_REPETITION.mat",
            session.name,
            plural(session.passed_over.len(), ".mat file"),
            if session.passed_over.len() == 1 {
                "is"
            } else {
                "are"
            },
            first.display()
        );
    }
    let copies = session.copies();
    if let [(first, second), more @ ..] = copies.as_slice() {
        let more = match more.len() {
            0 => String::new(),
            more => format!(", and so are {}", plural(more, "more pair")),
        };
        remark!(
            "taxel: {}: {} and {} are the same in all samples{more}: one is a copy of the other; take the wrong one away",
            session.name,
            first.name(),
            second.name()
        );
    }
    Ok(session)
}
