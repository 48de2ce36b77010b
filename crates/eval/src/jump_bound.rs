//! Jumps that nobody can avoid: what a flickering contact set asks of any display.

use crate::best_places::least_place_error;
use crate::plane::squared_distance;

/// Position error over the best known that the bound allows in a frame.
pub(crate) const ALLOWED: f64 = 1.08;

/// How many of `clusters` actuators must jump from one frame to the next, whatever the method, if
/// the position error of neither frame may exceed [`ALLOWED`] times the best.
///
/// Let a contact be *alone* if putting it into a cluster with any other costs more than a frame may
/// cost: `d^2 / 2` for the nearest other at distance `d`. An actuator stands on it then, and on
/// nothing else. If it is *new*, farther than a jump from every contact of the frame before, that
/// actuator stood farther away than that (actuators stand on contacts), and jumped, unless it was
/// idle. Few were idle: with every actuator taken away the best error grows, and those that may be
/// missing are counted. So jumps are at least the new contacts that are alone, less the actuators
/// that can have been idle. Merged contacts that are new are not counted; the true number is
/// higher.
///
/// `before` and `now` are contacts and their least place errors; "best" is what `restarts` runs of
/// k-means++ find. A jump is a move of more than `jump`.
pub(crate) fn unavoidable_jumps(
    before: (&[[f64; 2]], f64),
    now: (&[[f64; 2]], f64),
    clusters: usize,
    restarts: u32,
    jump: f64,
) -> u64 {
    let ((old, old_error), (new, error)) = (before, now);
    let alone = new.iter().enumerate().filter(|(n, place)| {
        let others = new.iter().enumerate().filter(|(m, _)| m != n);
        let nearest = others
            .map(|(_, other)| squared_distance(**place, *other))
            .fold(f64::INFINITY, f64::min);
        let is_new = old
            .iter()
            .all(|other| squared_distance(**place, *other) > jump * jump);
        is_new && 0.5 * nearest > ALLOWED * error
    });
    let alone = alone.count();
    if alone == 0 || old.is_empty() {
        return 0;
    }
    let mut idle = clusters.saturating_sub(old.len());
    while idle < alone && clusters - idle > 1 {
        let used = clusters - idle - 1;
        if least_place_error(old, used, restarts) > ALLOWED * old_error {
            break;
        }
        idle += 1;
    }
    alone.saturating_sub(idle) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn jumps(before: &[[u16; 2]], now: &[[u16; 2]], clusters: usize) -> u64 {
        let [before, now] =
            [before, now].map(|pixels| pixels.iter().map(|p| p.map(f64::from)).collect::<Vec<_>>());
        let of = |places: &[[f64; 2]]| least_place_error(places, clusters, 64);
        unavoidable_jumps((&before, of(&before)), (&now, of(&now)), clusters, 64, 2.0)
    }

    #[test]
    fn a_new_contact_far_away_takes_an_actuator_from_elsewhere_unless_one_was_idle() {
        let held = [[0, 0], [20, 0]];
        for (name, before, now, clusters, want) in [
            ("nothing new", &held[..], &held[..], 2, 0),
            ("no contact before", &[], &held[..], 2, 0),
            ("one idle", &held[..], &[[0, 0], [20, 0], [0, 20]][..], 3, 0),
            (
                "one goes, one comes, none idle",
                &held[..],
                &[[0, 0], [0, 20]][..],
                2,
                1,
            ),
            ("both elsewhere", &held[..], &[[40, 40], [0, 20]][..], 2, 2),
            ("within a jump", &held[..], &[[2, 0], [20, 2]][..], 2, 0),
            ("could share", &held[..], &[[0, 0], [0, 20], [20, 0]][..], 2, 0),
            (
                "every actuator is needed",
                &[[0, 0], [1, 0], [4, 0], [5, 0], [40, 0], [80, 0]][..],
                &[[0, 0], [5, 0], [40, 0], [80, 0], [0, 90]][..],
                5,
                1,
            ),
        ] {
            assert_eq!(jumps(before, now, clusters), want, "{name}");
        }
    }
}
