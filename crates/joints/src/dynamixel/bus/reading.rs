//! What a servo said in a cycle, or why it said nothing.

use crate::dynamixel::config::ServoConfig;
use crate::dynamixel::protocol2::StatusError;
use crate::dynamixel::registers::{angle_rad, pwm_share, velocity_rad_s};

/// One joint in one cycle.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
pub struct JointReading {
    /// When the servo's answer began on the bus, by the caller's clock, nanoseconds: computed from
    /// the time of the request and the bytes before the answer, and never after the answer came.
    pub t_ns: u64,
    /// The joint's angle, radians: homed, and in the joint's direction.
    pub angle_rad: f64,
    /// The joint's velocity in its direction, rad/s.
    pub velocity_rad_s: f64,
    /// Motor current in the joint's direction, amperes; `None` while the model is not known or if
    /// it has no sensor.
    pub current_a: Option<f64>,
    /// Share of full PWM in the joint's direction, -1 to 1.
    pub pwm: f64,
    /// Present Position as the servo sent it, pulses.
    pub position: i32,
    /// Present Current as the servo sent it.
    pub current_counts: i16,
    /// Whether the servo reports a hardware error (address 70 says which).
    pub alert: bool,
}

/// Why a servo has no reading in a cycle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum NoReading {
    /// Asked, and no answer before the deadline.
    #[error("no answer: check the servo's power, cable, id and baud rate")]
    Silent,
    /// Silent before; not asked in this cycle, and asked again before long.
    #[error("silent for a while and asked less often; it is asked again within half a second")]
    Resting,
    /// The answer came damaged.
    #[error("the answer was damaged (CRC): check cable, termination and baud rate")]
    BadCrc,
    /// Two servos with one id have answered.
    #[error(
        "two servos answer with this id, and the angle of neither is taken: give one of them an id of its own"
    )]
    Double,
    /// The servo refused to answer.
    #[error("the servo refused: {0}")]
    Refused(StatusError),
    /// There has been no cycle, or the port is away.
    #[error("not asked yet")]
    NotAsked,
}

/// Bytes from Present PWM to the end of Present Position.
pub(crate) const PRESENT_BYTES: usize = 12;

impl JointReading {
    /// From the twelve bytes at address 124.
    pub(crate) fn decode(
        bytes: &[u8; PRESENT_BYTES],
        config: &ServoConfig,
        current_unit_a: Option<f64>,
        alert: bool,
        t_ns: u64,
    ) -> Self {
        let [a, b, c, d, v0, v1, v2, v3, p0, p1, p2, p3] = *bytes;
        let direction = f64::from(config.direction);
        let position = i32::from_le_bytes([p0, p1, p2, p3]);
        let current_counts = i16::from_le_bytes([c, d]);
        Self {
            t_ns,
            angle_rad: direction * (angle_rad(position) - config.homing_rad),
            velocity_rad_s: direction * velocity_rad_s(i32::from_le_bytes([v0, v1, v2, v3])),
            current_a: current_unit_a.map(|unit| direction * f64::from(current_counts) * unit),
            pwm: direction * pwm_share(i16::from_le_bytes([a, b])),
            position,
            current_counts,
            alert,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn homing_and_direction_turn_servo_angles_into_joint_angles() {
        let mut bytes = [0; 12];
        bytes[0..2].copy_from_slice(&(-100_i16).to_le_bytes());
        bytes[2..4].copy_from_slice(&200_i16.to_le_bytes());
        bytes[4..8].copy_from_slice(&(-10_i32).to_le_bytes());
        bytes[8..12].copy_from_slice(&3072_i32.to_le_bytes());
        let mut config = ServoConfig {
            id: 1,
            name: "j".into(),
            homing_rad: 0.5,
            direction: -1,
        };
        let quarter = std::f64::consts::FRAC_PI_2;
        let r = JointReading::decode(&bytes, &config, Some(0.00269), true, 5);
        assert!((r.angle_rad - (0.5 - quarter)).abs() < 1e-12);
        assert!((r.velocity_rad_s - 0.239_808).abs() < 1e-5);
        assert!((r.current_a.unwrap() + 0.538).abs() < 1e-9);
        assert!((r.pwm - 0.113).abs() < 1e-9);
        assert_eq!(
            (r.position, r.current_counts, r.alert, r.t_ns),
            (3072, 200, true, 5)
        );
        config.direction = 1;
        let r = JointReading::decode(&bytes, &config, None, false, 5);
        assert!((r.angle_rad - (quarter - 0.5)).abs() < 1e-12);
        assert_eq!(r.current_a, None);
    }
}
