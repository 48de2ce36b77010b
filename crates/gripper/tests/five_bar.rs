//! The closed form of the five bars against a solver that only knows their lengths.

use proptest::prelude::*;
use std::f64::consts::PI;
use taxel_gripper::{FiveBar, FiveBarError, Spring};

const FINGER: FiveBar = FiveBar::FINGER;

/// Where pivot, joint, arm's end, crank's end and motor are, mm.
fn points(theta_a: f64, theta_p: f64, theta_u: f64) -> [[f64; 2]; 5] {
    let f = FINGER;
    let from =
        |[x, y]: [f64; 2], length: f64, angle: f64| [x + length * angle.cos(), y + length * angle.sin()];
    let motor = from([0.0; 2], f.e_mm, -f.gamma_rad);
    let joint = from([0.0; 2], f.a_mm, theta_u);
    let arm_end = from(joint, f.b_mm, theta_u + theta_p - f.psi_rad);
    [[0.0; 2], joint, arm_end, from(motor, f.d_mm, theta_a), motor]
}

fn distance([ax, ay]: [f64; 2], [bx, by]: [f64; 2]) -> f64 {
    (ax - bx).hypot(ay - by)
}

/// By how much the coupler is too long, mm.
fn gap(theta_a: f64, theta_p: f64, theta_u: f64) -> f64 {
    let [_, _, arm_end, crank_end, _] = points(theta_a, theta_p, theta_u);
    distance(arm_end, crank_end) - FINGER.c_mm
}

/// Newton's method on the coupler's length, its derivative by differences.
fn newton(theta_a: f64, theta_p: f64, guess: f64) -> f64 {
    let step = 1e-6;
    let mut theta_u = guess;
    for _ in 0..50 {
        let at = |theta_u| gap(theta_a, theta_p, theta_u);
        let slope = (at(theta_u + step) - at(theta_u - step)) / (2.0 * step);
        theta_u -= at(theta_u) / slope;
    }
    theta_u
}

fn rad(degrees: f64) -> f64 {
    degrees.to_radians()
}

#[test]
fn a_solver_that_knows_only_lengths_finds_the_same_finger_over_the_whole_range() {
    let mut closed = 0;
    for theta_p in (0..=90).map(|p| rad(f64::from(p))) {
        let mut guess = None;
        for theta_a in (-60..=90).map(|a| rad(f64::from(a))) {
            let Ok(theta_u) = FINGER.proximal_rad(theta_a, theta_p) else {
                continue;
            };
            assert!(gap(theta_a, theta_p, theta_u).abs() < 1e-9);
            // The solver goes on from its own last answer, so that it stays with one way of putting the bars together.
            let solved = newton(theta_a, theta_p, guess.unwrap_or(theta_u));
            let apart = (solved - theta_u) / (2.0 * PI);
            assert!(
                (apart - apart.round()).abs() < 1e-8,
                "{theta_a} {theta_p}: {solved} {theta_u}"
            );
            guess = Some(solved);
            closed += 1;
        }
    }
    assert!(closed > 10_000, "{closed}");
}

#[test]
fn small_steps_turn_the_finger_as_much_as_the_jacobian_says() {
    let step = 1e-6;
    for theta_p in [0, 20, 27, 42, 65, 90].map(|p| rad(f64::from(p))) {
        for theta_a in (-40..=90).step_by(5).map(|a| rad(f64::from(a))) {
            let Ok([by_motor, by_joint]) = FINGER.turning(theta_a, theta_p) else {
                continue;
            };
            let at = |a: f64, p: f64| FINGER.proximal_rad(theta_a + a, theta_p + p);
            let (Ok(more), Ok(less)) = (at(step, 0.0), at(-step, 0.0)) else {
                continue;
            };
            let (Ok(bent), Ok(straight)) = (at(0.0, step), at(0.0, -step)) else {
                continue;
            };
            let slopes = [(more - less) / (2.0 * step), (bent - straight) / (2.0 * step)];
            assert!(
                (slopes[0] - by_motor).abs() < 1e-6 * (1.0 + by_motor.abs()),
                "{theta_a} {theta_p}"
            );
            assert!(
                (slopes[1] - by_joint).abs() < 1e-6 * (1.0 + by_joint.abs()),
                "{theta_a} {theta_p}"
            );
        }
    }
}

#[test]
fn the_bars_close_up_to_the_angles_that_the_error_names_and_no_further() {
    for theta_p in [0.0, 20.0, 30.0, 42.0] {
        // The crank points at the pivot, where the bars close only with an arm's end that is far away.
        let error = FINGER.proximal_rad(rad(124.0), rad(theta_p)).unwrap_err();
        let FiveBarError::Open {
            least_deg, most_deg, ..
        } = error
        else {
            panic!("{error}");
        };
        let closes = |theta_a: f64| FINGER.proximal_rad(rad(theta_a), rad(theta_p)).is_ok();
        assert!(closes(least_deg + 1e-6) && closes(most_deg - 1e-6));
        assert!(!closes(least_deg - 1e-3) && !closes(most_deg + 1e-3));
        let near_the_end = FINGER.turning(rad(most_deg - 1e-9), rad(theta_p));
        let far = near_the_end.map(|[by_motor, _]| by_motor.abs() > 1e3);
        assert!(
            !matches!(far, Ok(false)),
            "the finger turns without bound at the end"
        );
    }
}

#[test]
fn an_angle_that_is_lost_or_a_finger_that_cannot_be_is_named() {
    let cases = [
        (FINGER.proximal_rad(f64::NAN, 0.7), "theta_a is NaN"),
        (FINGER.proximal_rad(0.1, f64::INFINITY), "theta_p is inf"),
        (FINGER.actuated_rad(f64::NAN, 0.7), "theta_u is NaN"),
        (
            FINGER.proximal_rad(rad(124.0), rad(42.0)),
            "theta_a = 124.00 degrees: with theta_p = 42.00",
        ),
        (
            FINGER.actuated_rad(rad(-56.0), rad(42.0)),
            "no theta_a gives theta_u = -56.00 degrees",
        ),
    ];
    for (result, expected) in cases {
        let error = result.unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
}

#[test]
fn forces_do_as_much_work_as_the_motor_and_the_spring() {
    let spring = Spring {
        stiffness_nmm_per_rad: 120.0,
        rest_rad: rad(30.0),
    };
    let (torque, contacts) = (600.0, [25.0, 40.0]);
    for (theta_a, theta_p) in
        [(10.0, 42.0), (40.0, 45.0), (65.0, 50.0), (30.0, 30.0)].map(|(a, p)| (rad(a), rad(p)))
    {
        let forces = FINGER
            .contact_forces_n([theta_a, theta_p], torque, spring, contacts)
            .unwrap();
        let theta_u = FINGER.proximal_rad(theta_a, theta_p).unwrap();
        // Where the contacts are, and which way the phalanges press.
        let contact = |u: f64, p: f64| {
            let joint = [FINGER.a_mm * u.cos(), FINGER.a_mm * u.sin()];
            [
                [contacts[0] * u.cos(), contacts[0] * u.sin()],
                [
                    joint[0] + contacts[1] * (u + p).cos(),
                    joint[1] + contacts[1] * (u + p).sin(),
                ],
            ]
        };
        let across = [theta_u, theta_u + theta_p].map(|angle| [-angle.sin(), angle.cos()]);
        for (du, dp) in [(1e-6, 0.0), (0.0, 1e-6), (1e-6, -2e-6)] {
            let before = contact(theta_u - du, theta_p - dp);
            let after = contact(theta_u + du, theta_p + dp);
            let of_contacts: f64 = (0..2)
                .map(|i| {
                    let way = [after[i][0] - before[i][0], after[i][1] - before[i][1]];
                    forces[i] * (way[0] * across[i][0] + way[1] * across[i][1])
                })
                .sum();
            let motor = |sign: f64| {
                FINGER
                    .actuated_rad(theta_u + sign * du, theta_p + sign * dp)
                    .unwrap()
            };
            let of_spring = -spring.stiffness_nmm_per_rad * (theta_p - spring.rest_rad) * 2.0 * dp;
            let work = torque * (motor(1.0) - motor(-1.0)) + of_spring;
            assert!((of_contacts - work).abs() < 1e-8, "{of_contacts} {work}");
        }
    }
}

#[test]
fn the_coupler_acts_where_its_line_meets_the_phalanx() {
    for (theta_a, theta_p) in [(10.0, 42.0), (40.0, 45.0), (65.0, 50.0)].map(|(a, p)| (rad(a), rad(p))) {
        let theta_u = FINGER.proximal_rad(theta_a, theta_p).unwrap();
        let [_, joint, arm_end, crank_end, _] = points(theta_a, theta_p, theta_u);
        let along = [joint[0] / FINGER.a_mm, joint[1] / FINGER.a_mm];
        let coupler = [arm_end[0] - crank_end[0], arm_end[1] - crank_end[1]];
        let cross = |u: [f64; 2], v: [f64; 2]| u[0] * v[1] - u[1] * v[0];
        let h = cross(crank_end, coupler) / cross(along, coupler) - FINGER.a_mm;
        let [_, by_joint] = FINGER.turning(theta_a, theta_p).unwrap();
        assert!((by_joint + h / (h + FINGER.a_mm)).abs() < 1e-9);
    }
}

#[test]
fn contacts_behind_their_joints_and_torques_that_are_no_numbers_are_refused() {
    let spring = Spring {
        stiffness_nmm_per_rad: 100.0,
        rest_rad: 0.5,
    };
    let forces = |torque, contacts| FINGER.contact_forces_n([0.5, 0.7], torque, spring, contacts);
    assert!(forces(1.0, [20.0, 30.0]).is_ok());
    for (torque, contacts, named) in [
        (f64::NAN, [20.0, 30.0], "torque is NaN"),
        (1.0, [0.0, 30.0], "first contact is 0"),
        (1.0, [20.0, -1.0], "second contact is -1"),
    ] {
        let error = forces(torque, contacts).unwrap_err().to_string();
        assert!(error.contains(named), "{error}");
    }
}

#[test]
fn forces_have_no_bound_at_the_cranks_dead_point() {
    // The finger closes as the motor turns on, up to where crank and coupler lie in one line.
    let theta_p = rad(65.0);
    let by_motor = |theta_a: f64| FINGER.turning(theta_a, theta_p).unwrap()[0];
    let (mut before, mut beyond) = (rad(60.0), rad(118.0));
    assert!(by_motor(before) > 0.0 && by_motor(beyond) < 0.0);
    for _ in 0..100 {
        let middle = 0.5 * (before + beyond);
        *(if by_motor(middle) > 0.0 {
            &mut before
        } else {
            &mut beyond
        }) = middle;
    }
    let error = FINGER.transfer(before, theta_p).unwrap_err();
    assert!(
        matches!(
            error,
            FiveBarError::Singular {
                bars: "crank and coupler",
                ..
            }
        ),
        "{error}"
    );
}

proptest! {
    #[test]
    fn a_finger_goes_to_its_motors_angle_and_back(theta_a in -60.0..80.0_f64, theta_p in 0.0..90.0_f64, turns in -3..=3) {
        let (theta_a, theta_p) = (rad(theta_a), rad(theta_p));
        if let Ok(theta_u) = FINGER.proximal_rad(theta_a + f64::from(turns) * 2.0 * PI, theta_p) {
            prop_assert!(theta_u > -PI && theta_u <= PI);
            if FINGER.turning(theta_a, theta_p).is_ok_and(|[by_motor, _]| by_motor > 1e-3) {
                let back = FINGER.actuated_rad(theta_u, theta_p).unwrap();
                prop_assert!((back - theta_a).abs() < 1e-6, "{back} {theta_a}");
            }
        }
    }

    #[test]
    fn no_angle_is_answered_by_what_is_none(theta_a in any::<f64>(), theta_p in any::<f64>()) {
        for result in [FINGER.proximal_rad(theta_a, theta_p), FINGER.actuated_rad(theta_a, theta_p)] {
            prop_assert!(result.is_err() || result.is_ok_and(|angle| angle.abs() <= PI));
        }
    }
}
