//! Columns of a csv file in the order of their names: those that are in threes, x, y and z of a taxel, and those with numbers.

use std::collections::BTreeMap;

/// A taxel's columns x, y and z.
type Axes = [Option<usize>; 3];

/// Pieces of a name, digits and what is between them, up to which numbers are looked for.
const MAX_PIECES: usize = 8;

/// The columns of names that are in threes x, y and z of a taxel, such as `txl1_x` or `Bx1`; none where most are not.
/// Taxels stand in the order of their first columns, those whose names differ by one number in the order of that number.
pub(super) fn named_axes(
    skin: &[usize],
    names: &[&str],
    has_joints: bool,
) -> Result<Option<Vec<usize>>, String> {
    let mut taxels: Vec<(String, Axes)> = Vec::new();
    let mut places: BTreeMap<String, usize> = BTreeMap::new();
    let mut twice: Option<usize> = None;
    let mut taxel_of = Vec::with_capacity(skin.len());
    for &column in skin {
        let place = axis_of(names[column]).map(|(of, axis)| {
            let place = *places.entry(of.clone()).or_insert_with(|| {
                taxels.push((of, [None; 3]));
                taxels.len() - 1
            });
            match &mut taxels[place].1[axis] {
                Some(_) => twice = twice.or(Some(column)),
                free => *free = Some(column),
            }
            place
        });
        taxel_of.push(place);
    }
    let is_whole =
        |place: Option<usize>| place.is_some_and(|place| taxels[place].1.iter().all(Option::is_some));
    let (whole, odd): (Vec<usize>, Vec<usize>) =
        (0..skin.len()).partition(|&index| is_whole(taxel_of[index]));
    if whole.len() <= odd.len() {
        return Ok(None);
    }
    if let [first_odd, ..] = odd[..] {
        let joints = match !has_joints && first_odd + odd.len() == skin.len() {
            true => format!(
                ", say with --joint-columns {} that joint angles come last",
                odd.len()
            ),
            false => String::new(),
        };
        return Err(format!(
            "column {:?} is neither x, y nor z of a taxel, as {:?} is; cut it out, and all others like it{joints}, or say with \
             --columns what the columns are",
            names[skin[first_odd]], names[skin[whole[0]]]
        ));
    }
    if let Some(column) = twice {
        return Err(format!(
            "column {:?} comes twice; say with --columns xyz-interleaved or xyz-blocks in which order they are",
            names[column]
        ));
    }
    sort_by_numbers(&mut taxels);
    Ok(Some(
        taxels
            .iter()
            .flat_map(|(_, axes)| axes)
            .copied()
            .flatten()
            .collect(),
    ))
}

/// Columns of values in the order of the numbers in their names, and which other one they stand in: that of these names as
/// texts, `s0`, `s1`, `s10`, `s2`, as whoever sorts names without looking at the numbers has them, or the numbers' reverse.
pub(super) fn by_numbers(values: &[usize], names: &[&str]) -> Option<(Vec<usize>, &'static str)> {
    let mut columns: Vec<(String, usize)> = values.iter().map(|c| (names[*c].to_owned(), *c)).collect();
    let is_of_texts = columns.is_sorted_by(|(a, _), (b, _)| a < b);
    sort_by_numbers(&mut columns);
    let sorted: Vec<usize> = columns.into_iter().map(|(_, column)| column).collect();
    if sorted == values {
        return None;
    }
    let is_reverse = sorted.iter().eq(values.iter().rev());
    match (is_of_texts, is_reverse) {
        (true, _) => Some((sorted, "in the order of their names as texts")),
        (false, true) => Some((sorted, "in the order of descending numbers")),
        (false, false) => None,
    }
}

/// What a column of this name is an axis of, and of the axes which. pandas puts `.1` behind a name that came before.
fn axis_of(name: &str) -> Option<(String, usize)> {
    let name = name.to_ascii_lowercase();
    let head = name.trim_end_matches(|c: char| c.is_ascii_digit() || c == '_' || c == '.');
    let axis = "xyz".find(head.chars().last()?)?;
    Some((
        format!("{} {}", &head[..head.len() - 1], &name[head.len()..]),
        axis,
    ))
}

/// Puts those taxels whose names are alike but for one number in the order of that number, in the places that they have.
fn sort_by_numbers<T: Clone>(taxels: &mut [(String, T)]) {
    for piece in 0..MAX_PIECES {
        let mut alike: BTreeMap<(String, String), Vec<(u64, usize)>> = BTreeMap::new();
        for (place, (name, _)) in taxels.iter().enumerate() {
            if let Some((before, number, after)) = number_at(name, piece) {
                let key = (before.to_owned(), after.to_owned());
                alike.entry(key).or_default().push((number, place));
            }
        }
        for mut numbers in alike.into_values() {
            let places: Vec<usize> = numbers.iter().map(|(_, place)| *place).collect();
            numbers.sort_unstable();
            let sorted: Vec<(String, T)> = numbers.iter().map(|(_, place)| taxels[*place].clone()).collect();
            for (place, taxel) in places.into_iter().zip(sorted) {
                taxels[place] = taxel;
            }
        }
    }
}

/// The number that is this piece of a name, and what is before and behind it.
fn number_at(name: &str, piece: usize) -> Option<(&str, u64, &str)> {
    let mut begin = 0;
    for _ in 0..piece {
        begin += piece_len(&name[begin..]);
    }
    let end = begin + piece_len(&name[begin..]);
    Some((&name[..begin], name[begin..end].parse().ok()?, &name[end..]))
}

/// Length of the digits, or of what is none, that a name begins with.
fn piece_len(name: &str) -> usize {
    let begins_with_digit = name.starts_with(|c: char| c.is_ascii_digit());
    name.find(|c: char| c.is_ascii_digit() != begins_with_digit)
        .unwrap_or(name.len())
}
