//! Body of a model, at rest.

use super::Curve;
use flotor_hal::{CenterlineInfo, Pose};

/// Constant data of a body: sizes for drawing, and the shape at rest.
#[derive(Clone, Debug)]
pub struct Body {
    /// Radii of wire, helix and plates, m, and number of turns.
    pub info: CenterlineInfo,
    /// Centreline at home.
    pub rest: Curve,
    /// Length of the centreline at home, m.
    pub rest_length_m: f64,
}

impl Body {
    /// Creates a body from the description of a model; `None` if the description is invalid or there is nothing to draw.
    #[must_use]
    pub fn new(info: CenterlineInfo, rest: &[Pose]) -> Option<Self> {
        let numbers = [info.tube_radius_m, info.helix_radius_m, info.helix_turns, info.plate_radius_m];
        if !numbers.iter().all(|number| number.is_finite() && *number >= 0.0) || info.tube_radius_m == 0.0 {
            return None;
        }
        let curve = Curve::through(rest)?;
        let steps = rest.windows(2).map(|pair| (pair[1].position() - pair[0].position()).length());
        let rest_length_m: f64 = steps.sum();
        (rest_length_m > 0.0).then_some(Self { info, rest: curve, rest_length_m })
    }

    /// Returns whether a wire is wound about the centreline; false for a plain tube.
    #[must_use]
    pub fn is_coil(&self) -> bool {
        self.info.helix_turns > 0.0 && self.info.helix_radius_m > 0.0
    }
}
