//! A hand as plain text, without a terminal.

use crate::flat::Flat;
use taxel_hand::Geometry;

/// Columns from one taxel to the next: characters are about twice as high as they are wide.
const ASPECT: f32 = 2.0;

/// The hand laid flat in at most so many columns, a letter for each taxel: that of its module ([`letter`]). Taxels of
/// a hand that is too wide for them share places.
pub fn outline(hand: &Geometry, columns: u16) -> String {
    let flat = Flat::of(hand);
    let (across, down) = (&flat.across[0], &flat.down[0][0]);
    let scale = ASPECT.min(f32::from(columns.max(1)) / across.length);
    let mut rows = vec![String::new(); down.length.ceil() as usize];
    let mut order: Vec<usize> = (0..hand.len()).collect();
    order.sort_by(|a, b| across.places[*a].total_cmp(&across.places[*b]));
    for taxel in order {
        let row = &mut rows[down.places[taxel].round() as usize];
        let column = (across.places[taxel] * scale).round() as usize;
        while row.len() < column {
            row.push(' ');
        }
        if row.len() == column {
            row.push(letter(usize::from(hand.taxels[taxel].module)));
        }
    }
    rows.iter().map(|row| format!("{row}\n")).collect()
}

/// The letter of a module, by its number from 0: `a` to `z`, `A` to `Z`, and from `a` again.
pub fn letter(module: usize) -> char {
    const LETTERS: &[u8] = b"abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ";
    char::from(LETTERS[module % LETTERS.len()])
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_skin::Layout;

    #[test]
    fn every_taxel_of_every_built_in_hand_has_its_letter() {
        for name in Layout::builtin_names() {
            let hand = Layout::builtin(name).unwrap();
            let text = outline(&hand, 78);
            let letters = text.chars().filter(|c| c.is_ascii_alphabetic()).count();
            assert_eq!(letters, hand.len(), "{name}\n{text}");
            assert!(text.lines().all(|line| line.len() <= 78), "{name}\n{text}");
        }
    }
}
