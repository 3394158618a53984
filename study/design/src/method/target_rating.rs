//! Adaptive rating: the level whose mean rating is a target, by accelerated stochastic approximation (Kesten, Ann. Math. Stat. 29:41,
//! 1958).
//!
//! The next level is `x - gain / (1 + reversals) (rating - target)`; the gain is negative if the rating falls with the level. For a
//! mean rating that is monotonic in the level the track converges to the level of the target.

use super::check::in_order;
use super::outcome::Outcome;
use crate::error::DesignError;
use serde::{Deserialize, Serialize};

/// Settings of an adaptive rating. Levels are on the scale of the stimulus.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TargetRatingRule {
    /// Rating to reach.
    pub target: f64,
    /// First level.
    pub initial: f64,
    /// First change of the level for each step of the rating above the target; negative if ratings fall with the level.
    pub gain: f64,
    /// Number of trials.
    pub trials: u32,
    /// Smallest level.
    pub floor: f64,
    /// Largest level.
    pub ceiling: f64,
}

impl TargetRatingRule {
    pub(super) fn check(&self) -> Result<(), DesignError> {
        in_order("method.rule", [self.floor, self.initial, self.ceiling])?;
        if self.gain == 0.0 || !self.gain.is_finite() {
            let problem = "the gain must not be 0: write the change of the level for one step of the rating";
            return Err(DesignError::new("method.rule.gain", problem));
        }
        if self.trials == 0 {
            return Err(DesignError::new("method.rule.trials", "0 trials: write 1 or more"));
        }
        Ok(())
    }
}

/// Adaptive rating in progress.
#[derive(Clone, Debug)]
pub struct TargetRating {
    rule: TargetRatingRule,
    level: f64,
    /// Sign of the last difference from the target; 0 before the first.
    side: f64,
    reversals: u32,
    trials: u32,
}

impl TargetRating {
    /// Starts a track at the first level.
    #[must_use]
    pub fn new(rule: &TargetRatingRule) -> Self {
        Self { level: rule.initial, rule: rule.clone(), side: 0.0, reversals: 0, trials: 0 }
    }

    /// Returns the level to present next.
    #[must_use]
    pub fn level(&self) -> f64 {
        self.level
    }

    /// Processes a rating; ignores other outcomes, and ratings after the end of the track.
    pub fn answer(&mut self, outcome: Outcome) {
        let Outcome::Rated(rating) = outcome else { return };
        if self.is_done() {
            return;
        }
        self.trials += 1;
        let above = rating - self.rule.target;
        if above * self.side < 0.0 {
            self.reversals += 1;
        }
        if above != 0.0 {
            self.side = above.signum();
        }
        let step = self.rule.gain / f64::from(1 + self.reversals) * above;
        self.level = (self.level - step).clamp(self.rule.floor, self.rule.ceiling);
    }

    /// Returns true if the track is over.
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.trials >= self.rule.trials
    }

    /// Returns the level after the last trial; `None` before the end of the track.
    #[must_use]
    pub fn threshold(&self) -> Option<f64> {
        self.is_done().then_some(self.level)
    }
}
