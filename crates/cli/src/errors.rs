//! Why a command fails, as it is told.

use clap::error::ErrorKind;
use taxel_playback::stand_in;

/// Options that exclude each other, or a value that is none, where clap cannot tell: the exit code is 2.
pub(crate) fn wrong_use(text: impl std::fmt::Display) -> anyhow::Error {
    clap::Error::raw(ErrorKind::ValueValidation, format!("{text}\n")).into()
}

/// The error and its causes on one line, without those that the line already tells, and with the names that people know.
pub(crate) fn describe(error: &anyhow::Error) -> String {
    let mut text = String::new();
    for cause in error.chain() {
        let cause = stand_in::as_named(cause.to_string());
        if text.is_empty() {
            text = cause;
        } else if !text.contains(&cause) {
            text = format!("{text}: {cause}");
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cause_is_not_told_twice() {
        let inner = std::io::Error::other("no such device");
        let error = anyhow::Error::new(inner).context("can0: no such device");
        assert_eq!(describe(&error), "can0: no such device");
        let error = anyhow::anyhow!("too short").context("frames.csv");
        assert_eq!(describe(&error), "frames.csv: too short");
    }
}
