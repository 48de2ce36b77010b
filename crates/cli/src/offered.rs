//! Names that a shell offers where one is typed.

use clap::builder::{PossibleValue, TypedValueParser};
use clap::{Arg, Command, Error};
use std::ffi::OsStr;

/// What `parser` reads, and names of it that completions offer; others are not refused for that.
pub(crate) fn offering<P: TypedValueParser>(
    names: impl IntoIterator<Item = &'static str>,
    parser: P,
) -> impl TypedValueParser<Value = P::Value> {
    let names = names.into_iter().collect();
    Offering { names, parser }
}

#[derive(Clone)]
struct Offering<P> {
    names: Vec<&'static str>,
    parser: P,
}

impl<P: TypedValueParser> TypedValueParser for Offering<P> {
    type Value = P::Value;

    fn parse_ref(&self, cmd: &Command, arg: Option<&Arg>, value: &OsStr) -> Result<P::Value, Error> {
        self.parser.parse_ref(cmd, arg, value)
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        Some(Box::new(self.names.iter().map(PossibleValue::new)))
    }
}
