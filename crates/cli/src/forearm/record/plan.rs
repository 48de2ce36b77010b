//! Which squeezes a session has, which are there, and which comes next.

use anyhow::{Context, anyhow, bail};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};
use taxel_forearm::{PLACES, Ramp, Squeeze, location_percent, touch_file};
use taxel_playback::output_file::OutputFile;

/// The squeezes of a session and the folder that they go into.
#[derive(Debug)]
pub(super) struct Plan {
    folder: PathBuf,
    places: Vec<usize>,
    repetitions: usize,
}

/// One squeeze to be made.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Next {
    /// From 0 (wrist).
    pub(super) place: usize,
    /// From 1, as files are numbered.
    pub(super) repetition: usize,
    repetitions: usize,
    pub(super) file: PathBuf,
}

/// What all squeezes of a session have in common.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Settings {
    pub(super) ramp: Ramp,
    pub(super) fingers: Vec<String>,
    pub(super) potentiometers: Vec<String>,
    /// Whether squeezes have tactile images.
    pub(super) touch: bool,
    /// Whether the gripper is a simulated one.
    pub(super) simulated: bool,
}

/// The file `session.json`.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Kept {
    version: u32,
    ramp: String,
    fingers: Vec<String>,
    potentiometers: Vec<String>,
    #[serde(default)]
    touch: bool,
    /// Left out where it is not known, as [`Session::open`](taxel_forearm::Session::open) reads it.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    simulated: bool,
}

const KEPT: &str = "session.json";
const VERSION: u32 = 1;

impl Plan {
    /// A plan of so many places, evenly from wrist to elbow, or of one of them.
    pub(super) fn new(
        folder: &Path,
        places: usize,
        repetitions: usize,
        only: Option<usize>,
    ) -> anyhow::Result<Self> {
        let all: Vec<usize> = match places {
            1 => vec![0],
            _ => (0..places).map(|n| n * (PLACES - 1) / (places - 1)).collect(),
        };
        let places = match only {
            None => all,
            Some(place) if all.contains(&place) => vec![place],
            Some(place) => bail!("there is no place {place}; there are {all:?}"),
        };
        Ok(Self {
            folder: folder.into(),
            places,
            repetitions,
        })
    }

    /// Settings of the session: kept where it begins, and refused where it was begun with others.
    pub(super) fn keep(&self, settings: &Settings) -> anyhow::Result<()> {
        let kept = Kept {
            version: VERSION,
            ramp: settings.ramp.to_string(),
            fingers: settings.fingers.clone(),
            potentiometers: settings.potentiometers.clone(),
            touch: settings.touch,
            simulated: settings.simulated,
        };
        match self.kept()? {
            None => {
                fs::create_dir_all(&self.folder).with_context(|| self.folder.display().to_string())?;
                OutputFile::write(
                    &self.folder.join(KEPT),
                    serde_json::to_string_pretty(&kept)? + "\n",
                )
            }
            Some(before) if before == kept => Ok(()),
            Some(before) => Err(self.begun_with(&before)),
        }
    }

    /// Whether the session can be gone on with, as far as that can be seen without a gripper: with this ramp, and these
    /// joints where they are named, and every squeeze that is there can be read.
    pub(super) fn check(
        &self,
        ramp: Ramp,
        fingers: &[String],
        potentiometers: &[String],
    ) -> anyhow::Result<()> {
        let before = self.kept()?;
        if let Some(before) = &before {
            let is_other = |named: &[String], kept: &[String]| !named.is_empty() && named != kept;
            if before.ramp != ramp.to_string()
                || is_other(fingers, &before.fingers)
                || is_other(potentiometers, &before.potentiometers)
            {
                return Err(self.begun_with(before));
            }
        }
        let has_touch = before.is_some_and(|before| before.touch);
        for next in self.squeezes().filter(|next| next.file.exists()) {
            let again = "take both files of this squeeze away, and it is made again";
            let squeeze = Squeeze::open(&next.file).context(again)?;
            if has_touch && squeeze.tactile.is_none() {
                let beside = touch_file(next.place, next.repetition);
                bail!("{}: no {beside} beside it; {again}", next.file.display());
            }
        }
        Ok(())
    }

    /// Settings that the session was begun with, where it was.
    fn kept(&self) -> anyhow::Result<Option<Kept>> {
        let path = self.folder.join(KEPT);
        let text = match fs::read_to_string(&path) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(error).with_context(|| path.display().to_string()),
        };
        let kept = serde_json::from_str(&text).with_context(|| path.display().to_string())?;
        Ok(Some(kept))
    }

    fn begun_with(&self, before: &Kept) -> anyhow::Error {
        anyhow!(
            "{}: this session was begun with ramp {}, fingers {:?}, potentiometers {:?} and {} touch{}; go on \
             with the same, or record into another folder",
            self.folder.join(KEPT).display(),
            before.ramp,
            before.fingers,
            before.potentiometers,
            if before.touch { "with" } else { "no" },
            if before.simulated { ", --simulated" } else { "" }
        )
    }

    /// The first squeeze that is missing; `None` when all are there.
    pub(super) fn next(&self) -> Option<Next> {
        self.squeezes().find(|next| !next.file.exists())
    }

    /// How many are there.
    pub(super) fn done(&self) -> usize {
        self.squeezes().filter(|next| next.file.exists()).count()
    }

    /// How many there are to be.
    pub(super) fn all(&self) -> usize {
        self.places.len() * self.repetitions
    }

    /// Writes a squeeze, whole or not at all, its tactile images in a file beside it. One that is there by now stays.
    pub(super) fn write(&self, next: &Next, squeeze: &Squeeze) -> anyhow::Result<()> {
        if let Some(folder) = next.file.parent() {
            fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
        }
        if next.file.exists() {
            bail!(
                "{}: somebody else has put this squeeze there meanwhile; theirs stays, and this one is not kept",
                next.file.display()
            );
        }
        // The squeeze is there when its angles are.
        if let Some(images) = squeeze.to_npy() {
            let beside = touch_file(next.place, next.repetition);
            OutputFile::write(&next.file.with_file_name(beside), images)?;
        }
        OutputFile::write_new(&next.file, squeeze.to_mat())
    }

    fn squeezes(&self) -> impl Iterator<Item = Next> + '_ {
        self.places.iter().flat_map(move |place| {
            (1..=self.repetitions).map(move |repetition| Next {
                place: *place,
                repetition,
                repetitions: self.repetitions,
                file: (self.folder.join(place.to_string())).join(format!("distance{place}_{repetition}.mat")),
            })
        })
    }
}

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{}: {} of {} squeezes are there",
            self.folder.display(),
            self.done(),
            self.all()
        )?;
        match self.next() {
            Some(next) => write!(f, "; next is {next}"),
            None => Ok(()),
        }
    }
}

impl fmt::Display for Next {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = match self.place {
            0 => ", the wrist",
            place if place + 1 == PLACES => ", the elbow",
            _ => "",
        };
        write!(
            f,
            "place {} ({:.1} %{name}), squeeze {} of {}",
            self.place,
            location_percent(self.place),
            self.repetition,
            self.repetitions
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_forearm::{Sample, Session, TACTELS};
    use tempfile::TempDir;

    fn squeeze() -> Squeeze {
        let mut squeeze = Squeeze::default();
        for row in 0..3u16 {
            squeeze.push(Sample {
                time_ms: 121.0 * f64::from(row),
                theta_p_deg: [42.0, 41.0],
                theta_a_deg: [1.0, 2.0],
                pwm: 10.0,
            });
            squeeze.push_image(&[7 * row; TACTELS]);
        }
        squeeze
    }

    #[test]
    fn a_session_that_was_interrupted_goes_on_with_the_first_squeeze_that_is_missing() {
        let dir = TempDir::new().unwrap();
        let folder = dir.path().join("session");
        let plan = Plan::new(&folder, 3, 2, None).unwrap();
        let mut order = Vec::new();
        while let Some(next) = plan.next() {
            order.push((next.place, next.repetition));
            plan.write(&next, &squeeze()).unwrap();
            // Somebody begins anew.
            let again = Plan::new(&folder, 3, 2, None).unwrap();
            assert_eq!(again.done(), order.len());
        }
        assert_eq!(order, [(0, 1), (0, 2), (6, 1), (6, 2), (12, 1), (12, 2)]);
        std::fs::remove_file(folder.join("6/distance6_1.mat")).unwrap();
        let next = plan.next().unwrap();
        assert_eq!((next.place, next.repetition), (6, 1));
        assert!(
            plan.to_string()
                .ends_with("5 of 6 squeezes are there; next is place 6 (50.0 %), squeeze 1 of 2")
        );
        // What is written is what the publication's reader reads.
        let session = Session::open(&folder).unwrap();
        assert_eq!(session.trials.len(), 5);
        assert_eq!(session.locations(), [0.0, 50.0, 100.0]);
        assert_eq!(session.trials[0].squeeze.theta_p_deg, squeeze().theta_p_deg);
        assert!(session.has_touch());
        assert_eq!(session.trials[4].squeeze.tactile, squeeze().tactile);
        // What is there stays.
        let first = plan.squeezes().next().unwrap();
        let error = plan.write(&first, &squeeze().prefix(2)).unwrap_err().to_string();
        assert!(error.contains("distance0_1.mat: somebody else"), "{error}");
        assert_eq!(Session::open(&folder).unwrap().trials[0].squeeze.len(), 3);
        // One whose images are of another squeeze is refused.
        let other = squeeze().prefix(2).to_npy().unwrap();
        std::fs::write(folder.join("0/tactile0_1.npy"), other).unwrap();
        let error = Session::open(&folder).unwrap_err().to_string();
        assert!(
            error.contains("tactile0_1.npy") && error.contains("3 samples"),
            "{error}"
        );
    }

    #[test]
    fn a_session_is_not_gone_on_with_under_other_settings() {
        let dir = TempDir::new().unwrap();
        let plan = Plan::new(dir.path(), 13, 60, Some(5)).unwrap();
        assert_eq!(plan.all(), 60);
        let mut settings = Settings {
            ramp: Ramp::Data,
            fingers: vec!["left".into(), "right".into()],
            potentiometers: Vec::new(),
            touch: true,
            simulated: false,
        };
        plan.keep(&settings).unwrap();
        plan.keep(&settings).unwrap();
        settings.ramp = Ramp::Article;
        let error = plan.keep(&settings).unwrap_err().to_string();
        assert!(error.contains("begun with ramp data"), "{error}");
        (settings.ramp, settings.touch) = (Ramp::Data, false);
        let error = plan.keep(&settings).unwrap_err().to_string();
        assert!(error.contains("and with touch; go on"), "{error}");
        (settings.touch, settings.simulated) = (true, true);
        assert!(plan.keep(&settings).is_err());
        assert!(Plan::new(dir.path(), 3, 2, Some(5)).is_err());
    }

    #[test]
    fn what_cannot_be_gone_on_with_is_seen_without_a_gripper() {
        let dir = TempDir::new().unwrap();
        let plan = Plan::new(dir.path(), 3, 2, None).unwrap();
        let names = |names: [&str; 2]| names.map(String::from).to_vec();
        let (left, swapped) = (names(["left", "right"]), names(["right", "left"]));
        plan.check(Ramp::Article, &swapped, &[]).unwrap();
        let settings = Settings {
            ramp: Ramp::Data,
            fingers: left.clone(),
            potentiometers: names(["p1", "p2"]),
            touch: true,
            simulated: true,
        };
        plan.keep(&settings).unwrap();
        for next in plan.squeezes() {
            plan.write(&next, &squeeze()).unwrap();
        }
        assert!(Session::open(dir.path()).unwrap().simulated);
        plan.check(Ramp::Data, &[], &[]).unwrap();
        plan.check(Ramp::Data, &left, &names(["p1", "p2"])).unwrap();
        let refused = |ramp, fingers: &[String], potentiometers: &[String], words: &str| {
            let error = plan.check(ramp, fingers, potentiometers).unwrap_err();
            assert!(format!("{error:#}").contains(words), "{error:#}");
        };
        refused(Ramp::Article, &[], &[], "begun with ramp data");
        refused(Ramp::Data, &swapped, &[], "fingers [\"left\", \"right\"]");
        refused(Ramp::Data, &[], &swapped, "potentiometers [\"p1\", \"p2\"]");
        // What is there has to be readable, and touch beside it.
        let touch = dir.path().join("6/tactile6_2.npy");
        let images = fs::read(&touch).unwrap();
        fs::remove_file(&touch).unwrap();
        refused(
            Ramp::Data,
            &[],
            &[],
            "distance6_2.mat: no tactile6_2.npy beside it; take both",
        );
        fs::write(&touch, &images[..images.len() / 2]).unwrap();
        refused(Ramp::Data, &[], &[], "tactile6_2.npy");
        fs::write(&touch, images).unwrap();
        let file = dir.path().join("12/distance12_1.mat");
        fs::write(&file, &squeeze().to_mat()[..300]).unwrap();
        refused(
            Ramp::Data,
            &[],
            &[],
            "take both files of this squeeze away, and it is made again: ",
        );
        refused(Ramp::Data, &[], &[], "distance12_1.mat: byte 128");
        fs::write(dir.path().join(KEPT), "{").unwrap();
        refused(Ramp::Data, &[], &[], "session.json: EOF");
    }
}
