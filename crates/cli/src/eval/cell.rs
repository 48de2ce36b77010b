//! Figures that stay in their column, whatever their size.

/// Each figure of the main table, with a blank before it: nine of them fit beside the name.
pub(super) const CELL: usize = 7;
/// Each figure in the tables of every figure, with two blanks before it.
pub(super) const WIDE_CELL: usize = 9;

/// A ratio near 1 with the digits that matter.
pub(super) fn ratio(value: f64) -> String {
    within(value, if value < 100.0 { 4 } else { 0 }, WIDE_CELL)
}

/// A share in a cell of that many characters.
pub(super) fn percent(share: f64, width: usize) -> String {
    within(100.0 * share, 1, width - 2) + " %"
}

/// Microseconds in a cell of the main table; from 10,000 on in milliseconds or seconds, which the cell then says.
pub(super) fn time(us: f64) -> String {
    let of = |value: f64, unit: &str| within(value, 1, CELL - 1 - unit.len()) + " " + unit;
    match us {
        us if us < 1e4 => within(us, 1, CELL),
        us if us < 1e7 => of(us / 1e3, "ms"),
        _ => of(us / 1e6, "s"),
    }
}

/// A number from 0 on in no more than `width` characters: with as many of its decimals as there is room for, and in
/// powers of ten where even the whole number is too long.
pub(super) fn within(value: f64, decimals: usize, width: usize) -> String {
    let plain = (0..=decimals).rev().map(|decimals| format!("{value:.decimals$}"));
    let powers = [2, 1, 0].map(|decimals| format!("{value:.decimals$e}"));
    let mut texts = plain.chain(powers);
    texts
        .find(|text| text.len() <= width)
        .unwrap_or_else(|| "-".repeat(width))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_figure_of_any_size_stays_in_its_cell_and_says_its_unit() {
        for (got, want) in [
            (within(0.857, 3, CELL), "0.857"),
            (within(9_876.543_21, 3, CELL), "9876.54"),
            (within(1.5e9, 2, CELL), "1.50e9"),
            (within(f64::MAX, 2, CELL), "1.8e308"),
            (percent(0.003, CELL), "0.3 %"),
            (percent(1.0, CELL), "100.0 %"),
            (percent(1_575.888, CELL), "1.6e5 %"),
            (percent(1_575.888, WIDE_CELL), "157589 %"),
            (time(11.52), "11.5"),
            (time(9_999.94), "9999.9"),
            (time(10_000.0), "10.0 ms"),
            (time(115_886.4), "116 ms"),
            (time(9_999_999.0), "1e4 ms"),
            (time(12_345_678.0), "12.3 s"),
            (ratio(1.000_04), "1.0000"),
            (ratio(56_632.4), "56632"),
        ] {
            assert_eq!(got, want);
        }
    }
}
