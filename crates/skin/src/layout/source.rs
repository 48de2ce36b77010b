//! What the checks of a layout file share: the file's modules, the places in its text, and what was
//! accepted so far.

use super::error::{LayoutError, LayoutProblem};
use super::pose::FilePose;
use super::wiring::Wiring;
use crate::protocol::cyskin::setup::CyskinSetup;
use crate::protocol::icub::setup::IcubSetup;
use serde::Deserialize;
use std::collections::HashMap;
use std::ops::Range;
use taxel_hand::{FromMap, Module, Taxel, Whole, why_no_name};
use toml::Spanned;

/// A table of the file: keys with their values, and no list of values in the order of the keys.
pub(crate) type Table<T> = Spanned<FromMap<T>>;

/// A module as it is written.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct FileModule {
    pub(crate) name: String,
    pub(crate) part: String,
    pub(crate) bus: Option<Spanned<String>>,
    pub(crate) board: Option<Spanned<i64>>,
    pub(crate) hub: Option<Spanned<String>>,
    pub(crate) icub: Option<Table<IcubSetup>>,
    pub(crate) protocol: Spanned<String>,
    pub(crate) at: Spanned<Whole<[i64; 2]>>,
    pub(crate) rotation: Option<Spanned<i64>>,
    pub(crate) rows: Option<Spanned<i64>>,
    pub(crate) columns: Option<Spanned<i64>>,
    pub(crate) order: Option<Spanned<Vec<Spanned<Vec<i64>>>>>,
    pub(crate) pitch_mm: Option<Spanned<f64>>,
    pub(crate) origin_mm: Option<Spanned<Whole<[f64; 3]>>>,
    pub(crate) axes: Option<Spanned<Whole<[[f64; 3]; 2]>>>,
    pub(crate) positions_mm: Option<Spanned<Whole<Vec<[f64; 3]>>>>,
    pub(crate) pose: Option<Table<FilePose>>,
    pub(crate) joint: Option<Spanned<String>>,
}

/// The text, to turn the offsets of spans into lines.
pub(crate) struct Source<'a> {
    file: &'a str,
    text: &'a str,
}

impl<'a> Source<'a> {
    pub(crate) fn new(file: &'a str, text: &'a str) -> Self {
        Self { file, text }
    }

    pub(crate) fn line(&self, span: &Range<usize>) -> usize {
        let end = span.start.min(self.text.len());
        1 + self.text.as_bytes()[..end]
            .iter()
            .filter(|b| **b == b'\n')
            .count()
    }

    pub(crate) fn refuse<T>(&self, span: &Range<usize>, problem: LayoutProblem) -> Result<T, LayoutError> {
        Err(LayoutError::Invalid {
            file: self.file.to_string(),
            line: self.line(span),
            problem: Box::new(problem),
        })
    }

    /// Refuses what is [no name](why_no_name).
    pub(crate) fn name(
        &self,
        span: &Range<usize>,
        what: &'static str,
        name: &str,
    ) -> Result<(), LayoutError> {
        let Some(why) = why_no_name(name) else {
            return Ok(());
        };
        let name = name.to_owned();
        self.refuse(span, LayoutProblem::BadName { what, name, why })
    }

    /// Refuses a number outside `min..=max`.
    pub(crate) fn range(
        &self,
        span: &Range<usize>,
        what: &'static str,
        value: i64,
        [min, max]: [i64; 2],
    ) -> Result<(), LayoutError> {
        if (min..=max).contains(&value) {
            return Ok(());
        }
        self.refuse(
            span,
            LayoutProblem::OutOfRange {
                what,
                value,
                min,
                max,
            },
        )
    }
}

/// Places in the file and in the image of what was accepted so far, to find what a later module
/// collides with.
#[derive(Default)]
pub(crate) struct Accepted {
    pub(crate) spans: Vec<Range<usize>>,
    pub(crate) modules: Vec<Module>,
    pub(crate) wiring: Vec<Wiring>,
    pub(crate) taxels: Vec<Taxel>,
    pub(crate) k: Vec<u16>,
    pub(crate) pixels: HashMap<(u16, u16), usize>,
    pub(crate) ids: HashMap<(u8, u16), usize>,
}

impl Accepted {
    /// The name of a taxel's module, its number there, and the line of that module.
    pub(crate) fn describe(&self, taxel: usize, source: &Source<'_>) -> (String, u16, usize) {
        let module = usize::from(self.taxels[taxel].module);
        let name = self.modules[module].name.clone();
        (name, self.k[taxel], source.line(&self.spans[module]))
    }
}

/// What of the head of the file every module is checked against.
pub(crate) struct Head {
    pub(crate) size: [u16; 2],
    pub(crate) buses: Vec<String>,
    pub(crate) cyskin: Option<CyskinSetup>,
}
