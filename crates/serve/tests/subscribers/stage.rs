//! A server on the test's own thread, whose images the test makes, and readers on threads of their own.

use std::path::PathBuf;
use std::rc::Rc;
use std::sync::mpsc;
use std::time::{Duration, Instant};
use taxel_hand::{ForceFrame, Profile, TactileFrame, TactileImage};
use taxel_serve::{
    Cost, DisplayProfile, Limits, MadeOutput, Measurement, OutputSlots, ProfileMaker, ProfilesConfig, Server,
    ServerHandle, ServerSeed,
};
use taxel_wire::{Clock, Encode, EncodeError, Header, Hello, HelloRate, Received, Subscribe, Subscriber};
use tokio_seqpacket::UnixSeqpacketListener;

pub(crate) const PATIENCE: Duration = Duration::from_secs(200);
/// Messages that are kept for a reader of every one at this rate.
pub(crate) const DEPTH: u64 = 16;

/// Images of one pixel.
struct Pixel(TactileImage);

impl Encode<u64> for Pixel {
    fn encode(&mut self, seq: &u64, payload: &mut Vec<u8>) -> Result<Header, EncodeError> {
        self.0.seq = *seq;
        taxel_wire::encode_image_payload(&self.0, payload)?;
        Ok(Header::of_image(&self.0, payload.len()))
    }
}

/// Frames of no taxel.
struct Raw;

impl Encode<u64> for Raw {
    fn encode(&mut self, seq: &u64, payload: &mut Vec<u8>) -> Result<Header, EncodeError> {
        let frame = TactileFrame {
            seq: *seq,
            ..TactileFrame::default()
        };
        let force = ForceFrame::new(0);
        taxel_wire::encode_raw_payload(&frame, &force, None, payload)?;
        Ok(Header::of_frame(&frame, &force, payload.len()))
    }
}

pub(crate) struct Maker;

impl ProfileMaker for Maker {
    type Frames = u64;

    fn hello(&self, wanted: &DisplayProfile) -> Hello {
        let hand = taxel_hand::Geometry::grid(1, 1).unwrap();
        let rate = HelloRate {
            mode: "timer".into(),
            hz: None,
        };
        Hello::new("test", &hand, &wanted.profile, rate, Clock::Recording)
    }

    fn output(&self, _: &DisplayProfile) -> Result<Option<MadeOutput<u64>>, String> {
        let image = TactileImage {
            width: 1,
            height: 1,
            pixels: vec![0],
            ..TactileImage::default()
        };
        Ok(Some((Box::new(Pixel(image)), 64)))
    }

    fn measurement(&self, _: &DisplayProfile, _: u64) -> Result<Measurement, String> {
        Ok(Box::new(Cost::default))
    }

    fn raw(&self) -> Option<MadeOutput<u64>> {
        Some((Box::new(Raw), 64))
    }

    fn region(&self, _: &[String]) -> Result<Option<Vec<String>>, String> {
        Ok(None)
    }

    fn period_ns(&self) -> u64 {
        1_000_000_000
    }
}

/// What a test does with the server, on the serving thread.
pub(crate) struct Stage {
    pub(crate) server: Rc<Server<Maker>>,
    pub(crate) handle: ServerHandle,
    pub(crate) outputs: OutputSlots<u64>,
    pub(crate) path: PathBuf,
    made: u64,
}

impl Stage {
    pub(crate) fn publish(&mut self, images: u64) {
        for _ in 0..images {
            self.publish_due(Instant::now());
        }
    }

    /// Publishes an image that was due then.
    pub(crate) fn publish_due(&mut self, due: Instant) {
        self.outputs.handle_changes();
        self.outputs.publish(self.made + 1, due, &self.made);
        self.made += 1;
    }

    /// Lets the tasks run until something holds.
    pub(crate) async fn until(&mut self, what: &str, mut holds: impl FnMut(&Server<Maker>) -> bool) {
        let deadline = Instant::now() + PATIENCE;
        while !holds(&self.server) {
            assert!(Instant::now() < deadline, "still not so: {what}");
            tokio::time::sleep(Duration::from_millis(1)).await;
        }
    }
}

pub(crate) fn on_stage<F: Future<Output = ()>>(act: impl FnOnce(Stage) -> F) {
    on_stage_for(200, ProfilesConfig::default(), act);
}

/// A stage for this many subscribers, with these profiles.
pub(crate) fn on_stage_for<F: Future<Output = ()>>(
    max_subscribers: usize,
    profiles: ProfilesConfig,
    act: impl FnOnce(Stage) -> F,
) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("images.sock");
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .unwrap();
    tokio::task::LocalSet::new().block_on(&runtime, async {
        let limits = Limits {
            max_subscribers,
            stall_ms: 20_000,
        };
        let profile = Profile::default();
        let (seed, outputs) = ServerSeed::new(Maker, limits, profiles, profile, || {}).unwrap();
        let handle = seed.handle();
        let server = Server::new(seed);
        let listener = UnixSeqpacketListener::bind(&path).unwrap();
        tokio::task::spawn_local(server.clone().serve(listener));
        let stage = Stage {
            server,
            handle,
            outputs,
            path,
            made: 0,
        };
        act(stage).await;
    });
}

/// What a reader got: an image's number and how many were skipped before it, or the text of an event.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Got {
    Image(u64, u32),
    Event(String),
}

/// A reader on a thread of its own, that reads as many messages as it is told to.
pub(crate) struct Reader {
    orders: mpsc::Sender<usize>,
    got: tokio::sync::mpsc::UnboundedReceiver<Got>,
}

impl Reader {
    /// It has read what comes before the first image.
    pub(crate) async fn connect(path: &std::path::Path, wants: Subscribe) -> Self {
        let (orders, ordered) = mpsc::channel();
        let (welcome, welcomed) = tokio::sync::oneshot::channel();
        let (give, got) = tokio::sync::mpsc::unbounded_channel();
        let path = path.to_owned();
        std::thread::spawn(move || {
            let mut subscriber = Subscriber::connect(&path).unwrap();
            subscriber.subscribe(&wants).unwrap();
            for _ in ["to whoever comes", "to the subscription"] {
                while !matches!(
                    subscriber.next_timeout(PATIENCE).unwrap(),
                    Some(Received::Hello(_))
                ) {}
            }
            welcome.send(()).unwrap();
            for messages in ordered {
                let mut left: usize = messages;
                while left > 0 {
                    let got = match subscriber.next_timeout(PATIENCE) {
                        Ok(Some(Received::Image(header, _))) => Got::Image(header.seq, header.skipped),
                        Ok(Some(Received::Event(_, event))) => Got::Event(event.message),
                        Ok(Some(_)) => continue,
                        other => panic!("{other:?}"),
                    };
                    left -= 1;
                    give.send(got).unwrap();
                }
            }
        });
        welcomed.await.unwrap();
        Self { orders, got }
    }

    pub(crate) async fn read(&mut self, messages: usize) -> Vec<Got> {
        self.orders.send(messages).unwrap();
        let mut all = Vec::new();
        for _ in 0..messages {
            all.push(self.got.recv().await.expect("the reader ended"));
        }
        all
    }
}
