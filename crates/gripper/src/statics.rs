use crate::error::FiveBarError;
use crate::five_bar::FiveBar;

/// The least share of the motor's turn that the finger must follow for forces to be finite.
const DEAD: f64 = 1e-9;

/// The spring between the phalanges, which holds them apart where nothing is touched.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spring {
    /// Torque by angle, N mm/rad. No publication gives it.
    pub stiffness_nmm_per_rad: f64,
    /// The angle between the phalanges at which it is slack, rad.
    pub rest_rad: f64,
}

impl FiveBar {
    /// What turns the phalanges, by what turns motor and joint: a row for `theta_u` and one for `theta_p`, a column for
    /// the motor's torque and one for the spring's.
    ///
    /// By virtual work: the motor's turn is `(d theta_u - J_p d theta_p) / J_a`, with [`FiveBar::turning`] as `[J_a, J_p]`.
    /// It is the transfer matrix of Birglen and Gosselin with the crank's ratio in it; `-J_p` is their `h / (h + a)`, with
    /// `h` from the joint to where the coupler's line meets the phalanx's. The same laboratory's public code has the
    /// chain as `fcn_matriz_transfer.m`, which takes `N` for `N^2` under one root; this is the mended one.
    ///
    /// # Errors
    /// As [`FiveBar::turning`], and at the crank's dead points, where any torque of the finger is held by none of the
    /// motor.
    pub fn transfer(&self, actuated_rad: f64, passive_rad: f64) -> Result<[[f64; 2]; 2], FiveBarError> {
        let [by_motor, by_joint] = self.turning(actuated_rad, passive_rad)?;
        if by_motor.abs() < DEAD {
            return Err(self.singular(actuated_rad, passive_rad, "crank and coupler"));
        }
        Ok([[1.0 / by_motor, 0.0], [-by_joint / by_motor, 1.0]])
    }

    /// What the two phalanges press with at right angles to themselves, N, where the finger rests: proximal, distal.
    /// Below 0 a contact pulls, so that there is none and the finger goes on closing around the other.
    ///
    /// `contacts_mm` is from the finger's pivot to the first contact, and from the joint to the second. The torques at the
    /// phalanges are `[[k1, k2 + a cos theta_p], [0, k2]]` times the forces.
    ///
    /// # Errors
    /// As [`FiveBar::transfer`]; a contact that is not beyond its joint, or a torque or spring that is not finite.
    pub fn contact_forces_n(
        &self,
        [actuated_rad, passive_rad]: [f64; 2],
        torque_nmm: f64,
        spring: Spring,
        contacts_mm: [f64; 2],
    ) -> Result<[f64; 2], FiveBarError> {
        for (what, value) in [
            ("the motor's torque", torque_nmm),
            ("the spring's stiffness", spring.stiffness_nmm_per_rad),
            ("the spring's angle of rest", spring.rest_rad),
        ] {
            if !value.is_finite() {
                let must = "a number";
                return Err(FiveBarError::Statics { what, value, must });
            }
        }
        for (what, value) in ["the first contact", "the second contact"]
            .into_iter()
            .zip(contacts_mm)
        {
            if !(value > 0.0 && value.is_finite()) {
                let must = "above 0 mm from its joint";
                return Err(FiveBarError::Statics { what, value, must });
            }
        }
        let transfer = self.transfer(actuated_rad, passive_rad)?;
        let of_spring = -spring.stiffness_nmm_per_rad * (passive_rad - spring.rest_rad);
        let [proximal_nmm, distal_nmm] =
            transfer.map(|[motor, joint]| motor * torque_nmm + joint * of_spring);
        let [first_mm, second_mm] = contacts_mm;
        let distal_n = distal_nmm / second_mm;
        let lever_mm = second_mm + self.a_mm * passive_rad.cos();
        Ok([(proximal_nmm - lever_mm * distal_n) / first_mm, distal_n])
    }
}
