//! Words of commands that people are told to type.

use std::fmt::Display;

/// A path, or another word of a command in a message, as a shell takes it for this one word: in quotes where it has blanks or
/// anything else that means something to a shell, as the `?` of `log:a.log?interface=can0`.
pub fn shell_word(word: impl Display) -> String {
    let word = word.to_string();
    let is_plain = |c: char| c.is_alphanumeric() || "_-+./:,@%=".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        return word;
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::process::Command;

    #[test]
    fn a_shell_takes_every_word_for_the_one_it_is() {
        let plain = [
            "a.log",
            "log:/x/a-1.log",
            "udp::45133",
            "größe.csv",
            "a=b,c@d%2+3",
        ];
        for word in plain {
            assert_eq!(shell_word(word), word);
        }
        let others = [
            "",
            "my log.log",
            "log:a.log?interface=can0",
            "it's.csv",
            "a*b",
            "~x",
            "$HOME",
            "a\\b",
            "a;b&c|(d)",
            "#a",
            "!!",
        ];
        for word in others {
            assert!(shell_word(word).starts_with('\''), "{word}");
        }
        for word in plain.into_iter().chain(others) {
            let echo = format!("printf %s {}", shell_word(word));
            let said = Command::new("sh").args(["-c", &echo]).output().unwrap();
            assert_eq!(String::from_utf8(said.stdout).unwrap(), word);
        }
    }
}
