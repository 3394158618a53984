//! Energy at the port of a device: what the hand has put in, and what has come back out.
//!
//! With the wrench held from one sample to the next, the energy that crosses the port between two samples is known
//! exactly: the wrench that was held times the way the handle went (the passivity observer of Hannaford and Ryu,
//! "Time-domain passivity control of haptic interfaces", IEEE Trans. Robotics and Automation 18(1), 2002, eq. 5).
//! A spring, a damper, a wall of stored or dissipated energy never gives back more than it got. A loop that does is
//! active: its model creates energy, or sampling does.
//!
//! The controller takes away what the next period could bring out beyond what is there: first by damping along the
//! motion (the impedance form of the same paper), as much as the device's own boundary uses; where that is not
//! enough, because the handle hardly moves, by scaling the wrench down (the energy tank of Franken and others,
//! IEEE Trans. Robotics 27(4), 2011, section IV).

use crate::scene::PassivityMode;
use flotor_hal::{DQuat, DVec3, DeviceState, Wrench};

/// Acceleration that a handle may have without its next sample being a surprise, m/s²: 40 N on 0.58 kg are 69, and
/// a hand in between takes most of it.
const EXPECTED_ACCELERATION_M_PER_S2: f64 = 50.0;
/// The same for rotation, rad/s²: the above at a lever of a tenth of a metre.
const EXPECTED_ACCELERATION_RAD_PER_S2: f64 = 500.0;

/// Watches, and on request guards, the energy at one port.
pub(super) struct Passivity {
    mode: PassivityMode,
    /// Most damping the controller injects, N·s/m and N·m·s/rad.
    damping_ns_per_m: f64,
    damping_nms_per_rad: f64,
    period_s: f64,
    /// Pose at the last sample; `None` before the first.
    last: Option<(DVec3, DQuat)>,
    energy_j: f64,
}

impl Passivity {
    /// `damping` is the most the controller may inject, N·s/m and N·m·s/rad. Not real-time.
    pub(super) fn new(mode: PassivityMode, damping: [f64; 2], period_s: f64) -> Self {
        let [damping_ns_per_m, damping_nms_per_rad] = damping;
        Self { mode, damping_ns_per_m, damping_nms_per_rad, period_s, last: None, energy_j: 0.0 }
    }

    /// Books what has crossed the port since the last sample, while `held` was applied. Real-time: bounded, no
    /// allocation.
    #[inline]
    pub(super) fn observe(&mut self, state: &DeviceState, held: &Wrench) {
        let now = (state.pose.position(), state.pose.orientation());
        if let Some((position_m, orientation)) = self.last {
            let moved = now.0 - position_m;
            let turned = small_rotation(now.1 * orientation.conjugate());
            self.energy_j -= held.force().dot(moved) + held.torque().dot(turned);
        }
        self.last = Some(now);
    }

    /// Energy the hand has put into the port so far less what has come out, J. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn energy_j(&self) -> f64 {
        self.energy_j
    }

    /// The wrench with as much taken away as it takes to keep the energy from becoming negative by the next sample,
    /// and whether that was anything. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn guard(&self, wrench: &Wrench, state: &DeviceState) -> Option<Wrench> {
        if self.mode == PassivityMode::Observe {
            return None;
        }
        let half_period_squared = 0.5 * self.period_s * self.period_s;
        let force = Side {
            effort: wrench.force(),
            way: state.twist.linear() * self.period_s,
            surprise: EXPECTED_ACCELERATION_M_PER_S2 * half_period_squared,
            damping: self.damping_ns_per_m / self.period_s,
        };
        let torque = Side {
            effort: wrench.torque(),
            way: state.twist.angular() * self.period_s,
            surprise: EXPECTED_ACCELERATION_RAD_PER_S2 * half_period_squared,
            damping: self.damping_nms_per_rad / self.period_s,
        };
        let available_j = self.energy_j.max(0.0);
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
#[inline]
fn small_rotation(rotation: DQuat) -> DVec3 {
    let sine = if rotation.w < 0.0 { -rotation.xyz() } else { rotation.xyz() };
    sine * (2.0 + sine.length_squared() / 3.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_hal::{Pose, Twist, rotation_vector};

    const PERIOD_S: f64 = 1.0e-3;

    fn passivity(mode: PassivityMode) -> Passivity {
        Passivity::new(mode, [15.0, 0.15], PERIOD_S)
    }

    fn at(z_m: f64, velocity_m_per_s: f64) -> DeviceState {
        DeviceState {
            pose: Pose::new(DVec3::Z * z_m, DQuat::IDENTITY),
            twist: Twist::new(DVec3::Z * velocity_m_per_s, DVec3::ZERO),
            ..DeviceState::HOME
        }
    }

    #[test]
    fn what_a_spring_got_is_what_it_holds() {
        let mut observer = passivity(PassivityMode::Observe);
        let (stiffness_n_per_m, steps) = (500.0, 1000_i32);
        let mut held = Wrench::ZERO;
        // Into the spring by 5 mm, slowly: half k x², but for the half step by which a held force lags behind.
        for step in 0..=steps {
            let z_m = -0.005 * f64::from(step) / f64::from(steps);
            observer.observe(&at(z_m, 0.0), &held);
            held = Wrench::from_force(DVec3::Z * -stiffness_n_per_m * z_m);
        }
        let stored_j = 0.5 * stiffness_n_per_m * 0.005 * 0.005;
        let lag_j = stored_j / f64::from(steps);
        assert!((observer.energy_j() - (stored_j - lag_j)).abs() < 1.0e-15, "{}", observer.energy_j());
    }

    #[test]
    fn turning_against_a_torque_puts_energy_in() {
        let mut observer = passivity(PassivityMode::Observe);
        let mut state = DeviceState::HOME;
        observer.observe(&state, &Wrench::ZERO);
        state.pose = Pose::new(DVec3::ZERO, DQuat::from_rotation_y(0.01));
        observer.observe(&state, &Wrench::new(DVec3::ZERO, DVec3::new(5.0, -2.0, 5.0)));
        assert!((observer.energy_j() - 0.02).abs() < 1.0e-9, "{}", observer.energy_j());
    }

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

    #[test]
    fn observing_changes_nothing() {
        let push = Wrench::from_force(DVec3::Z * 40.0);
        assert_eq!(passivity(PassivityMode::Observe).guard(&push, &at(0.0, 1.0)), None);
    }

    #[test]
    fn a_controller_lets_pass_what_takes_energy_and_what_there_is_energy_for() {
        let mut controller = passivity(PassivityMode::Control);
        let push = Wrench::from_force(DVec3::Z * 4.0);
        assert_eq!(controller.guard(&push, &at(0.0, -0.1)), None, "it brakes");
        controller.energy_j = 1.0;
        assert_eq!(controller.guard(&push, &at(0.0, 0.1)), None, "0.4 mJ of 1 J");
    }

    #[test]
    fn what_drives_without_energy_becomes_damping_or_nothing() {
        let controller = passivity(PassivityMode::Control);
        let push = Wrench::from_force(DVec3::Z * 0.5);
        let moving = controller.guard(&push, &at(0.0, 0.1)).expect("it is too much");
        assert!(moving.force().z < 0.0, "15 N s/m at 0.1 m/s are more than 0.5 N: {moving:?}");
        let at_rest = controller.guard(&push, &at(0.0, 0.0)).expect("it is too much");
        assert_eq!(at_rest, Wrench::ZERO, "nothing to damp");
    }

    /// The promise of the controller: no motion within what is expected makes the energy negative.
    #[test]
    fn no_expected_motion_brings_out_more_than_there_is() {
        let mut controller = passivity(PassivityMode::Control);
        let numbers = [0.0, 1.0e-9, -3.0e-3, 0.2, -1.5, 40.0];
        let mut cases = 0_u32;
        for energy_j in [0.0, 1.0e-6, 1.0e-3] {
            controller.energy_j = energy_j;
            for (x, z, speed) in numbers.iter().flat_map(|x| {
                numbers.iter().flat_map(move |z| [0.0, 0.001, 0.1, -0.1, 2.0].map(|speed| (*x, *z, speed)))
            }) {
                let wrench = Wrench::from_force(DVec3::new(x, 0.0, z));
                let state = at(0.0, speed);
                let sent = controller.guard(&wrench, &state).unwrap_or(wrench);
                for direction in
                    [DVec3::X, DVec3::NEG_X, DVec3::Z, DVec3::NEG_Z, sent.force().normalize_or_zero()]
                {
                    let surprise = direction * (0.5 * EXPECTED_ACCELERATION_M_PER_S2 * PERIOD_S * PERIOD_S);
                    let way = state.twist.linear() * PERIOD_S + surprise;
                    let left_j = energy_j - sent.force().dot(way);
                    assert!(
                        left_j >= -1.0e-15,
                        "{wrench:?} at {speed} m/s with {energy_j} J leaves {left_j} J"
                    );
                    cases += 1;
                }
            }
        }
        assert!(cases > 2000);
    }
}
