//! A file of a recording that is written on a disk which may be full.

use crate::series::{SharedSeries, is_of_full_disk};
use std::io::{self, Seek, SeekFrom, Write};
use std::thread;
use std::time::Duration;

/// How long a file system is given to hand out the room of a removed file, before another one is removed, and how often it is
/// asked: some do so with their next transaction. Meanwhile what comes waits in memory.
const WAIT: Duration = Duration::from_millis(50);
const MOST_WAITS: usize = 20;

/// What a file is written through: where its disk is full, the oldest files of its recording make room, as many as it takes,
/// if older ones are to make room for newer ones at all.
#[derive(Debug)]
pub(crate) struct RoomyFile<W> {
    file: W,
    series: SharedSeries,
}

impl<W> RoomyFile<W> {
    pub(crate) fn new(file: W, series: SharedSeries) -> Self {
        Self { file, series }
    }
}

impl<W: Write> Write for RoomyFile<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut waits = MOST_WAITS;
        loop {
            match self.file.write(bytes) {
                Err(error) if is_of_full_disk(&error) => {
                    if waits < MOST_WAITS {
                        thread::sleep(WAIT);
                        waits += 1;
                    } else if self.series.lock().give_way() {
                        waits = 0;
                    } else {
                        return Err(error);
                    }
                }
                written => return written,
            }
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl<W: Seek> Seek for RoomyFile<W> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::series::Series;
    use std::fs::File;
    use std::io::ErrorKind;
    use std::path::Path;

    /// A file in a folder that holds so many bytes, and has the room of a removed file only some writes later.
    struct Disk<'a> {
        folder: &'a Path,
        holds: u64,
        file: File,
        /// Bytes that were taken at the last write, and writes for which they stay so.
        taken: u64,
        late: usize,
    }

    impl Write for Disk<'_> {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            let files = std::fs::read_dir(self.folder)?;
            let taken: u64 = files.map(|file| file.unwrap().metadata().unwrap().len()).sum();
            if taken < self.taken && self.late > 0 {
                self.late -= 1;
                return Err(ErrorKind::StorageFull.into());
            }
            self.taken = taken;
            match self.holds.saturating_sub(taken).min(bytes.len() as u64) {
                0 => Err(ErrorKind::StorageFull.into()),
                room => self.file.write(&bytes[..room as usize]),
            }
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    /// What is left of five files of a hundred bytes, on a disk that is full with them, when `bytes` are written into a sixth.
    fn written(most_files: Option<usize>, bytes: usize, late: usize) -> (io::Result<()>, Vec<u64>, [u32; 2]) {
        let folder = tempfile::tempdir().unwrap();
        let path = |number: u64| folder.path().join(format!("day-{number:04}.mcap"));
        for number in 1..=5 {
            let mut old = mcap::MAGIC.to_vec();
            old.resize(100, 0);
            std::fs::write(path(number), old).unwrap();
        }
        let series = SharedSeries::new(Series::new(&folder.path().join("day.mcap"), true, most_files));
        let (_, file) = series.lock().create().unwrap();
        let disk = Disk {
            folder: folder.path(),
            holds: 500,
            file,
            taken: 500,
            late,
        };
        let result = RoomyFile::new(disk, series.clone()).write_all(&vec![1; bytes]);
        let left = (1..=6).filter(|number| path(*number).exists()).collect();
        let series = series.lock();
        (result, left, [series.removed(), series.given()])
    }

    #[test]
    fn the_oldest_files_make_room_on_a_full_disk_as_many_as_it_takes() {
        for (bytes, left) in [(100, 2..=6), (101, 3..=6), (400, 5..=6), (500, 6..=6)] {
            let left: Vec<u64> = left.collect();
            let given = 6 - left.len() as u32;
            let (result, there, counts) = written(Some(20), bytes, 0);
            assert!(result.is_ok(), "{bytes}: {result:?}");
            assert_eq!((there, counts), (left, [given; 2]), "{bytes}");
        }
    }

    #[test]
    fn room_that_is_there_a_moment_later_costs_no_other_file() {
        let (result, there, counts) = written(Some(20), 100, 3);
        assert!(result.is_ok(), "{result:?}");
        assert_eq!((there, counts), (vec![2, 3, 4, 5, 6], [1; 2]));
    }

    #[test]
    fn a_full_disk_ends_what_has_nothing_left_to_give_or_is_to_give_nothing() {
        for (most, bytes, left) in [(Some(20), 501, vec![6]), (None, 1, vec![1, 2, 3, 4, 5, 6])] {
            let (result, there, _) = written(most, bytes, 0);
            assert_eq!(result.unwrap_err().kind(), ErrorKind::StorageFull);
            assert_eq!(there, left);
        }
    }
}
