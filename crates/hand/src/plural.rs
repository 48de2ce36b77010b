//! Numbers of things, in words.

/// `1 board`, `2 boards`.
pub fn plural(n: usize, word: &str) -> String {
    format!("{n} {word}{}", if n == 1 { "" } else { "s" })
}
