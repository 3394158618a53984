//! Limits of the wrench on the coils, independent of the host.

use flotor_hal::{DVec3, Wrench, math};

/// Limits of the controller: largest wrench and slew rates, wall, edge of the range, and load of the coils.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LimitConfig {
    /// Largest force along each axis, N.
    pub max_force_n: DVec3,
    /// Largest torque about each axis, N·m.
    pub max_torque_nm: DVec3,
    /// Maximum slew rate of the force, N/s.
    pub force_slew_n_per_s: f64,
    /// Maximum slew rate of the torque, N·m/s.
    pub torque_slew_nm_per_s: f64,
    /// Distance from the origin at which the controller's own wall begins, m.
    pub wall_m: f64,
    /// Stiffness of the controller's own wall, N/m.
    pub wall_n_per_m: f64,
    /// Damping of the controller's own wall against outward motion, N·s/m.
    pub wall_ns_per_m: f64,
    /// Distance from the origin at which the controller lands, before the sensors lose the flotor, m.
    pub edge_m: f64,
    /// Time ahead for which the distance is predicted before the comparison with `edge_m`, s.
    pub edge_ahead_s: f64,
    /// Limit of the root mean square of the load. The load is the largest ratio of a component of the wrench to its limit.
    pub continuous_load: f64,
    /// Time constant of the mean square of the load, s.
    pub load_time_s: f64,
}

impl LimitConfig {
    /// Published limits of the device (`facts`): the weaker force on the horizontal axes; full scale in a millisecond; 2 A
    /// of 3.5 A mean over a minute. The wall begins just inside the sensors' range with the makers' damping, 15 N·s/m, and
    /// a stiffness that keeps the sum of this wall and one of the host (10 000 N/m, 15 N·s/m) below the limit of Gil et al.
    /// 2009 for a period and a delay of a millisecond: 30 / 0.0015 = 20 000 N/m. Landing starts 0.05 mm short of the
    /// sensors' range of 12 mm, predicted two cycles ahead: one to detect, one to react.
    pub const MAGLEV: Self = Self {
        max_force_n: DVec3::new(55.0, 55.0, 140.0),
        max_torque_nm: DVec3::new(6.3, 6.3, 12.2),
        force_slew_n_per_s: 55.0e3,
        torque_slew_nm_per_s: 6.3e3,
        wall_m: 11.8e-3,
        wall_n_per_m: 8000.0,
        wall_ns_per_m: 15.0,
        edge_m: 11.95e-3,
        edge_ahead_s: 2.0e-3,
        continuous_load: 2.0 / 3.5,
        load_time_s: 60.0,
    };

    /// Returns the force of the controller's own wall, N; `None` in free space (closer to the centre than the wall), and for a
    /// position that is not finite. The damping resists outward motion only.
    pub(super) fn wall(&self, position_m: DVec3, velocity_m_per_s: DVec3) -> Option<DVec3> {
        let distance_m = position_m.length();
        let depth_m = distance_m - self.wall_m;
        if depth_m <= 0.0 || !distance_m.is_finite() {
            return None;
        }
        let outward = position_m / distance_m;
        let leaving_m_per_s = velocity_m_per_s.dot(outward).max(0.0);
        Some(outward * -(self.wall_n_per_m * depth_m + self.wall_ns_per_m * leaving_m_per_s))
    }

    /// Returns true if the flotor is at the edge of the range, or will be within the prediction time.
    pub(super) fn is_leaving(&self, position_m: DVec3, velocity_m_per_s: DVec3) -> bool {
        let distance_m = position_m.length();
        let outward = position_m / distance_m.max(f64::MIN_POSITIVE);
        let leaving_m_per_s = velocity_m_per_s.dot(outward).max(0.0);
        distance_m + leaving_m_per_s * self.edge_ahead_s >= self.edge_m
    }

    /// Returns the wrench clamped to the limits of each axis.
    pub(super) fn clamped(&self, wrench: &Wrench) -> Wrench {
        Wrench::new(
            wrench.force().clamp(-self.max_force_n, self.max_force_n),
            wrench.torque().clamp(-self.max_torque_nm, self.max_torque_nm),
        )
    }

    /// Returns the next wrench from `last` towards `wanted` within the slew limits.
    pub(super) fn slewed(&self, last: &Wrench, wanted: &Wrench, dt_s: f64) -> Wrench {
        let step = |from: DVec3, to: DVec3, most: f64| from + (to - from).clamp_length_max(most * dt_s);
        Wrench::new(
            step(last.force(), wanted.force(), self.force_slew_n_per_s),
            step(last.torque(), wanted.torque(), self.torque_slew_nm_per_s),
        )
    }

    /// Returns the largest fraction of any axis' limit in a wrench.
    fn share(&self, wrench: &Wrench) -> f64 {
        let force = (wrench.force() / self.max_force_n).abs().max_element();
        force.max((wrench.torque() / self.max_torque_nm).abs().max_element())
    }
}

/// Running mean square of the load, with the time constant of a coil's temperature (I²t).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Load {
    mean_square: f64,
}

impl Load {
    /// Updates the mean square with a wrench applied for `dt_s`; returns true if the continuous limit is exceeded.
    pub fn update(&mut self, wrench: &Wrench, dt_s: f64, limits: &LimitConfig) -> bool {
        let share = limits.share(wrench);
        self.mean_square += (share * share - self.mean_square) * -math::exp_m1(-dt_s / limits.load_time_s);
        self.mean_square > limits.continuous_load * limits.continuous_load
    }
}
