//! Unforced weighted up-down rule (Kaernbach, Perception & Psychophysics 63:1377, 2001).
//!
//! A correct answer reduces the difference by a step D1, a wrong one increases it by `D2 = D1 p / (1 - p)`, and "I don't know"
//! by `D3 = D1 (p - 1/m) / (1 - p)` (equations 5 and 7), with the target p and m = 2 alternatives. The expected step is zero at
//! the threshold, where `P(correct) + P(don't know) / m = p`.
//!
//! Points left open by CMU-RI-TR-07-21 (section 4.2) are options here; their defaults reproduce the published distribution of
//! simulated estimates.

use crate::answer::Judgement;
use serde::{Deserialize, Serialize};

/// Number of alternatives of a comparison: first or second.
const ALTERNATIVES: f64 = 2.0;

/// Step size applied at a reversal that halves the step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum StepAtReversal {
    /// Halved step, from this trial on
    #[default]
    New,
    /// Old step; the halved step from the next trial on
    Old,
}

/// Inclusion of the trials at the first and last counted reversal in the mean for the threshold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Averaging {
    /// Both trials included
    #[default]
    BothEnds,
    /// Trial of the first reversal excluded
    AfterFirst,
    /// Trial of the last reversal excluded
    BeforeLast,
}

/// Settings of the weighted up-down rule.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct WeightedUpDownRule {
    /// First difference, as a fraction of the base.
    pub initial_delta: f64,
    /// Initial step D1 after a correct answer, as a fraction of the base.
    pub first_step: f64,
    /// Target: value of `P(correct) + P(don't know) / 2` at the threshold.
    pub target: f64,
    /// Numbers of the reversals at which the steps are halved, from 1.
    pub halve_at: Vec<u32>,
    /// Number of the reversal that ends the track, from 1.
    pub stop_after: u32,
    /// Number of the reversal at which the mean for the threshold begins, from 1.
    pub average_from: u32,
    /// Inclusion of the trials at the first and last counted reversal in the mean.
    pub averaging: Averaging,
    /// Step size at a halving reversal.
    pub step_at_reversal: StepAtReversal,
    /// Smallest difference, as a fraction of the base; above 0, because equal stimuli have no correct answer.
    pub floor: f64,
    /// Largest difference, as a fraction of the base.
    pub ceiling: f64,
    /// Maximum number of trials; a longer track ends without a threshold.
    pub trials_most: u32,
}

impl Default for WeightedUpDownRule {
    /// Returns the settings of CMU-RI-TR-07-21, section 4.2, and a floor of 1 %, which the thesis leaves open.
    fn default() -> Self {
        Self {
            initial_delta: 0.40,
            first_step: 0.10,
            target: 0.75,
            halve_at: vec![2, 4],
            stop_after: 8,
            average_from: 4,
            averaging: Averaging::BothEnds,
            step_at_reversal: StepAtReversal::New,
            floor: 0.01,
            ceiling: 0.95,
            trials_most: 200,
        }
    }
}

/// Error: invalid setting of a procedure.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{setting} {value}: {legal}")]
pub struct InvalidRule {
    /// Command-line option or name of the setting.
    pub setting: &'static str,
    /// Rejected value, as text.
    pub value: String,
    /// Description of the legal values.
    pub legal: String,
}

impl InvalidRule {
    /// Creates the error for a setting.
    pub fn new(setting: &'static str, value: impl ToString, legal: impl Into<String>) -> Self {
        Self { setting, value: value.to_string(), legal: legal.into() }
    }
}

impl WeightedUpDownRule {
    /// Checks the settings.
    ///
    /// # Errors
    /// The first invalid setting.
    pub fn check(&self) -> Result<(), InvalidRule> {
        let share = |setting, value: f64, least: f64, most: f64, legal| {
            let inside = value > least && value < most;
            if inside { Ok(()) } else { Err(InvalidRule::new(setting, value, legal)) }
        };
        share("--step", self.first_step, 0.0, 1.0, "must be above 0 and below 1")?;
        share("--target", self.target, 0.5, 1.0, "must be above 0.5 (guessing) and below 1")?;
        share(
            "--ceiling",
            self.ceiling,
            0.0,
            1.0,
            "must be above 0 and below 1 (the comparison must stay above 0)",
        )?;
        if !(self.floor > 0.0 && self.floor < self.ceiling) {
            let legal = "must be above 0 (equal stimuli have no correct answer) and below --ceiling";
            let legal = format!("{legal} ({})", self.ceiling);
            return Err(InvalidRule::new("--floor", self.floor, legal));
        }
        if !(self.initial_delta > self.floor && self.initial_delta <= self.ceiling) {
            let legal =
                format!("must be above --floor ({}) and up to --ceiling ({})", self.floor, self.ceiling);
            return Err(InvalidRule::new("--initial", self.initial_delta, legal));
        }
        if self.stop_after == 0 {
            return Err(InvalidRule::new("--stop-after", self.stop_after, "must be 1 or more"));
        }
        if self.average_from == 0 || self.average_from > self.stop_after {
            let legal = format!("must be 1 to --stop-after ({})", self.stop_after);
            return Err(InvalidRule::new("--average-from", self.average_from, legal));
        }
        if self.trials_most < self.stop_after {
            let legal = format!("must be 1 to {}, the largest number of trials of a track", self.trials_most);
            return Err(InvalidRule::new("--stop-after", self.stop_after, legal));
        }
        Ok(())
    }

    /// Returns D2 / D1, the ratio of the steps after wrong and correct answers.
    #[must_use]
    pub fn wrong_ratio(&self) -> f64 {
        self.target / (1.0 - self.target)
    }

    /// Returns D3 / D1, the ratio of the steps after "I don't know" and correct answers.
    #[must_use]
    pub fn unsure_ratio(&self) -> f64 {
        (self.target - 1.0 / ALTERNATIVES) / (1.0 - self.target)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Direction {
    Down,
    Up,
}

/// Weighted up-down track in progress.
#[derive(Clone, Debug)]
pub struct WeightedUpDown {
    rule: WeightedUpDownRule,
    delta: f64,
    step: f64,
    direction: Option<Direction>,
    reversals: u32,
    trials: u32,
    counted_sum: f64,
    counted: u32,
}

impl WeightedUpDown {
    /// Starts a track at the first difference.
    #[must_use]
    pub fn new(rule: &WeightedUpDownRule) -> Self {
        Self {
            delta: rule.initial_delta,
            step: rule.first_step,
            rule: rule.clone(),
            direction: None,
            reversals: 0,
            trials: 0,
            counted_sum: 0.0,
            counted: 0,
        }
    }

    /// Returns the difference to present next, as a fraction of the base.
    #[must_use]
    pub fn delta(&self) -> f64 {
        self.delta
    }

    /// Processes an answer. Returns true for a reversal; ignores answers after the end of the track.
    pub fn answer(&mut self, judgement: Judgement) -> bool {
        if self.is_done() {
            return false;
        }
        self.trials += 1;
        let direction = if judgement == Judgement::Correct { Direction::Down } else { Direction::Up };
        let turned = self.direction.is_some_and(|before| before != direction);
        self.direction = Some(direction);
        let mut step = self.step;
        if turned {
            self.reversals += 1;
            if self.rule.halve_at.contains(&self.reversals) {
                self.step *= 0.5;
                if self.rule.step_at_reversal == StepAtReversal::New {
                    step = self.step;
                }
            }
        }
        if self.counts(turned) {
            self.counted_sum += self.delta;
            self.counted += 1;
        }
        let moved = match judgement {
            Judgement::Correct => -step,
            Judgement::Wrong => step * self.rule.wrong_ratio(),
            Judgement::Unsure => step * self.rule.unsure_ratio(),
        };
        self.delta = (self.delta + moved).clamp(self.rule.floor, self.rule.ceiling);
        turned
    }

    /// Returns true if the current trial counts in the mean for the threshold; `turned` if it is a reversal.
    fn counts(&self, turned: bool) -> bool {
        let WeightedUpDownRule { average_from, stop_after, averaging, .. } = self.rule;
        let first = turned && self.reversals == average_from;
        let last = self.reversals >= stop_after;
        self.reversals >= average_from
            && match averaging {
                Averaging::BothEnds => true,
                Averaging::AfterFirst => !first,
                Averaging::BeforeLast => !last,
            }
    }

    /// Returns true if the track is over.
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.reversals >= self.rule.stop_after || self.trials >= self.rule.trials_most
    }

    /// Returns the threshold, the mean of the counted differences, as a fraction of the base; `None` before the last reversal, if
    /// the track ended without the last reversal, or if no trial counts in the mean.
    #[must_use]
    pub fn threshold(&self) -> Option<f64> {
        let complete = self.reversals >= self.rule.stop_after && self.counted > 0;
        complete.then(|| self.counted_sum / f64::from(self.counted))
    }
}

#[cfg(test)]
mod tests;
