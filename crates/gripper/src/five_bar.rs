use crate::error::FiveBarError;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Sines of angles between bars below which they lie in one line.
const IN_LINE: f64 = 1e-9;

/// A finger as a linkage of five bars in a plane.
///
/// The finger's pivot is the origin. The motor's axis is `e` from it, at the angle `-gamma`, and turns a crank `d` to
/// `theta_a`. The proximal phalanx `a` is at `theta_u`. The distal phalanx is at `theta_u + theta_p`, and its arm `b` is
/// `psi` behind that. A coupler `c` joins the ends of crank and arm. All angles grow counterclockwise; a finger closes
/// as `theta_a` grows.
///
/// `a` to `d` are those of the 2022 publication's Table 2. `e`, `gamma` and `psi` are not in it: they are from the same
/// laboratory's public code for the same fingers (github.com/TaISLab/Code_dynamixel_model). That zero and sign of angles
/// in the publication's data are those of this linkage is plausible, since the bars close for all of them, and unverified.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FiveBar {
    /// Proximal phalanx, from the finger's pivot to the joint between the phalanges, mm.
    pub a_mm: f64,
    /// Arm of the distal phalanx, from that joint to the coupler, mm.
    pub b_mm: f64,
    /// Coupler, mm.
    pub c_mm: f64,
    /// The motor's crank, mm.
    pub d_mm: f64,
    /// From the finger's pivot to the motor's axis, mm.
    pub e_mm: f64,
    /// The angle by which the arm is behind the distal phalanx, rad.
    pub psi_rad: f64,
    /// The angle by which the motor's axis is below the finger's zero, rad.
    pub gamma_rad: f64,
}

/// A vector in the finger's plane, mm.
type Vector = [f64; 2];

fn polar(length: f64, angle_rad: f64) -> Vector {
    [length * angle_rad.cos(), length * angle_rad.sin()]
}

fn angle_of([x, y]: Vector) -> f64 {
    y.atan2(x)
}

fn minus(u: Vector, v: Vector) -> Vector {
    [u[0] - v[0], u[1] - v[1]]
}

fn plus(u: Vector, v: Vector) -> Vector {
    [u[0] + v[0], u[1] + v[1]]
}

fn cross(u: Vector, v: Vector) -> f64 {
    u[0] * v[1] - u[1] * v[0]
}

fn length([x, y]: Vector) -> f64 {
    x.hypot(y)
}

/// The angle in a triangle between two sides, by the third; `None` where they are no triangle.
fn enclosed(side: f64, other: f64, opposite: f64) -> Option<f64> {
    let cosine = (side * side + other * other - opposite * opposite) / (2.0 * side * other);
    // Where the bars are stretched, rounding may be on either side of 1.
    (cosine.abs() <= 1.0 + 1e-12).then(|| cosine.clamp(-1.0, 1.0).acos())
}

/// The same angle in (-pi, pi].
fn wrapped(angle_rad: f64) -> f64 {
    let turned = angle_rad - TAU * (angle_rad / TAU).round();
    if turned <= -PI { turned + TAU } else { turned }
}

fn finite(angle: &'static str, value: f64) -> Result<(), FiveBarError> {
    if value.is_finite() {
        return Ok(());
    }
    Err(FiveBarError::NotFinite { angle, value })
}

impl FiveBar {
    /// A finger of the gripper of 2022.
    pub const FINGER: Self = Self {
        a_mm: 40.0,
        b_mm: 20.0,
        c_mm: 60.0,
        d_mm: 25.0,
        e_mm: 27.8,
        psi_rad: FRAC_PI_2,
        gamma_rad: 56.0 * PI / 180.0,
    };

    /// The proximal phalanx's angle, rad in (-pi, pi], from the motor's and that between the phalanges.
    ///
    /// With O4 the end of the crank and O3 that of the arm, both are seen from the pivot under known angles but for
    /// `theta_u`, and the angle between them is that of a triangle whose third side is the coupler. Of its two solutions
    /// the finger is the one with O3 counterclockwise of O4: the other would be put together in another way, and the
    /// finger cannot pass from one to the other, since pivot and coupler are in one line between them.
    ///
    /// # Errors
    /// An angle that is not finite, or one at which the bars do not close, with the angles at which they do.
    pub fn proximal_rad(&self, actuated_rad: f64, passive_rad: f64) -> Result<f64, FiveBarError> {
        finite("theta_a", actuated_rad)?;
        finite("theta_p", passive_rad)?;
        let (crank_end, arm_end) = (self.crank_end(actuated_rad), self.arm_end_of_finger(passive_rad));
        let (f, h) = (length(crank_end), length(arm_end));
        let between = enclosed(f, h, self.c_mm).ok_or_else(|| {
            let [least_deg, most_deg] = self.closing_deg(h);
            FiveBarError::Open {
                actuated_deg: actuated_rad.to_degrees(),
                passive_deg: passive_rad.to_degrees(),
                least_deg,
                most_deg,
            }
        })?;
        Ok(wrapped(angle_of(crank_end) - angle_of(arm_end) + between))
    }

    /// The motor's angle, rad in (-pi, pi], that puts the proximal phalanx at one. Of two such angles it is the one at
    /// which the finger still closes as the motor turns on; the other lies beyond the crank's dead point.
    ///
    /// # Errors
    /// An angle that is not finite, or a finger that these bars cannot make.
    pub fn actuated_rad(&self, proximal_rad: f64, passive_rad: f64) -> Result<f64, FiveBarError> {
        finite("theta_u", proximal_rad)?;
        finite("theta_p", passive_rad)?;
        let (proximal_deg, passive_deg) = (proximal_rad.to_degrees(), passive_rad.to_degrees());
        let arm_end = self.arm_end(proximal_rad, passive_rad);
        let from_motor = minus(arm_end, self.motor());
        let distance_mm = length(from_motor);
        let between = enclosed(self.d_mm, distance_mm, self.c_mm).ok_or(FiveBarError::OutOfReach {
            proximal_deg,
            passive_deg,
            distance_mm,
            least_mm: (self.c_mm - self.d_mm).abs(),
            most_mm: self.c_mm + self.d_mm,
        })?;
        let actuated_rad = wrapped(angle_of(from_motor) - between);
        let crank_end = self.crank_end(actuated_rad);
        // At the very end of the way rounding may be on either side.
        if cross(crank_end, arm_end) < -IN_LINE * length(crank_end) * length(arm_end) {
            return Err(FiveBarError::OtherAssembly {
                proximal_deg,
                passive_deg,
            });
        }
        Ok(actuated_rad)
    }

    /// How far the proximal phalanx turns when the motor does, and when the joint between the phalanges does:
    /// `[d theta_u / d theta_a, d theta_u / d theta_p]`.
    ///
    /// Both come from the coupler's length, which no motion changes.
    ///
    /// # Errors
    /// As [`FiveBar::proximal_rad`], and where pivot and coupler lie in one line: there the finger turns without bound.
    pub fn turning(&self, actuated_rad: f64, passive_rad: f64) -> Result<[f64; 2], FiveBarError> {
        let proximal_rad = self.proximal_rad(actuated_rad, passive_rad)?;
        let crank_end = self.crank_end(actuated_rad);
        let arm_end = self.arm_end(proximal_rad, passive_rad);
        let coupler = minus(arm_end, crank_end);
        let of_finger = cross(arm_end, coupler);
        if of_finger.abs() < IN_LINE * length(arm_end) * self.c_mm {
            return Err(self.singular(actuated_rad, passive_rad, "pivot and coupler"));
        }
        let arm = minus(arm_end, polar(self.a_mm, proximal_rad));
        let crank = minus(crank_end, self.motor());
        Ok([
            cross(crank, coupler) / of_finger,
            -cross(arm, coupler) / of_finger,
        ])
    }

    /// The motor's angles, degrees, between which the bars close where the arm's end is `h_mm` from the pivot.
    fn closing_deg(&self, h_mm: f64) -> [f64; 2] {
        let nearest = (self.c_mm - h_mm).abs();
        // How far the crank may be turned from where it points away from the pivot. All the way round where it is always
        // far enough.
        let half = enclosed(self.d_mm, self.e_mm, nearest).map_or(PI, |inner| PI - inner);
        [-half, half].map(|turn| (turn - self.gamma_rad).to_degrees())
    }

    pub(crate) fn singular(&self, actuated_rad: f64, passive_rad: f64, bars: &'static str) -> FiveBarError {
        FiveBarError::Singular {
            actuated_deg: actuated_rad.to_degrees(),
            passive_deg: passive_rad.to_degrees(),
            bars,
        }
    }

    fn motor(&self) -> Vector {
        polar(self.e_mm, -self.gamma_rad)
    }

    fn crank_end(&self, actuated_rad: f64) -> Vector {
        plus(self.motor(), polar(self.d_mm, actuated_rad))
    }

    /// Where the arm ends, seen along the proximal phalanx.
    fn arm_end_of_finger(&self, passive_rad: f64) -> Vector {
        plus([self.a_mm, 0.0], polar(self.b_mm, passive_rad - self.psi_rad))
    }

    fn arm_end(&self, proximal_rad: f64, passive_rad: f64) -> Vector {
        let arm = polar(self.b_mm, proximal_rad + passive_rad - self.psi_rad);
        plus(polar(self.a_mm, proximal_rad), arm)
    }
}
