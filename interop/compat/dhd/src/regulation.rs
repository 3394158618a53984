//! Regulation: a virtual spring that holds the handle, moves it along a straight line, or tracks targets without a planned motion.
//!
//! The original library regulates the encoder positions with the motors. Here a spring and a damper act on the handle instead,
//! inside the envelope: soft enough for any device, so that a resisting hand prevails.

use flotor_compat::{Axes, State};
use flotor_hal::{DQuat, DVec3, orientation_from_rotation_vector, rotation_vector};

/// Stiffness and damping of the position, N/m and N·s/m.
const STIFFNESS: [f64; 2] = [400.0, 4.0];
/// Stiffness and damping of the orientation, N·m/rad and N·m·s/rad.
const TURNING: [f64; 2] = [0.5, 0.005];
/// Duration of the shortest motion, s.
const SHORTEST_S: f64 = 0.1;
/// Ratio of peak to mean speed of a minimum-jerk motion.
const PEAK: f64 = 1.875;
/// Tolerances of arrival, distance and speed, m and m/s: a handle of half a kilogram overshoots on the spring by
/// `v sqrt(m / k)`, 1 mm.
const ARRIVED: [f64; 2] = [1.0e-3, 25.0e-3];
/// Tolerances of arrival, angle and angular velocity, rad and rad/s.
const TURNED: [f64; 2] = [0.02, 0.5];
/// Timeout for the arrival after the planned end of a motion, ns: a hand may hold the handle.
const PATIENCE_NS: u64 = 2_000_000_000;

/// Progress of a motion. The variants are ordered: several motions together have the largest progress of all.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Progress {
    /// The handle has arrived.
    Arrived,
    /// The handle did not arrive in time.
    TimedOut,
    /// The plan is in progress, or the handle has not arrived yet.
    Moving,
}

/// State and goals of the regulation.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Regulation {
    pub(crate) is_running: bool,
    /// Regulated axes: position, rotation, gripper.
    pub(crate) axes: [bool; 3],
    pub(crate) position: Motion,
    pub(crate) rotation: Motion,
}

/// Motion along a straight line, or a constant goal: a position, m, or a rotation vector, rad, in Flotor's axes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Motion {
    from: DVec3,
    to: DVec3,
    since_ns: u64,
    until_ns: u64,
    progress: Progress,
}

impl Motion {
    const NONE: Self =
        Self { from: DVec3::ZERO, to: DVec3::ZERO, since_ns: 0, until_ns: 0, progress: Progress::Arrived };

    /// Returns a constant goal, which takes effect at once.
    pub(crate) fn at(place: DVec3) -> Self {
        Self { from: place, to: place, ..Self::NONE }
    }

    /// Plans a minimum-jerk motion along a line from `since_ns` on, with peak speed `fastest`, m/s or rad/s.
    pub(crate) fn go_to(&mut self, to: DVec3, fastest: f64, since_ns: u64) {
        let from = self.place(since_ns);
        let time_s = (PEAK * (to - from).length() / fastest.max(1.0e-3)).clamp(SHORTEST_S, 60.0);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // at most a minute
        let time_ns = (time_s * 1.0e9) as u64;
        *self = Self { from, to, since_ns, until_ns: since_ns + time_ns, progress: Progress::Moving };
    }

    /// Updates the progress; `is_at_end` is true while the handle is at the end of the motion.
    fn update(&mut self, is_at_end: bool, now_ns: u64) -> Progress {
        if self.progress == Progress::Moving && now_ns >= self.until_ns {
            if is_at_end {
                self.progress = Progress::Arrived;
            } else if now_ns >= self.until_ns + PATIENCE_NS {
                self.progress = Progress::TimedOut;
            }
        }
        self.progress
    }

    fn place(&self, now_ns: u64) -> DVec3 {
        let length_ns = self.until_ns.saturating_sub(self.since_ns);
        if length_ns == 0 || now_ns >= self.until_ns {
            return self.to;
        }
        let part = now_ns.saturating_sub(self.since_ns) as f64 / length_ns as f64;
        // Minimum jerk.
        let done = part * part * part * (10.0 + part * (6.0 * part - 15.0));
        self.from + (self.to - self.from) * done
    }
}

impl Regulation {
    pub(crate) const OFF: Self =
        Self { is_running: false, axes: [true; 3], position: Motion::NONE, rotation: Motion::NONE };

    /// Creates a regulation that holds the handle at its current pose.
    pub(crate) fn started(state: &State) -> Self {
        let mut started = Self { is_running: true, ..Self::OFF };
        started.hold(state);
        started
    }

    /// Holds the handle at its current pose.
    pub(crate) fn hold(&mut self, state: &State) {
        self.position = Motion::at(state.position_m);
        self.rotation = Motion::at(rotation_vector(state.orientation));
    }

    /// Updates the progress of the position and of the rotation from the state of a handle with these axes.
    pub(crate) fn update(&mut self, state: &State, axes: Axes, now_ns: u64) -> [Progress; 2] {
        let [position, rotation, _] = self.axes;
        let is_below = |[most, fastest]: [f64; 2], away: DVec3, speed: DVec3| {
            away.length() < most && speed.length() < fastest
        };
        let has_arrived =
            !position || is_below(ARRIVED, self.position.to - state.position_m, state.velocity_m_per_s);
        let has_turned = !rotation
            || axes != Axes::Six
            || is_below(TURNED, turn_from(state, self.rotation.to), state.angular_velocity_rad_per_s);
        [self.position.update(has_arrived, now_ns), self.rotation.update(has_turned, now_ns)]
    }

    /// Returns force and torque of the regulation, Flotor's axes, N and N·m.
    pub(crate) fn wrench(&self, state: &State, now_ns: u64) -> (DVec3, DVec3) {
        let [position, rotation, _] = self.axes.map(|is_on| is_on && self.is_running);
        let mut wrench = (DVec3::ZERO, DVec3::ZERO);
        if position {
            let [stiffness, damping] = STIFFNESS;
            wrench.0 = (self.position.place(now_ns) - state.position_m) * stiffness
                - state.velocity_m_per_s * damping;
        }
        if rotation {
            let [stiffness, damping] = TURNING;
            let away = turn_from(state, self.rotation.place(now_ns));
            wrench.1 = away * stiffness - state.angular_velocity_rad_per_s * damping;
        }
        wrench
    }
}

/// Returns the rotation vector from the handle's orientation to a goal, given as a rotation vector.
fn turn_from(state: &State, to_rad: DVec3) -> DVec3 {
    let target: DQuat = orientation_from_rotation_vector(to_rad);
    rotation_vector(target * state.orientation.conjugate())
}
