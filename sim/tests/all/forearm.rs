//! The simulated forearm beside the publication's squeezes.

use ndarray::Array4;
use taxel_sim::forearm::Grip;

/// Samples of a squeeze at which PWM is 100, 150, 200, 250, 300 and 400 on its way up.
const SAMPLES: [usize; 6] = [20, 25, 30, 35, 40, 50];

#[test]
fn mean_motor_angles_of_the_recorded_squeezes_are_followed_from_wrist_to_elbow() {
    let Some(mut npz) = taxel_recordings::open("forearm_kinesthetic.npz") else {
        return;
    };
    let data: Array4<f32> = npz.by_name("data.npy").unwrap();
    let (places, repetitions) = (data.shape()[0], data.shape()[1]);
    let mean = |place: usize, sample: usize, columns: &[usize]| {
        let all = (0..repetitions).flat_map(|r| columns.iter().map(move |c| (r, *c)));
        let sum: f64 = all.map(|(r, c)| f64::from(data[(place, r, sample, c)])).sum();
        sum / (repetitions * columns.len()) as f64
    };
    let (mut pairs, mut of_places) = (Vec::new(), Vec::new());
    for place in 0..places {
        let location = place as f64 / (places - 1) as f64;
        let mut line = format!("{:5.1} %", 100.0 * location);
        let before = pairs.len();
        for sample in SAMPLES {
            let measured = mean(place, sample, &[3, 4]);
            let grip = Grip::at(location).unwrap().under(mean(place, sample, &[5]));
            let modelled = grip.angles().actuated_deg;
            line += &format!("  {measured:4.1} {modelled:4.1}");
            pairs.push((measured, modelled));
        }
        println!("{line}");
        let off: f64 = pairs[before..].iter().map(|(a, b)| a - b).sum();
        of_places.push(off / SAMPLES.len() as f64);
    }
    let centre = pairs.iter().map(|(a, _)| a).sum::<f64>() / pairs.len() as f64;
    let spread: f64 = pairs.iter().map(|(a, _)| (a - centre).powi(2)).sum();
    let left: f64 = pairs.iter().map(|(a, b)| (a - b).powi(2)).sum();
    let explained = 1.0 - left / spread;
    let degrees = (left / pairs.len() as f64).sqrt();
    println!("R2 {explained:.3}, {degrees:.2} degrees; of places {of_places:.1?}");
    assert!(explained > 0.93 && degrees < 3.3, "{explained} {degrees}");
    // What the simulated places are off by is the spread of these.
    let mean_off = of_places.iter().sum::<f64>() / places as f64;
    let variance = of_places.iter().map(|off| (off - mean_off).powi(2)).sum::<f64>() / (places - 1) as f64;
    assert!((variance.sqrt() - 2.8).abs() < 0.1, "{}", variance.sqrt());
}
