//! Detection of a force that alternates between its limits: the sign of an unstable loop, for example of a stiffness
//! that the device cannot render. The force is reduced first; if the oscillation continues, the run ends.
//!
//! Reversals at the limits are counted: a limited force points against the previous limited force, and the handle has
//! moved in between. A hand between two stiff walls causes a few reversals per second; an unstable loop causes tens.
//! Noise of a model reverses the force in every tick and moves the handle by micrometres: only the limits apply to it.

use flotor_hal::{DQuat, DVec3, Pose, Wrench};

/// Number of reversals that count as an oscillation.
const REVERSALS: usize = 10;
/// Time window of these reversals, ns: 10 Hz and more, which no hand reaches against the full force of a device.
const WINDOW_NS: u64 = 500_000_000;
/// Smallest displacement, m, or rotation, rad, of the handle between two reversals that count.
const LEAST_WAY_M: f64 = 0.1e-3;
const LEAST_TURN_RAD: f64 = 1.0e-3;
/// Gain of the force while an oscillation is being damped.
const DAMPED: f64 = 0.25;
/// Time for damping to take effect before the run is ended, ns.
const TRIED_NS: u64 = 250_000_000;
/// Time without a reversal after which the force starts to return, and duration of the return, ns.
const CALM_NS: u64 = 2_000_000_000;
const RETURN_NS: u64 = 1_000_000_000;

/// The last reversals of force or torque.
#[derive(Clone, Copy, Debug)]
struct Swing {
    last: DVec3,
    /// Pose of the handle at the last reversal that counted.
    last_pose: Pose,
    times_ns: [u64; REVERSALS],
    count: usize,
}

impl Swing {
    const NONE: Swing =
        Swing { last: DVec3::ZERO, last_pose: Pose::HOME, times_ns: [0; REVERSALS], count: 0 };

    /// Records a force or torque that was limited, and the pose; returns true for a reversal that counts.
    fn note(&mut self, cut: DVec3, pose: &Pose, now_ns: u64) -> bool {
        let is_reversal = cut.dot(self.last) < 0.0 && has_moved(&self.last_pose, pose);
        self.last = cut;
        if is_reversal {
            self.last_pose = *pose;
            if let Some(time_ns) = self.times_ns.get_mut(self.count % REVERSALS) {
                *time_ns = now_ns;
            }
            self.count += 1;
        }
        is_reversal
    }

    /// Returns true if the last reversals came within the window, and then restarts the count.
    fn is_oscillation(&mut self, now_ns: u64) -> bool {
        let oldest = self.times_ns.get(self.count % REVERSALS).copied().unwrap_or(0);
        let is_one = self.count >= REVERSALS && now_ns.saturating_sub(oldest) <= WINDOW_NS;
        if is_one {
            self.count = 0;
        }
        is_one
    }
}

/// Returns true if a handle has moved or turned far enough for a reversal to count.
fn has_moved(from: &Pose, to: &Pose) -> bool {
    let way_m = (to.position() - from.position()).length();
    let turn: DQuat = from.orientation().conjugate() * to.orientation();
    // Of a small turn the vector part of the quaternion is half the angle.
    let turn_rad = 2.0 * turn.xyz().length();
    way_m >= LEAST_WAY_M || turn_rad >= LEAST_TURN_RAD
}

/// Stage of the response to an oscillation.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage {
    Whole,
    /// Damped, with the times of the first and of the last reversal.
    Damped {
        began_ns: u64,
        since_ns: u64,
    },
    GivenUp,
}

/// Detector of oscillations in the limited force of one device.
#[derive(Clone)]
pub struct Oscillation {
    force: Swing,
    torque: Swing,
    stage: Stage,
}

impl Oscillation {
    /// Detector without recorded reversals.
    pub const NONE: Oscillation =
        Oscillation { force: Swing::NONE, torque: Swing::NONE, stage: Stage::Whole };

    /// Records a wrench with the pose of the handle; `cut` flags a limited force and a limited torque. An oscillation
    /// reduces the gain; if the oscillation continues, the gain becomes 0 for the rest of the run. Real-time: bounded,
    /// no allocation.
    #[inline(never)] // seldom called
    pub fn note(&mut self, wrench: &Wrench, cut: [bool; 2], pose: &Pose, now_ns: u64) {
        let [cuts_force, cuts_torque] = cut;
        let force = cuts_force && self.force.note(wrench.force(), pose, now_ns);
        let torque = cuts_torque && self.torque.note(wrench.torque(), pose, now_ns);
        if !(force || torque) {
            return;
        }
        let is_one = self.force.is_oscillation(now_ns) | self.torque.is_oscillation(now_ns);
        self.stage = match self.stage {
            Stage::Whole if is_one => {
                // An oscillation in spite of the damping has to be detected anew.
                (self.force.count, self.torque.count) = (0, 0);
                Stage::Damped { began_ns: now_ns, since_ns: now_ns }
            }
            Stage::Damped { began_ns, .. } if is_one && now_ns.saturating_sub(began_ns) >= TRIED_NS => {
                Stage::GivenUp
            }
            Stage::Damped { began_ns, .. } => Stage::Damped { began_ns, since_ns: now_ns },
            stage => stage,
        };
    }

    /// Returns the gain of force and torque, 0 to 1; `None` without damping. The gain returns to 1 after a time without
    /// reversals. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn gain(&mut self, now_ns: u64) -> Option<f64> {
        match self.stage {
            Stage::Whole => None,
            Stage::GivenUp => Some(0.0),
            Stage::Damped { since_ns, .. } => {
                let calm_ns = now_ns.saturating_sub(since_ns);
                if calm_ns >= CALM_NS + RETURN_NS {
                    self.stage = Stage::Whole;
                    return None;
                }
                let part = calm_ns.saturating_sub(CALM_NS) as f64 / RETURN_NS as f64;
                Some(DAMPED + (1.0 - DAMPED) * part)
            }
        }
    }

    /// Returns true if the oscillation continued in spite of the damping: the run has to end. Real-time: bounded, no
    /// allocation.
    #[inline]
    #[must_use]
    pub fn is_given_up(&self) -> bool {
        self.stage == Stage::GivenUp
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn calm() -> Oscillation {
        Oscillation::NONE
    }

    /// Reverses a force at its limit so often a second, for so long; when it was damped and given up, s.
    fn swing(oscillation: &mut Oscillation, per_s: f64, from_s: f64, length_s: f64) -> [Option<f64>; 2] {
        let (mut damped, mut given_up) = (None, None);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // seconds of a test
        let ticks = (length_s * 1000.0) as u64;
        for tick in 0..ticks {
            let now_s = from_s + tick as f64 * 1.0e-3;
            let sign = if (now_s * per_s).floor() % 2.0 == 0.0 { 1.0 } else { -1.0 };
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // seconds of a test
            let now_ns = (now_s * 1.0e9) as u64;
            let wrench = Wrench::new(DVec3::new(0.0, 0.0, 100.0 * sign), DVec3::ZERO);
            let pose = Pose::new(DVec3::new(0.0, 0.0, 1.0e-3 * sign), DQuat::IDENTITY);
            oscillation.note(&wrench, [true, false], &pose, now_ns);
            if oscillation.gain(now_ns).is_some() && damped.is_none() {
                damped = Some(now_s);
            }
            if oscillation.is_given_up() && given_up.is_none() {
                given_up = Some(now_s);
            }
        }
        [damped, given_up]
    }

    #[test]
    fn an_unstable_loop_is_damped_within_half_a_second_and_ended_in_a_second() {
        for per_s in [25.0, 100.0, 500.0] {
            let [damped, given_up] = swing(&mut calm(), per_s, 0.0, 2.0);
            assert!(damped.is_some_and(|at_s| at_s <= 0.5), "{per_s}: {damped:?}");
            assert!(given_up.is_some_and(|at_s| at_s <= 1.0), "{per_s}: {given_up:?}");
        }
    }

    /// Where the handle stays, a force that reverses is noise, however often: the limits meet it.
    /// A torque that reverses one tick after the force is no second sign of the same swing.
    #[test]
    fn the_damping_is_tried_where_force_and_torque_swing_together() {
        let mut oscillation = calm();
        let (mut damped, mut given_up) = (None, None);
        for tick in 0..1000_u64 {
            let sign = |tick: u64| if (tick / 10).is_multiple_of(2) { 1.0 } else { -1.0 };
            let wrench = Wrench::new(DVec3::Z * sign(tick), DVec3::Z * sign(tick + 9));
            let pose =
                Pose::new(DVec3::Z * (1.0e-3 * sign(tick)), DQuat::from_rotation_z(0.01 * sign(tick + 9)));
            oscillation.note(&wrench, [true, true], &pose, tick * 1_000_000);
            damped = damped.or(oscillation.gain(tick * 1_000_000).map(|_| tick));
            given_up = given_up.or(oscillation.is_given_up().then_some(tick));
        }
        let between = given_up.expect("it goes on") - damped.expect("it swings");
        assert!(between >= 50, "{between} ms");
    }

    #[test]
    fn a_force_that_does_not_move_the_handle_is_no_oscillation() {
        let mut oscillation = calm();
        for tick in 0..2000 {
            let sign = if tick & 1 == 0 { 1.0 } else { -1.0 };
            let wrench = Wrench::new(DVec3::Z * sign, DVec3::Z * sign);
            let pose = Pose::new(DVec3::Z * (0.04e-3 * sign), DQuat::from_rotation_z(0.4e-3 * sign));
            oscillation.note(&wrench, [true, true], &pose, tick * 1_000_000);
        }
        assert_eq!(oscillation.gain(2_000_000_000), None);
    }

    #[test]
    fn a_hand_between_two_walls_is_let_alone() {
        assert_eq!(swing(&mut calm(), 16.0, 0.0, 20.0), [None, None]);
        // Pressed against one wall for ever, with however many ticks at the limit.
        assert_eq!(swing(&mut calm(), 1.0e-3, 0.0, 20.0), [None, None]);
    }

    #[test]
    fn the_force_comes_back_after_two_calm_seconds_within_one() {
        let mut oscillation = calm();
        let [damped, given_up] = swing(&mut oscillation, 100.0, 0.0, 0.12);
        assert!(damped.is_some() && given_up.is_none(), "{damped:?} {given_up:?}");
        assert_eq!(oscillation.gain(2_000_000_000), Some(DAMPED));
        let half = oscillation.gain(2_610_000_000).expect("on its way");
        assert!((0.5..0.8).contains(&half), "{half}");
        assert_eq!(oscillation.gain(3_200_000_000), None);
        assert_eq!(oscillation.gain(3_200_000_001), None);
    }
}
