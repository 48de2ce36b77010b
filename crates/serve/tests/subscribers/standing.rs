//! What lasts is told to whoever comes while it does.

use crate::stage::{PATIENCE, on_stage};
use std::path::PathBuf;
use taxel_wire::{Event, EventKind, Received, Subscribe, Subscriber};

/// The events between the first HELLO and the one that answers a subscription.
async fn told(path: PathBuf) -> Vec<EventKind> {
    let client = tokio::task::spawn_blocking(move || {
        let mut subscriber = Subscriber::connect(&path).unwrap();
        subscriber.subscribe(&Subscribe::default()).unwrap();
        let (mut hellos, mut told) = (0, Vec::new());
        while hellos < 2 {
            match subscriber.next_timeout(PATIENCE).unwrap() {
                Some(Received::Hello(_)) => hellos += 1,
                Some(Received::Event(_, event)) => told.push(event.event),
                other => panic!("{other:?}"),
            }
        }
        told
    });
    client.await.unwrap()
}

#[test]
fn who_comes_while_something_lasts_is_told_of_it() {
    on_stage(async |stage| {
        assert_eq!(told(stage.path.clone()).await, []);
        let paused = Event::new(EventKind::Paused, "paused");
        stage.handle.set_standing(Some(paused));
        for _ in 0..2 {
            assert_eq!(told(stage.path.clone()).await, [EventKind::Paused]);
        }
        stage.handle.set_standing(None);
        assert_eq!(told(stage.path.clone()).await, []);
    });
}
