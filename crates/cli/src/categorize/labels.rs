//! Labels that are likely to be one class, spelt in two ways.

use std::collections::HashMap;

/// That two labels differ in case or blanks alone, where any do.
pub(super) fn alike<'a>(labels: impl IntoIterator<Item = &'a String>) -> Option<String> {
    let mut spelt: HashMap<String, &str> = HashMap::new();
    labels.into_iter().find_map(|label| {
        let plain: String = label.split_whitespace().collect();
        let first = *spelt.entry(plain.to_lowercase()).or_insert(label);
        (first != label).then(|| {
            format!(
                "the labels {first:?} and {label:?} differ in case or blanks alone and are taken for two classes; if they are one, \
                 spell them alike"
            )
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_that_differ_in_case_or_blanks_alone_are_said() {
        let alike = |labels: &[&str]| alike(&labels.iter().map(|l| (*l).to_owned()).collect::<Vec<_>>());
        for same in [
            ["none", "None"],
            ["big ball", "bigball"],
            ["big ball", "Big  ball"],
        ] {
            let told = alike(&["soft", same[0], same[0], same[1]]).unwrap();
            assert!(
                told.contains(&format!("{:?} and {:?}", same[0], same[1])),
                "{told}"
            );
        }
        assert_eq!(alike(&["a", "a", "b", "", "ab", ""]), None);
    }
}
