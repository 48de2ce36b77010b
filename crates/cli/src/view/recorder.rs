//! A recording that a key begins and ends, while the hand is looked at.

use super::lock;
use crate::record::{described_by_status, plan_of_daemon, words};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{SystemTime, UNIX_EPOCH};
use taxel_recorder::{Finished, Signals};
use taxel_view::Seen;

/// At most one recording at a time.
#[derive(Debug, Default)]
pub(super) struct Recorder(Mutex<Option<Ongoing>>);

#[derive(Debug)]
struct Ongoing {
    file: String,
    stop: Arc<AtomicBool>,
    /// What became of it, in the end.
    thread: JoinHandle<Vec<String>>,
}

impl Ongoing {
    fn finish(self) -> Vec<String> {
        self.stop.store(true, Ordering::Relaxed);
        let failed = |_| vec![format!("{}: the recorder panicked", self.file)];
        self.thread.join().unwrap_or_else(failed)
    }
}

impl Recorder {
    /// The file that is being written.
    pub(super) fn file(&self) -> Option<String> {
        let mut ongoing = lock(&self.0);
        // One that has failed has said why.
        if ongoing
            .as_ref()
            .is_some_and(|ongoing| ongoing.thread.is_finished())
        {
            *ongoing = None;
        }
        ongoing.as_ref().map(|ongoing| ongoing.file.clone())
    }

    /// Begins a recording in a file of its own in the current folder, or ends the one there is; what there is to say.
    pub(super) fn toggle(&self, images: &Path, seen: &Arc<Mutex<Seen>>) -> Option<String> {
        let mut ongoing = lock(&self.0);
        if let Some(ongoing) = ongoing.take() {
            return Some(ongoing.finish().join("; "));
        }
        match begin(images, free_name(Path::new(""), SystemTime::now()), seen.clone()) {
            Ok(begun) => {
                let words = format!("recording {}; r ends it", begun.file);
                *ongoing = Some(begun);
                Some(words)
            }
            Err(error) => Some(format!("{error:#}")),
        }
    }

    /// Ends the recording, if there is one; what became of it.
    pub(super) fn finish(&self) -> Vec<String> {
        let ongoing = lock(&self.0).take();
        ongoing.map_or(Vec::new(), Ongoing::finish)
    }
}

fn begin(images: &Path, out: PathBuf, seen: Arc<Mutex<Seen>>) -> anyhow::Result<Ongoing> {
    let plan = plan_of_daemon(images, out)?;
    let images = images.to_owned();
    let file = plan.out.display().to_string();
    let stop = Arc::new(AtomicBool::new(false));
    let is_stopped = stop.clone();
    let record = move || {
        let tell = |_, text: &str| lock(&seen).tell(text, taxel_can::monotonic_ns());
        let signals = Signals {
            stop: &|| is_stopped.load(Ordering::Relaxed),
            trigger: &|| false,
            say: &tell,
            described: &|_| described_by_status(&images, &plan),
        };
        let finished = taxel_recorder::record(&plan, &signals).unwrap_or_else(|failure| Finished {
            failure: Some(failure),
            ..Finished::default()
        });
        let words = words(&plan, &finished);
        let mut words: Vec<_> = words.into_iter().map(|(_, line)| line).collect();
        if let Some(failure) = finished.failure {
            let failure = format!("{failure}; nothing is recorded any more");
            lock(&seen).say(failure.as_str(), taxel_can::monotonic_ns());
            words.push(failure);
        }
        words
    };
    let thread = std::thread::Builder::new()
        .name("recorder".into())
        .spawn(record)?;
    Ok(Ongoing { file, stop, thread })
}

/// A file of this folder that is named by the time, UTC, as `taxel-20261122T120455Z.mcap`; behind it a number, `_2`, where
/// another recording was begun within that second.
fn free_name(folder: &Path, now: SystemTime) -> PathBuf {
    let utc = humantime::format_rfc3339_seconds(now.max(UNIX_EPOCH)).to_string();
    let stem = format!("taxel-{}", utc.replace(['-', ':'], ""));
    let mut name = folder.join(format!("{stem}.mcap"));
    let mut number = 2;
    while name.exists() {
        name.set_file_name(format!("{stem}_{number}.mcap"));
        number += 1;
    }
    name
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn a_recording_is_named_by_the_time() {
        let folder = tempfile::tempdir().unwrap();
        for (seconds, name) in [
            (0, "taxel-19700101T000000Z.mcap"),
            (951_782_400, "taxel-20000229T000000Z.mcap"),
            (1_795_349_095, "taxel-20261122T120455Z.mcap"),
            (4_107_542_399, "taxel-21000228T235959Z.mcap"),
            (4_107_542_400, "taxel-21000301T000000Z.mcap"),
            (4_107_542_400, "taxel-21000301T000000Z_2.mcap"),
            (4_107_542_400, "taxel-21000301T000000Z_3.mcap"),
        ] {
            let file = free_name(folder.path(), UNIX_EPOCH + Duration::from_secs(seconds));
            assert_eq!(file, folder.path().join(name));
            std::fs::write(&file, "").unwrap();
        }
    }
}
