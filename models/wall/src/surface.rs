//! Material of a surface.

/// Material of a surface: spring, damper and Coulomb friction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// Stiffness `K`, N/m.
    pub stiffness_n_per_m: f64,
    /// Damping `B` along the normal while in contact, N s/m.
    pub damping_ns_per_m: f64,
    /// Coefficient of friction `mu`.
    pub friction: f64,
}

impl Surface {
    /// Returns the normal force on a handle at `depth_m` that moves outwards at `outwards_m_per_s`, N; never
    /// attractive. Real-time: bounded, no allocation.
    #[must_use]
    pub fn normal_force_n(&self, depth_m: f64, outwards_m_per_s: f64) -> f64 {
        (self.stiffness_n_per_m * depth_m - self.damping_ns_per_m * outwards_m_per_s).max(0.0)
    }
}
