//! Keys with their values, and nothing else.

use serde::de::value::MapAccessDeserializer;
use serde::de::{Deserialize, Deserializer, MapAccess, Visitor};
use std::fmt;
use std::marker::PhantomData;

/// A value that is read from keys and values alone. What serde derives for a struct also reads a list of its values
/// without their keys, so that `[]` would be a struct whose fields all have their defaults.
#[derive(Debug)]
pub struct FromMap<T>(pub T);

impl<'de, T: Deserialize<'de>> FromMap<T> {
    /// The same for a field that may be absent or null: `#[serde(default, deserialize_with = "FromMap::optional")]`.
    pub fn optional<D: Deserializer<'de>>(deserializer: D) -> Result<Option<T>, D::Error> {
        let read = Option::<Self>::deserialize(deserializer)?;
        Ok(read.map(|Self(value)| value))
    }

    /// The same for a field that is a list: `#[serde(deserialize_with = "FromMap::list")]`.
    pub fn list<D: Deserializer<'de>>(deserializer: D) -> Result<Vec<T>, D::Error> {
        let read = Vec::<Self>::deserialize(deserializer)?;
        Ok(read.into_iter().map(|Self(value)| value).collect())
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for FromMap<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(Keys(PhantomData))
    }
}

struct Keys<T>(PhantomData<T>);

impl<'de, T: Deserialize<'de>> Visitor<'de> for Keys<T> {
    type Value = FromMap<T>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a map")
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
        T::deserialize(MapAccessDeserializer::new(map)).map(FromMap)
    }
}
