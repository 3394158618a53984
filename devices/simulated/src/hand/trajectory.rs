//! The intended motion of the hand over time, with the times of the grip.
//!
//! Voluntary movements start and stop smoothly; [`minimum_jerk`] (Flash and Hogan 1985, J. Neurosci. 5:1688) is the usual
//! curve, and every motion here is composed of minimum-jerk curves and sines.

use super::{Recording, Script};
use crate::validation::{Check, Domain, InvalidParameter, number, vector};
use flotor_hal::glam::{BVec3, DQuat, DVec3};
use flotor_hal::math;
use std::f64::consts::TAU;

/// Position and orientation in the device frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Position of the flotor frame's origin, m.
    pub position_m: DVec3,
    /// Unit quaternion, flotor to device frame.
    pub orientation: DQuat,
}

impl Pose {
    /// Origin of the device frame, upright.
    pub const HOME: Self = Self { position_m: DVec3::ZERO, orientation: DQuat::IDENTITY };

    /// Rounding tolerance of a unit quaternion's length in user input.
    const LENGTH_TOLERANCE: f64 = 1.0e-6;

    /// Rejects non-finite numbers and quaternions that are no rotation. Real-time: bounded, no allocation.
    ///
    /// # Errors
    /// If a number is not finite, or the quaternion has not unit length.
    pub(crate) fn check(&self) -> Check {
        vector("position_m", self.position_m, Domain::Finite)?;
        let length = self.orientation.length();
        // Written so that NaN is rejected too.
        if (length - 1.0).abs() <= Self::LENGTH_TOLERANCE {
            Ok(())
        } else {
            Err(InvalidParameter::NotARotation { name: "orientation", length })
        }
    }
}

/// Intention of the hand at one instant, device frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aim {
    /// Intended pose of the handle.
    pub pose: Pose,
    /// Intended force in addition, N.
    pub force_n: DVec3,
    /// Axes with an intended force instead of a position: the hand has no stiffness there.
    pub yielding: BVec3,
}

impl Aim {
    /// Creates an aim at a pose, without force. Real-time: bounded, no allocation.
    #[must_use]
    #[inline]
    pub const fn at(pose: Pose) -> Self {
        Self { pose, force_n: DVec3::ZERO, yielding: BVec3::FALSE }
    }

    #[inline]
    fn below_home(depth_m: f64) -> Self {
        Self::at(Pose { position_m: DVec3::new(0.0, 0.0, -depth_m), orientation: DQuat::IDENTITY })
    }
}

/// Intention of the hand during a piece of time, device frame: the aim interpolated linearly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Intention {
    /// Intended position of the handle at the start, m.
    pub position_m: DVec3,
    /// Constant velocity of the intended position, m/s.
    pub velocity_m_per_s: DVec3,
    /// Constant intended orientation of the handle.
    pub orientation: DQuat,
    /// Intended angular velocity, used by the damping of the hand, rad/s.
    pub angular_velocity_rad_per_s: DVec3,
    /// Constant intended force in addition, N.
    pub force_n: DVec3,
    /// Axes along which the hand has no stiffness.
    pub yielding: BVec3,
}

impl Intention {
    /// Creates the intention to hold the handle at a pose. Real-time: bounded, no allocation.
    #[must_use]
    pub const fn resting(pose: Pose) -> Self {
        Self {
            position_m: pose.position_m,
            velocity_m_per_s: DVec3::ZERO,
            orientation: pose.orientation,
            angular_velocity_rad_per_s: DVec3::ZERO,
            force_n: DVec3::ZERO,
            yielding: BVec3::FALSE,
        }
    }
}

/// The intended motion of the hand. Times count from the start of the run.
#[derive(Clone, Debug, PartialEq)]
pub enum Trajectory {
    /// The hand is off the handle.
    Open,
    /// The hand holds the handle at a pose.
    Hold(Pose),
    /// Straight down from home along a minimum-jerk curve, then hold.
    Press {
        /// Depth below home, m; negative pulls up.
        depth_m: f64,
        /// Start of the movement, s.
        start_s: f64,
        /// Duration of the movement, s.
        rise_s: f64,
    },
    /// Hold at a pose, then release.
    Release {
        /// Pose before the release.
        from: Pose,
        /// Time of the release, ns.
        at_ns: u64,
    },
    /// Vertical sine, first downwards, faded in by a minimum-jerk envelope, as the subjects of the thesis explored their
    /// springs.
    Oscillate {
        /// Middle of the movement, z in m; negative is below home.
        centre_m: f64,
        /// Half the distance between the turning points, m.
        amplitude_m: f64,
        /// Cycles per second, Hz.
        frequency_hz: f64,
        /// Time until the full amplitude, s.
        onset_s: f64,
    },
    /// A sequence of movements from a file, or built in.
    Scripted(Script),
    /// The recorded motion of a handle.
    Recorded(Recording),
}

impl Trajectory {
    /// Exploration of the demo. With [`Impedance::FIRM`](super::Impedance::FIRM) against spring 1 of the thesis (1.13 N/mm
    /// at the handle) two thirds of the amplitude reach the handle: 4 mm about a middle 2.5 mm below home, 1.5 times a
    /// second. Rate: most people explore softness at 1 to 2 Hz in 3 or more cycles (Macfadyen 1998).
    pub const EXPLORE: Self =
        Self::Oscillate { centre_m: -4.0e-3, amplitude_m: 6.0e-3, frequency_hz: 1.5, onset_s: 1.0 };

    /// Returns the aim at a time since the start of the run; `None` while the hand is off the handle.
    ///
    /// Real-time: bounded, no allocation.
    #[must_use]
    #[inline]
    pub fn aim(&self, time_ns: u64) -> Option<Aim> {
        let time_s = seconds(time_ns);
        match self {
            Self::Open => None,
            Self::Hold(pose) => Some(Aim::at(*pose)),
            Self::Press { depth_m, start_s, rise_s } => {
                Some(Aim::below_home(depth_m * minimum_jerk(time_s - start_s, *rise_s)))
            }
            Self::Release { from, at_ns } => (time_ns < *at_ns).then_some(Aim::at(*from)),
            Self::Oscillate { centre_m, amplitude_m, frequency_hz, onset_s } => {
                let full_m = centre_m - amplitude_m * math::sin(TAU * frequency_hz * time_s);
                Some(Aim::below_home(-minimum_jerk(time_s, *onset_s) * full_m))
            }
            Self::Scripted(script) => script.aim(time_ns),
            Self::Recorded(recording) => Some(recording.aim(time_ns)),
        }
    }

    /// Returns every set of axes along which the hand yields at some time. Not real-time.
    pub(crate) fn yieldings(&self) -> Vec<BVec3> {
        match self {
            Self::Scripted(script) => script.yieldings(),
            _ => vec![BVec3::FALSE],
        }
    }

    /// Returns the time of the planned release, ns; `None` without one. Real-time: bounded, no allocation.
    #[inline]
    pub(crate) fn release_ns(&self) -> Option<u64> {
        match self {
            Self::Release { at_ns, .. } => Some(*at_ns),
            Self::Scripted(script) => script.release_ns(),
            _ => None,
        }
    }

    /// Rejects numbers that describe no motion. Real-time: bounded, no allocation.
    ///
    /// # Errors
    /// If a number is not finite or out of its range; the error contains its name.
    pub(super) fn check(&self) -> Check {
        match self {
            // Scripts and recordings were checked on reading.
            Self::Open | Self::Scripted(_) | Self::Recorded(_) => Ok(()),
            Self::Hold(pose) | Self::Release { from: pose, .. } => pose.check(),
            Self::Press { depth_m, start_s, rise_s } => {
                number("press depth_m", *depth_m, Domain::Finite)?;
                number("press start_s", *start_s, Domain::Finite)?;
                number("press rise_s", *rise_s, Domain::Positive)
            }
            Self::Oscillate { centre_m, amplitude_m, frequency_hz, onset_s } => {
                number("oscillate centre_m", *centre_m, Domain::Finite)?;
                number("oscillate amplitude_m", *amplitude_m, Domain::NotNegative)?;
                number("oscillate frequency_hz", *frequency_hz, Domain::NotNegative)?;
                number("oscillate onset_s", *onset_s, Domain::Positive)
            }
        }
    }
}

/// Returns the completed fraction (0 to 1) of a minimum-jerk movement `elapsed_s` after its start.
///
/// `10 u^3 - 15 u^4 + 6 u^5` with `u = elapsed / duration` (Flash and Hogan 1985); 0 before and 1 after.
/// Real-time: bounded, no allocation.
#[must_use]
#[inline]
pub fn minimum_jerk(elapsed_s: f64, duration_s: f64) -> f64 {
    let u = (elapsed_s / duration_s).clamp(0.0, 1.0);
    u * u * u * (10.0 + u * (-15.0 + 6.0 * u))
}

#[inline]
fn seconds(time_ns: u64) -> f64 {
    time_ns as f64 * 1.0e-9
}

#[cfg(test)]
mod tests {
    use super::*;

    const PRESS: Trajectory = Trajectory::Press { depth_m: 4.0e-3, start_s: 0.1, rise_s: 0.5 };

    #[test]
    fn a_press_starts_at_home_and_ends_at_its_depth_at_rest() {
        let z_m = |t| PRESS.aim(t).expect("held").pose.position_m.z;
        assert_eq!(z_m(0), 0.0);
        assert_eq!(z_m(350_000_000), -2.0e-3, "half of it in half the time");
        assert_eq!(z_m(5_000_000_000), -4.0e-3);
        // A minimum-jerk movement starts and ends like the cube of time: 10 u^3 of it a millisecond from its ends.
        let least_m = 10.0 * (1.0e-3_f64 / 0.5).powi(3) * 4.0e-3;
        assert!(z_m(101_000_000).abs() <= least_m && (z_m(599_000_000) + 4.0e-3).abs() <= least_m);
    }

    #[test]
    fn an_oscillation_starts_at_rest_and_turns_where_it_says() {
        let z_m = |t| Trajectory::EXPLORE.aim(t).expect("held").pose.position_m.z;
        assert_eq!(z_m(0), 0.0);
        let turning: Vec<f64> = (3_000_000_000..5_000_000_000).step_by(100_000).map(z_m).collect();
        let lowest = turning.iter().copied().fold(f64::INFINITY, f64::min);
        let highest = turning.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        // Sampling 0.1 ms from the turning point costs A (w t)^2 / 2 = 3e-9 m.
        assert!((lowest + 10.0e-3).abs() < 1.0e-8 && (highest - 2.0e-3).abs() < 1.0e-8, "{lowest} {highest}");
    }

    #[test]
    fn a_release_holds_until_its_time_and_not_at_it() {
        let release = Trajectory::Release { from: Pose::HOME, at_ns: 1_000 };
        assert!(release.aim(999).is_some() && release.aim(1_000).is_none());
    }

    #[test]
    fn bad_numbers_are_named() {
        let bad = Trajectory::Press { depth_m: f64::NAN, start_s: 0.0, rise_s: 1.0 };
        assert_eq!(bad.check(), Err(InvalidParameter::NotFinite { name: "press depth_m" }));
        let bad = Trajectory::Press { depth_m: 0.0, start_s: 0.0, rise_s: 0.0 };
        assert_eq!(bad.check(), Err(InvalidParameter::NotPositive { name: "press rise_s", value: 0.0 }));
        let bad =
            Trajectory::Hold(Pose { orientation: DQuat::from_xyzw(0.0, 0.0, 0.0, f64::NAN), ..Pose::HOME });
        assert!(matches!(bad.check(), Err(InvalidParameter::NotARotation { .. })));
    }
}
