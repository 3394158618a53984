//! Energy balance of the flotor: sources and sinks of its mechanical energy.
//!
//! Over any interval
//!
//! ```text
//! change of (kinetic + potential) = coils + feed-forward + hand - dissipated
//! ```
//!
//! Each of the six terms is computed independently: kinetic and potential energy from the state, the four works as
//! integrals of force times velocity along the motion (see `plant::step`). No term is the remainder of the others, so
//! an imbalance is an error of the integration, not of the bookkeeping. The host compares the imbalance with the peak
//! of the mechanical energy, and so detects every closed loop that gains energy without a source.

use flotor_hal::restorable;
use std::ops::AddAssign;

/// Mechanical energy of the flotor (without the mass of a gripping hand).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[must_use]
pub struct MechanicalEnergy {
    /// Energy of translation and rotation, J.
    pub kinetic_j: f64,
    /// Energy of gravity, J; zero at home (origin of the device frame, upright).
    pub potential_j: f64,
}

restorable!(MechanicalEnergy { kinetic_j, potential_j });

impl MechanicalEnergy {
    /// Returns kinetic plus potential energy, J. Real-time: bounded, no allocation.
    #[must_use]
    #[inline]
    pub fn total_j(&self) -> f64 {
        self.kinetic_j + self.potential_j
    }
}

/// Work done on the flotor during an interval.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Work {
    /// Work of the coils' wrench, J.
    pub coils_j: f64,
    /// Work of the gravity compensation, J.
    pub feed_forward_j: f64,
    /// Work of the hand on the handle, J: its spring, its damper and the inertia of its own mass.
    pub hand_j: f64,
    /// Energy dissipated by eddy-current drag, J; never negative but for rounding.
    pub dissipated_j: f64,
}

restorable!(Work { coils_j, feed_forward_j, hand_j, dissipated_j });

impl Work {
    /// Returns the net work on the flotor, J: work of coils, feed-forward and hand, less the dissipated energy. Real-time:
    /// bounded, no allocation.
    #[must_use]
    pub fn net_j(&self) -> f64 {
        self.coils_j + self.feed_forward_j + self.hand_j - self.dissipated_j
    }

    /// Returns true if every term is finite. Real-time: bounded, no allocation.
    #[must_use]
    #[inline]
    pub fn is_finite(&self) -> bool {
        [self.coils_j, self.feed_forward_j, self.hand_j, self.dissipated_j]
            .iter()
            .all(|term| term.is_finite())
    }
}

impl AddAssign for Work {
    #[inline]
    fn add_assign(&mut self, more: Self) {
        self.coils_j += more.coils_j;
        self.feed_forward_j += more.feed_forward_j;
        self.hand_j += more.hand_j;
        self.dissipated_j += more.dissipated_j;
    }
}

/// Running energy balance since the start of a run, or since the flotor was last stopped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ledger {
    start: MechanicalEnergy,
    now: MechanicalEnergy,
    work: Work,
    peak_j: f64,
}

restorable!(Ledger { start, now, work, peak_j });

impl Ledger {
    /// Creates an energy balance that starts at the given mechanical energy. Real-time: bounded, no allocation.
    #[must_use]
    pub fn open(start: MechanicalEnergy) -> Self {
        Self { start, now: start, work: Work::default(), peak_j: start.total_j().abs() }
    }

    /// Adds the work of an interval and sets the energy at its end. Real-time: bounded, no allocation.
    #[inline]
    pub fn add(&mut self, work: Work, now: MechanicalEnergy) {
        self.work += work;
        self.now = now;
        self.peak_j = self.peak_j.max(now.total_j().abs());
    }

    /// Returns the mechanical energy at the start of the balance. Real-time: bounded, no allocation.
    pub fn start(&self) -> MechanicalEnergy {
        self.start
    }

    /// Returns the present mechanical energy. Real-time: bounded, no allocation.
    pub fn energy(&self) -> MechanicalEnergy {
        self.now
    }

    /// Returns the work by source since the start of the balance. Real-time: bounded, no allocation.
    #[must_use]
    pub fn work(&self) -> Work {
        self.work
    }

    /// Returns the largest magnitude of the mechanical energy since the start, J. Real-time: bounded, no allocation.
    #[must_use]
    pub fn peak_j(&self) -> f64 {
        self.peak_j
    }

    /// Returns the energy gained (positive) or lost (negative) without a source since the start, J.
    ///
    /// Real-time: bounded, no allocation.
    #[must_use]
    pub fn imbalance_j(&self) -> f64 {
        (self.now.total_j() - self.start.total_j()) - self.work.net_j()
    }

    /// Returns the magnitude of [`Self::imbalance_j`] relative to [`Self::peak_j`]; 0 if the energy was always zero.
    ///
    /// Real-time: bounded, no allocation.
    #[must_use]
    pub fn relative_imbalance(&self) -> f64 {
        if self.peak_j > 0.0 { self.imbalance_j().abs() / self.peak_j } else { 0.0 }
    }
}
