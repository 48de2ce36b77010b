//! Many recordings: one table and one sheet.

use super::instants::{amount, compressed, felt};
use super::take::Take;
use taxel_plot::{Picture, Sheet};

/// What is told of each recording, at its tightest frame.
#[derive(Debug)]
struct Row {
    name: String,
    seconds: f64,
    contact_s: f64,
    tightest_s: f64,
    modules: usize,
    contacts: usize,
    strongest: f64,
    total: f64,
    /// Of both; empty for magnitudes, whose unit no recording says.
    unit: String,
    actuators: usize,
    levels: usize,
    /// Root of the squared error of the forces shown over that of the forces felt, taxels in contact.
    shown_error: f64,
}

/// Recordings, collected.
#[derive(Debug, Default)]
pub(super) struct Overview {
    rows: Vec<Row>,
    pictures: Vec<[Picture; 2]>,
}

const COLUMNS: [&str; 12] = [
    "recording",
    "seconds",
    "contact_s",
    "tightest_s",
    "modules",
    "contacts",
    "strongest",
    "total",
    "unit",
    "actuators",
    "levels",
    "level_error",
];

impl Overview {
    /// Whether there is no recording.
    pub(super) fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Takes a recording that has contacts.
    pub(super) fn add(&mut self, take: &Take) -> anyhow::Result<()> {
        let Some(index) = take.tightest() else {
            return Ok(());
        };
        let images = take.images(&take.profile)?;
        let image = &images[index];
        let frame = &take.force[index];
        let touched = || (0..take.layout.len()).filter(|taxel| frame.contact[*taxel]);
        let nearest = |force: f64| {
            let away = |level: &f64| (level - force).abs();
            image
                .levels
                .iter()
                .copied()
                .min_by(|a, b| away(a).total_cmp(&away(b)))
                .unwrap_or(0.0)
        };
        let (wrong, all) = touched()
            .map(|taxel| frame.force[taxel])
            .fold((0.0, 0.0), |(wrong, all), force| {
                (wrong + (force - nearest(force)).powi(2), all + force * force)
            });
        let frames_s = take
            .force
            .windows(2)
            .map(|pair| (pair[1].t_ns - pair[0].t_ns) as f64 / 1e9);
        let contact_s = frames_s
            .zip(&take.force)
            .filter(|(_, frame)| frame.contacts() > 0)
            .map(|(s, _)| s)
            // A sum of none is -0.
            .fold(0.0, |all, s| all + s);
        let strongest = touched().map(|taxel| frame.force[taxel]).fold(0.0, f64::max);
        let shown = image.actuators.iter().map(|a| a.force).fold(0.0, f64::max);
        self.rows.push(Row {
            name: take.name.clone(),
            seconds: take.time_s(take.force.len() - 1),
            contact_s,
            tightest_s: take.time_s(index),
            modules: (0..take.layout.modules.len())
                .filter(|module| take.force_on(*module, index) > 0.0)
                .count(),
            contacts: frame.contacts(),
            strongest,
            total: take.total_force(index),
            unit: take.unit.map_or(String::new(), |unit| unit.replace('²', "^2")),
            actuators: image.actuators.len(),
            levels: image.levels.len(),
            shown_error: (wrong / f64::max(all, f64::MIN_POSITIVE)).sqrt(),
        });
        let caption = |force| format!("strongest {}", amount(force, take.unit));
        self.pictures.push([
            felt(take, index, take.name.clone()).caption(caption(strongest)),
            compressed(take, image, format!("shown: {}", take.name)).caption(caption(shown)),
        ]);
        Ok(())
    }

    /// Four recordings in a row, raw beside compressed.
    pub(super) fn sheet(&self) -> Sheet {
        let sheet = Sheet::new("The tightest frame of each recording: forces felt, and as compressed");
        let pictures = self.pictures.iter().flatten().cloned();
        pictures.fold(sheet.columns(8).panel_size(120, 160), Sheet::picture)
    }

    /// What each row has of the columns, forces as `force` writes them.
    fn cells(&self, force: impl Fn(f64) -> String) -> Vec<Vec<String>> {
        let cells = |row: &Row| {
            vec![
                row.name.clone(),
                format!("{:.2}", row.seconds),
                format!("{:.2}", row.contact_s),
                format!("{:.2}", row.tightest_s),
                row.modules.to_string(),
                row.contacts.to_string(),
                force(row.strongest),
                force(row.total),
                row.unit.clone(),
                row.actuators.to_string(),
                row.levels.to_string(),
                format!("{:.4}", row.shown_error),
            ]
        };
        self.rows.iter().map(cells).collect()
    }

    /// The table as csv.
    pub(super) fn table(&self) -> String {
        let quoted = |cell: &String| {
            let plain = !cell.contains([',', '"', '\n']);
            if plain {
                cell.clone()
            } else {
                format!("\"{}\"", cell.replace('"', "\"\""))
            }
        };
        let lines = self
            .cells(|force| force.to_string())
            .into_iter()
            .map(|row| row.iter().map(quoted).collect::<Vec<_>>().join(","));
        [COLUMNS.join(",")]
            .into_iter()
            .chain(lines)
            .map(|line| line + "\n")
            .collect()
    }

    /// The table for people.
    pub(super) fn human(&self) -> String {
        let rows: Vec<Vec<String>> = [COLUMNS.map(String::from).to_vec()]
            .into_iter()
            .chain(self.cells(|force| amount(force, None)))
            .collect();
        let width = |column: usize| {
            rows.iter()
                .map(|row| row[column].chars().count())
                .max()
                .unwrap_or(0)
        };
        let widths: Vec<usize> = (0..COLUMNS.len()).map(width).collect();
        let line = |row: &Vec<String>| {
            let cells = row
                .iter()
                .zip(&widths)
                .enumerate()
                .map(|(column, (cell, width))| match column {
                    0 => format!("{cell:width$}"),
                    _ => format!("{cell:>width$}"),
                });
            cells.collect::<Vec<_>>().join("  ") + "\n"
        };
        rows.iter().map(line).collect()
    }
}
