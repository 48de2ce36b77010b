//! Where in a configuration file what a message speaks of is written.

/// The line, from 1, of the key in `table` that a message names first, as that of a value outside its range does. It reads
/// tables that are written line by line; `None` where it finds no such key.
pub fn line_of(text: &str, table: &str, message: &str) -> Option<usize> {
    entry_of_list(text, message).or_else(|| {
        let inside = format!("{table}.");
        let mut header = "";
        let written: Vec<(usize, &str)> = (1..)
            .zip(text.lines())
            .filter_map(|(number, line)| {
                if let Some(name) = header_of(line) {
                    header = name;
                    return Some((number, name.strip_prefix(&inside)?.rsplit('.').next()?));
                }
                (header == table || header.starts_with(&inside)).then_some((number, key_of(line)?))
            })
            .collect();
        let line_with = |word| {
            written
                .iter()
                .find(|(_, key)| *key == word)
                .map(|(number, _)| *number)
        };
        words(message).find_map(line_with)
    })
}

/// The line of what a message calls `joints.servo[1].id`: a key of the second `[[joints.servo]]`, or that table.
fn entry_of_list(text: &str, message: &str) -> Option<usize> {
    let (path, rest) = message.split_whitespace().find_map(|word| {
        let (path, rest) = word.split_once('[')?;
        rest.contains("].").then_some((path, rest))
    })?;
    let (index, key) = rest.split_once("].")?;
    let wanted = words(key).next()?;
    let is_entry = |line: &str| line.trim_start().starts_with("[[") && header_of(line) == Some(path);
    let mut lines = (1..).zip(text.lines());
    let entry = lines
        .by_ref()
        .filter(|(_, line)| is_entry(line))
        .nth(index.parse().ok()?)?
        .0;
    let mut keys = lines.take_while(|(_, line)| header_of(line).is_none());
    let written = keys.find(|(_, line)| key_of(line) == Some(wanted));
    Some(written.map_or(entry, |(number, _)| number))
}

/// The name in `[name]` or `[[name]]`.
fn header_of(line: &str) -> Option<&str> {
    let name = line.trim_start().strip_prefix('[')?;
    Some(name.trim_start_matches('[').split(']').next()?.trim())
}

/// The key in `key = value` or `key.part = value`.
fn key_of(line: &str) -> Option<&str> {
    let (key, _) = line.split_once('=').filter(|(key, _)| !key.contains('#'))?;
    words(key).next()
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
        ] {
            assert_eq!(line_of(text, table, message), line, "{message}");
        }
        assert_eq!(
            line_of("tick = { rate_hz = 5000.0 }", "tick", "tick.rate_hz = 5000"),
            None
        );
    }
}
