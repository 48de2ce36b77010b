//! Columns of a csv file whose names have two numbers, the row and the column of a taxel on a grid.

use std::collections::BTreeSet;

/// Puts the columns of taxels, `axes` of each, row by row, where their names have the two numbers of every cell of a grid of
/// this height and width and they stand column by column. Returns what is to be said of it.
///
/// # Errors
/// Where they say which is the row and which the column, and have every cell of a grid of other sides.
pub(super) fn by_grid(
    values: &mut Vec<usize>,
    axes: usize,
    names: &[&str],
    (height, width): (usize, usize),
) -> Result<Option<String>, String> {
    let taxels: Vec<&[usize]> = values.chunks_exact(axes).collect();
    if height < 2 || width < 2 || taxels.len() != height * width {
        return Ok(None);
    }
    let pairs = (taxels.iter()).map(|columns| Pair::of(names[columns[0]]));
    let Some(pairs) = pairs.collect::<Option<Vec<Pair<'_>>>>() else {
        return Ok(None);
    };
    let least = [0, 1].map(|which| pairs.iter().map(|pair| pair.numbers[which]).min().unwrap_or(0));
    let most = [0, 1].map(|which| pairs.iter().map(|pair| pair.numbers[which]).max().unwrap_or(0));
    let counts: [usize; 2] = [0, 1].map(|which| (most[which] - least[which]).saturating_add(1));
    let cells: BTreeSet<[usize; 2]> = pairs.iter().map(|pair| pair.numbers).collect();
    let are_cells = least.iter().all(|first| *first <= 1)
        && cells.len() == taxels.len()
        && counts[0].checked_mul(counts[1]) == Some(taxels.len());
    if !are_cells {
        return Ok(None);
    }
    let said = pairs[0]
        .said()
        .filter(|said| pairs.iter().all(|pair| pair.said() == Some(*said)));
    let of_names = said.map(|first_is_row| {
        if first_is_row {
            counts
        } else {
            [counts[1], counts[0]]
        }
    });
    if let Some([rows, columns]) = of_names.filter(|sides| *sides != [height, width]) {
        return Err(format!(
            "the names of its columns have {rows} rows of {columns}: --layout grid:{rows}x{columns}, and not grid:{height}x{width}"
        ));
    }
    let (first_is_row, is_sure) = match (said, counts == [height, width], counts == [width, height]) {
        (Some(first_is_row), _, _) => (first_is_row, true),
        (None, true, is_square) => (true, !is_square),
        (None, false, true) => (false, true),
        (None, false, false) => return Ok(None),
    };
    let [row, column] = if first_is_row { [0, 1] } else { [1, 0] };
    let at = |pair: &Pair<'_>| {
        (
            pair.numbers[row] - least[row],
            pair.numbers[column] - least[column],
        )
    };
    let cells: Vec<(usize, usize)> = pairs.iter().map(at).collect();
    let stand_by_column = (cells.iter().enumerate()).all(|(n, cell)| *cell == (n % height, n / height));
    if !stand_by_column {
        return Ok(None);
    }
    let [first, second] = [0, 1].map(|n| names[taxels[n][0]]);
    if !is_sure {
        return Ok(Some(format!(
            "its columns are taken row by row as they stand, {first:?} and {second:?} side by side"
        )));
    }
    let ordered = (0..height * width).flat_map(|n| taxels[n % width * height + n / width]);
    let ordered: Vec<usize> = ordered.copied().collect();
    let beside = names[ordered[axes]];
    *values = ordered;
    Ok(Some(format!(
        "its columns stand column by column of the grid by the numbers in their names; they are taken by these, {first:?} and \
         {beside:?} side by side"
    )))
}

/// The two numbers of a name, and the words before them.
struct Pair<'a> {
    words: [&'a str; 2],
    numbers: [usize; 2],
}

impl<'a> Pair<'a> {
    fn of(name: &'a str) -> Option<Self> {
        let is_digit = |c: char| c.is_ascii_digit();
        let (first, rest) = name.split_at(name.find(is_digit)?);
        let (number, rest) = rest.split_at(rest.find(|c| !is_digit(c))?);
        let (second, rest) = rest.split_at(rest.find(is_digit)?);
        let end = rest.find(|c| !is_digit(c)).unwrap_or(rest.len());
        let (other, rest) = rest.split_at(end);
        let numbers = [number.parse().ok()?, other.parse().ok()?];
        (!rest.contains(is_digit)).then_some(Self {
            words: [first, second],
            numbers,
        })
    }

    /// Whether the first number is the row, where the words say which is.
    fn said(&self) -> Option<bool> {
        let [first, second] = self.words.map(|word| {
            let letters = word.trim_end_matches(|c: char| !c.is_ascii_alphabetic());
            let begin = letters
                .rfind(|c: char| !c.is_ascii_alphabetic())
                .map_or(0, |at| at + 1);
            letters[begin..].to_ascii_lowercase()
        });
        let is_row = |word: &str| ["r", "row"].contains(&word);
        let is_column = |word: &str| ["c", "col", "column"].contains(&word);
        match (
            is_row(&first) && is_column(&second),
            is_column(&first) && is_row(&second),
        ) {
            (true, _) => Some(true),
            (_, true) => Some(false),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Names, height and width of the grid, and the first of the names in order where something is said.
    type Case = (Vec<String>, (usize, usize), Option<[&'static str; 3]>);

    /// Names of all cells, `fast` numbers of the one that changes from column to column.
    fn cells(slow: usize, fast: usize, name: impl Fn(usize, usize) -> String) -> Vec<String> {
        (0..slow * fast).map(|n| name(n / fast, n % fast)).collect()
    }

    #[test]
    fn columns_that_stand_column_by_column_are_taken_row_by_row_where_their_names_say_so() {
        let cases: [Case; 9] = [
            // Row by row already.
            (cells(3, 4, |r, c| format!("r{r}c{c}")), (3, 4), None),
            (
                cells(4, 3, |c, r| format!("r{r}c{c}")),
                (3, 4),
                Some(["r0c0", "r0c1", "r0c2"]),
            ),
            (
                cells(4, 3, |c, r| format!("p_{}_{}", r + 1, c + 1)),
                (3, 4),
                Some(["p_1_1", "p_1_2", "p_1_3"]),
            ),
            // Places x, y.
            (
                cells(4, 3, |x, y| format!("x{x}y{y}")),
                (3, 4),
                Some(["x0y0", "x1y0", "x2y0"]),
            ),
            (cells(3, 4, |y, x| format!("x{x}y{y}")), (3, 4), None),
            // Numbers of boards and taxels may be those of another grid.
            (cells(2, 6, |board, k| format!("m{board}_txl{k}")), (3, 4), None),
            // A square has rows and columns by their names alone.
            (
                cells(3, 3, |c, r| format!("row{r}_col{c}")),
                (3, 3),
                Some(["row0_col0", "row0_col1", "row0_col2"]),
            ),
            (
                cells(3, 3, |c, r| format!("s{r}_{c}")),
                (3, 3),
                Some(["s0_0", "s1_0", "s2_0"]),
            ),
            // One number.
            (cells(3, 4, |r, c| format!("s{}", 4 * r + c)), (3, 4), None),
        ];
        for (names, image, wanted) in cases {
            let names: Vec<&str> = names.iter().map(String::as_str).collect();
            for axes in [1, 3] {
                let of_axes: Vec<&str> = names.iter().flat_map(|name| vec![*name; axes]).collect();
                let before: Vec<usize> = (0..of_axes.len()).collect();
                let mut values = before.clone();
                let said = by_grid(&mut values, axes, &of_axes, image).unwrap();
                assert_eq!(said.is_some(), wanted.is_some(), "{names:?}: {said:?}");
                match wanted {
                    None => assert_eq!(values, before, "{names:?}"),
                    Some(wanted) => {
                        let first: Vec<&str> = values
                            .chunks_exact(axes)
                            .take(3)
                            .map(|c| of_axes[c[axes - 1]])
                            .collect();
                        assert_eq!(first, wanted);
                        let mut all = values.clone();
                        all.sort_unstable();
                        assert_eq!(all, before);
                    }
                }
            }
        }
    }

    #[test]
    fn a_grid_of_other_sides_than_the_names_of_rows_and_columns_have_is_refused() {
        for (names, image, wanted) in [
            (
                cells(3, 4, |r, c| format!("r{r}c{c}")),
                (4, 3),
                "3 rows of 4: --layout grid:3x4, and not grid:4x3",
            ),
            (cells(4, 3, |c, r| format!("r{r}c{c}")), (4, 3), "3 rows of 4"),
            (
                cells(2, 6, |r, c| format!("row{}_col{}", r + 1, c + 1)),
                (3, 4),
                "2 rows of 6",
            ),
            (cells(3, 4, |c, r| format!("c{c}r{r}")), (3, 4), "4 rows of 3"),
        ] {
            let names: Vec<&str> = names.iter().map(String::as_str).collect();
            let mut values: Vec<usize> = (0..names.len()).collect();
            let reason = by_grid(&mut values, 1, &names, image).unwrap_err();
            assert!(reason.contains(wanted), "{names:?}: {reason}");
        }
        // Not every cell is there, so that they may be something else.
        let names = ["r0c0", "r0c1", "r1c0", "r4c2"];
        assert_eq!(by_grid(&mut vec![0, 1, 2, 3], 1, &names, (2, 2)), Ok(None));
    }
}
