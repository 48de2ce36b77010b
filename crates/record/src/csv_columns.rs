//! What the columns of a csv file are.

use crate::table::{ReadOptions, TimeUnit};
use csv::ByteRecord;
use std::collections::BTreeMap;

/// What the columns of a csv file are.
#[derive(Debug)]
pub(crate) struct LineColumns {
    /// Number of columns that the header, or the first line without one, has.
    pub(crate) columns: Option<usize>,
    /// The column that is time, and its unit.
    pub(crate) time: Option<(usize, TimeUnit)>,
    /// What that column is called, where the name says no unit.
    pub(crate) unitless: Option<String>,
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
pub(crate) struct Places {
    pub(crate) values: Vec<usize>,
    pub(crate) joints: Vec<usize>,
}

impl LineColumns {
    /// Without a header.
    pub(crate) fn of_plain(options: &ReadOptions) -> Self {
        Self {
            columns: None,
            time: options.time_column.map(|unit| (0, unit)),
            unitless: None,
            kind: Kind::Plain {
                joints: options.joint_columns,
            },
            resolved: None,
        }
    }

    /// By the names of a header.
    pub(crate) fn of_header(record: &ByteRecord, options: &ReadOptions) -> Result<Self, String> {
        let names = record.iter().map(cell).collect::<Result<Vec<&str>, String>>()?;
        let time = options
            .time_column
            .or_else(|| time_unit(names[0]))
            .map(|unit| (0, unit));
        let is_unitless = options.time_column.is_none() && is_unitless(names[0]);
        let rest = usize::from(time.is_some())..names.len();
        let named = |column: &usize| names[*column];
        let mut joints: BTreeMap<u32, usize> = BTreeMap::new();
        let mut skin = Vec::new();
        for column in rest {
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
        if !joints.is_empty() && options.joint_columns > 0 {
            return Err("the header names the joints' columns; leave --joint-columns out".into());
        }
        let joints: Vec<usize> = joints.into_values().collect();
        let axes: Vec<Option<Axis>> = skin.iter().map(|column| Axis::of_name(named(column))).collect();
        let kind = if axes.iter().any(Option::is_some) {
            if options.columns.is_some() {
                return Err("the header names each column's taxel and axis; leave --columns out".into());
            }
            let kept = skin.len().saturating_sub(options.joint_columns);
            let values = counts(&skin[..kept], &axes[..kept], &names)?;
            let joints = if options.joint_columns > 0 {
                skin[kept..].to_vec()
            } else {
                joints
            };
            Kind::Counts(Places { values, joints })
        } else if joints.is_empty() {
            Kind::Plain {
                joints: options.joint_columns,
            }
        } else {
            Kind::Named(Places { values: skin, joints })
        };
        Ok(Self {
            columns: Some(names.len()),
            time,
            unitless: is_unitless.then(|| names[0].to_owned()),
            kind,
            resolved: None,
        })
    }

    /// Whether the header says that the values are counts.
    pub(crate) fn are_counts(&self) -> bool {
        matches!(self.kind, Kind::Counts(_))
    }

    /// Where what is, in lines of so many columns.
    pub(crate) fn resolve(&mut self, columns: usize) -> Result<&Places, String> {
        if self.resolved.is_none() {
            let first = usize::from(self.time.is_some());
            self.resolved = Some(match &self.kind {
                Kind::Named(places) | Kind::Counts(places) => places.clone(),
                Kind::Plain { joints } => {
                    let end = columns.checked_sub(*joints).filter(|end| *end > first);
                    let end = end.ok_or_else(|| {
                        format!("{columns} columns, of which {joints} are joint angles (--joint-columns); there is no taxel")
                    })?;
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

/// Names that say that a column is time, and not in which unit: seconds.
pub(crate) fn is_unitless(name: &str) -> bool {
    ["t", "time", "timestamp"].contains(&name.to_ascii_lowercase().as_str())
}

/// Whether a name says that what is called so is time, and in which unit.
pub(crate) fn time_unit(name: &str) -> Option<TimeUnit> {
    match name.to_ascii_lowercase().as_str() {
        "t_s" | "time_s" => Some(TimeUnit::S),
        "t_ms" | "time_ms" => Some(TimeUnit::Ms),
        "t_us" | "time_us" => Some(TimeUnit::Us),
        "t_ns" | "time_ns" => Some(TimeUnit::Ns),
        _ if is_unitless(name) => Some(TimeUnit::S),
        _ => None,
    }
}

/// The number of the joint whose angle a column of this name holds.
fn joint_number(name: &str) -> Option<u32> {
    let name = name.to_ascii_lowercase();
    let number = ["joint_", "joint", "j"]
        .iter()
        .find_map(|begin| name.strip_prefix(begin))?;
    number.parse().ok()
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
pub(crate) fn cell(bytes: &[u8]) -> Result<&str, String> {
    let text = std::str::from_utf8(bytes).map_err(|_| "not UTF-8 text")?;
    Ok(text.trim().trim_matches('"'))
}
