//! Marks of a scene with a phantom. Who plays the scene makes them on the daemon, as a robot would.

use super::control;
use anyhow::{Context, bail};
use std::convert::Infallible;
use std::path::PathBuf;
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::time::{Duration, Instant};
use taxel_sequence::Mark;
use taxel_sim::Scene;

/// Makes the marks of a scene at their instants, again and again, until it is dropped.
#[derive(Debug)]
pub(crate) struct SceneMarks {
    /// Its end ends the thread.
    _playing: Sender<Infallible>,
}

impl SceneMarks {
    /// Of a scene that began at `began`, on the control socket of a daemon. `report` is told of marks that the daemon
    /// did not take: once, until one is taken again.
    ///
    /// # Errors
    /// A scene without a phantom, which has no marks; no thread.
    pub(crate) fn start(
        scene: &Scene,
        began: Instant,
        socket: PathBuf,
        report: impl Fn(String) + Send + 'static,
    ) -> anyhow::Result<Self> {
        let Some(palpation) = scene.palpation() else {
            bail!(
                "the scene {} has no marks; phantom-1 and phantom-2 have",
                scene.name()
            );
        };
        let due = again_and_again(palpation.marks(), scene.length_ns());
        let (playing, dropped) = mpsc::channel::<Infallible>();
        let make = move || {
            let mut taken = true;
            for (at_ns, text) in due {
                let wait = (began + Duration::from_nanos(at_ns)).saturating_duration_since(Instant::now());
                let Err(RecvTimeoutError::Timeout) = dropped.recv_timeout(wait) else {
                    return;
                };
                let request = serde_json::json!({ "cmd": "mark", "text": text });
                let outcome = control::request(&socket, &request);
                if let (Err(error), true) = (&outcome, taken) {
                    report(format!("the mark {text:?} was not taken: {error:#}"));
                }
                taken = outcome.is_ok();
            }
        };
        std::thread::Builder::new()
            .name("marks".into())
            .spawn(make)
            .context("a thread for marks")?;
        Ok(Self { _playing: playing })
    }
}

/// Marks of a scene that is played in a loop: nanoseconds since its first beginning, and text.
fn again_and_again(marks: Vec<Mark>, length_ns: u64) -> impl Iterator<Item = (u64, String)> {
    let round = move |round: u64| {
        let begin_ns = round * length_ns;
        (marks.iter())
            .map(|mark| (begin_ns + mark.t_ns, mark.text.clone()))
            .collect::<Vec<_>>()
    };
    (0..).flat_map(round)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_come_again_with_each_round_of_the_scene() {
        let scene = Scene::builtin("phantom-1").unwrap();
        let marks = scene.palpation().unwrap().marks();
        let due: Vec<_> = again_and_again(marks.clone(), scene.length_ns())
            .take(34)
            .collect();
        assert_eq!(due[0], (marks[0].t_ns, "touch 0 NA".into()));
        assert_eq!(due[31].1, "away");
        assert_eq!(due[32], (scene.length_ns() + marks[0].t_ns, "touch 0 NA".into()));
        assert!(due.is_sorted_by_key(|(at_ns, _)| *at_ns));
    }

    #[test]
    fn a_daemon_that_is_not_there_is_reported_once() {
        let folder = tempfile::tempdir().unwrap();
        let (told, reports) = mpsc::channel();
        let scene = Scene::builtin("phantom-2").unwrap();
        // Begun long ago: marks are due at once.
        let began = Instant::now()
            .checked_sub(Duration::from_secs(3600))
            .unwrap_or_else(Instant::now);
        let report = move |text| {
            let _ = told.send(text);
        };
        let marks = SceneMarks::start(&scene, began, folder.path().join("none.sock"), report).unwrap();
        let first = reports.recv().unwrap();
        assert!(
            first.starts_with("the mark \"touch 0 NA\" was not taken: cannot reach taxeld"),
            "{first}"
        );
        drop(marks);
        assert!(
            reports.recv().is_err(),
            "the thread ends with the marks, and says nothing twice"
        );
        let error =
            SceneMarks::start(&Scene::builtin("tap").unwrap(), began, "x".into(), |_| ()).unwrap_err();
        assert!(error.to_string().contains("the scene tap has no marks"));
    }
}
