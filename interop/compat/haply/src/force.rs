//! Force on a device: the sum of the commands of all sessions, in Flotor's axes.

use flotor_compat::State;
use flotor_hal::DVec3;

/// Validity of a command without renewal, and fade-out time after it, ns.
const VALID_NS: u64 = 50_000_000;
const FADE_NS: u64 = 50_000_000;
/// Stiffness and damping towards a commanded position, N/m and N·s/m: soft enough for any device.
const STIFFNESS_N_PER_M: f64 = 400.0;
const DAMPING_NS_PER_M: f64 = 4.0;
/// Limit on the components of a summed force, N, so that a sum stays finite.
const LARGEST_N: f64 = 1.0e300;
/// Limit on the damping of a session, N·s/m.
const LARGEST_DAMPING_NS_PER_M: f64 = 50.0;

/// Domain of a session's commands to a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Domain {
    Cartesian,
    Angular,
}

/// Command of a session to a device.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SessionCommand {
    pub(crate) domain: Domain,
    pub(crate) force_n: Option<DVec3>,
    pub(crate) target_m: Option<DVec3>,
    /// Damping along each axis, N·s/m.
    pub(crate) damping: DVec3,
}

/// Commands to a device, each with its session and its time, ns.
#[derive(Debug, Default)]
pub(crate) struct Forces(Vec<(u64, u64, SessionCommand)>);

impl Forces {
    /// Replaces the command of a session.
    pub(crate) fn set(&mut self, session: u64, now_ns: u64, wanted: SessionCommand) {
        self.remove(session);
        self.0.push((session, now_ns, wanted));
    }

    /// Removes the command of a session.
    pub(crate) fn remove(&mut self, session: u64) {
        self.0.retain(|(of, ..)| *of != session);
    }

    /// Removes fully faded commands; returns true if there are none left.
    pub(crate) fn remove_expired(&mut self, now_ns: u64) -> bool {
        self.0.retain(|(_, since_ns, _)| now_ns.saturating_sub(*since_ns) < VALID_NS + FADE_NS);
        self.0.is_empty()
    }

    /// Returns true if the sum changes without a new command: the sum depends on the handle, or the command of one of several
    /// sessions may fade.
    pub(crate) fn follow_the_handle(&self) -> bool {
        let follows = |wanted: &SessionCommand| wanted.target_m.is_some() || wanted.damping != DVec3::ZERO;
        self.0.len() > 1 || self.0.iter().any(|(.., wanted)| follows(wanted))
    }

    /// Returns the newest valid command, which defines the control mode of the device.
    pub(crate) fn newest(&self, now_ns: u64) -> Option<&SessionCommand> {
        let valid = self.0.iter().filter(|(_, since_ns, _)| now_ns.saturating_sub(*since_ns) <= VALID_NS);
        valid.max_by_key(|(_, since_ns, _)| *since_ns).map(|(.., wanted)| wanted)
    }

    /// Returns the force on the hand, N: the sum of all commands, each faded out after its validity.
    pub(crate) fn sum(&self, state: &State, now_ns: u64) -> DVec3 {
        let largest = DVec3::splat(LARGEST_N);
        let force = |(_, since_ns, wanted): &(u64, u64, SessionCommand)| {
            let late_ns = now_ns.saturating_sub(*since_ns).saturating_sub(VALID_NS);
            let left = 1.0 - late_ns.min(FADE_NS) as f64 / FADE_NS as f64;
            let own_n = wanted.force_n.unwrap_or(DVec3::ZERO).clamp(-largest, largest);
            let held_n = wanted.target_m.map_or(DVec3::ZERO, |target_m| {
                (target_m - state.position_m) * STIFFNESS_N_PER_M - state.velocity_m_per_s * DAMPING_NS_PER_M
            });
            let damping = wanted.damping.clamp(DVec3::ZERO, DVec3::splat(LARGEST_DAMPING_NS_PER_M));
            (own_n + held_n - damping * state.velocity_m_per_s) * left
        };
        self.0.iter().map(force).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_hal::{DQuat, Wrench};

    const AT_HOME: State = State {
        ticks: 1,
        position_m: DVec3::ZERO,
        orientation: DQuat::IDENTITY,
        velocity_m_per_s: DVec3::ZERO,
        angular_velocity_rad_per_s: DVec3::ZERO,
        buttons: 0,
        applied: Wrench::ZERO,
        grip: None,
    };

    fn force(x: f64) -> SessionCommand {
        let force_n = Some(DVec3::new(x, 0.0, 0.0));
        SessionCommand { domain: Domain::Cartesian, force_n, target_m: None, damping: DVec3::ZERO }
    }

    #[test]
    fn forces_of_sessions_add_and_the_newest_of_one_counts() {
        let mut forces = Forces::default();
        forces.set(1, 0, force(1.0));
        forces.set(2, 0, force(0.5));
        forces.set(1, 1, force(2.0));
        assert_eq!(forces.sum(&AT_HOME, 1).x, 2.5);
        assert!(forces.follow_the_handle());
        forces.remove(2);
        assert_eq!(forces.sum(&AT_HOME, 1).x, 2.0);
        assert!(!forces.follow_the_handle());
    }

    #[test]
    fn a_session_that_stalls_fades_while_the_other_goes_on() {
        let mut forces = Forces::default();
        forces.set(1, 0, force(2.0));
        let now_ns = VALID_NS + FADE_NS / 4;
        forces.set(2, now_ns, force(1.0));
        assert_eq!(forces.sum(&AT_HOME, now_ns).x, 1.0 + 2.0 * 0.75);
        assert!(!forces.remove_expired(VALID_NS + FADE_NS));
        assert_eq!(forces.sum(&AT_HOME, VALID_NS + FADE_NS).x, 1.0);
        assert!(forces.remove_expired(10 * VALID_NS));
    }

    #[test]
    fn huge_forces_add_up_to_a_finite_one_and_a_target_pulls() {
        let mut forces = Forces::default();
        for session in 0..8 {
            forces.set(session, 0, force(f64::MAX));
        }
        assert!(forces.sum(&AT_HOME, 0).is_finite());
        let mut forces = Forces::default();
        let target_m = Some(DVec3::new(0.0, 0.01, 0.0));
        forces.set(1, 0, SessionCommand { force_n: None, target_m, ..force(0.0) });
        let away = State { velocity_m_per_s: DVec3::new(0.0, 0.1, 0.0), ..AT_HOME };
        assert!((forces.sum(&away, 0).y - (4.0 - 0.4)).abs() < 1.0e-12);
    }
}
