//! Wrench of a contact set in every tick.

use crate::cap::OffsetSpace;
use crate::contact::{ContactSet, are_usable, is_usable_pose};
use crate::coupling::{Coupling, Limits, NotPositive, check};
use crate::linear::{Vector6, dot};
use crate::newton::{MAX_STEPS, Minimum, Term, minimize};
use crate::replacement::{
    Balance, LONGEST_SPREAD_S, Replacement, SampledMotion, energy_j, relax, take_closest,
};
use crate::slot::{Role, Slot};
use flotor_hal::{DVec3, MAX_CONTACTS, Pose, Twist, Wrench};

/// Outcome of a solve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The wrench is that of the minimum, to rounding.
    Solved,
    /// The iterations ended before the minimum: the wrench is that of the best iterate. Normal forces still only push.
    BestIterate,
    /// Pose, twist or age were not finite: no wrench, and the friction is that of the tick before.
    InvalidInput,
}

/// Answer of a solve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solution {
    /// Wrench on the hand at the handle, scene frame, within the limits.
    pub wrench: Wrench,
    /// Outcome of the solve.
    pub outcome: Outcome,
    /// Number of Newton steps.
    pub steps: u32,
    /// True if the limits have shortened the wrench.
    pub is_limited: bool,
    /// True if pose and age are within the set's range of validity.
    pub is_in_range: bool,
}

/// Number of slots: the contacts of a set, and equally many fading contacts of earlier sets.
const SLOTS: usize = 2 * MAX_CONTACTS;

/// Contact set behind a coupling, with its friction.
pub struct Solver {
    coupling: Coupling,
    limits: Limits,
    replacement: Replacement,
    period_s: f64,
    set: ContactSet,
    /// Set for the next solve.
    next: Option<ContactSet>,
    space: OffsetSpace,
    slots: [Slot; SLOTS],
    terms: [Term; SLOTS],
    count: usize,
    /// Coordinates of the offset of the last solve.
    offset: Vector6,
    balance: Balance,
    last_age_s: f64,
    /// Time between the last two sets, s.
    interval_s: f64,
    since_replacement_s: f64,
}

impl Solver {
    /// Creates a solver without contacts; `period_s` is the time between solves. Not real-time.
    ///
    /// # Errors
    /// If the period, or the power of a surface, is not above 0.
    pub fn new(
        coupling: Coupling,
        limits: Limits,
        replacement: Replacement,
        period_s: f64,
    ) -> Result<Self, NotPositive> {
        check("period_s", period_s)?;
        if let Replacement::Conserving { surface_power_w } = replacement {
            check("surface_power_w", surface_power_w)?;
        }
        Ok(Self::empty(coupling, limits, replacement, period_s))
    }

    fn empty(coupling: Coupling, limits: Limits, replacement: Replacement, period_s: f64) -> Self {
        Self {
            coupling,
            limits,
            replacement,
            period_s,
            set: ContactSet::empty(),
            next: None,
            space: OffsetSpace::RIGID,
            slots: [Slot::default(); SLOTS],
            terms: [Term::default(); SLOTS],
            count: 0,
            offset: [0.0; 6],
            balance: Balance::EMPTY,
            last_age_s: 0.0,
            interval_s: f64::INFINITY,
            since_replacement_s: f64::INFINITY,
        }
    }

    /// Removes all contacts with their friction and energy. Real-time: bounded, no allocation.
    pub fn clear(&mut self) {
        *self = Self::empty(self.coupling, self.limits, self.replacement, self.period_s);
    }

    /// Returns true if the last solve had no contact and no new set is pending. Real-time: bounded, no allocation.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.count == 0 && self.next.is_none()
    }

    /// Returns the set of the last solve. Real-time: bounded, no allocation.
    #[must_use]
    pub fn set(&self) -> &ContactSet {
        &self.set
    }

    /// Returns the largest ratio of the stiffness of all contacts, touching or not, to the coupling's; at least 1. Contacts that
    /// fade count. Real-time: bounded, no allocation.
    #[must_use]
    pub fn excess(&self) -> f64 {
        self.space.excess()
    }

    /// Returns the largest stiffness of all contacts and the stiffness behind the coupling, N/m, if the coupling reduces it. Real-time:
    /// bounded, no allocation.
    #[must_use]
    pub fn reduced_n_per_m(&self) -> Option<[f64; 2]> {
        let felt_n_per_m = self.coupling.stiffness_n_per_m();
        (!self.space.is_rigid()).then(|| [self.space.excess() * felt_n_per_m, felt_n_per_m])
    }

    /// Returns force on the tool and velocity of the surface of each contact in the last solve, N and m/s: first those of the set
    /// in its order, then those that fade. Real-time: bounded, no allocation.
    pub fn forces(&self) -> impl Iterator<Item = (DVec3, DVec3)> {
        self.slots.iter().take(self.count).map(|slot| (slot.force, slot.contact.surface_velocity_m_per_s))
    }

    /// Returns the largest part of the depth of a contact of the set that has no force yet, m. Real-time: bounded, no allocation.
    #[must_use]
    pub fn withheld_m(&self) -> f64 {
        let live = self.slots.iter().take(self.count).filter(|slot| slot.role == Role::Live);
        live.fold(0.0, |most, slot| slot.withheld_m.max(most))
    }

    /// Replaces the set from the next solve on. Real-time: bounded, no allocation.
    pub fn replace(&mut self, set: &ContactSet) {
        self.next = Some(*set);
    }

    /// Returns the wrench at a pose and twist of the handle; `age_s` is the time since the newest set was published. Real-time:
    /// bounded, no allocation.
    pub fn solve(&mut self, pose: &Pose, twist: &Twist, age_s: f64) -> Solution {
        let is_usable = is_usable_pose(pose)
            && are_usable(&twist.linear_m_per_s)
            && are_usable(&twist.angular_rad_per_s)
            && are_usable(&[age_s]);
        if !is_usable {
            self.balance.interrupt();
            let (wrench, outcome) = (Wrench::ZERO, Outcome::InvalidInput);
            return Solution { wrench, outcome, steps: 0, is_limited: false, is_in_range: false };
        }
        // Read before the work of this tick is added: the springs store a part of this work.
        let available_j = self.balance.available_j();
        let next = self.next.take();
        let elapsed_s = if next.is_some() { self.period_s } else { (age_s - self.last_age_s).max(0.0) };
        self.last_age_s = age_s;
        self.since_replacement_s += elapsed_s;
        self.advance(elapsed_s);
        if let Some(set) = next {
            self.exchange(&set, pose, age_s);
        }
        self.balance.move_to(pose, elapsed_s);
        self.expire(age_s);
        self.prepare(pose, twist, available_j);
        let minimum = self.minimum();
        self.offset = minimum.offset;
        let load = self.settle(pose);
        let (wrench, is_limited) = self.limits.limit(&load);
        let slots = self.slots.get(..self.count).unwrap_or_default();
        self.balance.settle(&self.offset, slots, &wrench);
        while self.slots.get(..self.count).and_then(<[_]>::last).is_some_and(Slot::has_faded) {
            self.count -= 1;
        }
        Solution {
            wrench,
            outcome: if minimum.is_reached { Outcome::Solved } else { Outcome::BestIterate },
            steps: minimum.steps,
            is_limited,
            is_in_range: self.set.is_valid_at(pose, age_s),
        }
    }

    fn is_conserving(&self) -> bool {
        self.replacement != Replacement::Immediate
    }

    /// Moves the surfaces.
    fn advance(&mut self, elapsed_s: f64) {
        for slot in self.slots.iter_mut().take(self.count) {
            let velocity = slot.contact.surface_velocity_m_per_s;
            let power_w = slot.force.dot(velocity);
            let share = match self.replacement {
                Replacement::Conserving { surface_power_w } if power_w > surface_power_w => {
                    surface_power_w / power_w
                }
                _ => 1.0,
            };
            slot.advance(velocity * (share * elapsed_s));
            self.balance.add(power_w * share * elapsed_s);
        }
    }

    /// Computes the terms of the energy at a pose of the handle.
    fn prepare(&mut self, pose: &Pose, twist: &Twist, mut available_j: f64) {
        let is_conserving = self.is_conserving();
        for (slot, term) in self.slots.iter_mut().zip(&mut self.terms).take(self.count) {
            let arm_m = pose.orientation() * slot.contact.tool_point_m;
            let (whole_m, stretch_m) = slot.reach(pose.position() + arm_m);
            if is_conserving {
                available_j -= relax(slot, whole_m - dot(&term.rows.normal, &self.offset), available_j);
            }
            let depth_m = whole_m - slot.withheld_m;
            let normal = slot.normal_law(arm_m, twist, self.period_s);
            // Without an offset the normal force of this tick is known before the friction; otherwise use that of the last solve.
            let normal_n = if self.space.is_rigid() { normal.at(depth_m).0 } else { slot.normal_n };
            *term =
                Term { rows: term.rows, depth_m, stretch_m, normal, friction: slot.friction_law(normal_n) };
        }
    }

    fn minimum(&self) -> Minimum {
        if self.space.is_rigid() {
            return Minimum { offset: [0.0; 6], is_reached: true, steps: 0 };
        }
        minimize(self.terms.get(..self.count).unwrap_or_default(), &self.offset, MAX_STEPS)
    }

    /// Stores the forces at the solved offset, and returns their sum.
    fn settle(&mut self, pose: &Pose) -> Wrench {
        let is_conserving = self.is_conserving();
        let (mut load, mut sampled) = (Wrench::ZERO, SampledMotion::NONE);
        for (slot, term) in self.slots.iter_mut().zip(&self.terms).take(self.count) {
            let arm_m = pose.orientation() * slot.contact.tool_point_m;
            let point_m = pose.position() + arm_m;
            let (motion_m, is_touching) = (slot.motion_m(point_m), slot.depth_m > 0.0);
            let is_sliding = slot.settle(term, &self.offset, point_m);
            if is_conserving && (is_touching || slot.depth_m > 0.0) {
                let [first, second] = &term.rows.tangents;
                let rows = [&term.rows.normal, first, second];
                // A sliding contact has no tangential spring.
                let count = if is_sliding { 1 } else { 3 };
                for (spring, row) in slot.springs().into_iter().zip(rows).take(count) {
                    sampled.add(spring.stiffness_n_per_m, spring.direction.dot(motion_m), row);
                }
            }
            load = load + Wrench::new(slot.force, arm_m.cross(slot.force));
        }
        if is_conserving {
            self.balance.add(sampled.energy_j());
        }
        load
    }

    /// Fades all forces once a set is too old.
    fn expire(&mut self, age_s: f64) {
        if !self.is_conserving() || self.set.is_valid_for(age_s) {
            return;
        }
        let ticks = (LONGEST_SPREAD_S / self.period_s).max(1.0);
        for slot in self.slots.iter_mut().take(self.count).filter(|slot| slot.role == Role::Live) {
            slot.role = Role::Fading;
            slot.rate_m = slot.depth_m / ticks;
        }
    }

    /// Replaces the set at the pose of the last solve, with the surfaces at their present positions.
    fn exchange(&mut self, set: &ContactSet, pose: &Pose, age_s: f64) {
        let pose = self.balance.pose().copied().unwrap_or(*pose);
        let mut old = self.slots;
        let old_count = std::mem::replace(&mut self.count, set.contacts().len());
        let old = old.get_mut(..old_count).unwrap_or_default();
        (self.interval_s, self.since_replacement_s) = (self.since_replacement_s, 0.0);
        self.set = *set;
        for (slot, contact) in self.slots.iter_mut().zip(set.contacts()) {
            *slot = Slot::new(contact, set.anchor(), age_s);
            if let Some(old) = take_closest(old, slot) {
                slot.inherit(&old);
            }
        }
        if self.is_conserving() {
            self.keep_fading(old);
        }
        let springs = self.slots.iter().take(self.count).flat_map(Slot::springs);
        self.space = OffsetSpace::new(&self.coupling, springs);
        let mut load = Wrench::ZERO;
        for (slot, term) in self.slots.iter().zip(&mut self.terms).take(self.count) {
            term.rows = slot.rows(&self.space);
            let force = slot.spring_force();
            load = load + Wrench::new(force, (pose.orientation() * slot.contact.tool_point_m).cross(force));
        }
        self.offset = self.space.coordinates(load.force(), load.torque());
        if self.is_conserving() {
            self.shrink_to_stored();
        }
        let is_conserving = self.is_conserving();
        let ticks = ((0.5 * self.interval_s).min(LONGEST_SPREAD_S) / self.period_s).max(1.0);
        for (slot, term) in self.slots.iter_mut().zip(&self.terms).take(self.count) {
            slot.last_m = pose.position() + pose.orientation() * slot.contact.tool_point_m;
            if slot.anchor_m.is_some() {
                slot.fix(&term.rows, &self.offset, slot.last_m);
            }
            if is_conserving {
                let whole_m = slot.reach(slot.last_m).0 - dot(&term.rows.normal, &self.offset);
                slot.withhold(whole_m, ticks);
            }
        }
    }

    /// Appends the old contacts that still push, unless they would push into a surface of the new set.
    fn keep_fading(&mut self, old: &[Slot]) {
        for old in old.iter().filter(|old| old.depth_m > 0.0) {
            let opposes =
                |slot: &Slot| slot.role == Role::Live && slot.contact.normal.dot(old.contact.normal) < 0.0;
            let is_opposed = self.slots.iter().take(self.count).any(opposes);
            if let Some(place) = self.slots.get_mut(self.count)
                && !is_opposed
            {
                *place = *old;
                place.role = Role::Fading;
                self.count += 1;
            }
        }
    }

    /// Scales all springs down by one factor if springs and coupling would store more energy than before.
    fn shrink_to_stored(&mut self) {
        let slots = self.slots.get_mut(..self.count).unwrap_or_default();
        let (before_j, now_j) = (self.balance.stored_j(), energy_j(&self.offset, slots));
        if now_j > before_j {
            let share = (before_j / now_j).sqrt();
            self.offset = self.offset.map(|part| part * share);
            for slot in slots {
                slot.depth_m *= share;
                slot.stretch_m *= share;
            }
        }
    }
}
