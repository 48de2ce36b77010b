//! What a misspelt name most likely means.

/// The known name that a misspelt one most likely means: it differs in a quarter of its letters and one at most (letters
/// that swapped places count once), or begins with it. `None` where nothing is as close.
pub fn closest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let wanted = letters(name);
    let most = 1 + wanted.len() / 4;
    let near = known.into_iter().filter_map(|candidate| {
        let letters = letters(candidate);
        let edits = edits(&wanted, &letters);
        let begun = wanted.len() >= 3 && letters.starts_with(&wanted);
        ((edits <= most && edits < wanted.len()) || begun).then_some((edits, candidate))
    });
    near.min_by_key(|(edits, _)| *edits)
        .map(|(_, candidate)| candidate)
}

/// "; did you mean `x`?", to be put behind the misspelt name; empty where no known name is close.
pub fn did_you_mean<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    closest(name, known).map_or_else(String::new, |known| format!("; did you mean `{known}`?"))
}

/// Its letters without case; `-` and `_` are one.
fn letters(name: &str) -> Vec<char> {
    let lower = name.chars().take(64).flat_map(char::to_lowercase);
    lower.map(|c| if c == '_' { '-' } else { c }).collect()
}

/// Fewest letters to be put in, left out, exchanged or swapped with their neighbour to make `b` of `a`.
fn edits(a: &[char], b: &[char]) -> usize {
    let mut before: Vec<usize> = Vec::new();
    let mut above: Vec<usize> = (0..=b.len()).collect();
    for i in 0..a.len() {
        let mut row = vec![i + 1];
        for j in 0..b.len() {
            let exchanged = above[j] + usize::from(a[i] != b[j]);
            let mut least = exchanged.min(above[j + 1] + 1).min(row[j] + 1);
            if i > 0 && j > 0 && a[i] == b[j - 1] && a[i - 1] == b[j] {
                least = least.min(before[j - 1] + 1);
            }
            row.push(least);
        }
        before = std::mem::replace(&mut above, row);
    }
    above[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slip_of_the_keys_finds_the_name_meant() {
        let known = [
            "watch",
            "replay",
            "status",
            "levels",
            "level_steps",
            "ball-grasp",
            "max",
        ];
        for (typed, meant) in [
            ("wach", Some("watch")),
            ("wathc", Some("watch")),
            ("Watch", Some("watch")),
            ("stat", Some("status")),
            ("lvels", Some("levels")),
            ("level-steps", Some("level_steps")),
            ("bal_grasp", Some("ball-grasp")),
            ("m", None),
            ("record", None),
            ("", None),
        ] {
            assert_eq!(closest(typed, known), meant, "{typed}");
        }
    }

    #[test]
    fn edits_are_counted_as_people_make_them() {
        let count = |a: &str, b: &str| edits(&letters(a), &letters(b));
        assert_eq!(count("", "abc"), 3);
        assert_eq!(count("abc", ""), 3);
        assert_eq!(count("ab", "ba"), 1);
        assert_eq!(count("kitten", "sitting"), 3);
    }

    #[test]
    fn a_long_name_is_compared_by_its_start() {
        assert_eq!(closest(&"x".repeat(1 << 20), ["x"]), None);
    }
}
