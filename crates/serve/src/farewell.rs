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
    Failed(#[source] io::Error),
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
    #[error(
        "all places are taken, more of them by this process than by any other: its oldest made room for another's"
    )]
    Crowds,
}

impl Farewell {
    /// Whether the client is told why: whoever has gone, or reads nothing, is not.
    pub(crate) fn is_told(&self) -> bool {
        !matches!(self, Self::Closed | Self::Failed(_) | Self::Stalled(_))
    }
}

/// Who leaves without having read all that was sent resets the connection: it has closed it all the same.
impl From<io::Error> for Farewell {
    fn from(error: io::Error) -> Self {
        match error.kind() {
            io::ErrorKind::ConnectionReset | io::ErrorKind::BrokenPipe => Self::Closed,
            _ => Self::Failed(error),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_leaves_with_messages_unread_has_closed_the_connection() {
        for (errno, closed) in [
            (nix::libc::ECONNRESET, true),
            (nix::libc::EPIPE, true),
            (nix::libc::ENOBUFS, false),
        ] {
            let farewell = Farewell::from(io::Error::from_raw_os_error(errno));
            assert_eq!(matches!(farewell, Farewell::Closed), closed, "{farewell}");
        }
    }
}
