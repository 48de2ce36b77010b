//! The five bars under every sample of the publication's squeezes.

use ndarray::Array4;
use taxel_gripper::FiveBar;

#[test]
fn the_bars_close_for_all_recorded_samples_and_lead_back_to_the_motor() {
    let Some(mut npz) = taxel_recordings::open("forearm_kinesthetic.npz") else {
        return;
    };
    let data: Array4<f32> = npz.by_name("data.npy").unwrap();
    let (mut least, mut most, mut samples) = (f64::INFINITY, f64::NEG_INFINITY, 0);
    for row in data.rows() {
        for (passive, actuated) in [(1, 3), (2, 4)] {
            let at = |column: usize| f64::from(row[column]).to_radians();
            let (theta_a, theta_p) = (at(actuated), at(passive));
            let theta_u = FiveBar::FINGER.proximal_rad(theta_a, theta_p).unwrap();
            let back = FiveBar::FINGER.actuated_rad(theta_u, theta_p).unwrap();
            assert!((back - theta_a).abs() < 1e-9);
            // Far from both singularities: no bar takes more than twice the other's turn.
            let [by_motor, by_joint] = FiveBar::FINGER.turning(theta_a, theta_p).unwrap();
            assert!(
                (0.4..1.5).contains(&by_motor) && by_joint.abs() < 1.0,
                "{by_motor} {by_joint}"
            );
            least = theta_u.to_degrees().min(least);
            most = theta_u.to_degrees().max(most);
        }
        samples += 1;
    }
    assert_eq!(samples, 74_100);
    println!("theta_u is from {least:.1} to {most:.1} degrees in {samples} samples of two fingers");
    assert!(
        (55.0..56.0).contains(&least) && (109.0..110.0).contains(&most),
        "{least} {most}"
    );
}
