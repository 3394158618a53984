//! The intended motion of the hand over time, with the times of the grip.
//!
//! Voluntary movements start and stop smoothly; [`minimum_jerk`] (Flash and Hogan 1985, J. Neurosci. 5:1688) is the
//! usual curve. Every motion here, except a recorded one, is composed of minimum-jerk curves and sines.

use super::{Aim, Pose, Recording, Script, minimum_jerk};
use crate::units::seconds;
use crate::validation::{Check, Domain, number};
use flotor_hal::glam::BVec3;
use flotor_hal::math;
use std::f64::consts::TAU;

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

    /// Returns the sets of axes along which the hand, at some time, intends a force instead of a position; includes the
    /// empty set. Not real-time.
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
