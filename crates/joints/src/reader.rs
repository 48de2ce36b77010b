//! The threads that read a hand's angles, where they do not come over CAN.

use crate::analogue::AnalogueReader;
use crate::config::{JointSource, JointsConfig};
use crate::dynamixel::ServoReader;
use crate::serial::{ReadingThreadError, StartError};
use crate::synchrony::JointHistory;
use std::sync::Arc;

/// The running threads. They end when the last copy of this is dropped.
#[derive(Debug, Clone, Default)]
pub struct JointReader {
    /// The one that reads servos.
    pub servos: Option<Arc<ServoReader>>,
    /// The one that reads potentiometers.
    pub analogue: Option<Arc<AnalogueReader>>,
}

impl JointReader {
    /// How many sources it may be asked for.
    pub const SOURCES: usize = 2;

    /// Starts the threads that the joints need; `None` where they need none. Each thread calls `first` before anything
    /// else: to take a real-time priority, for example.
    pub fn start(
        config: &JointsConfig,
        first: impl FnOnce() + Clone + Send + 'static,
    ) -> Result<Option<Self>, StartError> {
        config.check()?;
        let servos = match &config.source {
            JointSource::Dynamixel(servos) => Some(Arc::new(ServoReader::start_with(servos, first.clone())?)),
            JointSource::Allegro(_) => None,
        };
        let analogue = (config.analogue.as_ref())
            .map(|analogue| AnalogueReader::start(analogue, first).map(Arc::new))
            .transpose()?;
        Ok((servos.is_some() || analogue.is_some()).then_some(Self { servos, analogue }))
    }

    /// Has the threads end, and does not wait: motors they have switched on are switched off.
    pub fn stop(&self) {
        if let Some(servos) = &self.servos {
            servos.stop();
        }
        if let Some(analogue) = &self.analogue {
            analogue.stop();
        }
    }

    /// Does so and waits until the threads have ended, but not for ever.
    pub fn end(&self) -> Result<(), ReadingThreadError> {
        self.stop();
        let servos = self.servos.as_ref().map_or(Ok(()), |servos| servos.end());
        let analogue = self.analogue.as_ref().map_or(Ok(()), |analogue| analogue.end());
        servos.and(analogue)
    }

    /// The names of the joints of which nobody knows whether their motors are off, though they are to be.
    pub fn motors_not_off(&self) -> Vec<&str> {
        self.joints_with(ServoReader::motors_not_off)
    }

    /// The names of the joints whose motors are on, as their servos said last.
    pub fn motors_on(&self) -> Vec<&str> {
        self.joints_with(ServoReader::motors_on)
    }

    fn joints_with(&self, which: impl Fn(&ServoReader) -> Vec<usize>) -> Vec<&str> {
        let servos = self.servos.as_deref();
        servos.map_or_else(Vec::new, |servos| {
            let joints = which(servos).into_iter();
            joints.map(|joint| servos.names()[joint].as_str()).collect()
        })
    }

    /// Copies the readings of a source (0 the joints' own, 1 the potentiometers beside it) that are kept, if there are
    /// others than when this returned `seen` (0 before the first time) and unless the thread is at them just now. Never
    /// waits, and allocates nothing where `into` has the memory for them ([`crate::SourceConfig::readings_kept`]).
    pub fn try_history_since(&self, source: usize, seen: u64, into: &mut JointHistory) -> u64 {
        match (source, &self.servos, &self.analogue) {
            (0, Some(servos), _) => servos.try_history_since(seen, into),
            (1, _, Some(analogue)) => analogue.try_history_since(seen, into),
            _ => seen,
        }
    }
}
