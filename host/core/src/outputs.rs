//! Outputs of the models in a tick; outputs that were not requested are absent.
#![deny(clippy::disallowed_types, clippy::disallowed_methods, clippy::disallowed_macros)] // see clippy.toml
#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

use flotor_hal::{DVec3, Demand, Wrench};

/// Sum of the outputs of all models and couplings at one device, device frame.
///
/// An output that was not computed is absent. An output that is present but not finite was computed for an observer
/// alone and did not reach the hand.
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
pub struct ModelOutputs {
    wrench: Wrench,
    energy_j: f64,
    computed: Demand,
}

impl ModelOutputs {
    /// Zero force, zero torque and zero energy, with all outputs present.
    pub const ZERO: ModelOutputs = ModelOutputs::new(Wrench::ZERO, 0.0);

    /// Creates a set of all outputs: wrench, N and N·m, and stored energy, J. Real-time: bounded, no allocation.
    #[inline]
    pub const fn new(wrench: Wrench, energy_j: f64) -> Self {
        Self { wrench, energy_j, computed: Demand::ALL }
    }

    /// Returns the outputs in `demand`; the other outputs become absent, except force, which is always present.
    /// Real-time: bounded, no allocation.
    #[inline]
    pub const fn limited_to(self, demand: Demand) -> Self {
        let computed = self.computed.limited_to(demand).with(Demand::FORCE);
        let Self { mut wrench, mut energy_j, .. } = self;
        if !computed.contains(Demand::TORQUE) {
            wrench.torque_nm = [0.0; 3];
        }
        if !computed.contains(Demand::ENERGY) {
            energy_j = 0.0;
        }
        Self { wrench, energy_j, computed }
    }

    /// Returns the set of outputs that are present.
    #[inline]
    pub const fn computed(&self) -> Demand {
        self.computed
    }

    /// Returns the force, N.
    #[inline]
    #[must_use]
    pub fn force(&self) -> DVec3 {
        self.wrench.force()
    }

    /// Returns the torque, N·m; `None` if it was not computed.
    #[inline]
    #[must_use]
    pub fn torque(&self) -> Option<DVec3> {
        self.computed.contains(Demand::TORQUE).then(|| self.wrench.torque())
    }

    /// Returns force and torque; `None` if the torque was not computed.
    #[inline]
    #[must_use]
    pub fn wrench(&self) -> Option<Wrench> {
        self.computed.contains(Demand::TORQUE).then_some(self.wrench)
    }

    /// Returns the stored energy, J; `None` if it was not computed.
    #[inline]
    #[must_use]
    pub fn energy_j(&self) -> Option<f64> {
        self.computed.contains(Demand::ENERGY).then_some(self.energy_j)
    }

    /// Returns the wrench and energy for the words of a record, zero where an output is absent.
    #[inline]
    pub(crate) const fn numbers(&self) -> (&Wrench, f64) {
        (&self.wrench, self.energy_j)
    }
}
