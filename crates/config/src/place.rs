//! Where in a configuration file what a message speaks of is written.

use toml::de::{DeTable, DeValue};

/// The line, from 1, of the key in `table`, or at the top where that is empty, that a message names first, as that of a value outside its range does; `None`
/// where there is no such key.
pub fn line_of(text: &str, table: &str, message: &str) -> Option<usize> {
    let file = DeTable::parse(text).ok()?;
    let file = file.get_ref();
    let offset = entry_of_list(file, message).or_else(|| {
        let mut keys = Vec::new();
        match table {
            "" => keys_of(file, &mut keys),
            name => {
                if let DeValue::Table(table) = file.get(name)?.get_ref() {
                    keys_of(table, &mut keys);
                }
            }
        }
        words(message).find_map(|word| keys.iter().find(|(key, _)| *key == word).map(|(_, at)| *at))
    })?;
    Some(1 + text.get(..offset)?.matches('\n').count())
}

/// Where what a message calls `joints.servo[1].id` is written: a key of the second entry of that list, or the entry.
fn entry_of_list(file: &DeTable<'_>, message: &str) -> Option<usize> {
    let (path, rest) = message.split_whitespace().find_map(|word| {
        let (path, rest) = word.split_once('[')?;
        rest.contains("].").then_some((path, rest))
    })?;
    let (index, key) = rest.split_once("].")?;
    let mut names = path.split('.');
    let mut list = file.get(names.next()?)?.get_ref();
    for name in names {
        let DeValue::Table(table) = list else {
            return None;
        };
        list = table.get(name)?.get_ref();
    }
    let DeValue::Array(list) = list else {
        return None;
    };
    let entry = list.get(index.parse::<usize>().ok()?)?;
    let mut keys = Vec::new();
    if let DeValue::Table(table) = entry.get_ref() {
        keys_of(table, &mut keys);
    }
    let wanted = words(key).next()?;
    let written = keys.iter().find(|(key, _)| *key == wanted);
    Some(written.map_or(entry.span().start, |(_, at)| *at))
}

/// The keys of a table and of those in it, each with where it is written.
fn keys_of<'a>(table: &'a DeTable<'_>, keys: &mut Vec<(&'a str, usize)>) {
    for (key, value) in table.iter() {
        keys.push((key.get_ref(), key.span().start));
        if let DeValue::Table(inner) = value.get_ref() {
            keys_of(inner, keys);
        }
    }
}

fn words(text: &str) -> impl Iterator<Item = &str> {
    text.split(|c: char| !c.is_ascii_alphanumeric() && c != '_')
        .filter(|word| !word.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_is_placed_at_the_key_that_it_names_first() {
        let text = "\
layout = \"a\"
[[bus]]
source = \"sim:tap\"
[[bus]]
source = \"sim:tip\"
[tick]
# rate_hz = 30.0
mode = \"timer\"
  rate_hz = 5000.0
[profile]
actuators = 4
codebook = [3, 2]
budgets.palm = 2
[joints]
source = \"dynamixel:/dev/ttyUSB0\"
[[joints.servo]]
id = 1
[[joints.servo]]
id = 300
[joints.allegro]
version = 9
";
        for (table, message, line) in [
            ("tick", "tick.rate_hz = 5000 is outside 1 to 1000 Hz", Some(9)),
            ("tick", "tick.silent_ms = 1 is outside 10 to 60000 ms", None),
            (
                "profile",
                "profile: codebook entry 1 (2) is not above; actuators",
                Some(12),
            ),
            ("profile", "profile: budgets names \"palm\"", Some(13)),
            ("joints", "joints.servo[1].id = 300 is outside 0 to 252", Some(19)),
            ("joints", "joints.servo[0].homing_rad = 9 is outside", Some(16)),
            ("joints", "joints.allegro.version = 9", Some(20)),
            ("bus", "bus[1].source", Some(5)),
            ("", "layout", Some(1)),
        ] {
            assert_eq!(line_of(text, table, message), line, "{message}");
        }
        assert_eq!(
            line_of("\ntick = { rate_hz = 5000.0 }", "tick", "tick.rate_hz = 5000"),
            Some(2)
        );
    }
}
