//! Jumps on a skin of many small taxels.

use taxel_eval::{Method, References, Sequence, judge};
use taxel_hand::{Coordinates, ForceFrame, Profile};
use taxel_skin::Layout;

/// A hold of about 400 contacts on 50 x 28 taxels that breathes, and drifts by a pixel in a frame. None flickers.
fn hold(frames: u32) -> Sequence {
    let layout = Layout::grid(50, 28).expect("a grid that fits");
    let force = (0..frames).map(|t| {
        let t = f64::from(t);
        let centre = [25.0 + 9.0 * (t / 9.0).sin(), 13.5 + 1.5 * (t / 3.0).sin()];
        let radius = 11.3 + 2.0 * (0.6 * t).sin();
        let mut frame = ForceFrame::new(layout.len());
        frame.t_ns = t as u64 * 10_000_000;
        let felt = frame.force.iter_mut().zip(&mut frame.contact);
        for (taxel, (force, contact)) in layout.taxels.iter().zip(felt) {
            let (dx, dy) = (f64::from(taxel.x) - centre[0], f64::from(taxel.y) - centre[1]);
            let off = (dx * dx + dy * dy) / (radius * radius);
            *force = 1.0 + 1000.0 * (1.0 - off).max(0.0);
            *contact = off < 1.0;
        }
        frame
    });
    Sequence {
        force: force.collect(),
        tactile: Vec::new(),
        conditioning: None,
        layout,
    }
}

#[test]
fn actuators_that_drift_with_a_large_contact_do_not_jump() {
    let sequence = hold(80);
    let profile = Profile {
        actuators: 16,
        ..Profile::default()
    };
    let references = References::find(&sequence, 8, 16, Coordinates::Pixels, 1, || ()).expect("a profile");
    let method = Method::parse("optimal", &profile).expect("a method");
    let errors = judge(&sequence, &references, &method).expect("a profile");
    // By moves of more than two pixels it would be 2 %. What is left are swaps that save more than jump_gain of the cost.
    assert!(errors.jump_fraction < 0.0025, "{}", errors.jump_fraction);
    assert!(errors.moved_px_mean > 0.5, "{}", errors.moved_px_mean);
}
