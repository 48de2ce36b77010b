//! The hand drawn in letters, with its faulty taxels marked.

use crate::wrap::wrap;
use taxel_hand::{Fault, Faults};
use taxel_skin::Layout;

/// Widest drawing, columns.
const WIDTH: usize = 68;
const HEALTHY: char = '.';
/// The letter of a taxel whose chip does not answer.
pub(super) const DEAD: char = 'D';
/// The letter of a taxel at the end of its range.
pub(super) const SATURATED: char = 'X';

/// The letter of a taxel's first fault, and what it stands for.
pub(super) fn letter(faults: Faults) -> Option<char> {
    faults.iter().next().map(|fault| match fault {
        Fault::Dead => DEAD,
        Fault::Stuck => 'S',
        Fault::Noisy => 'N',
        Fault::Wrapping => 'W',
        Fault::PaperRule => 'P',
        Fault::Status => 'E',
        Fault::Missing => '-',
        Fault::Masked => 'm',
    })
}

const LEGEND: [(char, &str); 9] = [
    (DEAD, "dead"),
    ('S', "stuck"),
    ('N', "noisy"),
    ('W', "wrapping"),
    ('P', "faulty by the paper's rule"),
    ('E', "error in its status"),
    ('-', "no value"),
    ('m', "switched off in the configuration"),
    (SATURATED, "saturated"),
];

/// The image of the hand, a row per line, and a legend of the letters in it; nothing if no taxel is
/// marked or the image is wider than a terminal. `marks` has a letter for each taxel that is not
/// healthy.
pub(super) fn draw(layout: &Layout, marks: &[Option<char>]) -> Vec<String> {
    let used = |letter: char| marks.iter().filter(|mark| **mark == Some(letter)).count();
    let step = if usize::from(layout.width) * 2 <= WIDTH {
        2
    } else {
        1
    };
    if marks.iter().all(Option::is_none) || usize::from(layout.width) * step > WIDTH {
        return Vec::new();
    }
    let mut lines: Vec<String> = (0..layout.height)
        .map(|y| {
            let mut line = String::new();
            for x in 0..layout.width {
                let cell = match layout.taxel_at(x, y) {
                    Some(taxel) => marks.get(taxel).copied().flatten().unwrap_or(HEALTHY),
                    None => ' ',
                };
                line.push(cell);
                if step == 2 {
                    line.push(' ');
                }
            }
            line.trim_end().to_string()
        })
        .collect();
    let legend: Vec<String> = LEGEND
        .iter()
        .filter(|(letter, _)| used(*letter) > 0)
        .map(|(letter, what)| format!("{letter} {what} ({})", used(*letter)))
        .collect();
    lines.extend(wrap(&format!("{HEALTHY} healthy, {}", legend.join(", ")), WIDTH));
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_taxel_is_marked_where_it_is_in_the_image() {
        let layout = Layout::builtin("uskin-module").unwrap();
        let mut marks = vec![None; layout.len()];
        let taxel = layout.taxel_at(2, 1).unwrap();
        marks[taxel] = Some('D');
        assert_eq!(
            draw(&layout, &marks),
            [
                ". . . .",
                ". . D .",
                ". . . .",
                ". . . .",
                ". healthy, D dead (1)"
            ]
        );
    }

    #[test]
    fn a_healthy_hand_and_one_too_wide_are_not_drawn() {
        let layout = Layout::builtin("uskin-module").unwrap();
        assert!(draw(&layout, &[None; 16]).is_empty());
        let wide = Layout::grid(200, 1).unwrap();
        assert!(draw(&wide, &[Some('D'); 200]).is_empty());
    }

    #[test]
    fn every_fault_has_its_letter_in_the_legend() {
        for fault in Fault::ALL {
            let mut faults = Faults::NONE;
            faults.insert(fault);
            let letter = letter(faults).unwrap();
            assert!(LEGEND.iter().any(|(l, _)| *l == letter), "{}", fault.name());
        }
        assert_eq!(letter(Faults::NONE), None);
    }
}
