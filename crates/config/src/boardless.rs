//! Modules that have no board, and so no values but those of an array in a file.

use crate::Config;

/// So many are named.
const NAMED: usize = 3;

impl Config {
    /// What is to be said of the layout's modules that have no board: a daemon has no values of them. `None` where all have one.
    pub fn boardless_modules(&self) -> Option<String> {
        let names: Vec<&str> = (self.layout.without_board())
            .map(|module| module.name.as_str())
            .collect();
        let (named, more) = names.split_at(names.len().min(NAMED));
        let more = match more.len() {
            0 => String::new(),
            more => format!(" and {more} more"),
        };
        let (modules, have, their) = match names.len() {
            0 => return None,
            1 => ("module", "has", "its"),
            _ => ("modules", "have", "their"),
        };
        let named = named.join(", ");
        Some(format!(
            "{modules} {named}{more} {have} no board (`protocol = \"offline\"`): {their} taxels have no values live, in \
             recordings alone"
        ))
    }
}
