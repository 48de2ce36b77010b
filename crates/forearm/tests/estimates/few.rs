//! What is promised where a place has few squeezes.

use super::{session, squeeze};
use taxel_cluster::Random;
use taxel_forearm::{Estimator, Kinesthetic, Model, PLACES, Trial, location_percent};

/// Squeezes of so many repetitions at all places. Each repetition goes its own way in all of its squeezes, as where its ramp
/// of PWM is drawn, and each squeeze is a little off.
fn wobbling(repetitions: usize, seed: u64) -> Vec<Trial> {
    let mut random = Random::new(seed);
    let mut trials = Vec::new();
    for repetition in 0..repetitions {
        let waves = [1.0, 2.0, 3.0, 5.0].map(|times| (times, random.normal(), random.normal()));
        for place in 0..PLACES {
            let mut squeeze = squeeze(location_percent(place), 2.0 * random.normal());
            for (row, angle) in squeeze.theta_a_deg[0].iter_mut().enumerate() {
                let turn = row as f64 / 95.0 * std::f64::consts::TAU;
                let wave = |(times, sine, cosine): (f64, f64, f64)| {
                    sine * (times * turn).sin() + cosine * (times * turn).cos()
                };
                *angle += waves.map(wave).iter().sum::<f64>() + 0.2 * random.normal();
            }
            trials.push(Trial {
                location_percent: location_percent(place),
                repetition,
                squeeze,
            });
        }
    }
    trials
}

#[test]
fn intervals_of_two_and_three_squeezes_a_place_hold_nine_of_ten_new_ones() {
    for trained in [2, 3] {
        let (mut held, mut all) = (0, 0);
        for seed in 0..12 {
            let trials = wobbling(trained + 3, seed);
            let (train, test) = trials.split_at(trained * PLACES);
            let model = Kinesthetic::train(&train.iter().collect::<Vec<_>>()).unwrap();
            for trial in test {
                let estimate = model.estimate(&trial.squeeze).unwrap();
                let off = (estimate.percent - trial.location_percent).abs();
                held += usize::from(off <= estimate.half_width_90);
                all += 1;
            }
        }
        assert!(
            10 * held >= 9 * all,
            "{trained} squeezes a place: {held} of {all}"
        );
    }
}

#[test]
fn a_sound_squeeze_that_is_unlike_the_few_others_is_trained_on() {
    let mut few = session();
    few.trials.retain(|trial| trial.repetition < 2);
    let odd = &mut few.trials[8].squeeze;
    odd.theta_p_deg[0].iter_mut().for_each(|angle| *angle += 19.0);
    Model::train(&few).unwrap();
    // One sample that is of no finger does not make it another gripper's.
    few.trials[8].squeeze.theta_p_deg[0][30] += 90.0;
    few.trials[9].squeeze.theta_p_deg[1][0] -= 90.0;
    Model::train(&few).unwrap();
    let odd = &mut few.trials[8].squeeze;
    odd.theta_p_deg[0].iter_mut().for_each(|angle| *angle += 10.0);
    let error = Model::train(&few).unwrap_err().to_string();
    assert!(
        error.contains("the squeeze 1 at 33.3 %: theta_p of finger 0 is "),
        "{error}"
    );
}
