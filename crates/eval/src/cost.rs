//! What a method costs: time and allocations per frame.

use crate::method::Method;
use crate::quantile::{Quantiles, quantile};
use crate::sequence::Sequence;
use serde::Serialize;
use std::hint::black_box;
use std::time::Instant;
use taxel_compress::Compressor;
use taxel_hand::ForceFrame;
use taxel_skin::Conditioner;

/// Counts the allocations of the calling thread; the program that owns the allocator provides it.
#[derive(Debug, Clone, Copy)]
pub struct Allocations {
    /// Begins to count, from zero.
    pub start: fn(),
    /// Ends it and returns the count.
    pub stop: fn() -> u64,
}

/// What a tick costs, in microseconds, over the frames with contacts.
///
/// Frames are run back to back in passes, each from a new conditioner and compressor. The time of a
/// frame is its median over the passes, so that quantiles tell how cost depends on the frame;
/// `every_tick_us` has every single measurement, with whatever else the machine did meanwhile.
/// Taking the time costs a few dozen nanoseconds, which are included.
#[derive(Debug, Default, Clone, PartialEq, Serialize)]
pub struct Cost {
    /// Conditioning and compression; compression alone where the recording holds magnitudes.
    pub tick_us: Quantiles,
    /// Conditioning alone.
    pub condition_us: Quantiles,
    /// Compression alone: both stages.
    pub compress_us: Quantiles,
    /// Conditioning and compression, all passes.
    pub every_tick_us: Quantiles,
    /// Allocations per tick after start, if they were counted.
    pub allocations_per_tick: Option<f64>,
}

/// One tick as measured, microseconds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lap {
    /// Conditioning; zero where the recording holds magnitudes.
    pub condition_us: f32,
    /// Both stages.
    pub compress_us: f32,
}

/// Measurements of one method.
#[derive(Debug, Clone)]
pub struct Timings {
    /// `laps[frame][pass]`; frames with contacts only.
    laps: Vec<Vec<Lap>>,
    allocations_per_tick: Option<f64>,
}

impl Timings {
    /// Every measurement: of each frame with contacts, in the order of the frames, that of each pass.
    pub fn laps(&self) -> &[Vec<Lap>] {
        &self.laps
    }

    /// The quantiles over frames of the time of both stages, each frame's the least of its passes:
    /// for few passes.
    pub fn least_compress_us(&self) -> Quantiles {
        let of_frame = |laps: &Vec<Lap>| {
            laps.iter()
                .map(|lap| f64::from(lap.compress_us))
                .fold(f64::INFINITY, f64::min)
        };
        Quantiles::of(&mut self.laps.iter().map(of_frame).collect::<Vec<_>>())
    }

    /// The quantiles over frames.
    pub fn cost(&self) -> Cost {
        let median = |of: fn(&Lap) -> f32| -> Quantiles {
            let of_frame = |laps: &Vec<Lap>| {
                let mut times: Vec<f64> = laps.iter().map(|lap| f64::from(of(lap))).collect();
                quantile(&mut times, 0.5)
            };
            Quantiles::of(&mut self.laps.iter().map(of_frame).collect::<Vec<_>>())
        };
        let tick = |lap: &Lap| lap.condition_us + lap.compress_us;
        let mut every: Vec<f64> = self
            .laps
            .iter()
            .flatten()
            .map(|lap| f64::from(tick(lap)))
            .collect();
        Cost {
            tick_us: median(tick),
            condition_us: median(|lap| lap.condition_us),
            compress_us: median(|lap| lap.compress_us),
            every_tick_us: Quantiles::of(&mut every),
            allocations_per_tick: self.allocations_per_tick,
        }
    }
}

/// Runs the frames through each method `passes` times, methods taking turns, and once more to count
/// allocations. Calls `progress` after each run.
///
/// # Panics
///
/// If a method or the conditioning does not fit the hand; [`crate::judge`] says so before.
pub fn time(
    sequence: &Sequence,
    methods: &[Method],
    passes: usize,
    allocations: Option<Allocations>,
    mut progress: impl FnMut(),
) -> Vec<Timings> {
    let timed: Vec<bool> = sequence.force.iter().map(|f| f.contacts() > 0).collect();
    let frames = timed.iter().filter(|t| **t).count();
    let mut timings = vec![
        Timings {
            laps: vec![Vec::with_capacity(passes); frames],
            allocations_per_tick: None,
        };
        methods.len()
    ];
    for _ in 0..passes {
        for (method, timings) in methods.iter().zip(&mut timings) {
            let mut at = timings.laps.iter_mut();
            let mut run = Run::new(sequence, method);
            for (index, timed) in timed.iter().enumerate() {
                let lap = run.lap(index);
                if *timed && let Some(laps) = at.next() {
                    laps.push(lap);
                }
            }
            progress();
        }
    }
    if let Some(allocations) = allocations {
        for (method, timings) in methods.iter().zip(&mut timings) {
            let mut run = Run::new(sequence, method);
            (allocations.start)();
            for index in 0..sequence.len() {
                black_box(run.lap(index));
            }
            let count = (allocations.stop)();
            timings.allocations_per_tick = Some(count as f64 / sequence.len().max(1) as f64);
            progress();
        }
    }
    timings
}

/// One pass.
struct Run<'a> {
    sequence: &'a Sequence,
    conditioner: Option<Conditioner>,
    conditioned: ForceFrame,
    compressor: Compressor,
    image: taxel_hand::TactileImage,
}

impl<'a> Run<'a> {
    fn new(sequence: &'a Sequence, method: &Method) -> Self {
        let taxels = sequence.layout.len();
        let conditioner = (sequence.conditioning.as_ref())
            .filter(|_| sequence.tactile.len() == sequence.force.len())
            .map(|config| {
                Conditioner::new(taxels, config.clone()).expect("settings that conditioned these frames")
            });
        let compressor = Compressor::new(method.profile.clone(), &sequence.layout)
            .expect("a profile that compressed these frames");
        Self {
            sequence,
            conditioner,
            conditioned: ForceFrame::new(taxels),
            image: compressor.new_image(),
            compressor,
        }
    }

    fn lap(&mut self, index: usize) -> Lap {
        let begin = Instant::now();
        let frame = match &mut self.conditioner {
            Some(conditioner) => {
                conditioner.process(black_box(&self.sequence.tactile[index]), &mut self.conditioned);
                &self.conditioned
            }
            None => &self.sequence.force[index],
        };
        let middle = Instant::now();
        self.compressor.compress(black_box(frame), &mut self.image);
        black_box(&mut self.image);
        let end = Instant::now();
        let micros = |from: Instant, to: Instant| (to - from).as_nanos() as f32 / 1000.0;
        Lap {
            // Two readings of the clock would be measured otherwise.
            condition_us: self.conditioner.as_ref().map_or(0.0, |_| micros(begin, middle)),
            compress_us: micros(middle, end),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_of_a_frame_is_its_median_and_every_measurement_is_kept() {
        let lap = |condition_us, compress_us| Lap {
            condition_us,
            compress_us,
        };
        let timings = Timings {
            laps: vec![
                vec![lap(1.0, 2.0), lap(1.0, 3.0), lap(50.0, 3.0)],
                vec![lap(2.0, 8.0), lap(2.0, 8.0), lap(2.0, 90.0)],
            ],
            allocations_per_tick: Some(0.0),
        };
        let cost = timings.cost();
        assert_eq!((cost.tick_us.p50, cost.tick_us.max), (4.0, 10.0));
        assert_eq!((cost.condition_us.p50, cost.compress_us.max), (1.0, 8.0));
        assert_eq!((cost.every_tick_us.p50, cost.every_tick_us.max), (10.0, 92.0));
        assert_eq!(
            (timings.least_compress_us().p50, timings.least_compress_us().max),
            (2.0, 8.0)
        );
    }
}
