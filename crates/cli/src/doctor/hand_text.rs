//! What hand is looked at, in words.

/// A hand and where its buses are, in words.
pub(super) fn describe_hand(
    name: &str,
    buses: impl Iterator<Item = (impl std::fmt::Display, String)>,
) -> String {
    let buses: Vec<String> = buses
        .map(|(bus, source)| {
            if source == format!("can:{bus}") {
                source
            } else {
                format!("{bus} = {source}")
            }
        })
        .collect();
    format!("hand {name} on {}", buses.join(", "))
}
