//! The text of a layout file, of which some keys are set anew and everything else stays as it is written.

use anyhow::ensure;
use std::fmt::Write;

const MODULE: &str = "[[module]]";

/// A layout file: what stands above its modules, and the text of each.
#[derive(Debug, Clone)]
pub(super) struct LayoutText {
    pub(super) head: String,
    pub(super) modules: Vec<String>,
}

impl LayoutText {
    /// Takes apart a file with `modules` tables `[[module]]`; comments directly above one belong to it, those at the top
    /// of the file are left out.
    pub(super) fn parse(text: &str, modules: usize) -> anyhow::Result<Self> {
        let mut parts = vec![String::new()];
        let mut comment = String::new();
        for line in text.lines() {
            if line.starts_with('#') {
                comment += &format!("{line}\n");
                continue;
            }
            if line.trim() == MODULE {
                parts.push(String::new());
            } else if line.trim().is_empty() {
                comment.clear();
                continue;
            }
            let part = parts.last_mut().expect("one part at least");
            *part += &std::mem::take(&mut comment);
            *part += &format!("{line}\n");
        }
        let head = parts.remove(0);
        ensure!(
            parts.len() == modules,
            "the layout has {modules} modules and {} tables {MODULE}; write each module as such a table",
            parts.len()
        );
        let first_key = head
            .lines()
            .position(|line| !line.starts_with('#'))
            .unwrap_or_default();
        let head = head
            .lines()
            .skip(first_key)
            .map(|line| format!("{line}\n"))
            .collect();
        Ok(Self { head, modules: parts })
    }

    /// Sets a key above the modules.
    pub(super) fn set_head(&mut self, key: &str, value: &str) {
        set(&mut self.head, key, value);
    }

    /// Sets a key of a module.
    pub(super) fn set(&mut self, module: usize, key: &str, value: &str) {
        set(&mut self.modules[module], key, value);
    }

    /// The file, with these comments at its top.
    pub(super) fn write(&self, comments: &str) -> String {
        let mut text = String::new();
        for line in comments.lines() {
            let _ = writeln!(text, "# {line}");
        }
        text += &self.head;
        for module in &self.modules {
            text += "\n";
            text += module;
        }
        text
    }
}

/// Writes `key = value` where the key stands, or as the last line.
fn set(part: &mut String, key: &str, value: &str) {
    let is_key = |line: &str| {
        let rest = line.strip_prefix(key);
        rest.is_some_and(|rest| rest.trim_start().starts_with('='))
    };
    let line = format!("{key} = {value}\n");
    let has_key = part.lines().any(is_key);
    *part = part
        .lines()
        .map(|old| match is_key(old) {
            true => line.clone(),
            false => format!("{old}\n"),
        })
        .collect();
    if !has_key {
        *part += &line;
    }
}

/// A text as a TOML string.
pub(super) fn quoted(text: &str) -> String {
    toml::Value::from(text).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "# About a hand.\n\nname = \"n\"\nbuses = [\"a\"]\n\n# The first.\n[[module]]\nname = \"m\"\n\
                        board = 1    # guessed\norder = [\n  [0, 1],\n]\n\n[[module]]\nname = \"o\"\n";

    #[test]
    fn keys_are_set_and_the_rest_stays_with_its_module() {
        let mut text = LayoutText::parse(TEXT, 2).unwrap();
        text.set_head("buses", "[\"b\"]");
        text.set(0, "board", "7");
        text.set(1, "board", "8");
        text.modules.swap(0, 1);
        assert_eq!(
            text.write("One line.\nAnother."),
            "# One line.\n# Another.\nname = \"n\"\nbuses = [\"b\"]\n\n[[module]]\nname = \"o\"\nboard = 8\n\n\
             # The first.\n[[module]]\nname = \"m\"\nboard = 7\norder = [\n  [0, 1],\n]\n"
        );
    }

    #[test]
    fn modules_that_are_written_otherwise_are_refused() {
        let error = LayoutText::parse("module = [{ name = \"m\" }]\n", 1).unwrap_err();
        assert!(error.to_string().contains("[[module]]"), "{error}");
    }
}
