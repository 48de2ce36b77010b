//! What serde says of a value in a file that it refuses, in words for who wrote the file.

use super::did_you_mean::did_you_mean;

/// A message of serde or toml in plain words: what was found, what is wanted, how to write it, and which known name a
/// misspelt one is likely to mean. What it does not know stays as it is.
pub fn plain_words(message: &str) -> String {
    let message = message.trim().replace('\n', "; ");
    for (start, what) in [("unknown field `", "key"), ("unknown variant `", "word")] {
        if let Some(told) = message.strip_prefix(start).and_then(|rest| unknown(what, rest)) {
            return told;
        }
    }
    for start in ["invalid type: ", "invalid value: "] {
        let parts = message
            .strip_prefix(start)
            .and_then(|rest| rest.rsplit_once(", expected "));
        if let Some(told) = parts.and_then(|(found, wanted)| match wanted.split_once(" at line ") {
            None => mistyped(found, wanted),
            Some((wanted, place)) => Some(format!("{} (line {place})", mistyped_json(found, wanted)?)),
        }) {
            return told;
        }
    }
    if let Some((found, wanted)) = message
        .strip_prefix("invalid length ")
        .and_then(|rest| rest.split_once(", expected an array of length "))
    {
        return format!("a list of {wanted} is wanted here, not of {found}");
    }
    if let Some(key) = message.strip_prefix("missing field `") {
        return format!("the key `{key} is missing here");
    }
    if message == "wanted string or table" {
        return "a word is wanted here, in quotes".into();
    }
    if message.starts_with("unexpected leading zero") {
        return "a number does not begin with 0; a mode is text, in quotes: mode = \"0660\"".into();
    }
    if message.starts_with("string values must be quoted") {
        return "a value is missing or without quotes: write a number, true or false, or text in quotes"
            .into();
    }
    message
}

/// `rest` begins with the unknown name and ends with those known, each in backticks, and perhaps a place.
fn unknown(what: &str, rest: &str) -> Option<String> {
    let Some((name, expected)) = rest.rsplit_once("`, expected ") else {
        let (name, _) = rest.rsplit_once("`, there are no ")?;
        return Some(format!("unknown {what} `{name}`; none is known here"));
    };
    let (listed, place) = expected.rsplit_once('`')?;
    let known: Vec<&str> = listed.split('`').skip(1).step_by(2).collect();
    let meant = did_you_mean(name, known.iter().copied());
    let there = match (meant.is_empty(), known.len()) {
        (true, 1) => "; there is only ",
        (true, _) => "; there are ",
        (false, 1) => " There is only ",
        (false, _) => " There are ",
    };
    let known = known.join(", ");
    Some(format!("unknown {what} `{name}`{meant}{there}{known}{place}"))
}

fn mistyped(found: &str, wanted: &str) -> Option<String> {
    let (wanted_words, numbers) = wanted_words(wanted)?;
    let text = found.strip_prefix("string ");
    let hint = match (found, wanted) {
        ("map", "a sequence") => "; [[name]] makes an entry of a list, [name] a table",
        ("sequence", _) if wanted_words.starts_with("a table") => {
            "; [name] makes a table, [[name]] an entry of a list"
        }
        (_, "a sequence") => "; a list is written in [ ]",
        _ if numbers && text.is_some_and(|text| text.trim_matches('"').parse::<f64>().is_ok()) => {
            "; leave out the quotes"
        }
        _ => "",
    };
    let found = match found {
        "map" => "a table".into(),
        "sequence" => "a list".into(),
        _ => match (text, found.split_once('`')) {
            (Some(text), _) => format!("the text {text}"),
            // "integer `3`", or "integer `99999999999999999999` as i128".
            (None, Some((_, value))) => value.split('`').next().unwrap_or(value).to_owned(),
            (None, None) => found.to_owned(),
        },
    };
    Some(format!("{wanted_words} is wanted here, not {found}{hint}"))
}

/// The same of JSON, in which tables and lists are written otherwise.
fn mistyped_json(found: &str, wanted: &str) -> Option<String> {
    let wanted = match wanted_words(wanted)?.0 {
        words if words.starts_with("a table") => "an object in { }".to_owned(),
        words if words == "a list" => "a list in [ ]".into(),
        _ => return mistyped(found, wanted),
    };
    let told = mistyped(found, "a string")?;
    let (_, found) = told.split_once(", not ")?;
    let found = if found == "a table" { "an object" } else { found };
    Some(format!("{wanted} is wanted here, not {found}"))
}

/// What is wanted, and whether it is a number.
fn wanted_words(wanted: &str) -> Option<(String, bool)> {
    let whole = |least: i128, most: i128| format!("a whole number from {least} to {most}");
    let words = match wanted {
        "f64" | "f32" => return Some(("a number".into(), true)),
        "u8" => return Some((whole(0, u8::MAX.into()), true)),
        "u16" => return Some((whole(0, u16::MAX.into()), true)),
        "u32" => return Some((whole(0, u32::MAX.into()), true)),
        "i8" => return Some((whole(i8::MIN.into(), i8::MAX.into()), true)),
        "i16" => return Some((whole(i16::MIN.into(), i16::MAX.into()), true)),
        "i32" => return Some((whole(i32::MIN.into(), i32::MAX.into()), true)),
        "u64" | "usize" => return Some(("a whole number from 0".into(), true)),
        "i64" => return Some(("a whole number".into(), true)),
        "a string" | "path string" => "text in quotes",
        "a boolean" => "true or false",
        "a sequence" => "a list",
        "a map" => "a table [name]",
        _ if wanted.starts_with("a whole number") => return Some((wanted.into(), true)),
        _ if wanted.starts_with("struct ") => "a table [name]",
        _ => return None,
    };
    Some((words.into(), false))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;
    use std::path::PathBuf;

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code)]
    struct File {
        rate_hz: Option<f64>,
        levels: Option<u8>,
        direction: Option<i8>,
        file: Option<PathBuf>,
        on: Option<bool>,
        method: Option<Method>,
        place: Option<[f64; 2]>,
        bus: Option<Vec<Bus>>,
        tick: Option<Bus>,
    }

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code)]
    struct Bus {
        source: String,
    }

    #[derive(Debug, Deserialize)]
    #[serde(rename_all = "lowercase")]
    enum Method {
        Paper,
        Optimal,
    }

    fn told(text: &str) -> String {
        plain_words(toml::from_str::<File>(text).unwrap_err().message())
    }

    #[test]
    fn each_refusal_of_a_file_says_what_to_write_instead() {
        for (text, wanted) in [
            (
                "rate_hz = \"30\"",
                "a number is wanted here, not the text \"30\"; leave out the quotes",
            ),
            (
                "rate_hz = \"fast\"",
                "a number is wanted here, not the text \"fast\"",
            ),
            (
                "rate_hz = 99999999999999999999999",
                "a number is wanted here, not 99999999999999999999999",
            ),
            ("rate_hz = true", "a number is wanted here, not true"),
            (
                "levels = 3.5",
                "a whole number from 0 to 255 is wanted here, not 3.5",
            ),
            (
                "levels = -3",
                "a whole number from 0 to 255 is wanted here, not -3",
            ),
            (
                "on = \"yes\"",
                "true or false is wanted here, not the text \"yes\"",
            ),
            ("file = 3", "text in quotes is wanted here, not 3"),
            (
                "[bus]\nsource = \"a\"",
                "a list is wanted here, not a table; [[name]] makes an entry of a list, [name] a table",
            ),
            (
                "bus = \"a, expected b\"",
                "a list is wanted here, not the text \"a, expected b\"; a list is written in [ ]",
            ),
            ("tick = 3", "a table [name] is wanted here, not 3"),
            ("[[bus]]", "the key `source` is missing here"),
            (
                "[[bus]]\nsorce = \"a\"",
                "unknown key `sorce`; did you mean `source`? There is only source",
            ),
            (
                "rate = 3",
                "unknown key `rate`; did you mean `rate_hz`? There are rate_hz, levels, direction, file, on, method, place, bus, tick",
            ),
            (
                "method = \"papr\"",
                "unknown word `papr`; did you mean `paper`? There are paper, optimal",
            ),
            (
                "method = \"x`, expected `y\"",
                "unknown word `x`, expected `y`; there are paper, optimal",
            ),
            ("method = true", "a word is wanted here, in quotes"),
            (
                "direction = -1.0",
                "a whole number from -128 to 127 is wanted here, not -1.0",
            ),
            (
                "on = 0660",
                "a number does not begin with 0; a mode is text, in quotes: mode = \"0660\"",
            ),
            (
                "on =",
                "a value is missing or without quotes: write a number, true or false, or text in quotes",
            ),
        ] {
            assert_eq!(told(text), wanted, "{text}");
        }
    }

    #[test]
    fn values_in_json_are_told_as_those_in_files() {
        for (message, wanted) in [
            (
                "invalid type: floating point `4.5`, expected i64 at line 1 column 26",
                "a whole number is wanted here, not 4.5 (line 1 column 26)",
            ),
            (
                "invalid type: string \"30\", expected f64 at line 2 column 5",
                "a number is wanted here, not the text \"30\"; leave out the quotes (line 2 column 5)",
            ),
            (
                "invalid type: integer `3`, expected a map at line 1 column 9",
                "an object in { } is wanted here, not 3 (line 1 column 9)",
            ),
            (
                "invalid type: sequence, expected a map at line 1 column 0",
                "an object in { } is wanted here, not a list (line 1 column 0)",
            ),
            (
                "invalid type: string \"index\", expected a sequence at line 1 column 17",
                "a list in [ ] is wanted here, not the text \"index\" (line 1 column 17)",
            ),
            (
                "invalid type: integer `1`, expected a boolean at line 1 column 10",
                "true or false is wanted here, not 1 (line 1 column 10)",
            ),
        ] {
            assert_eq!(plain_words(message), wanted);
        }
    }

    #[test]
    fn what_it_does_not_know_stays_as_it_is() {
        for text in ["", "unknown field `", "invalid type: x", "something else\n"] {
            assert_eq!(plain_words(text), text.trim(), "{text}");
        }
    }
}
