//! The energy tank of one end of a coupling.

use flotor_core::peer::TankState;

/// Part of the level that is passed on in a tick. Ends that share halves are level after a few ticks, so that an end
/// that is to push has what the other one's hand has put in; what is on its way serves neither for as long as it
/// travels.
const PASSED_ON: f64 = 0.1;

/// What a hand has put in and what has come out, J; what the partner has passed on, and what was passed on to it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tank {
    level_j: f64,
    lowest_j: f64,
    gone_in_j: f64,
    told_j: f64,
    /// All that the partner has ever passed on, as it was told last.
    heard_j: f64,
    given_up_j: f64,
}

impl Tank {
    /// Books what has crossed the port; negative: it came out. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn book(&mut self, gone_in_j: f64) {
        self.gone_in_j += gone_in_j;
        self.level_j += gone_in_j;
        self.lowest_j = self.lowest_j.min(self.level_j);
    }

    /// Passes a part of what is more than `kept_j` on to the partner; all that was ever passed on, J. Real-time: bounded, no
    /// allocation.
    #[inline]
    pub(super) fn pass_on(&mut self, kept_j: f64) -> f64 {
        let part_j = PASSED_ON * (self.level_j - kept_j).max(0.0);
        self.level_j -= part_j;
        self.told_j += part_j;
        self.told_j
    }

    /// Takes in what the partner has passed on since it was heard of last; `told_j` is all it ever has. What was
    /// overtaken brings nothing. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn hear(&mut self, told_j: f64) {
        if told_j > self.heard_j {
            self.level_j += told_j - self.heard_j;
            self.heard_j = told_j;
        }
    }

    /// All that was ever passed on to the partner, J.
    #[inline]
    pub(super) fn told_j(&self) -> f64 {
        self.told_j
    }

    /// The tank in numbers, for reports. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn state(&self) -> TankState {
        let Self { level_j, lowest_j, gone_in_j, given_up_j, .. } = *self;
        TankState { level_j, lowest_j, gone_in_j, given_up_j }
    }

    /// Gives up what is more than `most_j`: energy that has turned to heat in a damper is not to drive anything later.
    ///
    /// Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn limit(&mut self, most_j: f64) {
        let excess_j = (self.level_j - most_j).max(0.0);
        self.given_up_j += excess_j;
        self.level_j -= excess_j;
    }

    /// What is there to be taken out, J; negative: more has come out than had gone in.
    #[must_use]
    pub fn level_j(&self) -> f64 {
        self.level_j
    }

    /// The lowest it ever was, J: with the controller on, below zero only by what came out while a force acted for
    /// longer than a period, in ticks late or missed, or on a handle faster than was to be expected.
    #[must_use]
    pub fn lowest_j(&self) -> f64 {
        self.lowest_j
    }

    /// What the hand has put in so far less what has come out, J.
    #[must_use]
    pub fn gone_in_j(&self) -> f64 {
        self.gone_in_j
    }

    /// What was put in and can never come out again, J.
    #[must_use]
    pub fn given_up_j(&self) -> f64 {
        self.given_up_j
    }

    /// Imbalance: what has come and gone, less what is there, J.
    #[must_use]
    pub fn imbalance_j(&self) -> f64 {
        self.gone_in_j + self.heard_j - self.told_j - self.given_up_j - self.level_j
    }
}
