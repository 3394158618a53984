//! Energy at a port, between a hand and whatever pushes it: what has gone in, and how to keep more from coming out.
//!
//! With the wrench held from one sample to the next, the energy that crosses the port between two samples is known
//! exactly: the wrench that was held times the way the handle went (the passivity observer of Hannaford and Ryu,
//! "Time-domain passivity control of haptic interfaces", IEEE Trans. Robotics and Automation 18(1), 2002, eq. 5).
//! A spring, a damper, a wall of stored or dissipated energy never gives back more than it got. A loop that does is
//! active: its model creates energy, or sampling does.
//!
//! The controller takes away what the next period could bring out beyond what is there: first by damping along the
//! motion (the impedance form of the same paper); where that is not
//! enough, because the handle hardly moves, by scaling the wrench down (the energy tank of Franken and others,
//! IEEE Trans. Robotics 27(4), 2011, section IV).
//!
//! The envelope guards each device's port with it, a [coupling](crate::Coupling) each of its ends.
#![deny(clippy::disallowed_types, clippy::disallowed_methods, clippy::disallowed_macros)] // see clippy.toml
#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

use flotor_hal::{DQuat, DVec3, Pose, Twist, Wrench};

/// Measures what crosses a port.
#[derive(Clone, Copy, Debug, Default)]
pub struct PortObserver {
    /// Pose at the last sample; `None` before the first.
    last: Option<(DVec3, DQuat)>,
}

impl PortObserver {
    /// Energy that has gone in since the last sample, while `held` was applied, J; negative: it came out.
    ///
    /// Real-time: bounded, no allocation.
    #[inline]
    pub fn gone_in_j(&mut self, pose: &Pose, held: &Wrench) -> f64 {
        let now = (pose.position(), pose.orientation());
        let Some((position_m, orientation)) = self.last.replace(now) else { return 0.0 };
        let moved = now.0 - position_m;
        let turned = small_rotation(now.1 * orientation.conjugate());
        -(held.force().dot(moved) + held.torque().dot(turned))
    }
}

/// How far from a steady motion a handle may be at the next sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Expected {
    /// Acceleration that is no surprise, m/s².
    pub acceleration_m_per_s2: f64,
    /// Angular acceleration that is no surprise, rad/s².
    pub acceleration_rad_per_s2: f64,
}

/// Keeps energy from coming out that is not there.
#[derive(Clone, Copy, Debug)]
pub struct Controller {
    /// Most damping it injects, N·s/m.
    pub damping_ns_per_m: f64,
    /// Most damping of rotation it injects, N·m·s/rad.
    pub damping_nms_per_rad: f64,
    /// Time a wrench is held, s.
    pub period_s: f64,
}

impl Controller {
    /// The wrench with as much taken away as it takes to bring out no more than `available_j` by the next sample;
    /// `None` if that is nothing.
    ///
    /// Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn keep_within(
        &self,
        available_j: f64,
        wrench: &Wrench,
        twist: &Twist,
        expected: Expected,
    ) -> Option<Wrench> {
        let half_period_squared = 0.5 * self.period_s * self.period_s;
        let force = Side {
            effort: wrench.force(),
            way: twist.linear() * self.period_s,
            surprise: expected.acceleration_m_per_s2 * half_period_squared,
            damping: self.damping_ns_per_m / self.period_s,
        };
        let torque = Side {
            effort: wrench.torque(),
            way: twist.angular() * self.period_s,
            surprise: expected.acceleration_rad_per_s2 * half_period_squared,
            damping: self.damping_nms_per_rad / self.period_s,
        };
        let available_j = available_j.max(0.0);
        let asked_j = force.may_cost_j() + torque.may_cost_j();
        if asked_j <= available_j {
            return None;
        }
        // Each side gives up its share of what is too much; a side that only takes energy gives up nothing.
        let drawn_j = force.may_cost_j().max(0.0) + torque.may_cost_j().max(0.0);
        let excess = ((asked_j - available_j) / drawn_j).clamp(0.0, 1.0);
        Some(Wrench::new(force.within(excess), torque.within(excess)))
    }
}

/// Translation or rotation over the next period: effort in N or N·m, way in m or rad.
struct Side {
    effort: DVec3,
    /// Way the handle goes if nothing happens.
    way: DVec3,
    /// How far from that it may end.
    surprise: f64,
    /// Most damping, per period: effort per way.
    damping: f64,
}

impl Side {
    /// Most energy that the effort may bring out by the next sample, J; negative if it surely takes some in.
    fn may_cost_j(&self) -> f64 {
        self.effort.dot(self.way) + self.effort.length() * self.surprise
    }

    /// The effort changed so that it brings out less, by this part of what it may cost.
    fn within(&self, excess: f64) -> DVec3 {
        let cost_j = self.may_cost_j();
        if cost_j <= 0.0 {
            return self.effort;
        }
        let allowed_j = cost_j * (1.0 - excess);
        let way = self.way.length();
        // Damping takes `d way²` and, by making the effort longer, may cost `d way surprise`.
        let taken_per_damping = way * (way - self.surprise);
        let damping = if taken_per_damping > 0.0 {
            ((cost_j - allowed_j) / taken_per_damping).min(self.damping)
        } else {
            0.0
        };
        let damped = Self { effort: self.effort - self.way * damping, ..*self };
        let left_j = damped.may_cost_j();
        if left_j <= allowed_j { damped.effort } else { damped.effort * (allowed_j / left_j) }
    }
}

/// Rotation vector of a rotation from one sample to the next, rad. The series of the arc sine up to its third power is
/// exact to 1e-6 of the angle up to a tenth of a radian, which is 100 rad/s at 1 kHz; there is no arc tangent to wait for.
fn small_rotation(rotation: DQuat) -> DVec3 {
    let sine = rotation.xyz();
    // q and -q are one rotation: the smaller one is that with w above zero.
    let factor = (2.0 + sine.length_squared() * (1.0 / 3.0)).copysign(rotation.w);
    sine * factor
}

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_hal::rotation_vector;

    #[test]
    fn the_series_is_the_rotation_vector() {
        for exponent in -12..=-1 {
            let rotation = DQuat::from_axis_angle(DVec3::new(0.36, -0.48, 0.8), 10.0_f64.powi(exponent));
            for rotation in [rotation, -rotation] {
                let exact = rotation_vector(rotation);
                let error = (small_rotation(rotation) - exact).length() / exact.length();
                assert!(error < 1.0e-6, "1e{exponent}: {error}");
            }
        }
    }
}
