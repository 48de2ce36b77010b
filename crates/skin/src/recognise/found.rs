//! What was recognised.

use crate::protocol::cyskin::recognise::CyskinGuess;
use crate::protocol::recognised::RecognisedBus;

/// What was recognised on all buses.
#[derive(Debug, Default, Clone, PartialEq)]
pub struct Recognition {
    /// By bus.
    pub buses: Vec<RecognisedBus>,
    /// How the CySkin hubs speak, where there are any.
    pub cyskin: Option<CyskinGuess>,
}
