//! Tactile frames as `.parquet`: a column for each axis of each taxel.

use super::frames::counts_of;
use crate::error::RecordError;
use crate::recording::TaxelCounts;
use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
use parquet::column::writer::ColumnWriter;
use parquet::errors::Result;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::{Type, TypePtr};
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use taxel_hand::TactileFrame;

/// Numbers that are gathered before they are written column by column, 2 bytes each.
const GATHERED: usize = if cfg!(test) { 12_000 } else { 8 << 20 };

/// A Parquet file of tactile frames, written some thousand frames at a time.
///
/// Its columns are called as those of [`crate::FrameTable`]: `t_ns` (64 bits, signed as everybody reads it), then x, y and
/// z of each taxel (16 bits, unsigned, null where it has no value of the frame's time), then the joint angles (f32, radians, not a number where unknown).
pub struct FrameColumns {
    path: PathBuf,
    taxels: Vec<(u16, u16)>,
    writer: Option<SerializedFileWriter<File>>,
    t_ns: Vec<i64>,
    counts: Vec<TaxelCounts>,
    joints: Vec<f32>,
    joint_count: usize,
}

impl FrameColumns {
    /// Creates the file for frames of these taxels: module, and the taxel's own number there, ascending.
    pub fn create(path: &Path, taxels: impl IntoIterator<Item = (u16, u16)>) -> Self {
        Self {
            path: path.into(),
            taxels: taxels.into_iter().collect(),
            writer: None,
            t_ns: Vec::new(),
            counts: Vec::new(),
            joints: Vec::new(),
            joint_count: 0,
        }
    }

    /// Adds a frame; of the joints there are as many as in the first one.
    pub fn push(&mut self, frame: &TactileFrame) -> std::result::Result<(), RecordError> {
        if self.writer.is_none() {
            self.joint_count = frame.joints.len();
            let file = File::create(&self.path).map_err(RecordError::io(&self.path))?;
            let writer = SerializedFileWriter::new(file, self.schema(), Arc::new(properties()));
            self.writer = Some(self.told(writer)?);
        }
        self.t_ns.push(frame.t_ns as i64);
        let counts = counts_of(frame).chain(std::iter::repeat(None));
        self.counts.extend(counts.take(self.taxels.len()));
        let joints = frame.joints.iter().copied().chain(std::iter::repeat(f32::NAN));
        self.joints.extend(joints.take(self.joint_count));
        match 3 * self.counts.len() < GATHERED {
            true => Ok(()),
            false => self.write_gathered(),
        }
    }

    /// Writes what is left.
    pub fn finish(mut self) -> std::result::Result<(), RecordError> {
        self.write_gathered()?;
        match self.writer.take() {
            Some(writer) => self.told(writer.close()).map(drop),
            None => Ok(()),
        }
    }

    fn schema(&self) -> TypePtr {
        let column = |name: String, physical, logical: Option<LogicalType>| {
            let may_be_null = match logical {
                Some(_) => Repetition::OPTIONAL,
                None => Repetition::REQUIRED,
            };
            let column = Type::primitive_type_builder(&name, physical).with_repetition(may_be_null);
            Arc::new(
                column
                    .with_logical_type(logical)
                    .build()
                    .expect("types that go together"),
            )
        };
        let mut columns = vec![column("t_ns".into(), Physical::INT64, None)];
        for (module, taxel) in &self.taxels {
            for axis in ['X', 'Y', 'Z'] {
                let counts = Some(LogicalType::integer(16, false));
                columns.push(column(format!("{module}B{taxel}{axis}"), Physical::INT32, counts));
            }
        }
        columns.extend((0..self.joint_count).map(|joint| column(format!("J{joint}"), Physical::FLOAT, None)));
        let root = Type::group_type_builder("frames").with_fields(columns);
        Arc::new(root.build().expect("columns make a group"))
    }

    fn write_gathered(&mut self) -> std::result::Result<(), RecordError> {
        let Some(mut writer) = self.writer.take() else {
            return Ok(());
        };
        let written = self.write_group(&mut writer);
        self.writer = Some(writer);
        self.t_ns.clear();
        self.counts.clear();
        self.joints.clear();
        self.told(written)
    }

    fn write_group(&self, writer: &mut SerializedFileWriter<File>) -> Result<()> {
        if self.t_ns.is_empty() {
            return Ok(());
        }
        let mut group = writer.next_row_group()?;
        let (taxels, joints) = (self.taxels.len(), self.joint_count);
        let axes = 3 * taxels;
        let (mut number, mut integers, mut is_there, mut angles) = (0, Vec::new(), Vec::new(), Vec::new());
        while let Some(mut column) = group.next_column()? {
            match column.untyped() {
                ColumnWriter::Int64ColumnWriter(times) => times.write_batch(&self.t_ns, None, None)?,
                ColumnWriter::Int32ColumnWriter(counts) => {
                    let (taxel, axis) = ((number - 1) / 3, (number - 1) % 3);
                    let of_taxel = || self.counts.iter().skip(taxel).step_by(taxels);
                    integers.clear();
                    integers.extend(of_taxel().flatten().map(|counts| i32::from(counts[axis])));
                    is_there.clear();
                    is_there.extend(of_taxel().map(|counts| i16::from(counts.is_some())));
                    counts.write_batch(&integers, Some(&is_there), None)?
                }
                ColumnWriter::FloatColumnWriter(column) => {
                    angles.clear();
                    angles.extend(self.joints.iter().skip(number - 1 - axes).step_by(joints));
                    column.write_batch(&angles, None, None)?
                }
                _ => unreachable!("the schema has these three"),
            };
            column.close()?;
            number += 1;
        }
        group.close().map(drop)
    }

    fn told<T>(&self, done: Result<T>) -> std::result::Result<T, RecordError> {
        done.map_err(|error| RecordError::io(&self.path)(io::Error::other(error)))
    }
}

fn properties() -> WriterProperties {
    WriterProperties::builder()
        .set_compression(Compression::SNAPPY)
        .set_created_by(format!("taxel {}", env!("CARGO_PKG_VERSION")))
        .build()
}

#[cfg(test)]
mod tests {
    use super::*;
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::RowAccessor;
    use taxel_hand::Freshness;

    #[test]
    fn every_frame_is_a_row_of_what_was_measured() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("frames.parquet");
        let taxels = 20;
        let mut columns = FrameColumns::create(&path, (0..taxels).map(|taxel| (12, taxel)));
        let frames = GATHERED / 3 / usize::from(taxels) * 3 / 2;
        for n in 0..frames {
            let mut frame = TactileFrame {
                t_ns: 1_700_000_000_000_000_000 + n as u64,
                counts: vec![[n as u16, 2, 65_535]; usize::from(taxels)],
                freshness: vec![Freshness::Fresh; usize::from(taxels)],
                joints: vec![0.5 * n as f32, f32::NAN],
                ..TactileFrame::default()
            };
            frame.counts[1] = [4, 5, 6];
            if n == 97 {
                frame.joints.clear(); // A joint reader that went away.
                frame.freshness[2] = Freshness::Missing;
            }
            columns.push(&frame).unwrap();
        }
        columns.finish().unwrap();

        let reader = SerializedFileReader::new(File::open(&path).unwrap()).unwrap();
        let schema = reader.metadata().file_metadata().schema();
        let names: Vec<&str> = schema.get_fields().iter().map(|field| field.name()).collect();
        assert_eq!(names[..5], ["t_ns", "12B0X", "12B0Y", "12B0Z", "12B1X"]);
        assert_eq!(names[61..], ["J0", "J1"]);
        assert_eq!(reader.num_row_groups(), 2);
        let mut rows = 0;
        for (n, row) in reader.get_row_iter(None).unwrap().enumerate().step_by(97) {
            let row = row.unwrap();
            assert_eq!(row.get_long(0).unwrap(), 1_700_000_000_000_000_000 + n as i64);
            let counts = [1, 2, 3, 6, 60].map(|column| row.get_ushort(column).unwrap());
            assert_eq!(counts, [n as u16, 2, 65_535, 6, 65_535]);
            let of_third = [7, 8, 9].map(|column| row.get_ushort(column).ok());
            let measured = [n as u16, 2, 65_535].map(|count| Some(count).filter(|_| n != 97));
            assert_eq!(of_third, measured);
            let angle = row.get_float(61).unwrap();
            assert!(if n == 97 {
                angle.is_nan()
            } else {
                angle == 0.5 * n as f32
            });
            assert!(row.get_float(62).unwrap().is_nan());
            rows += 1;
        }
        assert_eq!(rows, frames.div_ceil(97));
        assert_eq!(reader.metadata().file_metadata().num_rows(), frames as i64);
    }
}
