//! What readers cost the thread that makes their messages.

use crate::stage::{PATIENCE, Stage, on_stage};
use std::path::Path;
use std::sync::mpsc;
use std::time::{Duration, Instant};
use taxel_wire::{Received, Subscribe, Subscriber};

/// All of them together are more than tokio has room for from the start where another thread wakes them.
const OF_EACH_KIND: usize = 40;

#[global_allocator]
static ALLOCATOR: taxel_allocations::Counting = taxel_allocations::Counting;

/// Reads up to something, while the server's tasks run.
async fn read_up_to(subscriber: &mut Subscriber, is_it: impl Fn(Received) -> bool) {
    let deadline = Instant::now() + PATIENCE;
    while !subscriber
        .next_timeout(Duration::ZERO)
        .unwrap()
        .is_some_and(&is_it)
    {
        assert!(Instant::now() < deadline, "it did not come");
        tokio::task::yield_now().await;
    }
}

async fn connect(path: &Path, wants: &Subscribe) -> Subscriber {
    let mut subscriber = Subscriber::connect(path).unwrap();
    subscriber.subscribe(wants).unwrap();
    for _ in ["to whoever comes", "to the subscription"] {
        read_up_to(&mut subscriber, |received| matches!(received, Received::Hello(_))).await;
    }
    subscriber
}

#[test]
fn a_message_costs_who_makes_it_no_memory_however_many_wait_for_it_and_in_whatever_way() {
    on_stage(async |stage| {
        let Stage {
            mut outputs,
            path,
            server: _server,
            ..
        } = stage;
        let (ticks, made) = mpsc::channel::<u64>();
        let (count, allocations) = mpsc::channel();
        let begin = Instant::now();
        std::thread::spawn(move || {
            for tick in made {
                outputs.handle_changes();
                // So far apart that none is passed over for the sake of a highest rate.
                let due = begin + Duration::from_secs(tick);
                let ((), allocated) = taxel_allocations::during(|| outputs.publish(tick, due, &tick));
                count.send(allocated).unwrap();
            }
        });
        // No task of the server runs meanwhile, so that every wake-up waits.
        let make = |tick| {
            ticks.send(tick).unwrap();
            allocations.recv().unwrap()
        };
        let default = Subscribe::default();
        let kinds = [
            default.clone(),
            Subscribe {
                max_rate_hz: Some(30.0),
                ..default.clone()
            },
            Subscribe {
                raw: true,
                ..default.clone()
            },
            Subscribe {
                every: true,
                ..default
            },
        ];
        let mut readers = Vec::new();
        // With one of each kind, whatever a thread makes only once is made.
        for (of_each_kind, first) in [(1, 1), (OF_EACH_KIND, 4)] {
            for wants in &kinds {
                for _ in 0..of_each_kind {
                    readers.push(connect(&path, wants).await);
                }
            }
            for tick in first..first + 3 {
                let allocated = make(tick);
                assert!(of_each_kind == 1 || allocated == 0, "{allocated} at tick {tick}");
                for reader in &mut readers {
                    read_up_to(
                        reader,
                        |received| matches!(received, Received::Image(header, _) if header.seq == tick),
                    )
                    .await;
                }
            }
        }
    });
}
