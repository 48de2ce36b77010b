//! Why a subscriber was let go.

use std::io;
use std::time::Duration;
use taxel_wire::SubscribeError;

/// Why a subscriber was let go.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Farewell {
    #[error("it closed the connection")]
    Closed,
    #[error("its connection failed: {0}")]
    Failed(#[from] io::Error),
    #[error("it took no message for {0:?}")]
    Stalled(Duration),
    #[error("it sent what is no subscription: {0}")]
    Nonsense(SubscribeError),
    #[error("it asked too often for what it cannot have: {0}")]
    Insists(String),
    #[error("{0} subscribers are connected already")]
    TooMany(usize),
    #[error("all places are taken, and it wants no images: it made room for a display; connect again")]
    MadeRoom,
}
