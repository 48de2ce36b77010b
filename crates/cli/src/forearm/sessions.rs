//! Sessions, and what is said of them before anything is made of them.

use std::path::Path;
use taxel_forearm::{ForearmError, Session};
use taxel_hand::plural;

/// Reads a session; what of its folder is no part of it is said.
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
    Ok(session)
}
