//! Limits on the claims of a partner on another host, to the motion and the energy that are possible for a hand on a
//! device like the local device.
//!
//! The content of a message is a claim. A message with an impossible position, orientation or velocity is ignored.
//! Otherwise its pose is limited to the range of the local device and to the speed of a hand. The energy that the
//! partner claims to have passed on is accepted up to the amount that can be checked here: the energy that this end has
//! passed on itself, and the work, against the coupling and with the power of a hand, of a hand that moved as the
//! claimed pose did. The excess is cut and counted; a partner with too much excess is rejected.

use flotor_core::coupling::CouplingConfig;
use flotor_core::mapping::Mapping;
use flotor_core::peer::PeerState;
use flotor_core::plausibility::{is_rotation, is_too_fast, normalised};
use flotor_hal::{DVec3, DeviceState, Pose, Twist, orientation_from_rotation_vector, rotation_vector};

/// Range of the local device, device frame: semi-axes of an ellipsoid of positions (m) and of an ellipsoid of rotation
/// vectors (rad). An axis without a range (0) is ignored.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reach {
    /// Semi-axes of the positions, m.
    pub range_m: [f64; 3],
    /// Semi-axes of the rotation vectors, rad.
    pub range_rad: [f64; 3],
}

/// Rejected part of a partner's claims.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ClaimExcess {
    /// Energy, J, in the shared frame.
    pub energy_j: f64,
    /// Distance by which the claimed position moved farther than a hand could, m, device frame.
    pub path_m: f64,
    /// Angle by which the claimed orientation rotated farther than a hand could, rad.
    pub turn_rad: f64,
}

/// Largest speed of a hand, m/s and rad/s: several times the speed of a hand that holds a handle.
const FASTEST_M_PER_S: f64 = 2.0;
const FASTEST_RAD_PER_S: f64 = 30.0;
/// Allowance for motion at once, because a message may be late: duration of motion at the largest speed, s.
const AT_ONCE_S: f64 = 0.01;
/// Largest mean power of a hand, W, averaged over more than [`BURST_S`]; within a shorter time the hand may do the work
/// of [`BURST_S`] at this power.
const HAND_W: f64 = 1.0;
const BURST_S: f64 = 0.2;
/// Largest age of a peer state for which the coupling is useful, s: the partner's spring is longer by the motion in that time.
const OLDEST_S: f64 = 0.1;
/// Ratio of the largest work that the partner's hand may have done to the work estimated here.
const MORE: f64 = 2.0;
/// Largest energy of a partner at its first message, J: a full reserve, and the same amount in its spring. This energy
/// counts as work of the partner's hand, so that repeated connections add no energy.
const AT_FIRST_J: f64 = 0.02;
/// Limits on the recent excess, which decays with [`MEMORY_S`]; a partner above one of them is rejected.
const TOO_MUCH: ClaimExcess = ClaimExcess { energy_j: 0.05, path_m: 0.25, turn_rad: 12.5 };
/// Time constant with which the recent excess decays, s.
const MEMORY_S: f64 = 1.0;
/// Largest distance of a partner from home, in the shared frame of devices that are not scaled, m: more than the
/// largest arms reach, as the range of the partner's device is unknown here.
const FARTHEST_M: f64 = 2.0;

/// Check of the claims of one partner. Energies in the shared frame.
pub(super) struct Claims {
    reach: Reach,
    config: CouplingConfig,
    energy_scale: f64,
    period_s: f64,
    /// Last accepted pose of the partner, device frame: position and rotation vector.
    last: Option<[DVec3; 2]>,
    /// Energy that the partner claims to have passed on, J.
    claimed_j: f64,
    /// Total energy accepted from all partners, J. The energy delivered to the local hand is at most this energy plus
    /// the energy that the local hand put in.
    pub(super) accepted_j: f64,
    /// Energy that the partner may still claim, J.
    open_j: f64,
    /// Work that the partner's hand may still have done, J.
    hand_j: f64,
    /// Energy that this end had passed on in the last tick, J.
    passed_on_j: f64,
    /// Remaining allowance of motion, m and rad.
    way: [f64; 2],
    /// Total excess of all partners.
    pub(super) cut: ClaimExcess,
    recent: ClaimExcess,
    /// True if a claim was cut in this tick.
    pub(super) is_cut: bool,
}

impl Claims {
    /// Creates the check without a partner. Not real-time.
    pub(super) fn new(config: &CouplingConfig, mapping: &Mapping, reach: Reach, period_s: f64) -> Self {
        Self {
            reach,
            config: *config,
            energy_scale: mapping.energy_scale(),
            period_s,
            last: None,
            claimed_j: 0.0,
            accepted_j: 0.0,
            open_j: 0.0,
            hand_j: HAND_W * BURST_S / mapping.energy_scale(),
            passed_on_j: 0.0,
            way: [0.0; 2],
            cut: ClaimExcess::default(),
            recent: ClaimExcess::default(),
            is_cut: false,
        }
    }

    /// Returns true if a device could have the pose and velocity of a message; other messages are ignored. Real-time:
    /// bounded, no allocation.
    #[inline]
    pub(super) fn can_be(&self, peer: &PeerState, mapping: &Mapping) -> bool {
        // From metres of a device to the shared frame; the partner's scale may differ, but then is not less than one.
        let scale = mapping.length_to_device(1.0).recip().max(1.0);
        let PeerState { pose, twist, .. } = peer;
        let unscaled = Twist::new(twist.linear() / scale, twist.angular());
        pose.is_finite()
            && twist.is_finite()
            && is_rotation(pose.orientation())
            && pose.position().length() <= FARTHEST_M * scale
            && !is_too_fast(&unscaled)
    }

    /// Starts the check of a partner with its first state: energy that the partner passed on earlier was for another run and is not
    /// accepted here. `is_another`: the partner's run differs from the previous partner's; the recent excess is then reset,
    /// otherwise it still counts. Real-time: bounded, no allocation.
    pub(super) fn meet(&mut self, peer: &PeerState, is_another: bool) {
        self.last = None;
        if is_another {
            self.recent = ClaimExcess::default();
        }
        let had_j = AT_FIRST_J.min(self.hand_j);
        (self.claimed_j, self.open_j, self.hand_j) = (peer.passed_on_j, had_j, self.hand_j - had_j);
    }

    /// Drops the partner's pose after a silence: the next pose is accepted as a start. Real-time: bounded, no
    /// allocation.
    pub(super) fn forget_place(&mut self) {
        self.last = None;
    }

    /// Updates the allowances for a tick; `passed_on_j` is the total energy passed on by this end. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn pass(&mut self, passed_on_j: f64) {
        let period_s = self.period_s;
        let shared = |hand: f64| hand / self.energy_scale;
        self.open_j += (passed_on_j - self.passed_on_j).max(0.0);
        self.open_j = self.open_j.min(shared(HAND_W * BURST_S) + AT_FIRST_J);
        self.passed_on_j = passed_on_j;
        self.hand_j = (self.hand_j + shared(HAND_W * period_s)).min(shared(HAND_W * BURST_S));
        for (way, fastest) in self.way.iter_mut().zip([FASTEST_M_PER_S, FASTEST_RAD_PER_S]) {
            *way = (*way + fastest * period_s).min(fastest * (AT_ONCE_S + period_s));
        }
        let kept = 1.0 - (period_s / MEMORY_S).min(1.0);
        let ClaimExcess { energy_j, path_m, turn_rad } = &mut self.recent;
        [energy_j, path_m, turn_rad].into_iter().for_each(|number| *number *= kept);
        self.is_cut = false;
    }

    /// Returns the accepted part of a claim. `here` is the state of the local handle (device frame), `silent_s` the
    /// time since the last message; the energy in the result is the running total of accepted energy. Real-time:
    /// bounded, no allocation.
    #[inline]
    pub(super) fn accept(
        &mut self,
        peer: &PeerState,
        here: &DeviceState,
        mapping: &Mapping,
        silent_s: f64,
    ) -> PeerState {
        let claimed = [
            mapping.position_to_device(peer.pose.position()),
            mapping.rotation().conjugate() * rotation_vector(peer.pose.orientation()),
        ];
        let within = [reached(claimed[0], self.reach.range_m), reached(claimed[1], self.reach.range_rad)];
        // A partner with more range than this device makes no false claim: the cut is reported, and not counted.
        self.is_cut = within != claimed;
        let last = self.last.unwrap_or(within);
        let mut accepted = within;
        let mut moved = [0.0; 2];
        for (index, fastest) in [FASTEST_M_PER_S, FASTEST_RAD_PER_S].into_iter().enumerate() {
            let (Some(to), Some(from), Some(way), Some(moved)) =
                (accepted.get_mut(index), last.get(index), self.way.get_mut(index), moved.get_mut(index))
            else {
                continue;
            };
            let step = *to - *from;
            let (length, most) = (step.length(), way.max(fastest * silent_s));
            if length > most {
                *to = *from + step * (most / length);
                self.is_cut = true;
                let beyond = length - most;
                let places = if index == 0 {
                    [&mut self.cut.path_m, &mut self.recent.path_m]
                } else {
                    [&mut self.cut.turn_rad, &mut self.recent.turn_rad]
                };
                places.into_iter().for_each(|place| *place += beyond);
            }
            *moved = length.min(most);
            *way = (*way - *moved).max(0.0);
        }
        self.last = Some(accepted);
        // A pose that is used as claimed keeps its bits, if its orientation has length one.
        let pose = if accepted == claimed {
            normalised(&peer.pose)
        } else {
            let pose = Pose::new(accepted[0], orientation_from_rotation_vector(accepted[1]));
            mapping.pose_to_model(&pose)
        };
        let [path_m, turn_rad] = moved;
        let moved = [path_m / mapping.length_to_device(1.0), turn_rad];
        let here = (mapping.pose_to_model(&here.pose), mapping.twist_to_model(&here.twist));
        let passed_on_j = self.energy(peer.passed_on_j, &pose, &here, moved, silent_s);
        PeerState { pose, twist: bounded_twist(&peer.twist, mapping), passed_on_j }
    }

    /// Accepts a claim of energy as far as it can be checked; returns the total accepted so far, J.
    fn energy(
        &mut self,
        passed_on_j: f64,
        pose: &Pose,
        (here, motion): &(Pose, Twist),
        [path_m, turn_rad]: [f64; 2],
        silent_s: f64,
    ) -> f64 {
        let config = &self.config;
        let time_s = silent_s.max(self.period_s);
        // Both hands move while the peer states are under way.
        let speed_m_per_s = path_m / time_s + motion.linear().length();
        let speed_rad_per_s = turn_rad / time_s + motion.angular().length();
        let away_m = (pose.position() - here.position()).length() + speed_m_per_s * OLDEST_S;
        let turned_rad = rotation_vector(pose.orientation() * here.orientation().conjugate()).length()
            + speed_rad_per_s * OLDEST_S;
        let force_n = config.stiffness_n_per_m * away_m + config.damping_ns_per_m * speed_m_per_s;
        let torque_nm =
            config.stiffness_nm_per_rad * turned_rad + config.damping_nms_per_rad * speed_rad_per_s;
        let work_j = (MORE * (force_n * path_m + torque_nm * turn_rad)).min(self.hand_j);
        self.hand_j -= work_j;
        self.open_j += work_j;
        let claim_j = (passed_on_j - self.claimed_j).max(0.0);
        let accepted_j = claim_j.min(self.open_j);
        self.claimed_j = self.claimed_j.max(passed_on_j);
        self.open_j -= accepted_j;
        self.accepted_j += accepted_j;
        let beyond_j = claim_j - accepted_j;
        // Sums of some thousand terms of up to 10 mJ.
        if beyond_j > 1.0e-12 {
            self.is_cut = true;
            self.cut.energy_j += beyond_j;
            self.recent.energy_j += beyond_j;
        }
        self.accepted_j
    }

    /// Returns true if the recent excess is above the limits for a partner. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn is_too_much(&self) -> bool {
        let ClaimExcess { energy_j, path_m, turn_rad } = self.recent;
        energy_j > TOO_MUCH.energy_j || path_m > TOO_MUCH.path_m || turn_rad > TOO_MUCH.turn_rad
    }
}

/// Limits a twist to the speeds of a hand; they are limits in the frame of the device.
fn bounded_twist(twist: &Twist, mapping: &Mapping) -> Twist {
    let most_m_per_s = FASTEST_M_PER_S / mapping.length_to_device(1.0);
    Twist::new(
        twist.linear().clamp_length_max(most_m_per_s),
        twist.angular().clamp_length_max(FASTEST_RAD_PER_S),
    )
}

/// Limits a vector to an ellipsoid with these semi-axes.
fn reached(vector: DVec3, range: [f64; 3]) -> DVec3 {
    let parts = vector.to_array().into_iter().zip(range).filter(|(_, range)| *range > 0.0);
    let outside = parts.map(|(part, range)| part / range).map(|ratio| ratio * ratio).sum::<f64>().sqrt();
    if outside > 1.0 { vector / outside } else { vector }
}

#[cfg(test)]
mod tests;
