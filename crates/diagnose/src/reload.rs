//! What is wrong with a configuration that is to be read again.

use crate::kind::Kind;
use crate::problem::{Place, Problem};
use std::time::Duration;

/// Why a configuration that is to be read again is not taken up.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum NotReloaded {
    /// It is wrong, for this reason.
    Refused(String),
    /// It has not been read for so long.
    Unread(Duration),
}

impl NotReloaded {
    /// What is the matter.
    pub fn sentence(&self) -> String {
        match self {
            Self::Refused(why) => format!("the configuration was read again and is refused: {why}"),
            Self::Unread(waited) => format!(
                "the configuration that is to be read again has not been read for {waited:?}, as on a disk that does not answer"
            ),
        }
    }
}

pub(crate) fn refused(why: &NotReloaded) -> Problem {
    let remedy = match why {
        NotReloaded::Refused(_) => "The one before goes on. Mend the file, and have it read again",
        NotReloaded::Unread(_) => "The one before goes on until it is; another reload waits for that",
    };
    Problem::new(
        Kind::ReloadRefused,
        Place::Daemon,
        why.sentence(),
        remedy,
        "the configuration was read again and is taken up",
    )
}
