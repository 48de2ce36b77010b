//! Numbers of things, in words.

use std::fmt::Display;

/// `1 board`, `2 boards`.
pub fn plural<N: Display + PartialEq + From<u8>>(n: N, word: &str) -> String {
    let s = if n == N::from(1) { "" } else { "s" };
    format!("{n} {word}{s}")
}

#[cfg(test)]
mod tests {
    use super::plural;

    #[test]
    fn one_thing_is_one() {
        assert_eq!(plural(0_usize, "image"), "0 images");
        assert_eq!(plural(1_u64, "image"), "1 image");
        assert_eq!(plural(21_u32, "image"), "21 images");
    }
}
