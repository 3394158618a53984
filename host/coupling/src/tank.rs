//! Energy tank of one end of a coupling.

use flotor_core::peer::TankState;

/// Fraction of the level that is passed on in a tick. The levels of two ends that pass energy on to each other become
/// equal after a few ticks, so that an end that exerts a force has the energy that the hand at the other end has put
/// in; energy in transit is available to neither end.
const PASSED_ON: f64 = 0.1;

/// Energy tank: energy, put in by the hand or passed on by the partner, that may still come out at this end, J, shared
/// frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tank {
    level_j: f64,
    lowest_j: f64,
    gone_in_j: f64,
    /// Total energy passed on to the partner, J.
    pub(super) passed_on_j: f64,
    /// Running total of the partner, as received last.
    received_j: f64,
    discarded_j: f64,
}

impl Tank {
    /// Adds the energy that has crossed the port; negative if it came out. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn book(&mut self, gone_in_j: f64) {
        self.gone_in_j += gone_in_j;
        self.level_j += gone_in_j;
        self.lowest_j = self.lowest_j.min(self.level_j);
    }

    /// Passes a fraction of the energy above `kept_j` on to the partner; returns the running total of energy passed on,
    /// J. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn pass_on(&mut self, kept_j: f64) -> f64 {
        let part_j = PASSED_ON * (self.level_j - kept_j).max(0.0);
        self.level_j -= part_j;
        self.passed_on_j += part_j;
        self.passed_on_j
    }

    /// Adds the energy that the partner has passed on since its last message; `passed_on_j` is the partner's running
    /// total. A message that arrives after a newer one adds no energy. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn receive(&mut self, passed_on_j: f64) {
        if passed_on_j > self.received_j {
            self.level_j += passed_on_j - self.received_j;
            self.received_j = passed_on_j;
        }
    }

    /// Returns the state of the tank for reports, J. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn state(&self) -> TankState {
        let Self { level_j, lowest_j, gone_in_j, discarded_j, .. } = *self;
        TankState { level_j, lowest_j, gone_in_j, discarded_j }
    }

    /// Discards the energy above `most_j`, so that energy dissipated in a damper cannot come out later.
    ///
    /// Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn limit(&mut self, most_j: f64) {
        let excess_j = (self.level_j - most_j).max(0.0);
        self.discarded_j += excess_j;
        self.level_j -= excess_j;
    }

    /// Returns the energy available, J; below zero if more has come out than had gone in.
    #[must_use]
    pub fn level_j(&self) -> f64 {
        self.level_j
    }

    /// Returns the error of the balance: energy received less energy passed on, discarded and available, J.
    #[cfg(test)]
    pub(super) fn imbalance_j(&self) -> f64 {
        self.gone_in_j + self.received_j - self.passed_on_j - self.discarded_j - self.level_j
    }
}
