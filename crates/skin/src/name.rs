//! What may be a name in a layout file.

/// Why nobody could read this as a name, or why it would break the lines in which it is told.
pub(crate) fn why_no_name(name: &str) -> Option<&'static str> {
    match name {
        "" => Some("empty"),
        name if name.contains(char::is_control) => {
            Some("no name: it has a line break or another control character")
        }
        _ => None,
    }
}
