//! Whether a live hand is one that a map can be of.

use super::map_file::MapFile;
use super::values::Values;
use anyhow::bail;

/// The hand that a map is of.
pub(crate) struct Probe {
    /// What the map is of, for messages.
    name: String,
    values: usize,
    values_are: Option<Values>,
    layout: Option<String>,
    is_told: bool,
}

impl Probe {
    pub(super) fn of(map: &MapFile) -> Self {
        Self {
            name: map.name.clone(),
            values: map.values,
            values_are: map.values_are,
            layout: map.layout.clone(),
            is_told: false,
        }
    }

    /// Compares it with a hand; what is to be said of one that may be another.
    ///
    /// # Errors
    /// Where the hand has other taxels.
    pub(super) fn meets(&self, layout: &str, taxels: usize) -> anyhow::Result<Option<String>> {
        let (name, values) = (&self.name, self.values);
        let fits = match self.values_are {
            Some(Values::Xyz) => values == 3 * taxels,
            Some(Values::Z | Values::Magnitudes) => values == taxels,
            None => values == taxels || values == 3 * taxels,
        };
        if !fits {
            bail!(
                "the map of {name} has {values} values a frame, and {layout} has {taxels} taxels; it is of another probe"
            );
        }
        let other = self.layout.as_ref().filter(|of| *of != layout);
        Ok(other.map(|of| {
            format!(
                "the map of {name} is of the layout {of}, and this hand's is {layout}, with as many taxels; where their \
                 taxels do not have the same places, categories are wrong"
            )
        }))
    }

    /// Takes note of a frame of a hand of as many taxels as the map has values; what is to be said of one of three axes.
    ///
    /// # Errors
    /// Where the map is of magnitudes, and the hand has three axes.
    pub(super) fn sees(&mut self, has_three_axes: bool) -> anyhow::Result<Option<String>> {
        let name = &self.name;
        match self.values_are {
            _ if !has_three_axes => Ok(None),
            Some(Values::Magnitudes) => bail!(
                "the map of {name} is of magnitudes, none of them below 0, and this hand's taxels have three axes, of which a \
                 touch is counts above rest; make the map of the counts x y z, as `taxel record` and `taxel convert` write them"
            ),
            None if !self.is_told => {
                self.is_told = true;
                Ok(Some(format!(
                    "the map of {name} does not say what its values are, and is compared with z; where they were magnitudes, \
                     make it again of the counts x y z"
                )))
            }
            _ => Ok(None),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn probe(values: usize, values_are: Option<Values>, layout: Option<&str>) -> Probe {
        Probe {
            layout: layout.map(Into::into),
            values,
            values_are,
            ..Probe::of(&MapFile::of_two_classes(None))
        }
    }

    #[test]
    fn magnitudes_are_compared_with_no_hand_of_three_axes() {
        use Values::{Magnitudes, Xyz, Z};
        // Values of a frame, what they are, whether a hand of 16 taxels has as many, and what is said of one of three axes.
        for (values, values_are, fits, refused) in [
            (16, Some(Magnitudes), true, true),
            (16, Some(Z), true, false),
            (48, Some(Xyz), true, false),
            (48, Some(Magnitudes), false, false),
            (16, Some(Xyz), false, false),
            (16, None, true, false),
            (48, None, true, false),
            (17, None, false, false),
        ] {
            let mut probe = probe(values, values_are, None);
            assert_eq!(probe.meets("hand", 16).is_ok(), fits, "{values} {values_are:?}");
            if !fits {
                continue;
            }
            assert!(probe.sees(false).unwrap().is_none());
            match probe.sees(true) {
                Err(error) => {
                    assert!(refused && error.to_string().contains("make the map of the counts x y z"))
                }
                Ok(told) => assert!(!refused && told.is_some() == values_are.is_none()),
            }
            assert!(refused || probe.sees(true).unwrap().is_none(), "once");
        }
    }

    #[test]
    fn a_map_of_another_layout_is_told() {
        for (layout, told) in [(Some("probe"), false), (Some("other"), true), (None, false)] {
            let said = probe(16, Some(Values::Z), layout).meets("probe", 16).unwrap();
            assert_eq!(said.is_some(), told, "{said:?}");
        }
    }
}
