//! Contact between a ball and the masses of a network.

use crate::vectors::Vectors;
use flotor_hal::{DVec3, restorable};
use std::ops::Range;

/// Ball that touches the network.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// Centre, m.
    pub centre_m: DVec3,
    /// Radius, m.
    pub radius_m: f64,
}

restorable!(Ball { centre_m } without { radius_m });

impl Ball {
    /// Adds the contact forces of the ball to the masses of a block; returns the force on the ball, N. Real-time:
    /// bounded, no allocation.
    #[inline]
    pub(crate) fn push(
        &self,
        contact_n_per_m: f64,
        positions_m: &Vectors,
        forces_n: &mut Vectors,
        range: Range<usize>,
    ) -> DVec3 {
        /// Floor of a squared distance, m²: a mass at the very centre gets no force.
        const LEAST_SQUARE: f64 = 1.0e-300;
        let count = range.len();
        let [x, y, z] = positions_m.slices(range.clone());
        let centre_m = self.centre_m;
        // Most blocks are far away: reject them in one cheap pass.
        let near = self.radius_m * self.radius_m;
        let mut inside = 0_u32;
        for i in 0..count {
            let (dx, dy, dz) = (x[i] - centre_m.x, y[i] - centre_m.y, z[i] - centre_m.z);
            inside += u32::from(dx * dx + dy * dy + dz * dz < near);
        }
        if inside == 0 {
            return DVec3::ZERO;
        }
        let [fx, fy, fz] = forces_n.slices_mut(range);
        let mut on_ball_n = DVec3::ZERO;
        for i in 0..count {
            let out = DVec3::new(x[i], y[i], z[i]) - centre_m;
            let distance_m = out.length_squared().max(LEAST_SQUARE).sqrt();
            let push = out * (contact_n_per_m * (self.radius_m - distance_m).max(0.0) / distance_m);
            fx[i] += push.x;
            fy[i] += push.y;
            fz[i] += push.z;
            on_ball_n -= push;
        }
        on_ball_n
    }
}
