//! Replacement of a contact set by the next one without adding energy.
//!
//! The springs of a contact that both sets have keep their compression; the difference to the depth in the new set is withheld,
//! as an offset of the gap. A contact of the new set only is withheld entirely; a contact of the old set only fades. Then every
//! withheld part falls to 0 at a rate that needs half the time between two sets, 20 ms at the most:
//!
//! - a part that is below 0, or fades, loses energy as it falls;
//! - a part above 0 gains energy, and falls only as far as the [`Balance`] pays for it; without a touching spring it costs
//!   nothing, and where the tool has left the contact it is gone.

use crate::linear::{self, Symmetric6, Vector6, dot};
use crate::slot::{Role, Slot};
use flotor_hal::{Pose, Wrench};

/// Manner of replacing a contact set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Replacement {
    /// Immediate: the force jumps, and the hand receives the difference of the stored energies.
    Immediate,
    /// Energy-conserving, without jumps: all energy comes from the motion of the hand and the declared motion of the surfaces.
    Conserving {
        /// Maximum power of the declared motion of a surface, W per contact; a surface with more power moves more slowly.
        surface_power_w: f64,
    },
}

/// Longest time over which a change of force is spread, s.
pub(crate) const LONGEST_SPREAD_S: f64 = 0.02;
/// Maximum balance, J: energy dissipated long ago is not available.
const LARGEST_J: f64 = 0.01;
/// Power added to the balance to cover rounding errors, W: 0.1 mJ per minute.
const DRIFT_W: f64 = 0.1e-3 / 60.0;

/// Dissipated energy: work of the hand and of the declared surfaces less the energy stored in the springs.
///
/// The force of a tick acts until the next tick. A spring of stiffness `k` that is moved by `d` meanwhile takes `k d^2 / 2` less
/// from the hand than it stores, in both directions, as in every sampled loop (J. Colgate, G. Schenkel, "Passivity of a class of
/// sampled-data systems", J. Robotic Systems 14(1), 1997). This energy is credited, so that the balance of an ideal spring stays
/// 0.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Balance {
    available_j: f64,
    stored_j: f64,
    wrench: Wrench,
    pose: Option<Pose>,
    is_interrupted: bool,
}

impl Balance {
    pub(crate) const EMPTY: Self =
        Self { available_j: 0.0, stored_j: 0.0, wrench: Wrench::ZERO, pose: None, is_interrupted: false };

    pub(crate) fn available_j(&self) -> f64 {
        self.available_j
    }

    pub(crate) fn stored_j(&self) -> f64 {
        self.stored_j
    }

    /// Returns the pose of the last solve.
    pub(crate) fn pose(&self) -> Option<&Pose> {
        self.pose.as_ref()
    }

    /// Records a tick without a solve: its motion is unknown and adds no energy.
    pub(crate) fn interrupt(&mut self) {
        self.is_interrupted = true;
    }

    /// Adds the work of the force of the last tick up to this pose.
    pub(crate) fn move_to(&mut self, pose: &Pose, elapsed_s: f64) {
        if let Some(last) = self.pose {
            let turn = pose.orientation() * last.orientation().conjugate();
            let chord = turn.xyz() * if turn.w < 0.0 { -2.0 } else { 2.0 };
            let work_j =
                -self.wrench.force().dot(pose.position() - last.position()) - self.wrench.torque().dot(chord);
            self.available_j += if self.is_interrupted { work_j.min(0.0) } else { work_j };
        }
        self.available_j += DRIFT_W * elapsed_s;
        self.is_interrupted = false;
        self.pose = Some(*pose);
    }

    /// Adds the work of a surface, or the credit of a sampled spring, J.
    pub(crate) fn add(&mut self, energy_j: f64) {
        self.available_j += energy_j;
    }

    /// Subtracts the increase of the stored energy after a solve; `wrench` acts until the next tick.
    pub(crate) fn settle(&mut self, offset: &Vector6, slots: &[Slot], wrench: &Wrench) {
        let stored_j = energy_j(offset, slots);
        self.available_j = (self.available_j - (stored_j - self.stored_j)).min(LARGEST_J);
        self.stored_j = stored_j;
        self.wrench = *wrench;
    }
}

/// Energy credit of springs sampled once per tick: the excess of their stored energy over the work of the hand.
///
/// It is `k d^2 / 2` of the stiffness felt behind the coupling: the least energy over all changes of the offset.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SampledMotion {
    stiff_j: f64,
    matrix: Symmetric6,
    slope: Vector6,
}

impl SampledMotion {
    pub(crate) const NONE: Self = Self { stiff_j: 0.0, matrix: linear::IDENTITY, slope: [0.0; 6] };

    /// Adds a spring that is moved by `motion_m` at the handle.
    #[inline]
    pub(crate) fn add(&mut self, stiffness_n_per_m: f64, motion_m: f64, row: &Vector6) {
        let force = stiffness_n_per_m * motion_m;
        self.stiff_j += 0.5 * force * motion_m;
        linear::add_square(&mut self.matrix, row, stiffness_n_per_m);
        linear::add(&mut self.slope, row, force);
    }

    /// Returns the energy, J.
    #[inline]
    pub(crate) fn energy_j(&self) -> f64 {
        self.stiff_j - 0.5 * dot(&self.slope, &linear::solve(self.matrix, &self.slope))
    }
}

/// Returns the energy of the coupling and of all springs, J.
pub(crate) fn energy_j(offset: &Vector6, slots: &[Slot]) -> f64 {
    0.5 * dot(offset, offset) + slots.iter().map(Slot::stored_j).sum::<f64>()
}

/// Reduces the withheld part of a contact in one tick; `whole_m` is the depth including this part. Returns the energy used of
/// `available_j`, J.
#[inline]
pub(crate) fn relax(slot: &mut Slot, whole_m: f64, available_j: f64) -> f64 {
    if slot.role == Role::Fading {
        slot.withheld_m += slot.rate_m;
        return 0.0;
    }
    if slot.withheld_m <= 0.0 {
        slot.withheld_m = (slot.withheld_m + slot.rate_m).min(0.0);
        return 0.0;
    }
    // Behind a coupling the solve moves the tool again: allow for twice the change of depth.
    let depth_m = (whole_m - slot.withheld_m).max(0.0);
    let depth_m = depth_m.max(slot.depth_m) + (depth_m - slot.depth_m).abs();
    let stiffness = slot.contact.stiffness_n_per_m;
    let force = stiffness * depth_m;
    let cost_j = |fall_m: f64| (force + 0.5 * stiffness * fall_m) * fall_m;
    let mut fall_m = slot.rate_m.min(slot.withheld_m);
    if cost_j(fall_m) > available_j {
        if available_j <= 0.0 {
            return 0.0;
        }
        fall_m = 2.0 * available_j / (force + (force * force + 2.0 * stiffness * available_j).sqrt());
    }
    slot.withheld_m -= fall_m;
    cost_j(fall_m)
}

/// Largest distance of the points on the tool, m, and smallest cosine between the normals (8 degrees), for which two contacts are
/// the same.
const SAME_POINT_M: f64 = 0.01;
const SAME_NORMAL: f64 = 0.99;

/// Removes and returns the closest matching old contact.
pub(crate) fn take_closest(old: &mut [Slot], slot: &Slot) -> Option<Slot> {
    let mut least = 1.0;
    let mut closest = None;
    for old in old {
        let cosine = old.contact.normal.dot(slot.contact.normal);
        let distance = (old.contact.tool_point_m - slot.contact.tool_point_m) / SAME_POINT_M;
        let difference = distance.length_squared() + (1.0 - cosine);
        if old.anchor_m.is_some() && cosine >= SAME_NORMAL && difference < least {
            least = difference;
            closest = Some(old);
        }
    }
    closest.map(std::mem::take)
}
