//! Contacts that an asynchronous model publishes, as a wrench in every tick of the loop.

use crate::contact::{Contact, ContactSet, ContactSetError};
use crate::solver::{Outcome, Solver};
use flotor_hal::{Input, Wrench};

/// Stable stiffness of contacts: a limit from the damping of the device, plus a limit from the damping of each contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StableStiffness {
    /// Maximum stable stiffness with the damping of the device, N/m, for all contacts in one direction together; 0: the damping
    /// is unknown, and contacts without damping are not reduced.
    pub by_device_n_per_m: f64,
    /// Additional stiffness for the damping of a contact, 1/s.
    pub per_damping_1_per_s: f64,
}

impl StableStiffness {
    /// No contact is reduced.
    pub const UNLIMITED: Self = Self { by_device_n_per_m: 0.0, per_damping_1_per_s: f64::INFINITY };

    /// Returns the largest stable stiffness of a contact that has this share of the device's damping, N/m; `None` if no damping
    /// is known.
    fn most_n_per_m(&self, damping_ns_per_m: f64, share: f64) -> Option<f64> {
        let own_n_per_m =
            if damping_ns_per_m > 0.0 { self.per_damping_1_per_s * damping_ns_per_m } else { 0.0 };
        let is_known = damping_ns_per_m > 0.0 || self.by_device_n_per_m > 0.0;
        is_known.then_some((own_n_per_m + self.by_device_n_per_m * share).max(f64::MIN_POSITIVE))
    }
}

/// Reduction of the stiffness of published contacts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FeltStiffness {
    /// Requested and rendered stiffness of the contact with the largest reduction, N/m; `None` without a reduction.
    pub reduced_n_per_m: Option<[f64; 2]>,
    /// Largest stiffness of a contact for which no damping is known, N/m; 0 without such a contact.
    pub undamped_n_per_m: f64,
}

/// Shortcoming of a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shortcoming {
    /// The newest set is older than it is valid: its forces fade.
    Aged,
    /// The iterations ended before the minimum: the wrench is that of the best iterate.
    Unsolved,
}

/// Wrench of a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Touch {
    /// Wrench on the hand at the handle, model frame.
    pub wrench: Wrench,
    /// True for the wrench of a valid set, solved to rounding and within the limits.
    pub is_valid: bool,
    /// Shortcoming of the tick; `None` without one.
    pub shortcoming: Option<Shortcoming>,
}

/// Newest contacts of a model, with the state of their springs.
pub struct PublishedContacts {
    solver: Solver,
    /// Age at which a set that declares no validity time begins to fade, s.
    valid_s: f64,
    stable: StableStiffness,
    felt: FeltStiffness,
    /// Time of the newest set, ns; `None` before the first contact.
    published_ns: Option<u64>,
}

impl PublishedContacts {
    /// Creates the state before the first contact. The stiffness of a contact is limited to `stable`; a set that declares no
    /// validity time is valid for `valid_s`. Not real-time.
    #[must_use]
    pub fn new(solver: Solver, stable: StableStiffness, valid_s: f64) -> Self {
        Self { solver, valid_s, stable, felt: FeltStiffness::default(), published_ns: None }
    }

    /// Checks a set and uses it from the next tick on; a rejected set changes nothing. Real-time: bounded, no allocation.
    ///
    /// # Errors
    /// As [`ContactSet::new`].
    pub fn publish(&mut self, set: &flotor_hal::ContactSet) -> Result<(), ContactSetError> {
        let checked = ContactSet::published(set, self.valid_s)?;
        if self.published_ns.is_some() || !checked.contacts().is_empty() {
            let all = checked;
            let checked = checked.map(|contact| self.reduced(contact, share(&contact, all.contacts())));
            self.solver.replace(&checked);
            self.published_ns = Some(set.time_ns);
        }
        Ok(())
    }

    /// Returns a contact with its stiffness limited to the stable stiffness, from its damping and its share of the device's
    /// damping.
    fn reduced(&mut self, contact: Contact, share: f64) -> Contact {
        let Contact { stiffness_n_per_m, damping_ns_per_m, .. } = contact;
        let Some(most_n_per_m) = self.stable.most_n_per_m(damping_ns_per_m, share) else {
            self.felt.undamped_n_per_m = self.felt.undamped_n_per_m.max(stiffness_n_per_m);
            return contact;
        };
        if stiffness_n_per_m <= most_n_per_m {
            return contact;
        }
        self.felt.note([stiffness_n_per_m, most_n_per_m]);
        Contact { stiffness_n_per_m: most_n_per_m, ..contact }
    }

    /// Returns the wrench at an input; `None` before the first contact. Real-time: bounded, no allocation.
    pub fn touch(&mut self, input: &Input) -> Option<Touch> {
        let age_s = input.time_ns.saturating_sub(self.published_ns?) as f64 * 1.0e-9;
        let solution = self.solver.solve(&input.pose, &input.twist, age_s);
        if let Some(pair) = self.solver.reduced_n_per_m() {
            self.felt.note(pair);
        }
        let set = self.solver.set();
        let shortcoming = if !set.is_valid_for(age_s) && !set.contacts().is_empty() {
            Some(Shortcoming::Aged)
        } else if solution.outcome == Outcome::BestIterate {
            Some(Shortcoming::Unsolved)
        } else {
            None
        };
        let is_valid = solution.is_in_range && !solution.is_limited && shortcoming.is_none();
        Some(Touch { wrench: solution.wrench, is_valid, shortcoming })
    }

    /// Returns true if no contact pushes or fades: the wrench is zero. Real-time: bounded, no allocation.
    #[must_use]
    pub fn is_idle(&self) -> bool {
        self.solver.is_empty()
    }

    /// Returns the reductions of stiffness so far. Real-time: bounded, no allocation.
    #[must_use]
    pub fn felt_stiffness(&self) -> FeltStiffness {
        self.felt
    }

    /// Removes all contacts: no force until the next set. Real-time: bounded, no allocation.
    pub fn clear(&mut self) {
        self.solver.clear();
        self.published_ns = None;
    }
}

/// Returns the share of the device's damping for one of the contacts of a set: 1 for a contact alone or across all others, `1/m` for
/// one of `m` parallel ones. With normals `n` and shares `w_i = 1 / sum_j |n_i n_j|` the matrix `sum_i w_i n_i n_i^T` has no
/// eigenvalue above 1 (Gershgorin), so together the contacts use the damping at most once in every direction.
fn share(contact: &Contact, all: &[Contact]) -> f64 {
    1.0 / all.iter().map(|other| contact.normal.dot(other.normal).abs()).sum::<f64>().max(1.0)
}

impl FeltStiffness {
    /// Records a reduction if it is the largest so far.
    fn note(&mut self, pair: [f64; 2]) {
        let loss = |[asked, felt]: [f64; 2]| asked / felt;
        if self.reduced_n_per_m.is_none_or(|known| loss(pair) > loss(known)) {
            self.reduced_n_per_m = Some(pair);
        }
    }
}
