//! Images are the same to the bit wherever they are made: whatever the platform, the optimisation
//! and the width of the machine's vectors.
//!
//! What is compressed is hashed and compared with numbers that were found once. `tests/widths/run`
//! runs this built for every vector width that the machine has. After a deliberate change of
//! results, take the new numbers from the message.

// The recordings' other test uses more of it.
#[allow(dead_code)]
#[path = "../recordings/hands.rs"]
mod hands;

use taxel_compress::Compressor;
use taxel_hand::{ActuatorForce, CodebookLearning, ForceFrame, LevelSteps, Method, Profile, TactileImage};
use taxel_skin::Layout;

/// Frames of a session that are hashed.
const FRAMES: usize = 250;

/// FNV-1a over bytes.
struct Hash(u64);

impl Hash {
    fn add(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }

    fn add_image(&mut self, image: &TactileImage) {
        self.add(&image.pixels);
        for level in &image.levels {
            self.add(&level.to_bits().to_le_bytes());
        }
        for actuator in &image.actuators {
            for number in [actuator.id, actuator.x, actuator.y, actuator.level] {
                self.add(&number.to_le_bytes());
            }
            self.add(&actuator.force.to_bits().to_le_bytes());
        }
    }
}

fn hash<'a>(profile: &Profile, layout: &Layout, frames: impl Iterator<Item = &'a ForceFrame>) -> u64 {
    let mut compressor = Compressor::new(profile.clone(), layout).expect("a valid profile");
    let mut image = compressor.new_image();
    let mut hash = Hash(0xcbf2_9ce4_8422_2325);
    for frame in frames {
        compressor.compress(frame, &mut image);
        hash.add_image(&image);
    }
    hash.0
}

/// Random contacts that come, stay and go, of forces with few digits and with many, made with
/// operations that every platform rounds alike.
fn made_up() -> Vec<ForceFrame> {
    let mut state = 9u64;
    let mut random = move || {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        state >> 33
    };
    let mut frame = ForceFrame::new(256);
    (0..400)
        .map(|t| {
            // Held still for a while, then changed a little, much, or altogether.
            let changes = [0, 0, 0, 0, 3, 0, 0, 20, 0, 200][t / 2 % 10];
            for _ in 0..changes {
                let n = (random() % 256) as usize;
                frame.contact[n] = random() % 4 > 0;
            }
            for n in 0..256 {
                let noise = random() as f64 / (1u64 << 31) as f64;
                frame.force[n] = match t / 40 % 3 {
                    0 => 50.0 + 500.0 * (1.0 / (1.0 - 0.99 * noise) - 1.0),
                    1 => 1.0 + (random() % 40) as f64,
                    _ => 60_000.0 + noise,
                };
            }
            frame.clone()
        })
        .collect()
}

fn profiles() -> Vec<(&'static str, Profile)> {
    let default = Profile::default;
    let places = (0..16).map(|n| [f64::from(n % 4) * 4.0 + 1.5, f64::from(n / 4) * 4.0 + 1.5]);
    vec![
        (
            "paper",
            Profile {
                method: Method::Paper,
                ..default()
            },
        ),
        ("optimal", default()),
        (
            "strongest force",
            Profile {
                actuator_force: Some(ActuatorForce::Max),
                ..default()
            },
        ),
        (
            "3 levels, 5 actuators",
            Profile {
                levels: 3,
                actuators: 5,
                ..default()
            },
        ),
        (
            "32 levels, 40 actuators",
            Profile {
                levels: 32,
                actuators: 40,
                ..default()
            },
        ),
        (
            "100 actuators",
            Profile {
                actuators: 100,
                ..default()
            },
        ),
        (
            "weighted, with history",
            Profile {
                force_weighted: true,
                history: 0.3,
                ..default()
            },
        ),
        (
            "hysteresis",
            Profile {
                level_hysteresis: 0.2,
                ..default()
            },
        ),
        (
            "fixed",
            Profile {
                fixed: places.collect(),
                ..default()
            },
        ),
        (
            "weber",
            Profile {
                level_steps: LevelSteps::Weber,
                force_min: Some(1.0),
                force_max: Some(3000.0),
                ..default()
            },
        ),
        (
            "learned",
            Profile {
                codebook_learning: Some(CodebookLearning { forgetting: 0.01 }),
                ..default()
            },
        ),
    ]
}

#[test]
fn made_up_frames_give_the_same_bits_everywhere() {
    let layout = Layout::grid(16, 16).expect("a grid that fits");
    let frames = made_up();
    let got: Vec<(&str, u64)> = (profiles().iter())
        .map(|(name, profile)| (*name, hash(profile, &layout, frames.iter())))
        .collect();
    let want = [
        ("paper", 0x9e4d_c3d9_3e6a_20b0),
        ("optimal", 0xadf6_cd56_c74c_78aa),
        ("strongest force", 0xeaee_a126_4b77_7dad),
        ("3 levels, 5 actuators", 0x8db3_d75c_3469_090e),
        ("32 levels, 40 actuators", 0x207b_be7b_22f5_12c3),
        ("100 actuators", 0xe647_82a0_e8d5_e2a6),
        ("weighted, with history", 0xe04c_474e_c3df_cf02),
        ("hysteresis", 0xadaf_7b93_a576_0017),
        ("fixed", 0xf1e4_6894_7f53_289e),
        ("weber", 0x9147_74b5_d174_3d5f),
        ("learned", 0x7b13_4163_7235_0b1e),
    ];
    assert!(got == want, "got {got:#x?}");
}

#[test]
fn recorded_frames_give_the_same_bits_everywhere() {
    // Not the made-up session among them, which needs sines: platforms round these differently.
    let want = [
        ("Waseda, shifted in time", 0x8cb6_69bf_26d4_4f12),
        ("pick and move", 0x6f66_296b_321e_8e92),
        ("Schunk, 6 arrays, idle + 10", 0x4b97_7154_3c9b_3287),
    ];
    let sessions = hands::sessions();
    let mut wrong = Vec::new();
    for (name, want) in want {
        let Some(session) = sessions.iter().find(|session| session.name == name) else {
            println!("SKIPPED: {name}: not on this machine");
            continue;
        };
        let frames = session.sequences.iter().flatten().take(FRAMES);
        let got = hash(&Profile::default(), &session.layout, frames);
        if got != want {
            wrong.push(format!("{name}: {got:#x}"));
        }
    }
    assert!(wrong.is_empty(), "got {wrong:?}");
}
