//! The thread that reads the buses.

use super::{Message, Shared};
use crate::can_block::CanBlock;
use crate::schema::Topic;
use std::sync::atomic::Ordering;
use std::sync::mpsc::SyncSender;
use std::thread;
use std::time::Duration;
use taxel_can::{CanSource, FrameMerge, monotonic_ns};

/// How long the buses are left alone: the smallest queue of a kernel holds the frames of a full bus for three times as long.
const CAN_PAUSE: Duration = Duration::from_millis(10);
/// Frames taken from a bus at once.
const CAN_BATCH: usize = 1024;
/// How long frames are collected for one message, nanoseconds.
const CAN_BLOCK_NS: u64 = 100_000_000;

/// Reads the buses until it is over.
pub(super) fn read_can(
    mut sources: Vec<Box<dyn CanSource>>,
    names: &[String],
    queue: &SyncSender<Message>,
    shared: &Shared<'_>,
) {
    let mut merge = FrameMerge::new(sources.len(), CAN_BATCH, true);
    let mut block = CanBlock::default();
    let mut lost = vec![0; sources.len()];
    while !shared.is_over() {
        thread::sleep(CAN_PAUSE);
        let now_ns = monotonic_ns();
        loop {
            for (bus, source) in sources.iter_mut().enumerate() {
                merge.fill(bus, now_ns, |frames| source.receive(now_ns, frames));
            }
            let mut any = false;
            while let Some((bus, received)) = merge.pop() {
                any = true;
                shared.can_frames[usize::from(bus)].fetch_add(1, Ordering::Relaxed);
                if !block.push(bus, &received) {
                    hand_over_can(&mut block, names, &lost, queue, shared);
                    block.push(bus, &received);
                }
            }
            if !any {
                break;
            }
        }
        for (lost, source) in lost.iter_mut().zip(&sources) {
            *lost = source.counters().lost_in_kernel;
        }
        shared.can_lost.store(lost.iter().sum(), Ordering::Relaxed);
        if !block.is_empty() && now_ns.saturating_sub(block.start_ns()) >= CAN_BLOCK_NS {
            hand_over_can(&mut block, names, &lost, queue, shared);
        }
    }
    if !block.is_empty() {
        hand_over_can(&mut block, names, &lost, queue, shared);
    }
}

fn hand_over_can(
    block: &mut CanBlock,
    names: &[String],
    lost: &[u64],
    queue: &SyncSender<Message>,
    shared: &Shared<'_>,
) {
    let wall_ns = shared.wall.at(block.start_ns());
    shared.entry(queue, Topic::Can, wall_ns, block.take(names, lost));
}
