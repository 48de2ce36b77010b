//! The thread that reads the buses.

use super::{CanInput, LOOK, LiveError, Message, Shared};
use crate::can_block::CanBlock;
use crate::schema::Topic;
use std::sync::PoisonError;
use std::sync::atomic::Ordering;
use std::sync::mpsc::SyncSender;
use std::thread;
use std::time::Duration;
use taxel_can::{CanSource, FrameMerge, Received, SourceOptions, monotonic_ns};

/// How long the buses are left alone: the smallest queue of a kernel holds the frames of a full bus for three times as long.
const CAN_PAUSE: Duration = Duration::from_millis(10);
/// Frames taken from a bus at once.
const CAN_BATCH: usize = 1024;
/// How long frames are collected for one message, nanoseconds.
const CAN_BLOCK_NS: u64 = 100_000_000;

/// Buses that are open.
pub(super) struct Buses {
    inputs: Vec<CanInput>,
    sources: Vec<Box<dyn CanSource>>,
}

impl Buses {
    pub(super) fn open(inputs: &[CanInput]) -> Result<Self, LiveError> {
        let open = |input: &CanInput| {
            let opened = taxel_can::open(&input.address, &SourceOptions::default());
            opened.map_err(|source| LiveError::Bus {
                name: input.name.clone(),
                source,
            })
        };
        Ok(Self {
            sources: inputs.iter().map(open).collect::<Result<_, _>>()?,
            inputs: inputs.to_vec(),
        })
    }
}

/// Reads these buses until it is over, or others from when [`Shared::other_buses`] has them.
pub(super) fn read_can(mut buses: Buses, queue: &SyncSender<Message>, shared: &Shared<'_>) {
    while let Some(others) = read_buses(buses, queue, shared) {
        buses = others;
    }
}

/// Reads these buses until it is over, or others are to be read.
fn read_buses(buses: Buses, queue: &SyncSender<Message>, shared: &Shared<'_>) -> Option<Buses> {
    let Buses { inputs, mut sources } = buses;
    let mut merge = FrameMerge::new(sources.len(), CAN_BATCH, true);
    let mut blocks = Blocks::new(&inputs, queue, shared);
    shared.count_can(&inputs, &vec![0; inputs.len()]);
    let pause = if sources.is_empty() { LOOK } else { CAN_PAUSE };
    let lost_before = shared.can_lost.load(Ordering::Relaxed);
    let mut others = None;
    while !shared.is_over() && others.is_none() {
        thread::sleep(pause);
        let other_buses = shared.other_buses.lock();
        others = other_buses.unwrap_or_else(PoisonError::into_inner).take();
        let now_ns = monotonic_ns();
        loop {
            for (bus, source) in sources.iter_mut().enumerate() {
                merge.fill(bus, now_ns, |frames| source.receive(now_ns, frames));
            }
            let mut any = false;
            // What came since waits for what another bus has of before; there is time.
            while let Some((bus, received)) = merge.pop_until(now_ns) {
                any = true;
                blocks.push(bus, &received);
            }
            if !any {
                break;
            }
        }
        for (lost, source) in blocks.lost_in_kernel.iter_mut().zip(&sources) {
            *lost = source.counters().lost_in_kernel;
        }
        let lost: u64 = blocks.lost_in_kernel.iter().sum();
        shared.can_lost.store(lost_before + lost, Ordering::Relaxed);
        if now_ns.saturating_sub(blocks.block.start_ns()) >= CAN_BLOCK_NS {
            blocks.hand_over();
        }
    }
    while let Some((bus, received)) = merge.pop() {
        blocks.push(bus, &received);
    }
    blocks.hand_over();
    others
}

/// Frames on their way to the writer.
struct Blocks<'a> {
    block: CanBlock,
    inputs: &'a [CanInput],
    names: Vec<String>,
    /// By bus.
    lost_in_kernel: Vec<u64>,
    /// By bus, frames of blocks that found no room in the queue.
    unwritten: Vec<u64>,
    queue: &'a SyncSender<Message>,
    shared: &'a Shared<'a>,
}

impl<'a> Blocks<'a> {
    fn new(inputs: &'a [CanInput], queue: &'a SyncSender<Message>, shared: &'a Shared<'a>) -> Self {
        Self {
            block: CanBlock::default(),
            inputs,
            names: inputs.iter().map(|input| input.name.clone()).collect(),
            lost_in_kernel: vec![0; inputs.len()],
            unwritten: vec![0; inputs.len()],
            queue,
            shared,
        }
    }

    fn push(&mut self, bus: u8, received: &Received) {
        if !self.block.push(bus, received) {
            self.hand_over();
            self.block.push(bus, received);
        }
    }

    /// Hands over what there is. Where that finds no room, the next block tells.
    fn hand_over(&mut self) {
        if self.block.is_empty() {
            return;
        }
        let wall_ns = self.shared.wall.at(self.block.start_ns());
        let frames = self.block.frames_of(self.names.len());
        self.shared.count_can(self.inputs, &frames);
        let lost: Vec<u64> = std::iter::zip(&self.lost_in_kernel, &self.unwritten)
            .map(|(kernel, unwritten)| kernel + unwritten)
            .collect();
        let data = self.block.take(&self.names, &lost);
        if !self.shared.entry(self.queue, Topic::Can, wall_ns, data) {
            std::iter::zip(&mut self.unwritten, frames).for_each(|(unwritten, frames)| *unwritten += frames);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::can_block::CanFrames;
    use crate::live::Signals;
    use crate::live::wall::Wall;
    use std::sync::mpsc::sync_channel;
    use taxel_can::CanFrame;

    #[test]
    fn frames_that_find_no_room_are_lost_to_who_reads_the_recording() {
        let signals = Signals {
            stop: &|| false,
            trigger: &|| false,
            say: &|_, _| {},
            described: &|_| None,
        };
        let shared = Shared::new(&signals, Wall::now());
        let (queue, messages) = sync_channel(1);
        let inputs = ["can0", "can1"].map(|name| CanInput {
            name: name.into(),
            address: "udp:".parse().unwrap(),
        });
        let mut blocks = Blocks::new(&inputs, &queue, &shared);
        blocks.lost_in_kernel[0] = 5;
        let frame = CanFrame::standard(1, &[]).unwrap();
        let mut hand_over = |buses: &[u8]| {
            buses
                .iter()
                .for_each(|bus| blocks.push(*bus, &Received { t_ns: 1, frame }));
            blocks.hand_over();
        };
        let told = || match messages.try_recv().unwrap() {
            Message::Entry(entry) => CanFrames::read(&entry.data).unwrap().lost,
            _ => panic!("no frames"),
        };
        hand_over(&[0]);
        // The disk is slow.
        hand_over(&[1, 1, 0]);
        hand_over(&[1]);
        assert_eq!(told(), [5, 0]);
        hand_over(&[0]);
        assert_eq!(told(), [6, 3]);
        let read = shared.can.into_inner().unwrap();
        let frames: Vec<u64> = read.iter().map(|bus| bus.frames).collect();
        assert_eq!(frames, [3, 3]);
    }
}
