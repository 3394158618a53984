//! Whether what the other end of a coupling tells can be true: the check of samples, for a device on another host.

use crate::plausibility::{Implausible, SPEED_M_PER_S, is_rotation, is_too_fast};
use flotor_core::peer::{Dispatch, PeerState};
use flotor_hal::{DVec3, Twist};

/// How far from the middle a partner may be, in the shared frame of devices that are not scaled, m: the range of its device
/// is not known here; that of the largest arms is less.
const REACH_M: f64 = 2.0;

/// The check of one end's partner.
pub(super) struct PeerCheck {
    /// From metres of a device to the shared frame, at least one.
    scale: f64,
    /// How much later than the one before a message may be, ns: its way is not always as long.
    late_ns: u64,
    last: Option<Believed>,
}

/// A message that was believed: of which run, where, when.
#[derive(Clone, Copy)]
struct Believed {
    run: u64,
    position: DVec3,
    heard_ns: u64,
}

impl PeerCheck {
    /// For an end with this motion scale, which waits at most `silence_ns` for a message. Not real-time.
    pub(super) fn new(motion_scale: f64, silence_ns: u64) -> Self {
        Self { scale: motion_scale.max(1.0), late_ns: silence_ns, last: None }
    }

    /// Looks at a new message; one that can be is the last one from now on.
    ///
    /// # Errors
    /// Why it cannot be.
    ///
    /// Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn check(&mut self, dispatch: &Dispatch, now_ns: u64) -> Result<(), Implausible> {
        let Dispatch { run, state: PeerState { pose, twist, .. }, .. } = dispatch;
        if !pose.is_finite() || !twist.is_finite() {
            return Err(Implausible::NotFinite);
        }
        if !is_rotation(pose.orientation()) {
            return Err(Implausible::Quaternion);
        }
        let position = pose.position();
        if position.length() > REACH_M * self.scale {
            return Err(Implausible::Range);
        }
        let unscaled = Twist::new(twist.linear() / self.scale, twist.angular());
        if is_too_fast(&unscaled) {
            return Err(Implausible::Speed);
        }
        if let Some(last) = self.last.filter(|last| last.run == *run) {
            let most_ns = now_ns.saturating_sub(last.heard_ns).saturating_add(self.late_ns);
            let most_m = SPEED_M_PER_S * self.scale * most_ns as f64 * 1.0e-9;
            if (position - last.position).length_squared() > most_m * most_m {
                return Err(Implausible::Speed);
            }
        }
        self.last = Some(Believed { run: *run, position, heard_ns: now_ns });
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_core::peer::TankState;
    use flotor_hal::{DQuat, Pose};

    fn dispatch(run: u64, z_m: f64) -> Dispatch {
        let pose = Pose::new(DVec3::Z * z_m, DQuat::IDENTITY);
        let state = PeerState { pose, twist: Twist::ZERO, told_j: 0.0 };
        Dispatch { run, tick: 0, state, tank: TankState::default() }
    }

    #[test]
    fn a_partner_is_believed_where_a_hand_can_be() {
        const MS: u64 = 1_000_000;
        let mut check = PeerCheck::new(1.0, 100 * MS);
        assert_eq!(check.check(&dispatch(1, 0.01), 0), Ok(()));
        // 5 m/s for the 101 ms that may lie between.
        assert_eq!(check.check(&dispatch(1, 0.6), MS), Err(Implausible::Speed));
        assert_eq!(check.check(&dispatch(1, 0.5), MS), Ok(()));
        assert_eq!(check.check(&dispatch(1, -1.0e30), MS), Err(Implausible::Range));
        assert_eq!(check.check(&dispatch(1, f64::NAN), MS), Err(Implausible::NotFinite));
        assert_eq!(check.check(&dispatch(2, -1.0), MS), Ok(()), "another run may be anywhere");
        let mut wrong = dispatch(2, -1.0);
        wrong.state.twist.linear_m_per_s = [0.0, 0.0, 1.0e30];
        assert_eq!(check.check(&wrong, MS), Err(Implausible::Speed));
        wrong = dispatch(2, -1.0);
        wrong.state.pose.orientation_xyzw = [0.0; 4];
        assert_eq!(check.check(&wrong, MS), Err(Implausible::Quaternion));
        // A shared frame of kilometres.
        assert_eq!(PeerCheck::new(1.0e3, MS).check(&dispatch(1, 1.0e3), 0), Ok(()));
    }
}
