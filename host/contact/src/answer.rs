//! Newest answer of an asynchronous model at one port, contacts and field, as a wrench in every tick of the loop.

use crate::contact::ContactSetError;
use crate::coupling::{Coupling, Limits, NotPositive};
use crate::cross_fade::CrossFade;
use crate::published::{FeltStiffness, PublishedContacts, StableStiffness, Touch};
use crate::replacement::Replacement;
use crate::solver::Solver;
use flotor_core::asynchronous::{ContactLimits, StiffnessCap};
use flotor_core::mapping::Mapping;
use flotor_hal::{ContactSet, DVec3, Input, Wrench};

/// Validity of contacts that declare none, in periods of the model.
const VALID_PERIODS: f64 = 3.0;

/// Age limit of a field, in periods of the model: later the handle may have moved too far from the sample.
const OLDEST_PERIODS: u64 = 10;

/// Newest contacts and field of a model, with their age.
pub struct NewestAnswer {
    contacts: PublishedContacts,
    fields: CrossFade,
    /// Sample time of the newest answer, ns; `None` before the first answer.
    newest_ns: Option<u64>,
    /// Time of the first tick since the last clearing, ns.
    since_ns: Option<u64>,
    oldest_ns: u64,
}

impl NewestAnswer {
    /// Creates the state before the first answer at a device with this mapping and these limits; `periods_ns` are those of the loop
    /// and of the model. A field fades in over a period of the model. Not real-time.
    ///
    /// # Errors
    /// If a limit is not above 0.
    pub fn new(mapping: &Mapping, limits: &ContactLimits, periods_ns: [u64; 2]) -> Result<Self, NotPositive> {
        let [loop_s, model_s] = periods_ns.map(|period_ns| period_ns as f64 * 1.0e-9);
        let cap = limits.cap.unwrap_or(StiffnessCap::UNKNOWN);
        // Stiffness and damping have the same scale.
        let scale = mapping.stiffness_scale();
        let (by_device_n_per_m, per_damping_1_per_s) =
            (cap.by_device_n_per_m / scale, cap.per_damping_1_per_s);
        let stable = StableStiffness { by_device_n_per_m, per_damping_1_per_s };
        let unit = mapping.wrench_to_model(&Wrench::new(DVec3::X, DVec3::X));
        let (force_n, torque_nm) =
            (limits.force_n * unit.force().length(), limits.torque_nm * unit.torque().length());
        let replacement =
            Replacement::Conserving { surface_power_w: limits.surface_power_w / mapping.energy_scale() };
        // The device declares no stiffness of rotation.
        let coupling = Coupling::new(cap.stiffness_n_per_m / scale, f64::INFINITY)?;
        let solver = Solver::new(coupling, Limits::new(force_n, torque_nm)?, replacement, loop_s)?;
        let [_, period_ns] = periods_ns;
        Ok(Self {
            contacts: PublishedContacts::new(solver, stable, VALID_PERIODS * model_s),
            fields: CrossFade::new(period_ns),
            newest_ns: None,
            since_ns: None,
            oldest_ns: OLDEST_PERIODS * period_ns,
        })
    }

    /// Takes an answer that has arrived at an input; a set that is refused changes nothing. Real-time: bounded, no allocation.
    ///
    /// # Errors
    /// As [`PublishedContacts::publish`].
    pub fn take(&mut self, set: &ContactSet, input: &Input) -> Result<(), ContactSetError> {
        self.contacts.publish(set)?;
        self.fields.take(set.bilateral(), &input.pose, input.time_ns);
        self.newest_ns = Some(set.time_ns);
        Ok(())
    }

    /// Returns the wrench at an input; `None` after ten periods of the model without an answer, once contacts have faded. Real-time:
    /// bounded, no allocation.
    pub fn touch(&mut self, input: &Input) -> Option<Touch> {
        let since_ns = *self.since_ns.get_or_insert(input.time_ns);
        let age_ns = input.time_ns.saturating_sub(self.newest_ns.unwrap_or(since_ns));
        let is_old = age_ns > self.oldest_ns;
        if is_old && self.contacts.is_idle() {
            return None;
        }
        let (wrench, is_valid) =
            if is_old { (Wrench::ZERO, false) } else { self.fields.at(&input.pose, input.time_ns) };
        Some(match self.contacts.touch(input) {
            Some(touch) => {
                Touch { wrench: wrench + touch.wrench, is_valid: is_valid && touch.is_valid, ..touch }
            }
            None => Touch { wrench, is_valid, shortcoming: None },
        })
    }

    /// Returns the reductions of contact stiffness so far. Real-time: bounded, no allocation.
    #[must_use]
    pub fn felt_stiffness(&self) -> FeltStiffness {
        self.contacts.felt_stiffness()
    }

    /// Removes all answers: no force until the next one. Real-time: bounded, no allocation.
    pub fn clear(&mut self) {
        self.contacts.clear();
        self.fields.clear();
        (self.newest_ns, self.since_ns) = (None, None);
    }
}
