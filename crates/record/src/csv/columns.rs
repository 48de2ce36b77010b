//! What the columns of a csv file are.

use super::axes::{by_numbers, named_axes};
use super::grid::by_grid;
use crate::clock_name::{ClockName, in_two_columns, last_part};
use crate::table::{ColumnNames, ReadOptions, TimeUnit};
use csv::ByteRecord;
use std::collections::BTreeMap;

/// What the columns of a csv file are.
#[derive(Debug)]
pub(super) struct LineColumns {
    /// Number of columns that the header, or the first line without one, has.
    pub(super) columns: Option<usize>,
    /// The column that is time, and its unit.
    pub(super) time: Option<(usize, TimeUnit)>,
    /// What that column is called, where the name says no unit.
    pub(super) unitless: Option<String>,
    /// What the header calls them.
    pub(super) names: ColumnNames,
    kind: Kind,
    resolved: Option<Places>,
}

/// What is not time.
#[derive(Debug)]
enum Kind {
    /// Numbers, the last so many of which are joint angles.
    Plain { joints: usize },
    /// Numbers and joint angles where the header has them.
    Named(Places),
    /// Counts x1, y1, z1, x2, ... and joint angles where the header has them.
    Counts(Places),
}

/// Where in a line the values and the joint angles are, in their order.
#[derive(Debug, Clone, Default)]
pub(super) struct Places {
    pub(super) values: Vec<usize>,
    pub(super) joints: Vec<usize>,
}

impl LineColumns {
    /// Without a header.
    pub(super) fn of_plain(options: &ReadOptions) -> Self {
        Self {
            columns: None,
            time: options.time_column.map(|unit| (0, unit)),
            unitless: None,
            names: ColumnNames::default(),
            kind: Kind::Plain {
                joints: options.joint_columns,
            },
            resolved: None,
        }
    }

    /// By the names of a header. `is_index_time`: a first column without a name is time, rather than numbers of frames.
    pub(super) fn of_header(
        record: &ByteRecord,
        options: &ReadOptions,
        is_index_time: bool,
    ) -> Result<Self, String> {
        let names = record.iter().map(cell).collect::<Result<Vec<&str>, String>>()?;
        if let Some([seconds, rest]) = in_two_columns(&names).filter(|_| options.time_column.is_none()) {
            return Err(format!(
                "times are in two columns, {seconds:?} and {rest:?}; make one of them: in pandas \
                 df.insert(0, \"t\", df[{seconds:?}] - df[{seconds:?}][0] + df[{rest:?}] / 1e9), and drop both"
            ));
        }
        let Split {
            counters,
            times,
            rest,
        } = Split::of(&names, options, is_index_time);
        let clock = |column: &usize| ClockName::of(names[*column]);
        let is_plain = |column: &&usize| clock(column).is_some_and(|clock| clock.is_plain);
        let column = times.iter().find(is_plain).or(times.first()).copied();
        let time = column.and_then(|column| {
            let named = clock(&column).map(|clock| clock.unit.unwrap_or(TimeUnit::S));
            Some((column, options.time_column.or(named)?))
        });
        let unitless = column
            .filter(|column| {
                options.time_column.is_none() && clock(column).is_some_and(|clock| clock.unit.is_none())
            })
            .map(|column| names[column]);
        let other_times = times.into_iter().filter(|other| Some(*other) != column);
        let mut left_out: Vec<usize> = counters.into_iter().chain(other_times).collect();
        left_out.sort_unstable();
        let (joints, skin) = joints_and_skin(rest, &names, options.joint_columns)?;
        let axes: Vec<Option<Axis>> = skin.iter().map(|column| Axis::of_name(names[*column])).collect();
        let are_of_boards = axes.iter().any(Option::is_some);
        if are_of_boards && options.columns.is_some() {
            return Err("the header names each column's taxel and axis; leave --columns out".into());
        }
        let counts = match (are_of_boards, options.columns) {
            (true, _) => Some(counts(&skin, &axes, &names)?),
            (false, None) => named_axes(&skin, &names, !joints.is_empty())?,
            (false, Some(_)) => None,
        };
        let are_counts = counts.is_some();
        let sorted = by_numbers(&skin, &names).filter(|_| !are_counts && options.columns.is_none());
        let (sorted, order_before) = sorted.unzip();
        let mut values = counts.or(sorted).unwrap_or(skin);
        let axes = if are_counts { 3 } else { 1 };
        // A board and a taxel are no row and column.
        let image = options
            .image
            .filter(|_| options.columns.is_none() && !are_of_boards);
        let of_grid = match image {
            Some(image) => by_grid(&mut values, axes, &names, image)?,
            None => None,
        };
        let named = |columns: &[usize]| columns.iter().map(|column| names[*column].to_owned()).collect();
        let names_of_columns = ColumnNames {
            values: named(&values),
            left_out: named(&left_out),
            order_before,
            of_grid,
            ..ColumnNames::default()
        };
        let places = Places { values, joints };
        Ok(Self {
            columns: Some(names.len()),
            time,
            unitless: unitless.map(str::to_owned),
            names: names_of_columns,
            kind: match are_counts {
                true => Kind::Counts(places),
                false => Kind::Named(places),
            },
            resolved: None,
        })
    }

    /// Whether the header says that the values are counts.
    pub(super) fn are_counts(&self) -> bool {
        matches!(self.kind, Kind::Counts(_))
    }

    /// Where what is, in lines of so many columns.
    pub(super) fn resolve(&mut self, columns: usize) -> Result<&Places, String> {
        if self.resolved.is_none() {
            let first = usize::from(self.time.is_some());
            self.resolved = Some(match &self.kind {
                Kind::Named(places) | Kind::Counts(places) => places.clone(),
                Kind::Plain { joints } => {
                    let end = columns.checked_sub(*joints).filter(|end| *end > first);
                    let end = end.ok_or_else(|| no_taxel(columns, *joints))?;
                    Places {
                        values: (first..end).collect(),
                        joints: (end..columns).collect(),
                    }
                }
            });
        }
        let places = self.resolved.as_ref();
        places
            .filter(|p| !p.values.is_empty())
            .ok_or_else(|| "no column of a taxel".into())
    }
}

/// The columns of a header.
struct Split {
    /// Those that count frames.
    counters: Vec<usize>,
    /// Those of times.
    times: Vec<usize>,
    rest: Vec<usize>,
}

impl Split {
    fn of(names: &[&str], options: &ReadOptions, is_index_time: bool) -> Self {
        // Beside other parts of a hand, index is a finger.
        let parts = ["thumb", "middle", "ring", "little", "pinky", "palm", "wrist"];
        let is_part = |name: &&str| {
            let name = name.to_ascii_lowercase();
            parts.iter().any(|part| name.contains(part))
        };
        let is_of_fingers = names.iter().any(is_part);
        let is_finger = |column: usize| is_of_fingers && names[column].eq_ignore_ascii_case("index");
        let counts_frames = |column: &usize| is_counter(*column, names[*column]) && !is_finger(*column);
        let all = || 0..names.len();
        // A `t` is time where nothing but numbers of frames is before it, and may else be a taxel.
        let first = all().find(|column| !counts_frames(column));
        let is_time = |column: &usize| {
            let may_be = !names[*column].eq_ignore_ascii_case("t") || Some(*column) == first;
            may_be && ClockName::of(names[*column]).is_some()
        };
        // Where no name is of time, one is, if that is said: the first; a number of the frame only where none is called t.
        let said = match options.time_column.is_some() && !all().any(|column| is_time(&column)) {
            true if is_index_time => Some(0),
            true if first == Some(0) => first,
            true => all()
                .find(|column| ["t", "ts"].contains(&names[*column].to_ascii_lowercase().as_str()))
                .or_else(|| all().find(|column| !is_unnamed(*column, names[*column]))),
            false => None,
        };
        let (times, rest): (_, Vec<usize>) =
            all().partition(|column| is_time(column) || Some(*column) == said);
        let (counters, rest) = rest.into_iter().partition(counts_frames);
        Self {
            counters,
            times,
            rest,
        }
    }
}

/// The columns of joint angles, in the order of their numbers, or the last so many where no name is one's, and the others.
fn joints_and_skin(
    columns: Vec<usize>,
    names: &[&str],
    joint_columns: usize,
) -> Result<(Vec<usize>, Vec<usize>), String> {
    let mut joints: BTreeMap<u32, usize> = BTreeMap::new();
    let mut skin = Vec::new();
    for column in columns {
        match joint_number(names[column]) {
            Some(number) if joints.insert(number, column).is_some() => {
                return Err(format!(
                    "joint {number} has two columns, the second is {:?}",
                    names[column]
                ));
            }
            Some(_) => {}
            None => skin.push(column),
        }
    }
    if joint_columns > 0 {
        if !joints.is_empty() {
            return Err("the header names the joints' columns; leave --joint-columns out".into());
        }
        let kept = skin.len().checked_sub(joint_columns).filter(|kept| *kept > 0);
        let kept = kept.ok_or_else(|| no_taxel(names.len(), joint_columns))?;
        return Ok((skin.split_off(kept), skin));
    }
    let numbers: Vec<u32> = joints.keys().copied().collect();
    if let Some([before, behind]) = numbers.windows(2).find(|pair| pair[1] - pair[0] > 1) {
        return Err(format!(
            "joint {} has no column, and {before} and {behind} have one; give it one, of empty cells where it was not read",
            before + 1
        ));
    }
    Ok((joints.into_values().collect(), skin))
}

/// The columns of named counts, in the order of their taxels.
fn counts(skin: &[usize], axes: &[Option<Axis>], names: &[&str]) -> Result<Vec<usize>, String> {
    let mut taxels: BTreeMap<(u32, u32, u32), [Option<usize>; 3]> = BTreeMap::new();
    for (&column, axis) in skin.iter().zip(axes) {
        let name = names[column];
        let Some(Axis { taxel, axis }) = axis else {
            return Err(format!(
                "column {name:?} is not named {{board}}B{{taxel}}X, Y or Z as the others are"
            ));
        };
        if taxels.entry(*taxel).or_default()[*axis].replace(column).is_some() {
            return Err(format!("column {name:?} comes twice"));
        }
    }
    let mut order = Vec::with_capacity(taxels.len() * 3);
    for ((_, board, taxel), axes) in taxels {
        for (axis, column) in ["X", "Y", "Z"].into_iter().zip(axes) {
            order.push(column.ok_or_else(|| format!("taxel {board}B{taxel} has no column {axis}"))?);
        }
    }
    Ok(order)
}

/// Whether a column of this name counts frames.
fn is_counter(column: usize, name: &str) -> bool {
    const NAMES: [&str; 7] = [
        "index",
        "frame",
        "frame_index",
        "frame_id",
        "frame_number",
        "seq",
        "sequence",
    ];
    is_unnamed(column, name) || NAMES.contains(&last_part(&name.to_ascii_lowercase()))
}

/// Whether it is the column that pandas writes first without a name, or what it calls that when it has read it.
pub(super) fn is_unnamed(column: usize, name: &str) -> bool {
    (column == 0 && name.is_empty()) || name.eq_ignore_ascii_case("unnamed: 0")
}

fn no_taxel(columns: usize, joints: usize) -> String {
    format!("{columns} columns, of which {joints} are joint angles (--joint-columns); there is no taxel")
}

/// The number of the joint whose angle a column of this name holds.
fn joint_number(name: &str) -> Option<u32> {
    let name = name.to_ascii_lowercase();
    let number = ["joint_", "joint", "j"]
        .iter()
        .find_map(|begin| name.strip_prefix(begin))?;
    number.parse().ok()
}

/// The board and the taxel whose column has this name, `{board}B{taxel}X` without a finger.
pub(crate) fn taxel_of(name: &str) -> Option<(u32, u32)> {
    let is_of_finger = name.to_ascii_uppercase().contains('F');
    let Axis { taxel, .. } = Axis::of_name(name).filter(|_| !is_of_finger)?;
    Some((taxel.1, taxel.2))
}

/// A column's taxel (finger, board, taxel) and axis.
#[derive(Debug)]
struct Axis {
    taxel: (u32, u32, u32),
    axis: usize,
}

impl Axis {
    fn of_name(name: &str) -> Option<Self> {
        let name = name.to_ascii_uppercase();
        let axis = match name.chars().last()? {
            'X' => 0,
            'Y' => 1,
            'Z' => 2,
            _ => return None,
        };
        let rest = &name[..name.len() - 1];
        let (finger, rest) = match rest.split_once('F') {
            Some((finger, rest)) => (finger.parse().ok()?, rest),
            None => (0, rest),
        };
        let (board, taxel) = rest.split_once('B')?;
        Some(Self {
            taxel: (finger, board.parse().ok()?, taxel.parse().ok()?),
            axis,
        })
    }
}

/// A cell without its quotes and the blanks around it.
pub(super) fn cell(bytes: &[u8]) -> Result<&str, String> {
    let text = std::str::from_utf8(bytes).map_err(|_| "not UTF-8 text")?;
    Ok(text.trim().trim_matches('"'))
}
