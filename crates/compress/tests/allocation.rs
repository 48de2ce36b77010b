//! Compressing allocates nothing once the compressor and its image exist.

use taxel_compress::Compressor;
use taxel_hand::{CodebookLearning, ForceFrame, Grey, LevelSteps, Method, Profile};
use taxel_skin::Layout as SkinLayout;

#[global_allocator]
static ALLOCATOR: taxel_allocations::Counting = taxel_allocations::Counting;

#[test]
fn no_frame_allocates() {
    let layout = SkinLayout::grid(16, 15).expect("a grid that fits");
    let profiles = [
        Profile {
            method: Method::Paper,
            ..Profile::default()
        },
        Profile {
            grey: Grey::Centroid,
            force_weighted: true,
            levels: 255,
            actuators: 3,
            ..Profile::default()
        },
        Profile {
            method: Method::Optimal,
            ..Profile::default()
        },
        Profile {
            method: Method::Optimal,
            levels: 64,
            actuators: 32,
            level_hysteresis: 0.1,
            history: 0.5,
            force_weighted: true,
            parts_apart: true,
            ..Profile::default()
        },
        Profile {
            method: Method::Optimal,
            codebook_learning: Some(CodebookLearning { forgetting: 0.01 }),
            fixed: (0..16)
                .map(|n| [f64::from(n % 4) * 4.0, f64::from(n / 4) * 4.0])
                .collect(),
            ..Profile::default()
        },
        Profile {
            method: Method::Optimal,
            level_steps: LevelSteps::Weber,
            budgets: [("grid".to_string(), 7)].into(),
            ..Profile::default()
        },
        Profile {
            jnd: Some(0.07),
            force_min: Some(1.0),
            force_max: Some(240.0),
            level_steps: LevelSteps::Equal,
            ..Profile::default()
        },
        Profile {
            codebook: vec![1.0, 50.0, 9000.0],
            ..Profile::default()
        },
    ];
    let mut frame = ForceFrame::new(240);
    for profile in profiles {
        let mut compressor = Compressor::new(profile.clone(), &layout).expect("a valid profile");
        let mut image = compressor.new_image();
        let ((), allocations) = taxel_allocations::during(|| {
            for decades in [0, 35] {
                for contacts in [240, 0, 1, 15, 16, 17, 240, 3, 100] {
                    for n in 0..240 {
                        let decade = n as i32 % (2 * decades + 1) - decades;
                        frame.contact[n] = n < contacts;
                        frame.force[n] = ((n * 7919 % 240) as f64 + 0.5) * 10f64.powi(decade);
                    }
                    compressor.compress(&frame, &mut image);
                    assert_eq!(usize::from(image.contacts), contacts);
                }
            }
        });
        assert_eq!(allocations, 0, "allocations with {profile:?}");
    }
}
