//! Contacts that an asynchronous model publishes, as a wrench in every tick of the loop.

use crate::contact::{Contact, ContactSet, ContactSetError};
use crate::solver::{Outcome, Solver};
use flotor_hal::{Input, Wrench};

/// Stiffness of published contacts, as far as the loop has to reduce it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FeltStiffness {
    /// Stiffness that a contact asked for, N/m, and the stiffness that it got, where they differ most; `None` without
    /// a reduction.
    pub reduced_n_per_m: Option<[f64; 2]>,
    /// Largest stiffness of a contact without damping, N/m; 0 if all are damped.
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
    /// Shortcoming of the tick; `None` for a tick as it should be.
    pub shortcoming: Option<Shortcoming>,
}

/// Newest contacts of a model, with the state of their springs.
pub struct PublishedContacts {
    solver: Solver,
    /// Age at which a set without a validity of its own begins to fade, s.
    valid_s: f64,
    /// Largest ratio of stiffness to damping, 1/s; infinite: no contact is reduced.
    most_per_damping: f64,
    felt: FeltStiffness,
    /// Time of the newest set, ns; `None` before the first contact.
    published_ns: Option<u64>,
}

impl PublishedContacts {
    /// Creates the state before the first contact. A contact with damping gets at most `most_per_damping` (1/s) times its damping
    /// as stiffness; a set without a validity of its own is valid for `valid_s`. Not real-time.
    #[must_use]
    pub fn new(solver: Solver, most_per_damping: f64, valid_s: f64) -> Self {
        Self { solver, valid_s, most_per_damping, felt: FeltStiffness::default(), published_ns: None }
    }

    /// Checks a set, which the next tick uses; a set that is refused changes nothing. Real-time: bounded, no allocation.
    ///
    /// # Errors
    /// As [`ContactSet::new`].
    pub fn publish(&mut self, set: &flotor_hal::ContactSet) -> Result<(), ContactSetError> {
        let checked = ContactSet::published(set, self.valid_s)?;
        if self.published_ns.is_some() || !checked.contacts().is_empty() {
            let checked = checked.map(|contact| self.reduced(contact));
            self.solver.replace(&checked);
            self.published_ns = Some(set.time_ns);
        }
        Ok(())
    }

    /// Returns a contact with as much stiffness as its damping keeps stable.
    fn reduced(&mut self, contact: Contact) -> Contact {
        let Contact { stiffness_n_per_m, damping_ns_per_m, .. } = contact;
        if damping_ns_per_m <= 0.0 {
            self.felt.undamped_n_per_m = self.felt.undamped_n_per_m.max(stiffness_n_per_m);
            return contact;
        }
        let most_n_per_m = (self.most_per_damping * damping_ns_per_m).max(f64::MIN_POSITIVE);
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

    /// Returns what the hand has felt of the stiffness so far. Real-time: bounded, no allocation.
    #[must_use]
    pub fn felt_stiffness(&self) -> FeltStiffness {
        self.felt
    }

    /// Forgets all contacts: without force until the next set. Real-time: bounded, no allocation.
    pub fn clear(&mut self) {
        self.solver.clear();
        self.published_ns = None;
    }
}

impl FeltStiffness {
    /// Keeps a reduction if it is the largest so far.
    fn note(&mut self, pair: [f64; 2]) {
        let loss = |[asked, felt]: [f64; 2]| asked / felt;
        if self.reduced_n_per_m.is_none_or(|known| loss(pair) > loss(known)) {
            self.reduced_n_per_m = Some(pair);
        }
    }
}
