//! What is wrong with a text of JSON that a program has sent.

use serde_json::Error;
use serde_json::error::Category;
use taxel_hand::plain_words;

/// What is wrong, in plain words. The place is told only where the text is no JSON: what holds a wrong key or value was
/// written by a program around what somebody typed, and nobody sees its columns.
pub fn json_in_words(error: &Error) -> String {
    let said = plain_words(&error.to_string());
    match error.classify() {
        Category::Data => {
            let place = format!("line {} column {}", error.line(), error.column());
            said.replace(&format!(" at {place}"), "")
                .replace(&format!(" ({place})"), "")
        }
        _ => said,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Subscribe;
    use crate::text::SubscribeError;

    #[test]
    fn the_place_is_told_of_what_is_no_json_and_of_nothing_else() {
        for (text, has_place) in [
            (r#"{"image": true,}"#, true),
            (r#"{"image": "#, true),
            (r#"{"imagine": true}"#, false),
            (r#"{"image": 3}"#, false),
            (r#"{"profile": {"level": 4}}"#, false),
            (r#"{"profile": {"levels": "four"}}"#, false),
            (r#"{"profile": [3]}"#, false),
        ] {
            let Err(SubscribeError::Json(error)) = Subscribe::parse(text.as_bytes()) else {
                panic!("{text} is read");
            };
            let said = json_in_words(&error);
            assert_eq!(said.contains("line 1"), has_place, "{text}: {said}");
            assert_eq!(said.contains("column"), has_place, "{text}: {said}");
        }
    }
}
