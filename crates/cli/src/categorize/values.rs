//! What the values of touches are.

use serde::{Deserialize, Serialize};
use taxel_record::{Frames, Recording};

/// What the values of a frame are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Values {
    /// Counts x y z of each taxel, above rest.
    Xyz,
    /// z of each taxel, above rest; what else is one signed number for each taxel is taken for it.
    Z,
    /// One number for each taxel and none below 0, such as norms.
    Magnitudes,
}

impl Values {
    pub(super) fn of(recording: &Recording) -> Self {
        match recording.frames() {
            Frames::Counts(_) => Self::Xyz,
            Frames::Magnitudes(values) if values.iter().any(|value| *value < 0.0) => Self::Z,
            Frames::Magnitudes(_) => Self::Magnitudes,
        }
    }

    /// Those of a file behind files with `before`: a file in which none is below 0 may be as signed as these.
    pub(super) fn or(self, before: Self, is_first: bool) -> Self {
        match (self, before) {
            (Self::Magnitudes, Self::Z) if !is_first => Self::Z,
            _ => self,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_record::ReadOptions;

    #[test]
    fn numbers_with_a_sign_are_z_and_those_without_magnitudes() {
        use Values::{Magnitudes, Xyz, Z};
        let of = |name: &str, rows: &str| {
            let dir = tempfile::tempdir().unwrap();
            let path = dir.path().join(name);
            std::fs::write(&path, rows).unwrap();
            Values::of(&Recording::open(&path, &ReadOptions::default()).unwrap())
        };
        assert_eq!(of("a.csv", "1,2\n3,4\n"), Magnitudes);
        assert_eq!(of("a.csv", "1,2\n-3,4\n"), Z);
        assert_eq!(of("a.csv", "x1,y1,z1\n1,2,3\n"), Xyz);
        assert_eq!(
            [
                Magnitudes.or(Z, false),
                Magnitudes.or(Xyz, true),
                Z.or(Magnitudes, false)
            ],
            [Z, Magnitudes, Z]
        );
    }
}
