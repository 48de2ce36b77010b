//! `taxel categorize --live MAP`: touch after touch into its category, beside a running daemon.

use super::touches::Set;
use anyhow::{Context, bail, ensure};
use serde::{Deserialize, Serialize};
use std::io::{self, Write};
use std::path::Path;
use taxel_palpation::Classifier;
use taxel_sequence::{Aligned, Alignment, Motion, Touch};
use taxel_serve::{Announcements, Limits, ProfilesConfig, Server, ServerHandle, ServerSeed, SocketPath};
use taxel_wire::{EventKind, Hello, Kind, Received, Subscribe, Subscriber};
use tokio_seqpacket::UnixSeqpacketListener;

/// A map in a file: categories, and how touches were put side by side.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MapFile {
    /// What it is of, for messages.
    name: String,
    /// Depth and radius, mm; null where touches are aligned by time.
    motion: Option<[f64; 2]>,
    /// How long the probe rests on each step, ms; null where there is a frame for each.
    rest_ms: Option<f64>,
    first: f64,
    step: f64,
    steps: usize,
    /// Values of a frame: one or three for each taxel.
    values: usize,
    /// The name of each category.
    labels: Vec<Option<String>>,
    classifier: Classifier,
}

impl MapFile {
    pub(super) fn new(
        set: &Set,
        aligned: &Aligned,
        labels: Vec<Option<String>>,
        classifier: Classifier,
    ) -> Self {
        Self {
            name: set.name.clone(),
            motion: set.motion.map(|motion| [motion.depth_mm, motion.radius_mm]),
            rest_ms: set.rest_ms,
            first: aligned.first,
            step: aligned.step,
            steps: aligned.steps,
            values: aligned.taxels,
            labels,
            classifier,
        }
    }

    pub(super) fn save(&self, path: &Path) -> anyhow::Result<()> {
        let mut file = crate::output_file::OutputFile::begin(path)?;
        std::fs::write(file.path(), serde_json::to_vec(self)?).with_context(|| path.display().to_string())?;
        file.finish()
    }

    fn load(path: &Path) -> anyhow::Result<Self> {
        let text = std::fs::read(path).with_context(|| path.display().to_string())?;
        let not_a_map = || {
            format!(
                "{}: no map as `taxel categorize --save` writes it",
                path.display()
            )
        };
        let map: Self = serde_json::from_slice(&text).with_context(not_a_map)?;
        // Numbers of frames are bounded before anything is made of them.
        let features = map
            .steps
            .checked_mul(map.values)
            .filter(|n| (1..=10_000_000).contains(n));
        let whole =
            features.is_some_and(|n| map.classifier.is_whole(n)) && map.step > 0.0 && map.first.is_finite();
        ensure!(
            whole && map.labels.len() == map.classifier.categories(),
            "{}: its parts do not fit",
            not_a_map()
        );
        Ok(map)
    }
}

/// Touches as they come: frames and marks in, categories out. No socket and no clock.
struct Live {
    grid: Aligned,
    motion: Option<Motion>,
    rest_ns: Option<u64>,
    labels: Vec<Option<String>>,
    classifier: Classifier,
    until: String,
    /// The touch at work: when it began, when its last frame was.
    touch: Option<(Touch, u64, u64)>,
}

/// A touch and its category: the keys of a TOUCH message, and the mark that began it.
#[derive(Debug, Serialize, PartialEq)]
struct Categorised {
    category: usize,
    label: Option<String>,
    distances: Vec<f64>,
    confidence: f64,
    unknown: bool,
    start_ns: u64,
    end_ns: u64,
    mark: String,
}

impl Live {
    fn new(map: MapFile, until: &str) -> anyhow::Result<Self> {
        let motion = map
            .motion
            .map(|[depth, radius]| Motion::new(depth, radius))
            .transpose()?;
        Ok(Self {
            grid: Aligned {
                along: motion.map_or(Alignment::Time, Motion::along),
                first: map.first,
                step: map.step,
                steps: map.steps,
                taxels: map.values,
                left_out: 0,
                values: Vec::new(),
            },
            motion,
            rest_ns: map.rest_ms.map(|ms| (ms * 1e6) as u64).filter(|ns| *ns > 0),
            labels: map.labels,
            classifier: map.classifier,
            until: until.to_owned(),
            touch: None,
        })
    }

    /// Takes a frame: signed counts above baseline.
    fn handle_frame(&mut self, t_ns: u64, values: impl Iterator<Item = f64>) {
        let Some((touch, start_ns, end_ns)) = &mut self.touch else {
            return;
        };
        let since_ns = t_ns.saturating_sub(*start_ns);
        let at = match (self.motion, self.rest_ns) {
            // The probe moves at the beginning of a step.
            (Some(_), Some(rest_ns)) if since_ns % rest_ns < rest_ns / 10 => return,
            (Some(motion), Some(rest_ns)) => motion.at((since_ns / rest_ns) as usize),
            (Some(motion), None) => motion.at(touch.at.len()),
            (None, _) => since_ns as f64 / 1e9,
        };
        // A touch that nobody ends keeps no more than twice what its steps can need.
        if touch.at.len() < 1_000_000 {
            touch.at.push(at);
            touch.values.extend(values);
            *end_ns = t_ns;
        }
    }

    /// Takes a mark: the touch that it ends, if it ends one; why that has no category, where it has none.
    fn handle_mark(&mut self, t_ns: u64, text: &str) -> Option<anyhow::Result<Categorised>> {
        let ended = self.touch.take();
        if text != self.until {
            let touch = Touch {
                name: text.to_owned(),
                at: Vec::new(),
                taxels: self.grid.taxels,
                values: Vec::new(),
            };
            self.touch = Some((touch, t_ns, t_ns));
        }
        ended.map(|(touch, start_ns, end_ns)| self.categorise(touch, start_ns, end_ns))
    }

    fn categorise(&self, touch: Touch, start_ns: u64, end_ns: u64) -> anyhow::Result<Categorised> {
        let (features, _) = self.grid.place(&touch)?;
        let found = self.classifier.classify(&features)?;
        Ok(Categorised {
            category: found.category,
            label: self.labels[found.category].clone(),
            distances: found.distances,
            confidence: found.confidence,
            unknown: found.unknown,
            start_ns,
            end_ns,
            mark: touch.name,
        })
    }
}

/// Reads every frame of a daemon and writes a line for each touch; publishes it too, where there is a socket for that.
pub(super) fn run(
    map: &Path,
    socket: Option<&Path>,
    publish: Option<&Path>,
    until: &str,
) -> anyhow::Result<()> {
    let map = MapFile::load(map)?;
    let (name, values) = (map.name.clone(), map.values);
    let mut live = Live::new(map, until)?;
    let socket = socket.map_or_else(
        || taxeld::config::running_socket("images.sock"),
        Path::to_path_buf,
    );
    let mut subscriber = Subscriber::connect(&socket)?;
    subscriber.subscribe(&Subscribe {
        image: false,
        raw: true,
        every: true,
        ..Subscribe::default()
    })?;
    let mut publisher = None;
    let mut newest = 0;
    loop {
        match subscriber.next()? {
            Received::Hello(hello) => {
                let taxels = hello.taxels.len();
                if values != taxels && values != 3 * taxels {
                    bail!(
                        "the map of {name} has {values} values a frame, and {} has {taxels} taxels; it is of another probe",
                        hello.layout
                    );
                }
                if let (None, Some(path)) = (&publisher, publish) {
                    publisher = Some(Publisher::start(path, hello.clone())?);
                }
            }
            Received::Raw(header, raw) => {
                if header.skipped > 0 && live.touch.is_some() {
                    eprintln!(
                        "taxel: {} frames were lost before frame {}; this reader was slow",
                        header.skipped, header.seq
                    );
                }
                newest = header.seq;
                let one = values == raw.taxels().len();
                let Some(baselines) = raw.baselines() else {
                    bail!(
                        "the daemon sends no baselines (it is of version 1.0, or the hand has too many taxels)"
                    );
                };
                let pressed = raw
                    .taxels()
                    .zip(baselines)
                    .map(|(taxel, baseline)| taxel.press(baseline));
                let values = pressed.flat_map(|xyz| xyz.into_iter().skip(if one { 2 } else { 0 }));
                live.handle_frame(header.t_ns, values.map(f64::from));
            }
            Received::Event(header, event) if event.event == EventKind::Mark => {
                match live.handle_mark(header.t_ns, &event.message) {
                    None => {}
                    Some(Err(error)) => eprintln!("taxel: {error}"),
                    Some(Ok(touch)) => {
                        let line = serde_json::to_string(&touch)?;
                        if let Some(publisher) = &publisher {
                            publisher
                                .handle
                                .publish_text(Kind::Touch, line.as_bytes(), newest, touch.end_ns);
                        }
                        let mut out = io::stdout().lock();
                        writeln!(out, "{line}")
                            .and_then(|()| out.flush())
                            .context("stdout")?;
                    }
                }
            }
            _ => {}
        }
    }
}

/// The socket that touches are published on, served by a thread of its own as long as the program runs.
struct Publisher {
    handle: ServerHandle,
    _path: SocketPath,
}

impl Publisher {
    fn start(path: &Path, hello: Hello) -> anyhow::Result<Self> {
        let mut path = SocketPath::take(path, 0o660, "")?;
        let listening = path.listen(nix::sys::socket::SockType::SeqPacket, 16)?;
        let limits = Limits {
            max_subscribers: 16,
            stall_ms: 2000,
        };
        let maker = Announcements::new(Hello {
            daemon: format!("taxel {}", env!("CARGO_PKG_VERSION")),
            ..hello
        });
        let profile = taxel_hand::Profile::default();
        let (seed, _) = ServerSeed::new(maker, limits, ProfilesConfig::default(), profile, || ())
            .map_err(anyhow::Error::msg)?;
        let handle = seed.handle();
        let serve = move || -> io::Result<()> {
            let runtime = tokio::runtime::Builder::new_current_thread()
                .enable_all()
                .build()?;
            let local = tokio::task::LocalSet::new();
            runtime.block_on(local.run_until(async {
                let listener = UnixSeqpacketListener::try_from(listening)?;
                Server::new(seed).serve(listener).await;
                Ok(())
            }))
        };
        let report = move || {
            if let Err(error) = serve() {
                eprintln!("taxel: touches are not published: {error}");
            }
        };
        std::thread::Builder::new().name("publish".into()).spawn(report)?;
        Ok(Self { handle, _path: path })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;
    use taxel_palpation::{Pca, Solver, optimal};

    /// A map of two classes on one taxel, three steps of half a millimetre.
    fn live(rest_ms: Option<f64>) -> Live {
        let touches = DMatrix::from_fn(3, 6, |step, n| {
            (step + 1) as f64 * (1.0 + (n / 3) as f64) * 10.0 + n as f64 * 0.1
        });
        let pca = Pca::fit(&touches, 1, Solver::Auto).unwrap();
        let found = optimal(&pca.project(&touches).unwrap(), 2, 1).unwrap();
        let map = MapFile {
            name: "test".into(),
            motion: Some([1.5, 0.0]),
            rest_ms,
            first: 0.5,
            step: 0.5,
            steps: 3,
            values: 1,
            labels: vec![Some("soft".into()), None],
            classifier: Classifier::new(&pca, &touches, &found).unwrap(),
        };
        Live::new(map, "away").unwrap()
    }

    #[test]
    fn a_touch_is_told_at_the_mark_that_ends_it() {
        let mut live = live(Some(100.0));
        assert!(live.handle_mark(1_000_000_000, "away").is_none());
        assert!(live.handle_mark(2_000_000_000, "touch 3").is_none());
        // Two frames a step; one while the probe moves, which is not taken.
        for (ms, value) in [
            (20, 10.0),
            (70, 10.2),
            (101, 999.0),
            (120, 20.0),
            (170, 20.2),
            (220, 30.0),
            (270, 30.2),
        ] {
            live.handle_frame(2_000_000_000 + ms * 1_000_000, std::iter::once(value));
        }
        let touch = live.handle_mark(2_300_000_000, "away").unwrap().unwrap();
        assert_eq!(
            (touch.category, touch.label.as_deref(), touch.unknown),
            (0, Some("soft"), false)
        );
        assert_eq!((touch.start_ns, touch.end_ns), (2_000_000_000, 2_270_000_000));
        assert_eq!((touch.mark.as_str(), touch.distances.len()), ("touch 3", 2));
        // Frames between touches are of none.
        live.handle_frame(2_400_000_000, std::iter::once(500.0));
        assert!(live.handle_mark(3_000_000_000, "touch 4").is_none());
    }

    #[test]
    fn a_touch_ends_where_the_next_begins_and_one_without_a_step_is_named() {
        let mut live = live(None);
        live.handle_mark(0, "a");
        for value in [20.0, 40.0, 60.0] {
            live.handle_frame(1, std::iter::once(value));
        }
        let touch = live.handle_mark(2, "b").unwrap().unwrap();
        assert_eq!((touch.category, touch.label), (1, None));
        live.handle_frame(3, std::iter::once(1.0));
        let error = live.handle_mark(4, "away").unwrap().unwrap_err().to_string();
        assert!(error.contains("touch b: no frame at depth 1;"), "{error}");
        live.handle_mark(5, "c");
        for value in [900.0, -900.0, 900.0] {
            live.handle_frame(6, std::iter::once(value));
        }
        assert!(live.handle_mark(7, "away").unwrap().unwrap().unknown);
    }

    #[test]
    fn a_map_comes_back_from_its_file_and_another_file_is_none() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("map.json");
        let live = live(None);
        let map = MapFile {
            name: "test".into(),
            motion: None,
            rest_ms: None,
            first: 0.0,
            step: 0.1,
            steps: 3,
            values: 1,
            labels: live.labels.clone(),
            classifier: live.classifier.clone(),
        };
        map.save(&path).unwrap();
        let back = MapFile::load(&path)
            .unwrap()
            .classifier
            .classify(&[1.0, 2.0, 3.0])
            .unwrap();
        assert_eq!(
            back.category,
            live.classifier.classify(&[1.0, 2.0, 3.0]).unwrap().category
        );
        let text = std::fs::read_to_string(&path).unwrap();
        for (from, to) in [
            ("\"steps\":3", "\"steps\":4"),
            ("\"labels\":[", "\"labels\":[null,"),
            ("{", "["),
        ] {
            std::fs::write(&path, text.replacen(from, to, 1)).unwrap();
            let error = format!("{:#}", MapFile::load(&path).unwrap_err());
            assert!(
                error.contains("no map as `taxel categorize --save` writes it"),
                "{error}"
            );
        }
    }
}
