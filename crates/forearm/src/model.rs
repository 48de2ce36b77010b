//! Models in files.

use crate::error::ForearmError;
use crate::estimate::{Estimate, Estimator, Seen};
use crate::fusion::Fusion;
use crate::kinesthetic::Kinesthetic;
use crate::session::Session;
use crate::squeeze::Squeeze;
use crate::tactile::Tactile;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// What the first line of a model file says it is.
const KIND: &str = "taxel forearm model";
/// The version that is written, and the only one that is read.
const VERSION: u32 = 6;
/// A model file is no larger: what is read first is bounded.
const MOST_BYTES: u64 = 64 << 20;

/// The first line of a model file, as JSON. The second line is the model.
#[derive(Debug, Serialize, Deserialize)]
struct Header {
    kind: String,
    version: u32,
    /// Units of what the model takes and gives.
    units: Units,
    trained_on: TrainedOn,
}

/// What the first line of a model file of any version has.
#[derive(Debug, Deserialize)]
struct Which {
    kind: String,
    version: u32,
}

#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Units {
    angles: String,
    pwm: String,
    time: String,
    estimate: String,
}

impl Units {
    /// The only ones there are.
    fn known() -> Self {
        Self {
            angles: "degrees".into(),
            pwm: "of 885".into(),
            time: "ms".into(),
            estimate: "percent from wrist to elbow".into(),
        }
    }
}

/// The last line of a model file.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Footer {
    /// CRC-32 of all lines before it, line ends included.
    checksum: u32,
}

/// What a model was trained on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TrainedOn {
    /// File or folder.
    pub session: String,
    /// Squeezes of it.
    pub squeezes: usize,
    /// Places, from 0 (wrist) to 100 (elbow).
    pub places: Vec<f64>,
    /// Whether it says that it is of a simulated forearm.
    pub simulated: bool,
}

/// A trained estimator with what it was trained on.
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    /// What it was trained on.
    pub trained_on: TrainedOn,
    /// The estimator from the fingers' angles.
    pub kinesthetic: Kinesthetic,
    /// The estimator from tactile images, and how the two are weighed, where every squeeze of the session had touch.
    pub touch: Option<(Tactile, Fusion)>,
}

/// The second line of a model file.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Parts<K, T> {
    kinesthetic: K,
    touch: T,
}

impl Model {
    /// Trains on every squeeze of a session.
    ///
    /// # Errors
    /// As [`Kinesthetic::train`] and, where every squeeze has touch, [`Tactile::train`].
    pub fn train(session: &Session) -> Result<Self, ForearmError> {
        let trials: Vec<_> = session.trials.iter().collect();
        Ok(Self {
            trained_on: TrainedOn {
                session: session.name.clone(),
                squeezes: trials.len(),
                places: session.locations(),
                simulated: session.simulated,
            },
            kinesthetic: Kinesthetic::train(&trials)?,
            touch: match session.has_touch() {
                true => Some((Tactile::train(&trials)?, Fusion::by_intervals())),
                false => None,
            },
        })
    }

    /// The bytes of a model file: three lines of JSON, what it is, the model, and the checksum of both. Data, no code.
    pub fn to_bytes(&self) -> Vec<u8> {
        let parts = Parts {
            kinesthetic: &self.kinesthetic,
            touch: &self.touch,
        };
        let header = Header {
            kind: KIND.into(),
            version: VERSION,
            units: Units::known(),
            trained_on: self.trained_on.clone(),
        };
        let line = |json: serde_json::Result<String>| json.unwrap_or_default() + "\n";
        let mut text = line(serde_json::to_string(&header)) + &line(serde_json::to_string(&parts));
        let checksum = crc32fast::hash(text.as_bytes());
        text += &line(serde_json::to_string(&Footer { checksum }));
        text.into_bytes()
    }

    /// Reads what [`Model::to_bytes`] writes.
    ///
    /// # Errors
    /// Another kind of file, another version, other units, a file that is damaged.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, ForearmError> {
        let not = |what: &str| ForearmError::Model { what: what.into() };
        let text = std::str::from_utf8(bytes).map_err(|_| not("it is no text"))?;
        let (first, rest) = text
            .split_once('\n')
            .ok_or_else(|| not("it has one line, and three are needed"))?;
        let not_read = |e| not(&format!("its first line: {e}"));
        let which: Which = serde_json::from_str(first).map_err(not_read)?;
        if which.kind != KIND {
            return Err(not(&format!("it says that it is a {:?}", which.kind)));
        }
        if which.version != VERSION {
            let what = format!(
                "it is of version {}, and {VERSION} is read; train it again",
                which.version
            );
            return Err(not(&what));
        }
        let header: Header = serde_json::from_str(first).map_err(not_read)?;
        let (model, last) = rest.split_once('\n').unwrap_or((rest, ""));
        let summed = &text[..text.len() - last.len()];
        let footer = serde_json::from_str(last).ok();
        if footer.is_none_or(|footer: Footer| footer.checksum != crc32fast::hash(summed.as_bytes())) {
            return Err(not(
                "its checksum is wrong: it was changed or cut off; train it again",
            ));
        }
        if header.units != Units::known() {
            let [found, read] = [&header.units, &Units::known()].map(serde_json::to_string);
            let what = format!(
                "its units are {}, and {} are read",
                found.unwrap_or_default(),
                read.unwrap_or_default()
            );
            return Err(not(&what));
        }
        let Parts::<Kinesthetic, Option<(Tactile, Fusion)>> { kinesthetic, touch } =
            serde_json::from_str(model).map_err(|e| not(&e.to_string()))?;
        let touches = touch
            .as_ref()
            .is_none_or(|(tactile, fusion)| tactile.is_whole() && fusion.is_whole());
        if !(kinesthetic.is_whole() && touches) {
            return Err(not("its parts do not fit each other"));
        }
        Ok(Self {
            trained_on: header.trained_on,
            kinesthetic,
            touch,
        })
    }

    /// Reads a model file.
    ///
    /// # Errors
    /// As [`Model::from_bytes`], with the file, and a file that cannot be read.
    pub fn open(path: &Path) -> Result<Self, ForearmError> {
        let io = |source| ForearmError::Io {
            path: path.into(),
            source,
        };
        let at = |source: ForearmError| ForearmError::In {
            at: path.display().to_string(),
            source: Box::new(source),
        };
        if std::fs::metadata(path).map_err(io)?.len() > MOST_BYTES {
            return Err(at(ForearmError::Model {
                what: "it is larger than 64 MB".into(),
            }));
        }
        Self::from_bytes(&std::fs::read(path).map_err(io)?).map_err(at)
    }
}

impl Estimator for Model {
    fn estimate(&self, squeeze: &Squeeze) -> Result<Estimate, ForearmError> {
        self.follow(squeeze, &mut Seen::default())
    }

    fn follow(&self, squeeze: &Squeeze, seen: &mut Seen) -> Result<Estimate, ForearmError> {
        let angles = self.kinesthetic.estimate(squeeze);
        match &self.touch {
            Some((tactile, fusion)) if squeeze.tactile.is_some() => {
                fusion.fuse(angles, tactile.follow(squeeze, seen))
            }
            _ => angles,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_model_in_other_units_is_not_read() {
        let mut units = Units::known();
        units.angles = "radians".into();
        let header = Header {
            kind: KIND.into(),
            version: VERSION,
            units,
            trained_on: TrainedOn {
                session: "elsewhere".into(),
                squeezes: 0,
                places: Vec::new(),
                simulated: false,
            },
        };
        let mut text = serde_json::to_string(&header).unwrap() + "\n{}\n";
        let checksum = crc32fast::hash(text.as_bytes());
        text += &serde_json::to_string(&Footer { checksum }).unwrap();
        let error = Model::from_bytes(text.as_bytes()).unwrap_err().to_string();
        assert!(
            error.contains(r#"its units are {"angles":"radians","pwm":"of 885","#),
            "{error}"
        );
    }

    #[test]
    fn a_model_of_another_version_may_have_other_keys() {
        let text = format!("{{\"kind\":\"{KIND}\",\"version\":3,\"of\":\"then\"}}\n{{}}\n{{}}\n");
        let error = Model::from_bytes(text.as_bytes()).unwrap_err().to_string();
        assert!(
            error.contains("of version 3, and 6 is read; train it again"),
            "{error}"
        );
    }
}
