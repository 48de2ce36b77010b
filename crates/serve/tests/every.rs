//! What a subscriber is promised that asks for every message, and what it costs the others: nothing.

use std::path::PathBuf;
use std::rc::Rc;
use std::sync::mpsc;
use std::time::Duration;
use taxel_hand::{Profile, TactileImage};
use taxel_serve::{
    Cost, DisplayProfile, Limits, MadeOutput, Measurement, OutputSlots, ProfileMaker, ProfilesConfig, Server,
    ServerHandle, ServerSeed,
};
use taxel_wire::{
    Clock, Encode, EncodeError, Event, EventKind, Header, Hello, HelloRate, Received, Subscribe, Subscriber,
};
use tokio_seqpacket::UnixSeqpacketListener;

const PATIENCE: Duration = Duration::from_secs(20);
/// Messages that are kept for a reader of every one at this rate.
const DEPTH: u64 = 16;

/// Images of one pixel.
struct Pixel;

impl Encode<u64> for Pixel {
    fn encode(&mut self, seq: &u64, payload: &mut Vec<u8>) -> Result<Header, EncodeError> {
        let image = TactileImage {
            seq: *seq,
            width: 1,
            height: 1,
            pixels: vec![0],
            ..TactileImage::default()
        };
        taxel_wire::encode_image_payload(&image, payload)?;
        Ok(Header::of_image(&image, payload.len()))
    }
}

struct Maker;

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
        Ok(Some((Box::new(Pixel), 64)))
    }

    fn measurement(&self, _: &DisplayProfile, _: u64) -> Result<Measurement, String> {
        Ok(Box::new(Cost::default))
    }

    fn raw(&self) -> Option<MadeOutput<u64>> {
        None
    }

    fn region(&self, _: &[String]) -> Result<Option<Vec<String>>, String> {
        Ok(None)
    }

    fn period_ns(&self) -> u64 {
        1_000_000_000
    }
}

/// What a test does with the server, on the serving thread.
struct Stage {
    server: Rc<Server<Maker>>,
    handle: ServerHandle,
    outputs: OutputSlots<u64>,
    path: PathBuf,
    made: u64,
}

impl Stage {
    fn publish(&mut self, images: u64) {
        for _ in 0..images {
            self.outputs.handle_changes();
            self.outputs.publish(self.made + 1, &self.made);
            self.made += 1;
        }
    }

    /// Lets the tasks run until something holds.
    async fn until(&mut self, what: &str, mut holds: impl FnMut(&Server<Maker>) -> bool) {
        let deadline = std::time::Instant::now() + PATIENCE;
        while !holds(&self.server) {
            assert!(std::time::Instant::now() < deadline, "still not so: {what}");
            tokio::time::sleep(Duration::from_millis(1)).await;
        }
    }
}

fn on_stage<F: Future<Output = ()>>(act: impl FnOnce(Stage) -> F) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("images.sock");
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .unwrap();
    tokio::task::LocalSet::new().block_on(&runtime, async {
        let limits = Limits {
            max_subscribers: 8,
            stall_ms: 20_000,
        };
        let profile = Profile::default();
        let (seed, outputs) =
            ServerSeed::new(Maker, limits, ProfilesConfig::default(), profile, || {}).unwrap();
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
enum Got {
    Image(u64, u32),
    Event(String),
}

/// A reader on a thread of its own, that reads as many messages as it is told to.
struct Reader {
    orders: mpsc::Sender<usize>,
    got: tokio::sync::mpsc::UnboundedReceiver<Got>,
}

impl Reader {
    fn connect(path: &std::path::Path, every: bool) -> Self {
        let (orders, ordered) = mpsc::channel();
        let (give, got) = tokio::sync::mpsc::unbounded_channel();
        let path = path.to_owned();
        std::thread::spawn(move || {
            let mut subscriber = Subscriber::connect(&path).unwrap();
            subscriber
                .subscribe(&Subscribe {
                    every,
                    ..Subscribe::default()
                })
                .unwrap();
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
        Self { orders, got }
    }

    async fn read(&mut self, messages: usize) -> Vec<Got> {
        self.orders.send(messages).unwrap();
        let mut all = Vec::new();
        for _ in 0..messages {
            all.push(self.got.recv().await.expect("the reader ended"));
        }
        all
    }
}

#[test]
fn every_message_comes_in_order_though_the_reader_was_busy() {
    on_stage(async |mut stage| {
        let mut reader = Reader::connect(&stage.path, true);
        stage
            .until("it asked for every message", |server| {
                server.roster().subscriber_status().iter().any(|s| s.every)
            })
            .await;
        stage.publish(DEPTH);
        let images = reader.read(DEPTH as usize).await;
        let expected: Vec<Got> = (0..DEPTH).map(|seq| Got::Image(seq, 0)).collect();
        assert_eq!(images, expected);
        assert_eq!(stage.server.roster().subscriber_status()[0].skipped, 0);
    });
}

#[test]
fn what_is_lost_to_a_reader_of_every_message_is_counted_and_costs_the_others_nothing() {
    on_stage(async |mut stage| {
        let mut slow = Reader::connect(&stage.path, true);
        let mut newest = Reader::connect(&stage.path, false);
        stage
            .until("both are there", |server| {
                let all = server.roster().subscriber_status();
                all.len() == 2 && all.iter().any(|s| s.every)
            })
            .await;
        // The slow reader takes nothing; its socket and its backlog fill.
        for seq in 0..2000 {
            stage.publish(1);
            assert_eq!(newest.read(1).await, [Got::Image(seq, 0)]);
        }
        stage.publish(1);
        let mut last = None;
        while last != Some(2000) {
            let got = slow.read(1).await;
            let Got::Image(seq, skipped) = got[0] else {
                panic!("{got:?}")
            };
            let before = last.map_or(-1, |last: u64| last as i64);
            assert_eq!(seq as i64, before + 1 + i64::from(skipped), "after {last:?}");
            last = Some(seq);
        }
        let status = stage.server.roster().subscriber_status();
        let slow = status.iter().find(|s| s.every).unwrap();
        assert!(slow.skipped > 0, "{slow:?}");
        assert_eq!(slow.images + slow.skipped, 2001);
        assert_eq!(stage.outputs.unpublished(), 0);
    });
}

#[test]
fn a_mark_comes_behind_the_images_made_before_it_and_before_those_made_after() {
    on_stage(async |mut stage| {
        let mut reader = Reader::connect(&stage.path, true);
        stage
            .until("it asked for every message", |server| {
                server.roster().subscriber_status().iter().any(|s| s.every)
            })
            .await;
        stage.publish(5);
        let mark = Event::new(EventKind::Mark, "touch 3");
        stage.handle.announce_at(&mark, 4, 4_500);
        stage.publish(5);
        let expected: Vec<Got> = (0..5)
            .map(|seq| Got::Image(seq, 0))
            .chain([Got::Event("touch 3".into())])
            .chain((5..10).map(|seq| Got::Image(seq, 0)))
            .collect();
        assert_eq!(reader.read(11).await, expected);
    });
}

#[test]
fn another_thread_sees_who_is_connected_and_tells_them_something() {
    on_stage(async |mut stage| {
        let mut reader = Reader::connect(&stage.path, false);
        stage
            .until("somebody is there", |server| server.roster().subscribers() == 1)
            .await;
        let handle = stage.handle.clone();
        let roster = std::thread::spawn(move || {
            let mut runtime = tokio::runtime::Builder::new_current_thread();
            let roster = runtime.build().unwrap().block_on(handle.roster()).unwrap();
            handle.announce(Event::new(EventKind::Notice, "seen"));
            roster
        });
        assert_eq!(reader.read(1).await, [Got::Event("seen".into())]);
        let roster = roster.join().unwrap();
        assert_eq!(roster.subscriber_status()[0].images, 0);
        stage.publish(1);
        assert_eq!(reader.read(1).await, [Got::Image(0, 0)]);
        // The counts go on, though nobody asked the serving thread again.
        stage
            .until("it is counted", |_| roster.subscriber_status()[0].images == 1)
            .await;
    });
}
