//! Lists of a fixed length that are refused where they go on.

use serde::de::{Deserialize, Deserializer, Error};

/// Arrays, and what holds arrays, read as a whole: `#[serde(deserialize_with = "WholeList::read")]`. What serde derives for
/// an array leaves the rest of a longer list of TOML unread, so that of `at = [8, 0, 77]` the 77 would be dropped unsaid.
pub trait WholeList<'de>: Sized {
    /// The list, refused if it is longer than wanted as it is if it is shorter.
    fn read<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error>;
}

/// The same as a type, for what holds it to be deserialized: `Spanned<Whole<[i64; 2]>>`.
#[derive(Debug)]
pub struct Whole<T>(pub T);

impl<'de, T: WholeList<'de>> Deserialize<'de> for Whole<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        T::read(deserializer).map(Self)
    }
}

/// What lists are of.
macro_rules! element {
    ($($number:ty),*) => {$(
        impl<'de> WholeList<'de> for $number {
            fn read<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                Self::deserialize(deserializer)
            }
        }
    )*};
}

element!(f64, i64, i32, i8);

impl<'de, T: WholeList<'de>, const N: usize> WholeList<'de> for [T; N] {
    fn read<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Self::try_from(Vec::<T>::read(deserializer)?).map_err(|list: Vec<T>| {
            let wanted = format!("an array of length {N}");
            D::Error::invalid_length(list.len(), &&*wanted)
        })
    }
}

impl<'de, T: WholeList<'de>> WholeList<'de> for Vec<T> {
    fn read<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let list = Vec::<Whole<T>>::deserialize(deserializer)?;
        Ok(list.into_iter().map(|Whole(value)| value).collect())
    }
}

impl<'de, T: WholeList<'de>> WholeList<'de> for Option<T> {
    fn read<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Ok(Option::<Whole<T>>::deserialize(deserializer)?.map(|Whole(value)| value))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plain_words;

    #[derive(Debug, PartialEq, serde::Deserialize)]
    struct File {
        #[serde(default, deserialize_with = "WholeList::read")]
        at: Option<[i64; 2]>,
        #[serde(default, deserialize_with = "WholeList::read")]
        places: Vec<[f64; 2]>,
        #[serde(default, deserialize_with = "WholeList::read")]
        axes: [[f64; 3]; 2],
    }

    #[test]
    fn a_list_is_as_long_as_it_is_wanted() {
        let text = "at = [8, 0]\nplaces = [[1, 2.5]]\naxes = [[1, 0, 0], [0, 1, 0]]";
        let (at, places) = (Some([8, 0]), vec![[1.0, 2.5]]);
        let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        assert_eq!(toml::from_str::<File>(text).unwrap(), File { at, places, axes });
        for (text, length) in [
            ("at = [8, 0, 77]", 3),
            ("at = [8]", 1),
            ("places = [[1, 1], [1, 1, 9]]", 3),
            ("places = [[]]", 0),
            ("axes = [[1, 0, 0]]", 1),
            ("axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]", 3),
        ] {
            let error = toml::from_str::<File>(text).unwrap_err();
            assert!(error.span().is_some(), "{text}");
            assert_eq!(
                plain_words(error.message()),
                format!("a list of 2 is wanted here, not of {length}")
            );
        }
    }
}
