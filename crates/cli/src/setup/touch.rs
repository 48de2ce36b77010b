//! Which module is being pressed: the one whose taxels rise, far above all others and for a while.

use std::ops::Range;
use taxel_hand::{ForceFrame, Geometry};

/// A module is pressed after it has led for this long.
const HOLD_NS: u64 = 300_000_000;
/// How many times as much as any other it has to rise.
const LEAD: f64 = 2.0;
/// How many contact thresholds it has to rise.
const LEAST: f64 = 2.0;
/// The module pressed before counts again once its force is below this share of its most.
const RELEASED: f64 = 0.3;

/// What the skin shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Touch {
    /// Nothing that has lasted.
    None,
    /// One module alone is pressed, and has risen so many times as much as any other; infinity where none has.
    Module { module: usize, lead: f64 },
    /// Two modules are pressed, the stronger one first.
    Two([usize; 2]),
}

/// Watches for one press after the other.
#[derive(Debug)]
pub(super) struct TouchWatch {
    /// The taxels of each module.
    taxels: Vec<Range<usize>>,
    /// The least force of each module since the press was asked for.
    floor: Vec<f64>,
    /// What is seen, and since when, nanoseconds.
    seen: Option<([usize; 2], bool, u64)>,
    /// The module pressed before, until it is let go, and the most of its force.
    before: Option<(usize, f64)>,
}

impl TouchWatch {
    pub(super) fn new(geometry: &Geometry) -> Self {
        let taxels: Vec<_> = geometry.modules.iter().map(|m| m.taxel_range()).collect();
        Self {
            floor: vec![f64::INFINITY; taxels.len()],
            taxels,
            seen: None,
            before: None,
        }
    }

    /// A press is asked for: what is pressed already does not count.
    pub(super) fn begin(&mut self) {
        self.floor.fill(f64::INFINITY);
        self.seen = None;
    }

    /// Takes a frame.
    pub(super) fn handle_frame(&mut self, frame: &ForceFrame) -> Touch {
        if frame.calibrating {
            self.begin();
            return Touch::None;
        }
        // The two modules that rise most.
        let mut most = [(0, 0.0); 2];
        for (module, taxels) in self.taxels.iter().enumerate() {
            let force = taxels
                .clone()
                .filter(|taxel| frame.contact[*taxel])
                .map(|taxel| frame.force[taxel])
                .fold(0.0, f64::max);
            if let Some((before, peak)) = &mut self.before
                && *before == module
            {
                *peak = peak.max(force);
                match force < *peak * RELEASED {
                    true => self.before = None,
                    false => continue,
                }
            }
            let floor = &mut self.floor[module];
            *floor = floor.min(force);
            let rise = force - *floor;
            if rise > most[0].1 {
                most = [(module, rise), most[0]];
            } else if rise > most[1].1 {
                most[1] = (module, rise);
            }
        }
        let [(first, rise), (second, other)] = most;
        if rise < LEAST * frame.threshold || rise <= 0.0 {
            self.seen = None;
            return Touch::None;
        }
        let is_alone = rise >= LEAD * other;
        let is_same = |seen: &([usize; 2], bool, u64)| {
            seen.1 == is_alone && seen.0[0] == first && (is_alone || seen.0[1] == second)
        };
        let seen = self.seen.filter(is_same);
        let (_, _, since_ns) = *self
            .seen
            .insert(seen.unwrap_or(([first, second], is_alone, frame.t_ns)));
        if frame.t_ns < since_ns + HOLD_NS {
            return Touch::None;
        }
        self.seen = None;
        if !is_alone {
            return Touch::Two([first, second]);
        }
        self.before = Some((first, rise));
        Touch::Module {
            module: first,
            lead: rise / other,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_skin::Layout;

    /// Frames of the default hand at 30 Hz in which modules are pressed with so much.
    struct Skin {
        watch: TouchWatch,
        frame: ForceFrame,
    }

    impl Skin {
        fn new() -> Self {
            let hand = Layout::builtin("allegro-uskin-15").unwrap();
            Self {
                watch: TouchWatch::new(&hand),
                frame: ForceFrame {
                    threshold: 20.0,
                    ..ForceFrame::new(hand.len())
                },
            }
        }

        /// A press is asked for, the skin stays as it was for a while, and is then pressed so for a second: the first
        /// that is seen.
        fn second(&mut self, pressed: &[(usize, f64)]) -> Touch {
            self.watch.begin();
            for frame in 0..35 {
                if frame == 5 {
                    self.frame.force.fill(0.0);
                    for (module, force) in pressed {
                        self.frame.force[module * 16 + 5] = *force;
                    }
                    self.frame.contact = self.frame.force.iter().map(|f| *f > 20.0).collect();
                }
                self.frame.t_ns += 33_333_333;
                let seen = self.watch.handle_frame(&self.frame);
                if seen != Touch::None {
                    return seen;
                }
            }
            Touch::None
        }
    }

    #[test]
    fn the_module_that_rises_far_above_the_rest_is_pressed() {
        let mut skin = Skin::new();
        assert_eq!(skin.second(&[]), Touch::None);
        let touch = skin.second(&[(4, 900.0), (5, 100.0)]);
        assert_eq!(touch, Touch::Module { module: 4, lead: 9.0 });
        assert_eq!(
            skin.second(&[(4, 900.0)]),
            Touch::None,
            "it is held, not pressed anew"
        );
        assert_eq!(skin.second(&[]), Touch::None);
        assert!(matches!(
            skin.second(&[(4, 500.0)]),
            Touch::Module { module: 4, .. }
        ));
    }

    #[test]
    fn two_modules_pressed_alike_are_none() {
        let mut skin = Skin::new();
        skin.second(&[]);
        assert_eq!(skin.second(&[(4, 900.0), (12, 700.0)]), Touch::Two([4, 12]));
        assert_eq!(skin.second(&[(3, 30.0)]), Touch::None, "hardly more than noise");
    }

    #[test]
    fn what_is_pressed_before_it_is_asked_for_does_not_count() {
        let mut skin = Skin::new();
        assert!(matches!(
            skin.second(&[(2, 800.0)]),
            Touch::Module { module: 2, .. }
        ));
        skin.watch.before = None;
        assert_eq!(skin.second(&[(2, 800.0)]), Touch::None);
        let both = skin.second(&[(2, 800.0), (7, 400.0)]);
        assert!(matches!(both, Touch::Module { module: 7, .. }));
    }

    #[test]
    fn a_module_that_is_let_go_slowly_is_not_taken_again() {
        let mut skin = Skin::new();
        assert!(matches!(
            skin.second(&[(1, 900.0)]),
            Touch::Module { module: 1, .. }
        ));
        for force in [850.0, 600.0, 700.0, 500.0] {
            assert_eq!(skin.second(&[(1, force)]), Touch::None);
        }
        assert!(matches!(
            skin.second(&[(2, 600.0)]),
            Touch::Module { module: 2, .. }
        ));
    }
}
