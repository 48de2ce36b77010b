//! Which kind of recording a file is.

use std::path::Path;

/// What kind of recording a file is, which the ending of its name tells, in small letters or capitals.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileKind {
    /// One array of numpy.
    Npy,
    /// Several arrays of numpy.
    Npz,
    /// A frame a line.
    Csv,
    /// CAN traffic as candump writes it.
    Log,
    /// What `taxel record` writes.
    Mcap,
}

impl FileKind {
    const ALL: [Self; 5] = [Self::Log, Self::Mcap, Self::Csv, Self::Npy, Self::Npz];

    /// All endings, in words.
    pub const ENDINGS: &str = ".log, .mcap, .csv, .npy or .npz";

    /// The kind of a file; `None` where its name ends otherwise.
    pub fn of(path: &Path) -> Option<Self> {
        let extension = path.extension()?;
        let is_it = |kind: &Self| extension.eq_ignore_ascii_case(kind.ending());
        Self::ALL.into_iter().find(is_it)
    }

    /// What its name ends in, behind the dot.
    pub const fn ending(self) -> &'static str {
        match self {
            Self::Npy => "npy",
            Self::Npz => "npz",
            Self::Csv => "csv",
            Self::Log => "log",
            Self::Mcap => "mcap",
        }
    }
}
