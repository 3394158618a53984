//! Limits of force and motion in a run, and the wall at the end of the device's range.

/// Treatment of energy that a port generates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PassivityMode {
    /// The energy is only measured.
    #[default]
    Observe,
    /// The energy is measured, and the passivity controller prevents its generation.
    Control,
}

/// Bound of a vector, in its unit: a largest norm, and a largest component along each axis. Both apply together.
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
pub struct Bound {
    norm: f64,
    axes: [f64; 3],
}

impl Bound {
    /// Bound that allows every vector.
    pub const NONE: Self = Self { norm: f64::INFINITY, axes: [f64::INFINITY; 3] };

    /// Creates a ball: the bound of vectors no longer than `norm`.
    pub const fn ball(norm: f64) -> Self {
        Self { norm, axes: [norm; 3] }
    }

    /// Creates a box: the bound of vectors whose components are at most `axes` in magnitude.
    pub const fn box_of(axes: [f64; 3]) -> Self {
        Self { norm: f64::INFINITY, axes }
    }

    /// Returns the intersection of two bounds. Not real-time.
    pub fn and(self, other: Self) -> Self {
        let norm = self.norm.min(other.norm);
        let axis = |index: usize| self.axes[index].min(other.axes[index]).min(norm);
        Self { norm, axes: std::array::from_fn(axis) }
    }

    /// Returns the largest norm; infinity for a box.
    #[must_use]
    pub const fn norm(&self) -> f64 {
        self.norm
    }

    /// Returns the largest magnitude of each component, at most the norm.
    #[must_use]
    pub const fn axes(&self) -> [f64; 3] {
        self.axes
    }

    /// Returns the length of the longest vector within the bound: the length to a corner of the box, or the norm if
    /// that is less. Not real-time.
    #[must_use]
    pub fn longest(&self) -> f64 {
        let corner = self.axes.iter().map(|axis| axis * axis).sum::<f64>().sqrt();
        corner.min(self.norm)
    }
}

/// Ceiling of the host for a device that does not declare itself simulated: 20 N and 1 N·m in any direction. More than
/// an object on a table needs, too little to throw an arm; the hand of an adult can resist it.
pub const CEILING: Ceiling = Ceiling { force_n: 20.0, torque_nm: 1.0 };

/// Largest force and torque that a host sends to a device, in any direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ceiling {
    /// Force, N.
    pub force_n: f64,
    /// Torque, N·m.
    pub torque_nm: f64,
}

/// Limits of a scene; the limits that the device declares apply too, so that the tighter limit counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Largest force, N.
    pub force_n: Bound,
    /// Largest torque, N·m.
    pub torque_nm: Bound,
    /// Largest force of a linear grip, N.
    pub grip_force_n: f64,
    /// Largest torque of an angular grip, N·m.
    pub grip_torque_nm: f64,
    /// Maximum slew rate of the force, N/s (norm of the change).
    pub force_slew_n_per_s: f64,
    /// Maximum slew rate of the torque, N·m/s (norm of the change).
    pub torque_slew_nm_per_s: f64,
    /// Velocity above which no force accelerates the handle, m/s.
    pub velocity_m_per_s: Bound,
    /// Angular velocity above which no torque accelerates the handle, rad/s.
    pub angular_velocity_rad_per_s: Bound,
    /// Time over which the force fades in at the start and out at an orderly end, s.
    pub ramp_s: f64,
    /// Time without a tick after which the watchdog stops the device, s (real clock).
    pub watchdog_s: f64,
    /// Buttons of the device that are emergency stops, one bit each.
    pub emergency_buttons: u32,
    /// Treatment of energy that the device's port generates.
    pub passivity: PassivityMode,
    /// True to reject a device without an independent stop, which nothing would stop after the end of the host's
    /// process.
    pub require_independent_stop: bool,
    /// True to accept a device that only the watchdog process can stop, although a kill of one control group would end
    /// both the host and the watchdog process.
    pub accept_shared_control_group: bool,
}

impl Limits {
    /// Returns these limits, reduced to a ceiling. Not real-time.
    #[must_use]
    pub fn under(self, ceiling: Ceiling) -> Self {
        Self {
            force_n: self.force_n.and(Bound::ball(ceiling.force_n)),
            torque_nm: self.torque_nm.and(Bound::ball(ceiling.torque_nm)),
            grip_force_n: self.grip_force_n.min(ceiling.force_n),
            grip_torque_nm: self.grip_torque_nm.min(ceiling.torque_nm),
            ..self
        }
    }
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            force_n: Bound::NONE,
            torque_nm: Bound::NONE,
            grip_force_n: f64::INFINITY,
            grip_torque_nm: f64::INFINITY,
            force_slew_n_per_s: f64::INFINITY,
            torque_slew_nm_per_s: f64::INFINITY,
            // Long enough not to startle a hand, short enough not to seem a delay.
            ramp_s: 0.2,
            velocity_m_per_s: Bound::NONE,
            angular_velocity_rad_per_s: Bound::NONE,
            // A hundred periods at 1 kHz: a loaded machine without real-time priority is late by tens of
            // milliseconds, and a hand that holds a force for a tenth of a second has not gone far.
            watchdog_s: 0.1,
            emergency_buttons: 0,
            passivity: PassivityMode::Observe,
            require_independent_stop: false,
            accept_shared_control_group: false,
        }
    }
}

/// Spring-damper wall a little inside the device's range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Boundary {
    /// Minimum distance of the wall inside the device's range, m.
    pub margin_m: f64,
    /// Distance of the wall inside the device's rotation range, rad.
    pub margin_rad: f64,
    /// Stiffness of the wall, N/m.
    pub stiffness_n_per_m: f64,
    /// Damping of outward motion in the wall, N·s/m.
    pub damping_ns_per_m: f64,
    /// Rotational stiffness, N·m/rad.
    pub stiffness_nm_per_rad: f64,
    /// Damping of outward rotation in the wall, N·m·s/rad.
    pub damping_nms_per_rad: f64,
}

impl Default for Boundary {
    fn default() -> Self {
        // The largest stiffness at 1 kHz without latency (`SampledLoop`). The gains 15 N s/m, 50 N m/rad and
        // 0.15 N m s/rad are those of the device's own boundary mode (Utah client).
        Self {
            margin_m: 0.5e-3,
            margin_rad: 0.005,
            stiffness_n_per_m: 7_500.0,
            damping_ns_per_m: 15.0,
            stiffness_nm_per_rad: 50.0,
            damping_nms_per_rad: 0.15,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ball_and_a_box_hold_together() {
        let both = Bound::ball(5.0).and(Bound::box_of([3.0, 9.0, 0.0]));
        assert_eq!((both.norm(), both.axes()), (5.0, [3.0, 5.0, 0.0]));
        assert_eq!(both, Bound::box_of([3.0, 9.0, 0.0]).and(Bound::ball(5.0)));
        assert_eq!(both.and(Bound::NONE), both);
        assert_eq!(both.longest(), 5.0, "the corner is at 5.83");
        assert_eq!(Bound::box_of([3.0, 4.0, 0.0]).longest(), 5.0);
        assert_eq!(Bound::ball(2.0).longest(), 2.0);
        assert_eq!(Bound::NONE.longest(), f64::INFINITY);
    }

    #[test]
    fn a_ceiling_raises_nothing() {
        let limits = Limits { force_n: Bound::ball(3.0), ..Limits::default() }.under(CEILING);
        assert_eq!((limits.force_n.norm(), limits.torque_nm.norm()), (3.0, 1.0));
        assert_eq!((limits.grip_force_n, limits.grip_torque_nm), (20.0, 1.0));
        let strong = Limits { force_n: Bound::box_of([55.0, 2.0, 140.0]), ..Limits::default() };
        assert_eq!(strong.under(CEILING).force_n.axes(), [20.0, 2.0, 20.0]);
    }
}
