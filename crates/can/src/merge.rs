//! Frames of several buses in the order of their times.

use crate::Received;

/// Gives the frames of several buses one after the other: in the order of their stamps, and of
/// their buses where these are equal.
///
/// Frames are taken from each bus in batches. What one bus has told beyond what all the others have
/// waits, so that the order is the same however few frames a bus hands over at once. Memory is
/// taken only when this is made.
#[derive(Debug)]
pub struct FrameMerge {
    batches: Vec<Batch>,
    live: bool,
    /// Stamp and bus up to which all buses have told everything.
    horizon: (u64, usize),
    newest_ns: Option<u64>,
}

/// Frames taken from one bus and not yet given.
#[derive(Debug)]
struct Batch {
    frames: Vec<Received>,
    next: usize,
    newest_ns: Option<u64>,
    /// Whether the bus has more frames than were taken.
    more: bool,
    /// When frames were taken last.
    taken_ns: u64,
}

impl Batch {
    fn is_given(&self) -> bool {
        self.next == self.frames.len()
    }
}

impl FrameMerge {
    /// For this many buses, of each of which at most `batch` frames are taken at once. `live` says
    /// that a bus which has more, but no frame among what was taken, must not hold up the others.
    pub fn new(buses: usize, batch: usize, live: bool) -> Self {
        let batches = (0..buses).map(|_| Batch {
            frames: Vec::with_capacity(batch),
            next: 0,
            newest_ns: None,
            more: false,
            taken_ns: 0,
        });
        Self {
            batches: batches.collect(),
            live,
            horizon: (u64::MAX, usize::MAX),
            newest_ns: None,
        }
    }

    /// Takes the next frames of a bus at the time `now_ns`, once all of those taken before were
    /// given; until then it does nothing, and what the other buses tell beyond the time of its last
    /// taking waits for what it tells then.
    ///
    /// `receive` puts them into an empty batch, without more capacity than it has, and says whether
    /// the bus has more, as [`CanSource::receive`](crate::CanSource::receive) does.
    ///
    /// # Panics
    /// When there is no such bus.
    pub fn fill(&mut self, bus: usize, now_ns: u64, receive: impl FnOnce(&mut Vec<Received>) -> bool) {
        let batch = &mut self.batches[bus];
        if batch.is_given() {
            batch.frames.clear();
            batch.next = 0;
            batch.more = receive(&mut batch.frames);
            batch.newest_ns = batch.frames.iter().map(|r| r.t_ns).max();
            batch.taken_ns = now_ns;
            self.newest_ns = self.newest_ns.max(batch.newest_ns);
        }
        let told = |batch: &Batch| match batch.more {
            true => batch.newest_ns.or((!self.live).then_some(0)),
            false if batch.is_given() || batch.taken_ns >= now_ns => None,
            false => batch.newest_ns.max(Some(batch.taken_ns)),
        };
        let horizons = (self.batches.iter().enumerate()).filter_map(|(bus, b)| Some((told(b)?, bus)));
        self.horizon = horizons.min().unwrap_or((u64::MAX, usize::MAX));
    }

    /// The oldest frame that was not yet given, and its bus; `None` where a bus may still tell of
    /// an older one, or where every frame was given.
    pub fn pop(&mut self) -> Option<(u8, Received)> {
        self.pop_until(u64::MAX)
    }

    /// The same of frames with stamps up to `until_ns`. Buses are taken from one after the other: where it is the time at
    /// which that began, each has told of all that came until then, and the order is that of the times whatever came meanwhile.
    pub fn pop_until(&mut self, until_ns: u64) -> Option<(u8, Received)> {
        let last = self.horizon.min((until_ns, usize::MAX));
        let (bus, batch) = (self.batches.iter_mut().enumerate())
            .filter(|(_, b)| !b.is_given())
            .min_by_key(|(bus, b)| (b.frames[b.next].t_ns, *bus))
            .filter(|(bus, b)| (b.frames[b.next].t_ns, *bus) <= last)?;
        let received = batch.frames[batch.next];
        batch.next += 1;
        Some((bus as u8, received))
    }

    /// Whether every frame that was taken was given.
    pub fn is_empty(&self) -> bool {
        self.batches.iter().all(Batch::is_given)
    }

    /// Whether a bus has, or may have by now, more frames than were taken.
    pub fn has_more(&self) -> bool {
        self.horizon_ns() < u64::MAX || self.batches.iter().any(|b| b.more)
    }

    /// Time up to which all buses have told everything, nanoseconds; `u64::MAX` where none has more.
    pub fn horizon_ns(&self) -> u64 {
        self.horizon.0
    }

    /// Stamp of the newest frame that was ever taken, nanoseconds.
    pub fn newest_ns(&self) -> Option<u64> {
        self.newest_ns
    }

    /// How many frames were taken from each bus when it was last filled.
    pub fn taken(&self) -> impl Iterator<Item = usize> {
        self.batches.iter().map(|b| b.frames.len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::CanFrame;

    fn received(t_ns: u64) -> Received {
        let frame = CanFrame::standard(1, &[]).unwrap();
        Received { t_ns, frame }
    }

    /// The order in which frames are given when each bus hands over at most `at_once` of those that came.
    fn order(buses: &[Vec<u64>], at_once: usize, live: bool) -> Vec<(u8, u64)> {
        let mut left: Vec<&[u64]> = buses.iter().map(Vec::as_slice).collect();
        let mut merge = FrameMerge::new(buses.len(), at_once, live);
        let mut given = Vec::new();
        for _ in 0..1000 {
            for (bus, left) in left.iter_mut().enumerate() {
                merge.fill(bus, 0, |frames| {
                    let (now, later) = left.split_at(at_once.min(left.len()));
                    frames.extend(now.iter().copied().map(received));
                    *left = later;
                    !later.is_empty()
                });
            }
            while let Some((bus, received)) = merge.pop() {
                given.push((bus, received.t_ns));
            }
            if merge.is_empty() && !merge.has_more() {
                return given;
            }
        }
        panic!("stuck at {given:?}");
    }

    #[test]
    fn frames_are_given_in_the_same_order_however_few_a_bus_hands_over_at_once() {
        let buses = [
            (0..60).map(|n| n / 3).collect(),
            (0..20).map(|n| n * 2).collect(),
            vec![5, 5, 5, 19],
        ];
        let together = order(&buses, 1000, true);
        assert!(together.is_sorted_by_key(|(bus, t_ns)| (*t_ns, *bus)));
        for at_once in [1, 2, 7, 30] {
            for live in [true, false] {
                assert_eq!(order(&buses, at_once, live), together, "{at_once} at once");
            }
        }
    }

    #[test]
    fn what_came_while_buses_were_taken_from_waits_where_it_is_told_to() {
        let mut merge = FrameMerge::new(2, 8, true);
        let mut given = Vec::new();
        // The second bus is taken from later, and has frames of which the first may still tell what came before them.
        let rounds = [
            (10, [vec![4, 9], vec![3, 12, 15]]),
            (20, [vec![11, 14, 19], vec![20, 24]]),
        ];
        for (now_ns, mut told) in rounds {
            for _ in 0..3 {
                for (bus, stamps) in told.iter_mut().enumerate() {
                    merge.fill(bus, now_ns, |frames| {
                        frames.extend(stamps.drain(..).map(received));
                        false
                    });
                }
                given.extend(std::iter::from_fn(|| merge.pop_until(now_ns)).map(|(_, r)| r.t_ns));
            }
        }
        assert_eq!(given, [3, 4, 9, 11, 12, 14, 15, 19, 20]);
        assert_eq!(merge.pop(), Some((1, received(24))));
    }

    #[test]
    fn stamps_that_go_back_hold_up_nobody() {
        let buses = [vec![10, 30, 20, 5, 40], vec![15, 25, 1, 50]];
        for at_once in [1, 2, 3] {
            assert_eq!(order(&buses, at_once, true).len(), 9);
        }
    }

    #[test]
    fn a_bus_with_more_and_no_frame_holds_up_the_others_only_where_it_is_not_live() {
        for live in [true, false] {
            let mut merge = FrameMerge::new(2, 1, live);
            merge.fill(0, 9, |frames| {
                frames.push(received(7));
                false
            });
            merge.fill(1, 9, |_| true);
            assert_eq!(merge.pop(), live.then_some((0, received(7))));
            assert_eq!((merge.has_more(), merge.newest_ns()), (true, Some(7)));
            assert_eq!(merge.taken().collect::<Vec<_>>(), [1, 0]);
        }
    }

    #[test]
    fn a_bus_whose_frames_wait_is_not_overtaken_by_what_others_tell_of_later() {
        let mut merge = FrameMerge::new(2, 3, true);
        let mut round = |now_ns, told: [(&[u64], bool); 2]| {
            for (bus, (stamps, more)) in told.into_iter().enumerate() {
                merge.fill(bus, now_ns, |frames| {
                    frames.extend(stamps.iter().copied().map(received));
                    more
                });
            }
            let given: Vec<u64> = std::iter::from_fn(|| merge.pop()).map(|(_, r)| r.t_ns).collect();
            (given, merge.has_more())
        };
        assert_eq!(
            round(10, [(&[1, 9], false), (&[1, 2, 3], true)]),
            (vec![1, 1, 2, 3], true)
        );
        // 9 still waits, so that 15, which came meanwhile, cannot be taken yet.
        assert_eq!(
            round(20, [(&[], false), (&[4, 5, 18], false)]),
            (vec![4, 5, 9], true)
        );
        assert_eq!(round(21, [(&[15], false), (&[], false)]), (vec![15, 18], true));
        assert_eq!(round(22, [(&[], false), (&[], false)]), (vec![], false));
    }
}
