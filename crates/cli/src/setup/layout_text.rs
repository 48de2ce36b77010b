//! The text of a layout file, of which some keys are set anew and everything else stays as it is written.

use anyhow::ensure;
use std::fmt::Write;

const MODULE: &str = "module";

/// A layout file: the keys at its top, its tables, and the text of each module.
#[derive(Debug, Clone)]
pub(super) struct LayoutText {
    head: String,
    pub(super) tables: Vec<String>,
    pub(super) modules: Vec<String>,
}

impl LayoutText {
    /// Takes apart a file with `modules` tables `[[module]]`; comments directly above a table belong to it, those at the top
    /// of the file are left out.
    pub(super) fn parse(text: &str, modules: usize) -> anyhow::Result<Self> {
        let mut parts = vec![String::new()];
        let mut comment = String::new();
        for line in text.lines() {
            if line.starts_with('#') {
                comment += &format!("{line}\n");
                continue;
            }
            if table(line).is_some_and(|name| !name.starts_with("module.")) {
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
        let (parts, tables): (Vec<String>, Vec<String>) =
            parts.into_iter().partition(|part| is_table(part, MODULE));
        ensure!(
            parts.len() == modules,
            "the layout has {modules} modules and {} tables [[{MODULE}]]; write each module as such a table",
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
        Ok(Self {
            head,
            tables,
            modules: parts,
        })
    }

    /// Leaves out the tables of this name.
    pub(super) fn remove_tables(&mut self, name: &str) {
        self.tables.retain(|part| !is_table(part, name));
    }

    /// Sets a key at the top.
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
        for part in self.tables.iter().chain(&self.modules) {
            text += "\n";
            text += part;
        }
        text
    }
}

/// The name of the table that begins with this line.
fn table(line: &str) -> Option<&str> {
    let name = line.trim_start().strip_prefix('[')?;
    let (name, _) = name.trim_start_matches('[').split_once(']')?;
    let name = name.trim();
    // Rows of numbers and of texts begin so, too.
    name.starts_with(|c: char| c.is_ascii_alphabetic())
        .then_some(name)
}

fn is_table(part: &str, name: &str) -> bool {
    part.lines().find_map(table) == Some(name)
}

/// Writes `key = value` where the key stands, or behind the keys of the part, before what tables there are in it.
fn set(part: &mut String, key: &str, value: &str) {
    let is_key = |line: &str| {
        let rest = line.strip_prefix(key);
        rest.is_some_and(|rest| rest.trim_start().starts_with('='))
    };
    let mut lines: Vec<String> = part.lines().map(str::to_owned).collect();
    let inner = (lines.iter()).position(|line| table(line).is_some_and(|name| name.starts_with("module.")));
    let own = inner.unwrap_or(lines.len());
    let line = format!("{key} = {value}");
    match lines[..own].iter().position(|line| is_key(line)) {
        Some(at) => lines[at] = line,
        None => lines.insert(own, line),
    }
    *part = lines.iter().map(|line| format!("{line}\n")).collect();
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

    #[test]
    fn keys_of_other_tables_stay_as_they_are() {
        let text = "name = \"n\"\n\n# Its hub.\n[[cyskin.hub]]\nname = \"h\"\n\n[[module]]\nname = \"m\"\norder = [\n[0, -1],\n[1, 2]]\n\
                    [module.icub]\nboard = 0\n\n[cyskin]\nname = \"c\"\n";
        let mut text = LayoutText::parse(text, 1).unwrap();
        text.set_head("name", "\"x\"");
        text.set_head("buses", "[]");
        text.set(0, "board", "7");
        let module =
            "\n[[module]]\nname = \"m\"\norder = [\n[0, -1],\n[1, 2]]\nboard = 7\n[module.icub]\nboard = 0\n";
        let top = "name = \"x\"\nbuses = []\n";
        let hub = "\n# Its hub.\n[[cyskin.hub]]\nname = \"h\"\n";
        let cyskin = "\n[cyskin]\nname = \"c\"\n";
        assert_eq!(text.write(""), format!("{top}{hub}{cyskin}{module}"));
        text.remove_tables("cyskin.hub");
        assert_eq!(text.write(""), format!("{top}{cyskin}{module}"));
    }
}
