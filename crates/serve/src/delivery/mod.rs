//! How messages get to a subscriber.

pub(crate) mod courier;
pub(crate) mod feed;
pub(crate) mod lane;
pub(crate) mod message;
pub(crate) mod pace;
pub(crate) mod packet;
pub(crate) mod second_hand;
pub(crate) mod sent;
pub(crate) mod socket;
pub(crate) mod stream;

use socket::Room;
use taxel_wire::Subscribe;

/// Which messages of a stream a subscriber is sent, and by whom.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Delivery {
    /// Every one, in order, by the subscriber's own task.
    Every,
    /// The newest, by the subscriber's own task.
    Newest,
    /// The newest, by the courier wherever the socket takes it at once.
    NewestByCourier,
}

impl Delivery {
    /// That of the images of a subscription. The courier looks at no clock, and leaves a socket to the
    /// task that raw frames go to as well.
    pub(crate) fn of_images(wants: &Subscribe) -> Self {
        match wants {
            Subscribe { every: true, .. } => Self::Every,
            Subscribe {
                raw: false,
                max_rate_hz: None,
                ..
            } => Self::NewestByCourier,
            _ => Self::Newest,
        }
    }

    /// That of the raw frames of a subscription.
    pub(crate) fn of_raw_frames(wants: &Subscribe) -> Self {
        match wants.every {
            true => Self::Every,
            false => Self::Newest,
        }
    }

    /// When a message may be sent.
    pub(crate) fn room(self) -> Room {
        match self {
            Self::Every => Room::Any,
            Self::Newest | Self::NewestByCourier => Room::Fresh,
        }
    }
}
