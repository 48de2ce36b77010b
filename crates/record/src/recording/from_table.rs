//! From the numbers of a file to a recording: what they mean, and what they cannot mean.

use super::backwards::refuse_backwards;
use super::{Frames, Recording, TaxelCounts};
use crate::error::RecordError;
use crate::idle;
use crate::meaning::Meaning;
use crate::table::{Columns, DEFAULT_RATE_HZ, ReadOptions, Table, Void};

impl Recording {
    /// Gives numbers their meaning by their shape and the options.
    pub(crate) fn from_table(mut table: Table, options: &ReadOptions) -> Result<Self, RecordError> {
        let meaning = Meaning::of(&table.at, &table.shape, table.columns, options)?;
        let (frames, cells) = match meaning.counts {
            Some(columns) => (counts_of(&mut table, meaning.taxels, columns, options)?, None),
            None => magnitudes_of(&mut table, meaning.taxels, options)?,
        };
        let taxels = match &cells {
            Some(cells) => cells.iter().filter(|cell| **cell).count(),
            None => meaning.taxels,
        };
        let counts_step = match &frames {
            Frames::Counts(counts) if table.is_half => half_step(counts),
            _ => None,
        };
        let times_ns = times_of(&mut table, options)?;
        Ok(Self {
            name: table.at,
            len: table.shape[0],
            taxels,
            shape: meaning.image,
            cells,
            frames,
            times_ns,
            joints: table.joints,
            rate_hz: options.rate_hz.unwrap_or(DEFAULT_RATE_HZ),
            unitless_time: table.unitless_time.filter(|_| options.rate_hz.is_none()),
            names: Box::new(table.names),
            counts_step,
            layout: None,
        })
    }
}

/// The frames of a table of counts.
fn counts_of(
    table: &mut Table,
    taxels: usize,
    columns: Columns,
    options: &ReadOptions,
) -> Result<Frames, RecordError> {
    if options.idle_frames.is_some() {
        let holds = "holds counts, whose baseline is measured; --idle is for magnitudes";
        return Err(RecordError::unfit(&table.at, holds));
    }
    let is_flat = table.shape.len() == 2;
    let mut counts = counts_of_columns(&table.at, taxels, columns, is_flat, &table.values)?;
    for (taxel, is_without) in counts.iter_mut().zip(table.without_value.iter().flatten()) {
        if *is_without {
            *taxel = None;
        }
    }
    Ok(Frames::Counts(counts))
}

/// The frames of a table of magnitudes, and which cells of a frame are taxels, where not all of them are.
fn magnitudes_of(
    table: &mut Table,
    cells: usize,
    options: &ReadOptions,
) -> Result<(Frames, Option<Vec<bool>>), RecordError> {
    let mut values = std::mem::take(&mut table.values);
    let without_value = table.without_value.take().unwrap_or_default();
    for (value, is_without) in values.iter_mut().zip(&without_value) {
        if *is_without {
            *value = f64::NAN;
        }
    }
    let void_is_nan = options.void == Some(Void::Nan);
    let void = match void_is_nan {
        true => Some(never_a_number(cells, &values)),
        false => table.void.take(),
    };
    let (values, taxels) = without_void(&table.at, cells, values, void)?;
    let may_be_missing = |cell| void_is_nan || without_value.get(cell) == Some(&true);
    let empty_at_end = table.names.empty_at_end;
    let mut frames = magnitudes(
        &table.at,
        taxels.as_deref(),
        cells,
        values,
        may_be_missing,
        empty_at_end,
    )?;
    if let Some(idle) = options.idle_frames {
        idle::subtract(&table.at, frames.len() / table.shape[0], idle, &mut frames)?;
    }
    Ok((Frames::Magnitudes(frames), taxels))
}

/// The times of the frames, but where a rate takes their place.
fn times_of(table: &mut Table, options: &ReadOptions) -> Result<Option<Vec<u64>>, RecordError> {
    let Some(times) = table.times_ns.take().filter(|_| options.rate_hz.is_none()) else {
        return Ok(None);
    };
    let len = table.shape[0];
    if times.len() != len {
        let reason = format!(
            "{} times for {len} frames; give --rate HZ to ignore them",
            times.len()
        );
        return Err(RecordError::unreadable(&table.at, reason));
    }
    refuse_backwards(&table.at, &times)?;
    Ok(Some(times))
}

/// The cells of a frame that are not a number in any frame.
fn never_a_number(cells: usize, values: &[f64]) -> Vec<bool> {
    let mut void = vec![true; cells];
    for frame in values.chunks_exact(cells) {
        for (void, value) in void.iter_mut().zip(frame) {
            *void &= value.is_nan();
        }
    }
    void
}

/// The values of the cells that are taxels, and which those are; `None` where all of them are.
fn without_void(
    at: &str,
    cells: usize,
    mut values: Vec<f64>,
    void: Option<Vec<bool>>,
) -> Result<(Vec<f64>, Option<Vec<bool>>), RecordError> {
    let Some(void) = void.filter(|void| void.contains(&true)) else {
        return Ok((values, None));
    };
    if !void.contains(&false) {
        return Err(RecordError::unfit(at, "has no taxel: every cell is void"));
    }
    let mut index = 0;
    values.retain(|_| {
        let is_taxel = !void[index % cells];
        index += 1;
        is_taxel
    });
    Ok((values, Some(void.into_iter().map(|void| !void).collect())))
}

/// Magnitudes of taxels: finite, or not a number where `may_be_missing` says so of a cell of the table. `cells` says which
/// cells of a frame they are.
fn magnitudes(
    at: &str,
    cells: Option<&[bool]>,
    all: usize,
    values: Vec<f64>,
    may_be_missing: impl Fn(usize) -> bool,
    empty_at_end: usize,
) -> Result<Vec<f64>, RecordError> {
    let taxels: Vec<usize> = match cells {
        Some(cells) => (0..all).filter(|cell| cells[*cell]).collect(),
        None => (0..all).collect(),
    };
    let place = |i: usize| (i / taxels.len(), taxels[i % taxels.len()]);
    let is_bad = |i: &usize| {
        let (frame, taxel) = place(*i);
        !(values[*i].is_finite() || values[*i].is_nan() && may_be_missing(frame * all + taxel))
    };
    let Some(i) = (0..values.len()).find(is_bad) else {
        return Ok(values);
    };
    let (frame, taxel) = place(i);
    Err(RecordError::NotFinite {
        at: at.to_owned(),
        frame,
        taxel,
        value: values[i],
        cells: all,
        empty_at_end,
    })
}

/// The counts of frames that have three columns for each taxel, or with `is_flat` false are of that shape.
fn counts_of_columns(
    at: &str,
    taxels: usize,
    columns: Columns,
    is_flat: bool,
    values: &[f64],
) -> Result<Vec<TaxelCounts>, RecordError> {
    let mut counts = Vec::with_capacity(values.len() / 3);
    for (frame, row) in values.chunks_exact(taxels * 3).enumerate() {
        for taxel in 0..taxels {
            let places = [0, 1, 2].map(|axis| match columns {
                Columns::XyzInterleaved => taxel * 3 + axis,
                Columns::XyzBlocks => axis * taxels + taxel,
            });
            if places.iter().all(|column| row[*column].is_nan()) {
                counts.push(None);
                continue;
            }
            let mut xyz = [0; 3];
            for (count, column) in xyz.iter_mut().zip(places) {
                *count = count_of(row[column]).ok_or_else(|| {
                    let what = format!("frame {frame}, value {column} is {}", row[column]);
                    RecordError::unreadable(at, no_count(&what, taxels, is_flat, row[column], values))
                })?;
            }
            counts.push(Some(xyz));
        }
    }
    Ok(counts)
}

/// Why a value, which is `what`, cannot be a count: one of all these.
fn no_count(what: &str, taxels: usize, is_flat: bool, value: f64, values: &[f64]) -> String {
    let because = match value.is_nan() {
        true => "; a taxel without a value has none on all three axes",
        false => "",
    };
    let or_else = match is_flat {
        true => String::new(),
        false => format!("; magnitudes of {taxels} x 3 cells are told by --layout grid:{taxels}x3"),
    };
    let made = made_counts(values).map_or_else(String::new, |made| {
        format!(
            ". Of forces on three axes give the norms, numpy.linalg.norm(a, axis=-1); what is not 0 at rest, as magnetic \
             fields, as whole numbers, {made}"
        )
    });
    format!("{what}; a raw count is a whole number from 0 to 65535{because}{made}{or_else}")
}

/// What makes counts of these values, in Python; none where all are counts that are numbers at all.
fn made_counts(values: &[f64]) -> Option<String> {
    let finite = || values.iter().copied().filter(|value| value.is_finite());
    if finite().all(|value| count_of(value).is_some()) {
        return None;
    }
    let least = finite().fold(0.0, f64::min);
    let greatest = finite().fold(0.0, f64::max);
    let are_signed = f64::from(i16::MIN) <= least && greatest <= f64::from(i16::MAX);
    if are_signed && finite().all(|value| value.fract() == 0.0) {
        // In doubles: it does not fit into the 16 bits that they may stand in.
        return Some("a.astype(float) + 32768".into());
    }
    let fits = |scale: f64| {
        count_of((30_000.0 + scale * least).floor()).is_some() && 30_000.0 + scale * greatest < 65_535.0
    };
    let decimals = (-1..=308).find(|decimals| fits(10f64.powi(-decimals)))?;
    let scaled = match decimals {
        -1 => "10 * a".into(),
        0 => "a".into(),
        _ => format!("1e-{decimals} * a"),
    };
    Some(format!("numpy.round({scaled}) + 30000"))
}

/// The step from the greatest of these counts to the one before in floats of 16 bits, whose fraction has 10 of them; none where
/// that is 1.
fn half_step(counts: &[TaxelCounts]) -> Option<u32> {
    let greatest = counts.iter().flatten().flatten().max()?;
    let beyond = greatest.checked_ilog2()?.checked_sub(10)?;
    (beyond > 0).then(|| 1 << beyond)
}

fn count_of(value: f64) -> Option<u16> {
    ((0.0..=65535.0).contains(&value) && value.fract() == 0.0).then_some(value as u16)
}
