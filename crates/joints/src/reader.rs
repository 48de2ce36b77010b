//! The thread that reads a source's angles, where they do not come over CAN.

use crate::config::{JointSource, JointsConfig};
use crate::dynamixel::{ServoReader, StartError};
use crate::synchrony::JointHistory;
use std::sync::Arc;

/// A running thread. It ends when the last copy of this is dropped.
#[derive(Debug, Clone)]
pub enum JointReader {
    /// One that reads servos.
    Servos(Arc<ServoReader>),
}

impl JointReader {
    /// Starts the thread that the source needs; `None` where it needs none. The thread calls
    /// `first` before anything else: to take a real-time priority, for example.
    pub fn start(
        config: &JointsConfig,
        first: impl FnOnce() + Send + 'static,
    ) -> Result<Option<Self>, StartError> {
        config.check()?;
        match &config.source {
            JointSource::Dynamixel(servos) => {
                let reader = ServoReader::start_with(servos, first)?;
                Ok(Some(Self::Servos(Arc::new(reader))))
            }
            JointSource::Allegro(_) => Ok(None),
        }
    }

    /// Copies the readings that are kept, if there are others than when this returned `seen` (0
    /// before the first time) and unless the thread is at them just now. Never waits, and allocates
    /// nothing where `into` has the memory for them ([`crate::SourceConfig::readings_kept`]).
    pub fn try_history_since(&self, seen: u64, into: &mut JointHistory) -> u64 {
        match self {
            Self::Servos(reader) => reader.try_history_since(seen, into),
        }
    }
}
