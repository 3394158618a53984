//! Guidance of the hand by a client of the run, for example with the mouse: the client sets the intended position of
//! the handle.
//!
//! A guide replaces the trajectory of the hand by a target, until the guide releases the hand. The intended position
//! follows the target like a critically damped oscillator of limited speed, so that a jump of the target causes no jump
//! of the force. After the release the intended position returns to the trajectory within [`RELEASE_NS`]; where the
//! trajectory does not hold the handle, or intends a force, the intended position approaches the handle itself, and the
//! force of the grip fades.
//!
//! Without a message from the guide for [`SILENCE_NS`], the hand is released: a client may end at any time. While one
//! client guides, all others are rejected. All times are times of the simulation's clock, so equal calls give
//! bit-identical results.

use super::{Aim, Pose, minimum_jerk};
use crate::plant::State;
use flotor_hal::glam::DVec3;
use flotor_hal::{Restorable, StateBytes, restorable};

/// Timeout of a guide: time without a message after which the hand is released, ns.
pub const SILENCE_NS: u64 = 1_000_000_000;

/// Duration of the blending from the guided motion back to the trajectory, ns.
pub const RELEASE_NS: u64 = 500_000_000;

/// Natural frequency of the oscillator that follows the target, 1/s: two thirds of a small step are done in 43 ms.
const FOLLOWING_PER_S: f64 = 50.0;

/// Speed limit of the intended position, m/s: quick for a hand that explores an object, and across the workspace in 0.1
/// s.
const SPEED_LIMIT_M_PER_S: f64 = 0.25;

/// Error: the client does not guide the hand; another client guides the hand, or no client does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NotGuiding {
    /// Number of the guiding client; 0 for none.
    pub guide: f64,
}

/// Motion of the intended position towards the target.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Follower {
    /// Intended pose; the orientation is constant.
    pub(crate) pose: Pose,
    /// Velocity of the intended position, m/s.
    pub(crate) velocity_m_per_s: DVec3,
}

restorable!(Follower { pose, velocity_m_per_s });

/// Source of the hand's motion.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    /// The trajectory alone.
    Free,
    /// A guide alone.
    Guided(Follower),
    /// The trajectory, blended with the last guided motion; the blend fades from this time on, ns.
    Releasing(Follower, u64),
}

impl Restorable for Phase {
    fn pass(&mut self, bytes: &mut StateBytes<'_>) {
        let (mut code, mut follower, mut since_ns) = match *self {
            Self::Free => (0, Follower::default(), 0),
            Self::Guided(follower) => (1, follower, 0),
            Self::Releasing(follower, since_ns) => (2, follower, since_ns),
        };
        bytes.choice(&mut code, &[0, 1, 2]);
        follower.pass(bytes);
        since_ns.pass(bytes);
        *self = match code {
            0 => Self::Free,
            1 => Self::Guided(follower),
            _ => Self::Releasing(follower, since_ns),
        };
    }
}

/// Guidance of one hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Guidance {
    phase: Phase,
    /// Number of the client that guides.
    guide: f64,
    /// True if the latest [`Self::take`] was from the guiding client; targets are accepted only then.
    is_guide_speaking: bool,
    target_m: DVec3,
    /// Time of the latest value from the guide, ns.
    heard_ns: u64,
}

restorable!(Guidance { phase, guide, is_guide_speaking, target_m, heard_ns });

impl Guidance {
    /// Guidance of a hand without a guide.
    pub(crate) const NONE: Self =
        Self { phase: Phase::Free, guide: 0.0, is_guide_speaking: false, target_m: DVec3::ZERO, heard_ns: 0 };

    /// Returns true while the trajectory alone moves the hand. Real-time: bounded, no allocation.
    #[inline]
    pub(crate) fn is_free(&self) -> bool {
        matches!(self.phase, Phase::Free)
    }

    /// Returns the number of the guiding client; 0 for none. Real-time: bounded, no allocation.
    pub(crate) fn guide(&self) -> f64 {
        if matches!(self.phase, Phase::Guided(_)) { self.guide } else { 0.0 }
    }

    /// Starts the guidance by client `guide` from the motion `start`, or resets the timeout of this client's guidance;
    /// 0 releases the hand.
    ///
    /// Real-time: bounded, no allocation.
    ///
    /// # Errors
    /// [`NotGuiding`] while another client guides.
    pub(crate) fn take(&mut self, guide: f64, now_ns: u64, start: Follower) -> Result<(), NotGuiding> {
        if guide == 0.0 {
            self.release(now_ns);
            return Ok(());
        }
        self.is_guide_speaking = match self.phase {
            Phase::Guided(_) => guide == self.guide,
            Phase::Free | Phase::Releasing(..) => {
                (self.phase, self.guide, self.target_m) =
                    (Phase::Guided(start), guide, start.pose.position_m);
                true
            }
        };
        self.poll(now_ns)
    }

    /// Sets the target along an axis (0 to 2: x, y, z), m, and resets the timeout. Real-time: bounded, no allocation.
    ///
    /// # Errors
    /// [`NotGuiding`] if the latest [`Self::take`] was not from the guiding client.
    pub(crate) fn aim_at(&mut self, axis: usize, target_m: f64, now_ns: u64) -> Result<(), NotGuiding> {
        self.poll(now_ns)?;
        self.target_m[axis.min(2)] = target_m;
        Ok(())
    }

    fn poll(&mut self, now_ns: u64) -> Result<(), NotGuiding> {
        if !self.is_guide_speaking || self.guide() == 0.0 {
            return Err(NotGuiding { guide: self.guide() });
        }
        self.heard_ns = now_ns;
        Ok(())
    }

    fn release(&mut self, now_ns: u64) {
        if let Phase::Guided(follower) = self.phase {
            self.phase = Phase::Releasing(follower, now_ns);
        }
        self.is_guide_speaking = false;
    }

    /// Advances by `dt_s` (s) to the time `now_ns`. Returns the aim of the hand, and the contribution of the guide to the
    /// intended velocity, m/s. `scripted` is the aim of the trajectory at `now_ns`, `handle` the motion of the handle before
    /// the step.
    ///
    /// Real-time: bounded, no allocation.
    pub(crate) fn advance(
        &mut self,
        now_ns: u64,
        dt_s: f64,
        scripted: Option<Aim>,
        handle: &Follower,
    ) -> (Option<Aim>, DVec3) {
        if now_ns.saturating_sub(self.heard_ns) > SILENCE_NS {
            self.release(now_ns);
        }
        match &mut self.phase {
            Phase::Free => (scripted, DVec3::ZERO),
            Phase::Guided(follower) => {
                follower.approach(self.target_m, dt_s);
                (Some(Aim::at(follower.pose)), follower.velocity_m_per_s)
            }
            Phase::Releasing(follower, since_ns) => {
                let elapsed_ns = now_ns.saturating_sub(*since_ns);
                if elapsed_ns >= RELEASE_NS {
                    self.phase = Phase::Free;
                    return (scripted, DVec3::ZERO);
                }
                follower.approach(self.target_m, dt_s);
                let share = minimum_jerk(elapsed_ns as f64, RELEASE_NS as f64);
                let aim = between(&follower.pose, share, scripted, handle, dt_s);
                (Some(aim), follower.velocity_m_per_s * (1.0 - share))
            }
        }
    }
}

impl Follower {
    /// Returns the motion of the handle. Real-time: bounded, no allocation.
    pub(crate) fn of(state: &State) -> Self {
        let pose = Pose { position_m: state.position_m, orientation: state.orientation };
        Self { pose, velocity_m_per_s: state.velocity_m_per_s }
    }

    /// Moves towards the target for `dt_s` (s, at most 1 ms): a critically damped oscillator, integrated by the
    /// semi-implicit Euler method, which is stable up to 40 ms. An initial speed above the limit only decreases.
    fn approach(&mut self, target_m: DVec3, dt_s: f64) {
        let way_m = target_m - self.pose.position_m;
        let pull = way_m * (FOLLOWING_PER_S * FOLLOWING_PER_S);
        let brake = self.velocity_m_per_s * (2.0 * FOLLOWING_PER_S);
        let fastest = self.velocity_m_per_s.length().max(SPEED_LIMIT_M_PER_S);
        self.velocity_m_per_s = limited(self.velocity_m_per_s + (pull - brake) * dt_s, fastest);
        self.pose.position_m += self.velocity_m_per_s * dt_s;
    }
}

/// Blends a guided pose (`share` 0) and a trajectory (1), `dt_s` (s) after the handle was at `handle`. Where the trajectory
/// does not hold the handle, or intends a force along an axis, the handle itself replaces the intended position: the spring
/// of the hand is then at rest.
fn between(guided: &Pose, share: f64, scripted: Option<Aim>, handle: &Follower, dt_s: f64) -> Aim {
    let Follower { pose: handle, velocity_m_per_s } = *handle;
    let open = || Aim::at(Pose { position_m: handle.position_m + velocity_m_per_s * dt_s, ..handle });
    let scripted = scripted.unwrap_or_else(open);
    let position_m = DVec3::select(scripted.yielding, handle.position_m, scripted.pose.position_m);
    let pose = Pose {
        position_m: guided.position_m.lerp(position_m, share),
        orientation: guided.orientation.lerp(scripted.pose.orientation, share),
    };
    Aim { force_n: scripted.force_n * share, ..Aim::at(pose) }
}

/// Returns the vector, shortened to at most this length.
fn limited(vector: DVec3, length: f64) -> DVec3 {
    let square = vector.length_squared();
    if square > length * length { vector * (length / square.sqrt()) } else { vector }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_hal::glam::BVec3;

    const MILLISECOND_NS: u64 = 1_000_000;

    fn at(z_m: f64) -> Pose {
        Pose { position_m: DVec3::new(0.0, 0.0, z_m), ..Pose::HOME }
    }

    fn start() -> Follower {
        Follower { pose: Pose::HOME, velocity_m_per_s: DVec3::ZERO }
    }

    /// Intended heights after each of some milliseconds, from a time on.
    fn heights(guidance: &mut Guidance, from_ms: u64, to_ms: u64, scripted: Option<Aim>) -> Vec<f64> {
        let handle = Follower { pose: at(-1.0e-3), velocity_m_per_s: DVec3::ZERO };
        let z_m = |ms: u64| {
            let (aim, _) = guidance.advance(ms * MILLISECOND_NS, 1.0e-3, scripted, &handle);
            aim.map_or(f64::NAN, |aim| aim.pose.position_m.z)
        };
        (from_ms + 1..=to_ms).map(z_m).collect()
    }

    #[test]
    fn a_jump_of_the_target_is_followed_within_the_speed_limit_and_without_overshoot() {
        for target_m in [-20.0e-3, -1.0e-4, 5.0e-3] {
            let mut guidance = Guidance::NONE;
            guidance.take(7.0, 0, start()).expect("nobody guides");
            guidance.aim_at(2, target_m, 0).expect("it guides");
            let way = heights(&mut guidance, 0, 900, None);
            let (mut before, mut speed) = (0.0, 0.0);
            for z_m in way {
                assert!((target_m - z_m) * target_m.signum() >= -1.0e-12, "it overshoots {target_m}: {z_m}");
                let now = (z_m - before) / 1.0e-3;
                assert!(f64::abs(now) <= SPEED_LIMIT_M_PER_S * (1.0 + 1.0e-9), "{now} m/s");
                // The acceleration of the linear follower from rest is largest at the start.
                let most = FOLLOWING_PER_S * FOLLOWING_PER_S * target_m.abs() * 1.0e-3;
                assert!(f64::abs(now - speed) <= most * (1.0 + 1.0e-9), "a jump of the velocity");
                (before, speed) = (z_m, now);
            }
            assert!((before - target_m).abs() < 1.0e-9, "{before}");
        }
    }

    #[test]
    fn one_client_guides_at_a_time_and_only_its_coordinates_count() {
        let mut guidance = Guidance::NONE;
        assert_eq!(guidance.aim_at(2, -1.0, 0), Err(NotGuiding { guide: 0.0 }), "nobody guides");
        guidance.take(7.0, 0, start()).expect("nobody guides");
        assert_eq!(guidance.take(8.0, 1, start()), Err(NotGuiding { guide: 7.0 }));
        assert_eq!(guidance.aim_at(2, -9.0, 1), Err(NotGuiding { guide: 7.0 }), "from the other client");
        guidance.take(7.0, 2, start()).expect("it guides already");
        guidance.aim_at(2, -1.0e-3, 2).expect("it guides");
        assert_eq!((guidance.target_m.z, guidance.heard_ns), (-1.0e-3, 2));
        guidance.take(0.0, 3, start()).expect("a release is always legal");
        assert_eq!(guidance.guide(), 0.0);
        guidance.take(8.0, 4, start()).expect("nobody guides any more");
        assert_eq!(guidance.guide(), 8.0);
    }

    #[test]
    fn a_silent_guide_has_released_the_hand() {
        let mut guidance = Guidance::NONE;
        guidance.take(7.0, 0, start()).expect("nobody guides");
        heights(&mut guidance, 0, 1000, None);
        assert_eq!(guidance.guide(), 7.0);
        heights(&mut guidance, 1000, 1001, None);
        assert_eq!(guidance.guide(), 0.0);
        assert!(!guidance.is_free());
        heights(&mut guidance, 1001, 1501, None);
        assert!(guidance.is_free());
    }

    #[test]
    fn a_release_returns_to_the_trajectory_or_to_the_handle_without_a_jump() {
        let scripted = Aim::at(at(4.0e-3));
        let pushing = Aim { force_n: DVec3::Z, yielding: BVec3::new(false, false, true), ..scripted };
        for (scripted, goal_m) in [(Some(scripted), 4.0e-3), (Some(pushing), -1.0e-3), (None, -1.0e-3)] {
            let mut guidance = Guidance::NONE;
            guidance.take(7.0, 0, start()).expect("nobody guides");
            guidance.aim_at(2, -3.0e-3, 0).expect("it guides");
            let held = heights(&mut guidance, 0, 500, scripted);
            guidance.take(0.0, 500 * MILLISECOND_NS, start()).expect("a release is always legal");
            let way = heights(&mut guidance, 500, 999, scripted);
            let mut before = *held.last().expect("500 of them");
            // A minimum-jerk curve is 15/8 as fast as its mean at most.
            let most_m = 15.0 / 8.0 * (goal_m - before) / 500.0;
            for z_m in way {
                assert!(z_m >= before && z_m - before <= most_m * 1.001, "{before} to {z_m}");
                before = z_m;
            }
            // 10 u^3 of the way a millisecond before the end.
            assert!((before - goal_m).abs() < 1.0e-9, "{before}");
            let (after, _) = guidance.advance(1000 * MILLISECOND_NS, 1.0e-3, scripted, &start());
            assert_eq!(after, scripted);
        }
    }
}
