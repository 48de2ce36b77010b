//! How messages get to a subscriber.

use crate::socket::Room;
use taxel_wire::Subscribe;

/// How messages get to a subscriber.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Way {
    /// Every one, in order.
    Every,
    /// The newest, by the subscriber's own task.
    Newest,
    /// The newest, by the courier wherever the socket takes it at once.
    Courier,
}

impl Way {
    /// That of the images of a subscription. The courier looks at no clock, and leaves a socket to the
    /// task that raw frames go to as well.
    pub(crate) fn of_images(wants: &Subscribe) -> Self {
        match wants {
            Subscribe { every: true, .. } => Self::Every,
            Subscribe {
                raw: false,
                max_rate_hz: None,
                ..
            } => Self::Courier,
            _ => Self::Newest,
        }
    }

    /// When a message may be sent.
    pub(crate) fn room(self) -> Room {
        match self {
            Self::Every => Room::Any,
            Self::Newest | Self::Courier => Room::Fresh,
        }
    }

    /// That of the raw frames of a subscription.
    pub(crate) fn of_raw_frames(wants: &Subscribe) -> Self {
        match wants.every {
            true => Self::Every,
            false => Self::Newest,
        }
    }
}
