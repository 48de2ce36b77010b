//! What the source says of the keys of the configuration: the comments of the fields that they are read into.

use std::path::Path;

/// A key of a table.
pub(crate) struct Key {
    pub(crate) name: String,
    /// What it means, a paragraph, with what each word that it may have means.
    pub(crate) meaning: String,
}

/// Source files, whose structs and enums are asked for by name.
pub(crate) struct Source(String);

impl Source {
    /// Reads them; paths are relative to the root of the workspace.
    pub(crate) fn read(files: &[&str]) -> Self {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let texts = files
            .iter()
            .map(|file| std::fs::read_to_string(root.join(file)).expect(file));
        Self(texts.collect::<Vec<_>>().join("\n"))
    }

    /// The fields of a struct with their comments, in their order. A struct that a macro makes is named by the macro.
    pub(crate) fn keys(&self, name: &str) -> Vec<Key> {
        let heads = [format!("struct {name} {{"), format!("{name}! {{\n")];
        let mut keys = Vec::new();
        for (field, meaning) in self.members(&heads) {
            let Some((name, kind)) = field.trim_start_matches("pub ").split_once(": ") else {
                continue;
            };
            let kind = kind.trim_end_matches(',');
            let kind = kind
                .strip_prefix("Option<")
                .map_or(kind, |kind| kind.trim_end_matches('>'));
            keys.push(Key {
                name: name.into(),
                meaning: format!("{meaning}{}", self.words(kind)),
            });
        }
        keys
    }

    /// The comment of a struct.
    pub(crate) fn about(&self, name: &str) -> String {
        let at = self.0.find(&format!("pub struct {name} {{")).expect(name);
        let above = self.0[..at].trim_end().lines().rev().map(str::trim);
        let mut comment: Vec<&str> = above
            .take_while(|line| line.starts_with("///") || line.starts_with("#["))
            .filter_map(|line| line.strip_prefix("///"))
            .collect();
        comment.reverse();
        // Behind an empty line is what programmers want.
        let first = comment.split(|line| line.trim().is_empty()).next().unwrap();
        plain(&first.join(" "))
    }

    /// What each word means that a key of this type may have; empty where it is no list of words.
    fn words(&self, kind: &str) -> String {
        let Some(at) = self.0.find(&format!("pub enum {kind} {{")) else {
            return String::new();
        };
        let variants = self.members(&[format!("pub enum {kind} {{")]);
        if variants.iter().any(|(variant, _)| variant.contains('(')) {
            return String::new();
        }
        let rule = self.0[..at].rfind("rename_all = \"").expect(kind);
        let rule = self.0[rule..].split('"').nth(1).unwrap();
        let mut text = String::new();
        for (variant, meaning) in variants {
            let variant = variant.trim_end_matches(',');
            let mut word = String::new();
            for (i, letter) in variant.chars().enumerate() {
                if letter.is_uppercase() && i > 0 && rule != "lowercase" {
                    word.push(if rule == "kebab-case" { '-' } else { '_' });
                }
                word.extend(letter.to_lowercase());
            }
            text += &format!(" `\"{word}\"`: {}", meaning);
        }
        text
    }

    /// The members between the braces behind one of these heads, and their comments.
    fn members(&self, heads: &[String]) -> Vec<(String, String)> {
        let start = heads
            .iter()
            .find_map(|head| Some(self.0.find(head)? + head.len()));
        let start = start.unwrap_or_else(|| panic!("no {heads:?} in the source"));
        let mut members = Vec::new();
        let mut comment: Vec<String> = Vec::new();
        for line in self.0[start..]
            .lines()
            .map(str::trim)
            .take_while(|line| *line != "}")
        {
            if let Some(text) = line.strip_prefix("///") {
                comment.push(text.trim().into());
            } else if !line.is_empty() && !line.starts_with("#[") {
                members.push((line.into(), plain(&comment.join(" "))));
                comment.clear();
            }
        }
        members
    }
}

/// A comment without links to items of the code.
fn plain(comment: &str) -> String {
    let mut text = comment.split_whitespace().collect::<Vec<_>>().join(" ");
    for (open, close) in [(" ([`", "`])"), ("[`", "`]")] {
        while let Some(start) = text.find(open) {
            let length = text[start..].find(close).expect("a link ends") + close.len();
            let inside = text[start + open.len()..start + length - close.len()].to_owned();
            let kept = if open.starts_with(' ') {
                String::new()
            } else {
                format!("`{inside}`")
            };
            text.replace_range(start..start + length, &kept);
        }
    }
    text
}
