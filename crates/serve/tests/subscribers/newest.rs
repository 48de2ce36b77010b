//! What a subscriber is promised that is sent the newest image, whatever others do and whatever it asks for.

use crate::stage::{Got, Maker, PATIENCE, Reader, on_stage};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};
use taxel_hand::Profile;
use taxel_serve::Server;
use taxel_wire::{Hello, Received, Subscribe, Subscriber, Subscription};
use tokio_seqpacket::UnixSeqpacketListener;

#[test]
fn a_reader_that_takes_nothing_costs_the_others_no_image() {
    on_stage(async |mut stage| {
        let _idle: Vec<Subscriber> = (0..5)
            .map(|_| Subscriber::connect(&stage.path).unwrap())
            .collect();
        let mut reader = Reader::connect(&stage.path, Subscribe::default()).await;
        stage
            .until("all are there", |server| server.roster().subscribers() == 6)
            .await;
        for seq in 0..200 {
            stage.publish(1);
            assert_eq!(reader.read(1).await, [Got::Image(seq, 0)]);
        }
        let roster = stage.server.roster();
        let images: Vec<u64> = roster.subscriber_status().iter().map(|s| s.images).collect();
        assert_eq!(
            images.iter().filter(|images| **images == 200).count(),
            1,
            "{images:?}"
        );
        assert!(
            images.iter().all(|images| *images == 200 || *images < 50),
            "{images:?}"
        );
        let sent = roster.sent_status();
        assert_eq!(sent.subscribers, 6);
        assert_eq!(sent.images, images.iter().sum::<u64>());
        assert!(
            sent.age_us.max > 0.0 && sent.age_us.p50 <= sent.age_us.max,
            "{sent:?}"
        );
    });
}

#[test]
fn what_a_reader_that_takes_nothing_is_not_sent_is_counted_while_it_is_there_and_when_it_is_gone() {
    on_stage(async |mut stage| {
        let idle = Subscriber::connect(&stage.path).unwrap();
        let mut reader = Reader::connect(&stage.path, Subscribe::default()).await;
        stage
            .until("both are there", |server| server.roster().subscribers() == 2)
            .await;
        let mut before = 0;
        for seq in 0..200 {
            stage.publish(1);
            // The newest may still be sent to both.
            let skipped = stage.server.roster().sent_status().skipped;
            assert!(skipped >= before, "{skipped} after {before}");
            before = skipped;
            assert_eq!(reader.read(1).await, [Got::Image(seq, 0)]);
        }
        let roster = stage.server.roster();
        let (mut each, sent) = (roster.subscriber_status(), roster.sent_status());
        each.sort_by_key(|status| status.images);
        assert_eq!((each[1].images, each[1].skipped), (200, 0));
        assert_eq!(each[0].images + each[0].skipped, 199);
        assert_eq!(sent.skipped, each[0].skipped);
        assert!(each[0].longest_gap_ms > 0.0 && sent.longest_gap_ms >= each[0].longest_gap_ms);
        drop(idle);
        stage
            .until("it is gone", |server| server.roster().subscribers() == 1)
            .await;
        let gone = stage.server.roster().sent_status();
        assert_eq!((gone.images, gone.images + gone.skipped), (sent.images, 400));
        assert!(gone.longest_gap_ms >= sent.longest_gap_ms);
    });
}

#[test]
fn nothing_is_counted_as_skipped_that_was_made_before_it_was_asked_for_or_not_asked_for() {
    on_stage(async |mut stage| {
        stage.publish(50);
        let stated = Subscribe {
            profile: Some(Profile {
                levels: 3,
                ..Profile::default()
            }),
            ..Subscribe::default()
        };
        let none = Subscribe {
            image: false,
            ..Subscribe::default()
        };
        // One whose images come from a stream of their own, that of whoever states none, and one that is sent none.
        let mut readers = Vec::new();
        for wants in [stated, Subscribe::default(), none] {
            readers.push(Reader::connect(&stage.path, wants).await);
        }
        for seq in 50..60 {
            stage.publish(1);
            for reader in &mut readers[..2] {
                assert_eq!(reader.read(1).await, [Got::Image(seq, 0)]);
            }
        }
        drop(readers);
        let skipped = |server: &Server<Maker>| server.roster().sent_status().skipped;
        assert_eq!(skipped(&stage.server), 0);
        stage
            .until("all are gone", |server| server.roster().subscribers() == 0)
            .await;
        assert_eq!(skipped(&stage.server), 0);
        assert_eq!(stage.server.roster().sent_status().images, 20);
    });
}

#[test]
fn the_first_image_says_how_many_were_skipped_since_it_asked_and_none_of_before() {
    on_stage(async |mut stage| {
        stage.publish(50);
        let mut reader = Reader::connect(&stage.path, Subscribe::default()).await;
        // The server has no time for what is made.
        stage.publish(5);
        assert_eq!(reader.read(1).await, [Got::Image(54, 4)]);
        assert_eq!(stage.server.roster().sent_status().skipped, 4);
    });
}

#[test]
fn nothing_is_counted_as_skipped_to_who_begins_before_a_new_profile_has_an_image() {
    async fn state(mut subscriber: Subscriber, wants: Subscribe) -> Subscriber {
        let stated = move || {
            subscriber.subscribe(&wants).unwrap();
            for _ in [
                "to whoever comes, or to whom the profile changes",
                "to the subscription",
            ] {
                answer(&mut subscriber, &mut None);
            }
            subscriber
        };
        tokio::task::spawn_blocking(stated).await.unwrap()
    }
    let none = Subscribe {
        image: false,
        ..Subscribe::default()
    };
    let raw = Subscribe {
        raw: true,
        ..none.clone()
    };
    for (what, before, wants) in [
        ("comes then", None, Subscribe::default()),
        ("asks for images then", Some(none.clone()), Subscribe::default()),
        ("asks for raw frames then", Some(none), raw),
    ] {
        on_stage(async |mut stage| {
            stage.publish(50);
            let connect = || Subscriber::connect(&stage.path).unwrap();
            let early = match before {
                Some(before) => Some(state(connect(), before).await),
                None => None,
            };
            let profile = Profile {
                levels: 6,
                ..Profile::default()
            };
            stage.handle.set_own_profile(profile).await.unwrap();
            let _subscriber = state(early.unwrap_or_else(connect), wants).await;
            stage.publish(1);
            let status = |server: &Server<Maker>| server.roster().subscriber_status().remove(0);
            stage
                .until("it is sent one", |server| {
                    status(server).images + status(server).raw_frames == 1
                })
                .await;
            let status = status(&stage.server);
            assert_eq!((status.skipped, status.raw_skipped), (0, 0), "{what}");
        });
    }
}

#[test]
fn who_is_in_stays_when_others_are_let_in_at_another_socket() {
    on_stage(async |mut stage| {
        let mut early = Reader::connect(&stage.path, Subscribe::default()).await;
        std::fs::remove_file(&stage.path).unwrap();
        let anew = UnixSeqpacketListener::bind(&stage.path).unwrap();
        stage.handle.listen(anew.into()).await.unwrap();
        let mut late = Reader::connect(&stage.path, Subscribe::default()).await;
        stage.publish(1);
        for reader in [&mut early, &mut late] {
            assert_eq!(reader.read(1).await, [Got::Image(0, 0)]);
        }
    });
}

#[test]
fn who_asks_for_the_roster_without_end_costs_no_image() {
    on_stage(async |mut stage| {
        let mut reader = Reader::connect(&stage.path, Subscribe::default()).await;
        stage
            .until("it is there", |server| server.roster().subscribers() == 1)
            .await;
        let (is_over, answers) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicU64::new(0)));
        let asker = {
            let (handle, is_over, answers) = (stage.handle.clone(), is_over.clone(), answers.clone());
            std::thread::spawn(move || {
                let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
                let ask = async || {
                    while !is_over.load(Ordering::Relaxed) && handle.roster().await.is_some() {
                        answers.fetch_add(1, Ordering::Relaxed);
                    }
                };
                // More than there is room for at once.
                let all = async || tokio::join!(ask(), ask(), ask(), ask(), ask(), ask(), ask(), ask());
                runtime.block_on(async { tokio::join!(all(), all(), all()) });
            })
        };
        stage
            .until("they ask", |_| answers.load(Ordering::Relaxed) > 100)
            .await;
        for seq in 0..200 {
            stage.publish(1);
            // Every task that has something to do has its turn, however much the others have.
            for _ in 0..3 {
                tokio::task::yield_now().await;
            }
            assert_eq!(stage.server.roster().sent_status().images, seq + 1);
            assert_eq!(reader.read(1).await, [Got::Image(seq, 0)]);
        }
        is_over.store(true, Ordering::Relaxed);
        stage.until("the last answer", |_| asker.is_finished()).await;
    });
}

#[test]
fn a_reader_that_was_busy_gets_the_newest_and_the_count_of_those_before() {
    on_stage(async |mut stage| {
        let mut reader = Reader::connect(&stage.path, Subscribe::default()).await;
        stage
            .until("it is there", |server| server.roster().subscribers() == 1)
            .await;
        for _ in 0..500 {
            stage.publish(1);
            tokio::task::yield_now().await;
        }
        let mut next = 0;
        while next < 500 {
            let got = reader.read(1).await;
            let Got::Image(seq, skipped) = got[0] else {
                panic!("{got:?}")
            };
            assert_eq!(seq, next + u64::from(skipped));
            next = seq + 1;
        }
        let status = stage.server.roster().subscriber_status();
        assert_eq!(status[0].images + status[0].skipped, 500);
        assert!(status[0].skipped > 0, "{status:?}");
    });
}

#[test]
fn who_asks_for_fewer_images_is_sent_each_when_it_is_made_or_not_at_all() {
    on_stage(async |mut stage| {
        let wants = Subscribe {
            max_rate_hz: Some(20.0),
            ..Subscribe::default()
        };
        let mut reader = Reader::connect(&stage.path, wants).await;
        stage
            .until("it is there", |server| server.roster().subscribers() == 1)
            .await;
        let begin = Instant::now();
        let mut got = Vec::new();
        for tick in 0..30 {
            stage.publish_due(begin + tick * Duration::from_secs(1) / 30);
            for _ in 0..3 {
                tokio::task::yield_now().await;
            }
            let sent = stage.server.roster().sent_status().images as usize;
            if sent > got.len() {
                got.extend(reader.read(1).await);
            }
        }
        let wanted = (0..30).filter(|tick| tick % 3 != 1);
        let wanted: Vec<Got> = wanted
            .map(|tick| Got::Image(tick, u32::from(tick % 3 == 2)))
            .collect();
        assert_eq!(got, wanted);
        // What it did not want is not what it was too slow for.
        let (sent, status) = (
            stage.server.roster().sent_status(),
            stage.server.roster().subscriber_status(),
        );
        for (images, skipped, paced) in [
            (sent.images, sent.skipped, sent.paced),
            (status[0].images, status[0].skipped, status[0].paced),
        ] {
            assert_eq!((images, skipped, paced), (20, 0, 10));
        }
    });
}

/// Reads up to the answer to a subscription. Images on the way must follow each other.
fn answer(subscriber: &mut Subscriber, last: &mut Option<u64>) -> Hello {
    loop {
        match subscriber.next_timeout(PATIENCE).unwrap().expect("an answer") {
            Received::Hello(hello) => return hello.clone(),
            Received::Image(header, _) => {
                let before = last.replace(header.seq);
                let expected = before.map_or(header.seq, |before| before + 1 + u64::from(header.skipped));
                assert_eq!(header.seq, expected, "after {before:?}");
            }
            _ => {}
        }
    }
}

#[test]
fn every_subscription_is_answered_with_what_is_in_force_and_numbers_go_on_across_all_of_them() {
    on_stage(async |mut stage| {
        let profile = |levels| {
            Some(Profile {
                levels,
                ..Profile::default()
            })
        };
        let all = Subscribe::default;
        let wants = [
            all(),
            Subscribe { every: true, ..all() },
            Subscribe {
                image: false,
                status: true,
                ..all()
            },
            Subscribe {
                max_rate_hz: Some(1000.0),
                ..all()
            },
            Subscribe {
                profile: profile(3),
                ..all()
            },
            Subscribe {
                profile: profile(3),
                image: false,
                ..all()
            },
            Subscribe {
                profile: profile(5),
                every: true,
                ..all()
            },
            all(),
        ];
        let path = stage.path.clone();
        let told = wants.clone();
        let (give, mut asked) = tokio::sync::mpsc::unbounded_channel();
        let reader = std::thread::spawn(move || {
            let mut subscriber = Subscriber::connect(&path).unwrap();
            let mut last = None;
            let hello = answer(&mut subscriber, &mut last);
            assert_eq!(hello.subscription, Some(Subscription::default()));
            for (round, wants) in told.iter().cycle().take(5 * told.len()).enumerate() {
                subscriber.subscribe(wants).unwrap();
                let hello = answer(&mut subscriber, &mut last);
                assert_eq!(
                    hello.subscription,
                    Some(Subscription::from(wants)),
                    "round {round}"
                );
                let levels = wants.profile.as_ref().unwrap_or(&Profile::default()).levels;
                assert_eq!(hello.profile.levels, levels, "round {round}");
                // Some images pass, which are read before the next answer.
                give.send(()).unwrap();
            }
        });
        let mut rounds = 0;
        while rounds < 5 * wants.len() {
            stage.publish(1);
            tokio::task::yield_now().await;
            while asked.try_recv().is_ok() {
                rounds += 1;
            }
            tokio::time::sleep(std::time::Duration::from_micros(300)).await;
        }
        reader.join().unwrap();
    });
}

#[test]
fn the_longest_subscriptions_of_all_clients_together_are_looked_at_at_one_pace() {
    /// What is looked at in a second, and what each costs beside its bytes (docs/wire.md).
    const BYTES_PER_SECOND: f64 = (2 << 20) as f64;
    const ANSWER: usize = 4096;
    const CLIENTS: usize = 8;
    const EACH: usize = 5;
    on_stage(async |mut stage| {
        let wants = Subscribe {
            region: Some(vec!["index".into(); 4000]),
            ..Subscribe::default()
        };
        let bytes = CLIENTS * EACH * (wants.to_packet().len() + ANSWER);
        let begin = Instant::now();
        let clients: Vec<_> = (0..CLIENTS)
            .map(|_| {
                let (path, wants) = (stage.path.clone(), wants.clone());
                std::thread::spawn(move || {
                    let mut subscriber = Subscriber::connect(&path).unwrap();
                    answer(&mut subscriber, &mut None);
                    for _ in 0..EACH {
                        subscriber.subscribe(&wants).unwrap();
                        answer(&mut subscriber, &mut None);
                    }
                })
            })
            .collect();
        stage
            .until("each is answered", |_| {
                clients.iter().all(|client| client.is_finished())
            })
            .await;
        for client in clients {
            client.join().unwrap();
        }
        // But for what is looked at at once after a pause.
        let least = Duration::from_secs_f64(bytes as f64 / BYTES_PER_SECOND) - Duration::from_millis(100);
        assert!(begin.elapsed() >= least, "{:?}", begin.elapsed());
    });
}
