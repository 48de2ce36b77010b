//! What a subscriber is promised that asks for every message, and what it costs the others: nothing.

use crate::stage::{DEPTH, Got, Reader, on_stage};
use taxel_wire::{Event, EventKind, Subscribe};

fn every() -> Subscribe {
    Subscribe {
        every: true,
        ..Subscribe::default()
    }
}

#[test]
fn every_message_comes_in_order_though_the_reader_was_busy() {
    on_stage(async |mut stage| {
        let mut reader = Reader::connect(&stage.path, every()).await;
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
        let mut slow = Reader::connect(&stage.path, every()).await;
        let mut newest = Reader::connect(&stage.path, Subscribe::default()).await;
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
        // What was lost is counted though nothing was read yet, and what is kept is not.
        let status = stage.server.roster().subscriber_status();
        let counted = status.iter().find(|s| s.every).map(|s| s.images + s.skipped);
        assert_eq!(counted, Some(2001 - DEPTH));
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
        let mut reader = Reader::connect(&stage.path, every()).await;
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
        let mut reader = Reader::connect(&stage.path, Subscribe::default()).await;
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
