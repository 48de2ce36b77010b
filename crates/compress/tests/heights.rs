//! Forces as a third coordinate: what shares an actuator is a matter of forces, whichever way the skin lies in the image.

use taxel_compress::Compressor;
use taxel_hand::{ForceFrame, Method, Profile};
use taxel_skin::Layout;

const SIDE: usize = 12;
const FRAMES: usize = 8;

/// Forces on a square skin, row by row; 0 where nothing touches.
type Skin = [[f64; SIDE]; SIDE];

fn transposed(skin: &Skin) -> Skin {
    std::array::from_fn(|y| std::array::from_fn(|x| skin[x][y]))
}

/// A contact of this many rows and columns, and its forces there.
fn contact(rows: usize, columns: usize, force: impl Fn(usize, usize) -> f64) -> Skin {
    let touched = |y, x| (2..2 + rows).contains(&y) && (2..2 + columns).contains(&x);
    std::array::from_fn(|y| std::array::from_fn(|x| if touched(y, x) { force(y - 2, x - 2) } else { 0.0 }))
}

/// Two plateaus, one beside the other, under a little noise.
fn plateaus([rows, columns, split]: [usize; 3], [hard, soft]: [f64; 2]) -> Skin {
    contact(rows, columns, |y, x| {
        let noise = (y * 7 + x * 5) * 37 % 19;
        noise as f64 - 9.0 + if x < split { hard } else { soft }
    })
}

/// Root of the squared error shown over the squared force, after some frames of the same contact, with 8 levels and 16 actuators.
fn error_shown(skin: &Skin, force_distance: f64) -> f64 {
    let layout = Layout::grid(SIDE as u16, SIDE as u16).unwrap();
    let profile = Profile {
        method: Method::Optimal,
        levels: 8,
        actuators: 16,
        force_distance,
        ..Profile::default()
    };
    let mut compressor = Compressor::new(profile, &layout).unwrap();
    let mut image = compressor.new_image();
    let mut frame = ForceFrame::new(SIDE * SIDE);
    frame.force.copy_from_slice(skin.as_flattened());
    for (contact, force) in frame.contact.iter_mut().zip(&frame.force) {
        *contact = *force > 0.0;
    }
    for _ in 0..FRAMES {
        compressor.compress(&frame, &mut image);
    }
    let stages = compressor.stages();
    let (mut error, mut all) = (0.0, 0.0);
    for (force, id) in stages.force.iter().zip(stages.actuator) {
        let shown = image.actuators.iter().find(|a| a.id == *id).unwrap().force;
        error += (force - shown) * (force - shown);
        all += force * force;
    }
    (error / all).sqrt()
}

#[test]
fn a_contact_and_the_same_contact_turned_are_shown_alike() {
    let slope = contact(6, 8, |y, x| {
        100.0 + 40.0 * x as f64 + 7.0 * ((y * 5 + x * 3) % 4) as f64
    });
    let ridge = contact(7, 6, |_, x| [60.0, 200.0, 900.0, 500.0, 150.0, 80.0][x]);
    let frames = [
        slope,
        ridge,
        plateaus([6, 8, 4], [300.0, 40.0]),
        plateaus([6, 7, 3], [300.0, 60.0]),
        plateaus([6, 6, 3], [200.0, 100.0]),
        plateaus([7, 5, 3], [300.0, 100.0]),
        plateaus([8, 4, 2], [600.0, 60.0]),
        plateaus([8, 7, 4], [600.0, 60.0]),
    ];
    for (n, frame) in frames.iter().enumerate() {
        let [upright, turned] = [*frame, transposed(frame)].map(|skin| error_shown(&skin, 1.0));
        let ratio = upright.max(turned) / upright.min(turned);
        assert!(ratio < 1.3, "frame {n}: {upright} and {turned} turned");
    }
}

#[test]
fn plateaus_of_two_forces_share_no_actuator_whichever_way_they_lie() {
    for sizes in [
        [6, 8, 4],
        [6, 7, 3],
        [5, 8, 2],
        [8, 4, 2],
        [8, 7, 4],
        [8, 7, 5],
        [7, 5, 3],
    ] {
        for forces in [[300.0, 40.0], [600.0, 60.0], [200.0, 100.0]] {
            let skin = plateaus(sizes, forces);
            for (way, skin) in [("upright", skin), ("turned", transposed(&skin))] {
                let error = error_shown(&skin, 1.0);
                // An actuator across the border alone would show more.
                assert!(error < 0.05, "{sizes:?} {forces:?} {way}: {error}");
                let without = error_shown(&skin, 0.0);
                assert!(
                    error < 1.2 * without,
                    "{sizes:?} {forces:?} {way}: {without} without heights"
                );
            }
        }
    }
}
