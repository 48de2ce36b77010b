//! What may be a name: of a hand, its buses, modules and parts, and of joints.

/// Why nobody could read this as a name, or why it would break the lines in which it is told.
pub fn why_no_name(name: &str) -> Option<&'static str> {
    match name {
        name if name.trim().is_empty() => Some("empty"),
        name if name.contains(char::is_control) => {
            Some("no name: it has a line break or another control character")
        }
        _ => None,
    }
}
