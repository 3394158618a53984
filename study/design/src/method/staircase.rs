//! Transformed up-down staircase (Levitt, J. Acoust. Soc. Am. 49:467, 1971): down after n positive outcomes in a row, up after one
//! that is not positive.
//!
//! The expected step is zero where `P^n s_down = (1 - P^n) s_up`, so the track converges to `P = (s_up / (s_up + s_down))^(1/n)`
//! (García-Pérez, Vision Res. 38:1861, 1998): 70.7 % for n = 2 and equal steps.

use super::check::{in_order, positive, reversals};
use super::outcome::Outcome;
use crate::error::DesignError;
use serde::{Deserialize, Serialize};

/// Settings of a transformed staircase. All levels and steps are on the scale of the stimulus.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct StaircaseRule {
    /// First level.
    pub initial: f64,
    /// Number of positive outcomes in a row before a step down.
    pub down_after: u32,
    /// Initial step down.
    pub step_down: f64,
    /// Initial step up.
    pub step_up: f64,
    /// Numbers of the reversals at which both steps are halved, from 1.
    pub halve_at: Vec<u32>,
    /// Number of the reversal that ends the track, from 1.
    pub stop_after: u32,
    /// Number of the first reversal whose level counts for the threshold, from 1.
    pub average_from: u32,
    /// Smallest level.
    pub floor: f64,
    /// Largest level.
    pub ceiling: f64,
    /// Maximum number of trials; a longer track ends without a threshold.
    pub trials_most: u32,
}

impl Default for StaircaseRule {
    /// Returns two-down one-up on shares, with ten reversals of which the last six count.
    fn default() -> Self {
        Self {
            initial: 0.4,
            down_after: 2,
            step_down: 0.1,
            step_up: 0.1,
            halve_at: vec![2, 4],
            stop_after: 10,
            average_from: 5,
            floor: 0.01,
            ceiling: 0.95,
            trials_most: 200,
        }
    }
}

impl StaircaseRule {
    /// Returns the share of positive outcomes to which the track converges.
    #[must_use]
    pub fn target(&self) -> f64 {
        let share = self.step_up / (self.step_up + self.step_down);
        libm::pow(share, 1.0 / f64::from(self.down_after.max(1)))
    }

    pub(super) fn check(&self) -> Result<(), DesignError> {
        in_order("method.rule", [self.floor, self.initial, self.ceiling])?;
        positive("method.rule.step_down", self.step_down)?;
        positive("method.rule.step_up", self.step_up)?;
        if self.down_after == 0 {
            return Err(DesignError::new("method.rule.down_after", "0: write 1 or more"));
        }
        reversals([self.average_from, self.stop_after, self.trials_most])
    }
}

/// Staircase in progress.
#[derive(Clone, Debug)]
pub struct Staircase {
    rule: StaircaseRule,
    level: f64,
    /// Factor of both steps.
    scale: f64,
    positive: u32,
    /// True after a step down; `None` before the first step.
    went_down: Option<bool>,
    reversals: u32,
    trials: u32,
    sum: f64,
    counted: u32,
}

impl Staircase {
    /// Starts a track at the first level.
    #[must_use]
    pub fn new(rule: &StaircaseRule) -> Self {
        let (level, rule) = (rule.initial, rule.clone());
        Self {
            rule,
            level,
            scale: 1.0,
            positive: 0,
            went_down: None,
            reversals: 0,
            trials: 0,
            sum: 0.0,
            counted: 0,
        }
    }

    /// Returns the level to present next.
    #[must_use]
    pub fn level(&self) -> f64 {
        self.level
    }

    /// Processes an outcome; ignored after the end of the track.
    pub fn answer(&mut self, outcome: Outcome) {
        if self.is_done() {
            return;
        }
        self.trials += 1;
        let goes_down = if outcome == Outcome::Positive {
            self.positive += 1;
            if self.positive < self.rule.down_after {
                return;
            }
            true
        } else {
            false
        };
        self.positive = 0;
        if self.went_down.is_some_and(|before| before != goes_down) {
            self.reversals += 1;
            if self.reversals >= self.rule.average_from {
                self.sum += self.level;
                self.counted += 1;
            }
            if self.rule.halve_at.contains(&self.reversals) {
                self.scale *= 0.5;
            }
        }
        self.went_down = Some(goes_down);
        let step = if goes_down { -self.rule.step_down } else { self.rule.step_up };
        self.level = (self.level + step * self.scale).clamp(self.rule.floor, self.rule.ceiling);
    }

    /// Returns true if the track is over.
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.reversals >= self.rule.stop_after || self.trials >= self.rule.trials_most
    }

    /// Returns the mean level of the counted reversals; `None` before the last reversal.
    #[must_use]
    pub fn threshold(&self) -> Option<f64> {
        let is_complete = self.reversals >= self.rule.stop_after && self.counted > 0;
        is_complete.then(|| self.sum / f64::from(self.counted))
    }
}
