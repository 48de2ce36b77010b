/// Why a linkage has no answer for two angles. Angles are in degrees, as sensors give them.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FiveBarError {
    /// An angle is lost.
    #[error("{angle} is {value}, no angle; read the sensor again, or do without this finger")]
    NotFinite {
        /// `theta_a`, `theta_p` or `theta_u`.
        angle: &'static str,
        /// What it is.
        value: f64,
    },
    /// The coupler does not reach from the motor's crank to the distal phalanx.
    #[error(
        "the five bars do not close at theta_a = {actuated_deg:.2} degrees: with theta_p = {passive_deg:.2} degrees \
         theta_a is between {least_deg:.2} and {most_deg:.2}; look after the zero and the sign of both"
    )]
    Open {
        /// The motor's angle.
        actuated_deg: f64,
        /// The angle between the phalanges.
        passive_deg: f64,
        /// From here the bars close.
        least_deg: f64,
        /// To here.
        most_deg: f64,
    },
    /// Crank and coupler do not reach to where the distal phalanx would be.
    #[error(
        "no theta_a gives theta_u = {proximal_deg:.2} degrees: with theta_p = {passive_deg:.2} degrees the coupler would \
         end {distance_mm:.1} mm from the motor, and crank and coupler reach from {least_mm:.1} to {most_mm:.1} mm"
    )]
    OutOfReach {
        /// The angle of the proximal phalanx.
        proximal_deg: f64,
        /// The angle between the phalanges.
        passive_deg: f64,
        /// From the motor's axis to the end of the coupler.
        distance_mm: f64,
        /// Coupler without crank.
        least_mm: f64,
        /// Coupler and crank.
        most_mm: f64,
    },
    /// The coupler would lie on the other side of the finger's pivot.
    #[error(
        "theta_u = {proximal_deg:.2} degrees with theta_p = {passive_deg:.2} degrees is a finger put together the other \
         way round; the coupler does not pass the pivot"
    )]
    OtherAssembly {
        /// The angle of the proximal phalanx.
        proximal_deg: f64,
        /// The angle between the phalanges.
        passive_deg: f64,
    },
    /// An angle at which a small turn of the motor is none of the finger, or as large a one as one likes.
    #[error(
        "theta_a = {actuated_deg:.2} degrees with theta_p = {passive_deg:.2} degrees is a singularity: {bars} lie in one \
         line, so motion and force have no finite ratio"
    )]
    Singular {
        /// The motor's angle.
        actuated_deg: f64,
        /// The angle between the phalanges.
        passive_deg: f64,
        /// Which bars.
        bars: &'static str,
    },
    /// A contact or a spring that cannot be.
    #[error("{what} is {value}; it must be {must}")]
    Statics {
        /// What of the finger.
        what: &'static str,
        /// What it is.
        value: f64,
        /// What it can be.
        must: &'static str,
    },
}
