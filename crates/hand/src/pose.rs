//! Where a module sits on the hand, and how it is turned.

use serde::{Deserialize, Serialize};

/// Place and orientation of a module's own frame, relative to the link that its joint moves, or to
/// the hand's base where it names no joint.
///
/// The module's frame has its origin at the first cell of the module's tile (row 0, column 0, as
/// its board is drawn, whether or not a taxel is there), x along a row, y from row to row, and z =
/// x cross y.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// Origin of the module's frame, millimetres.
    pub position_mm: [f32; 3],
    /// Unit quaternion w, x, y, z that turns vectors of the module's frame into those of the link's.
    pub orientation: [f32; 4],
}

impl Pose {
    /// A point of the module's frame, millimetres, in the link's.
    ///
    /// ```
    /// use taxel_hand::Pose;
    ///
    /// // Turned by 90 degrees about z, 30 mm along x.
    /// let half = std::f32::consts::FRAC_1_SQRT_2;
    /// let pose = Pose { position_mm: [30.0, 0.0, 0.0], orientation: [half, 0.0, 0.0, half] };
    /// let [x, y, z] = pose.apply([4.7, 0.0, 0.0]);
    /// assert!((x - 30.0).abs() < 1e-4 && (y - 4.7).abs() < 1e-4 && z == 0.0);
    /// ```
    pub fn apply(&self, point_mm: [f32; 3]) -> [f32; 3] {
        let [w, x, y, z] = self.orientation;
        let cross = |[a, b, c]: [f32; 3], [d, e, f]: [f32; 3]| [b * f - c * e, c * d - a * f, a * e - b * d];
        // p + 2 q x (q x p + w p), with q the vector part.
        let inner = cross([x, y, z], point_mm);
        let inner: [f32; 3] = std::array::from_fn(|i| inner[i] + w * point_mm[i]);
        let outer = cross([x, y, z], inner);
        std::array::from_fn(|i| self.position_mm[i] + point_mm[i] + 2.0 * outer[i])
    }
}
