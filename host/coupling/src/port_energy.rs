//! Passivity observer and passivity controller for the port between a hand and a device: measurement of the energy
//! through the port, and prevention of energy generation.
//!
//! With the wrench held from one sample to the next, the energy that crosses the port between two samples is known
//! exactly: the applied wrench times the displacement of the handle (the passivity observer of Hannaford and Ryu,
//! "Time-domain passivity control of haptic interfaces", IEEE Trans. Robotics and Automation 18(1), 2002, eq. 5). A
//! passive object (spring, damper, wall) never gives back more energy than it received. A loop that gives back more is
//! active: the model or the sampling generates energy.
//!
//! The controller predicts the energy that the port may give until the next sample, from the velocity and from the
//! accelerations of the recent past, and passes the fraction of the wrench for which the energy is available (the
//! energy tank of Franken and others, IEEE Trans. Robotics 27(4), 2011, section IV). In place of the rest it injects
//! damping along the motion (the impedance form of the paper of Hannaford and Ryu), unless the handle hardly moves.
//!
//! The envelope uses the controller at each device's port, a [coupling](crate::Coupling) uses it at each of its ends.
#![deny(clippy::disallowed_types, clippy::disallowed_methods, clippy::disallowed_macros)] // see clippy.toml
#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

use flotor_hal::{DQuat, DVec3, Pose, Twist, Wrench};

/// Displacement of a handle between two samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Displacement {
    /// Translation, m.
    pub linear: DVec3,
    /// Rotation vector, rad.
    pub angular: DVec3,
}

impl Displacement {
    /// Returns the work of a constant wrench on the handle, J; positive if the wrench acts along the motion. Real-time:
    /// bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn work_j(&self, wrench: &Wrench) -> f64 {
        wrench.force().dot(self.linear) + wrench.torque().dot(self.angular)
    }
}

/// Passivity observer: displacement of a handle, and energy through its port, from sample to sample.
#[derive(Clone, Copy, Debug, Default)]
pub struct PortObserver {
    /// Pose at the last sample; `None` before the first.
    last: Option<(DVec3, DQuat)>,
}

impl PortObserver {
    /// Stores the pose; returns the displacement since the last sample, zero at the first. Real-time: bounded, no
    /// allocation.
    #[inline]
    pub fn moved(&mut self, pose: &Pose) -> Displacement {
        let now = (pose.position(), pose.orientation());
        let Some((position_m, orientation)) = self.last.replace(now) else { return Displacement::default() };
        Displacement { linear: now.0 - position_m, angular: small_rotation(now.1 * orientation.conjugate()) }
    }

    /// Stores the pose; returns the energy that has gone into the port since the last sample, while `held` was applied,
    /// J; negative: the hand received energy.
    ///
    /// Real-time: bounded, no allocation.
    #[inline]
    pub fn gone_in_j(&mut self, pose: &Pose, held: &Wrench) -> f64 {
        -self.moved(pose).work_j(held)
    }
}

/// Estimate of the largest acceleration of a handle until the next sample, from the recent past.
///
/// A calm handle is assumed to remain calm, so that a hand that presses slowly feels a force from the first energy that
/// it puts in; a shaking handle is assumed to continue.
#[derive(Clone, Copy, Debug)]
struct RecentMotion {
    last: Option<Twist>,
    /// Linear and angular acceleration, m/s² and rad/s².
    acceleration: [f64; 2],
}

impl RecentMotion {
    /// Smallest acceleration assumed of a handle, m/s² and rad/s²: twice the acceleration of tremor of 0.1 mm at 10 Hz,
    /// and of the same motion at a lever of a tenth of a metre.
    const CALMEST: [f64; 2] = [0.8, 8.0];
    /// Mass and moment of inertia of the lightest handle and hand, kg and kg m²: a fifth and a tenth of the flotor alone (0.58 kg,
    /// 1e-3 kg m²).
    const LIGHTEST: [f64; 2] = [0.1, 1.0e-4];
    /// Ratio of the acceleration that is assumed possible at once to the acceleration over the last period.
    const MORE: f64 = 2.0;
    /// Time constant with which the estimate decays, s.
    const MEMORY_S: f64 = 0.05;

    const NONE: Self = Self { last: None, acceleration: Self::CALMEST };

    /// Updates the estimate with the velocity at a sample.
    #[inline]
    fn follow(&mut self, twist: &Twist, period_s: f64) {
        let Some(last) = self.last.replace(*twist) else { return };
        let kept = 1.0 - (period_s / Self::MEMORY_S).min(1.0);
        let after = |before: f64, change: DVec3, calmest: f64| {
            (before * kept).max(Self::MORE * change.length() / period_s).max(calmest)
        };
        let [linear, angular] = self.acceleration;
        self.acceleration = [
            after(linear, twist.linear() - last.linear(), Self::CALMEST[0]),
            after(angular, twist.angular() - last.angular(), Self::CALMEST[1]),
        ];
    }
}

/// Passivity controller: limits the energy that a device's port, or an end of a coupling, may give to the hand.
#[derive(Clone, Copy, Debug)]
pub struct Controller {
    damping_ns_per_m: f64,
    damping_nms_per_rad: f64,
    period_s: f64,
    motion: RecentMotion,
}

impl Controller {
    /// Creates a controller for wrenches that are held for `period_s` (s); `damping_ns_per_m` (N·s/m) and
    /// `damping_nms_per_rad` (N·m·s/rad) are the largest injected damping. Not real-time.
    #[must_use]
    pub fn new(damping_ns_per_m: f64, damping_nms_per_rad: f64, period_s: f64) -> Self {
        Self { damping_ns_per_m, damping_nms_per_rad, period_s, motion: RecentMotion::NONE }
    }

    /// Returns the time for which a wrench is held, s.
    #[must_use]
    pub fn period_s(&self) -> f64 {
        self.period_s
    }

    /// Updates the estimate of the motion with the velocity at a sample; call once per tick. Real-time: bounded, no
    /// allocation.
    #[inline]
    pub fn follow(&mut self, twist: &Twist) {
        self.motion.follow(twist, self.period_s);
    }

    /// Reduces `wrench` so that the port gives at most `available_j` until the next sample, after `held` over the last
    /// period: passes a fraction of the wrench, with injected damping in place of the rest. `None` if the whole wrench
    /// is within the limit.
    ///
    /// Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn keep_within(
        &self,
        available_j: f64,
        wrench: &Wrench,
        held: &Wrench,
        twist: &Twist,
    ) -> Option<Wrench> {
        let [linear, angular] = self.motion.acceleration;
        let half_period_squared = 0.5 * self.period_s * self.period_s;
        let side = |effort, held, velocity: DVec3, acceleration: f64, lightest: f64, damping: f64| {
            Side {
                effort,
                held,
                way: velocity * self.period_s,
                surprise: acceleration * half_period_squared,
                way_per_effort: half_period_squared / lightest,
                floor: DVec3::ZERO,
            }
            .with_floor(velocity * -damping)
        };
        let [lightest_kg, lightest_kg_m2] = RecentMotion::LIGHTEST;
        let force =
            side(wrench.force(), held.force(), twist.linear(), linear, lightest_kg, self.damping_ns_per_m);
        let torque = side(
            wrench.torque(),
            held.torque(),
            twist.angular(),
            angular,
            lightest_kg_m2,
            self.damping_nms_per_rad,
        );
        let available_j = available_j.max(0.0);
        let is_within = |share: f64| {
            force.may_cost_j(force.part(share)) + torque.may_cost_j(torque.part(share)) <= available_j
        };
        if is_within(1.0) {
            return None;
        }
        let (mut within, mut beyond) = (0.0, 1.0);
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (within + beyond);
            if is_within(middle) {
                within = middle;
            } else {
                beyond = middle;
            }
        }
        Some(Wrench::new(force.part(within), torque.part(within)))
    }
}

/// Number of bisection steps for the fraction of a wrench that passes: to 1 mN of 60 N.
const BISECTIONS: u32 = 16;

/// Translation or rotation over the next period: effort in N or N·m, displacement in m or rad.
struct Side {
    effort: DVec3,
    /// Effort over the last period.
    held: DVec3,
    /// Displacement of the handle at its present velocity.
    way: DVec3,
    /// Displacement that an acceleration of the recent past may add.
    surprise: f64,
    /// Displacement of the lightest handle per change of the effort.
    way_per_effort: f64,
    /// Effort with which the port certainly gives no energy: the injected damping, or zero.
    floor: DVec3,
}

impl Side {
    /// Adds injected damping if it certainly dissipates energy: not on a handle that hardly moves.
    #[inline]
    fn with_floor(self, damping: DVec3) -> Self {
        if self.may_cost_j(damping) < 0.0 { Self { floor: damping, ..self } } else { self }
    }

    /// Returns the largest energy that the port may give until the next sample, J; negative if it certainly receives
    /// energy.
    ///
    /// An effort against the motion is assumed not to reverse the handle within the period: an effort that would is too
    /// large for a stable loop, and an effort withheld from a handle that goes deeper into a wall comes back larger.
    #[inline]
    fn may_cost_j(&self, effort: DVec3) -> f64 {
        let along_j = effort.dot(self.way);
        let steady_j = along_j + effort.length() * self.surprise;
        if along_j < 0.0 {
            return steady_j;
        }
        steady_j + (effort - self.held).dot(effort).max(0.0) * self.way_per_effort
    }

    /// Returns the fraction `share` of the effort, 0 to 1, with damping in place of the rest; the whole effort if it
    /// certainly dissipates energy.
    #[inline]
    fn part(&self, share: f64) -> DVec3 {
        if share >= 1.0 || self.may_cost_j(self.effort) <= 0.0 {
            return self.effort;
        }
        self.floor + (self.effort - self.floor) * share
    }
}

/// Returns the rotation vector of a rotation between two samples, rad. The series of the arc sine up to its third power is
/// exact to 1e-6 of the angle up to a tenth of a radian, which is 100 rad/s at 1 kHz, and avoids an arc tangent.
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
