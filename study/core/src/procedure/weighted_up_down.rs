//! The unforced weighted up-down rule (Kaernbach, Perception & Psychophysics 63:1377, 2001).
//!
//! A correct answer makes the difference smaller by a step D1, a wrong one larger by `D2 = D1 p / (1 - p)`, and "I
//! don't know" larger by `D3 = D1 (p - 1/m) / (1 - p)` (his equations 5 and 7), with p the share of correct answers
//! aimed at and m = 2 alternatives. Where the expected step is zero, `P(correct) + P(don't know) / m = p`.
//!
//! What CMU-RI-TR-07-21 (section 4.2) leaves open is an option here, and its default reproduces the published
//! distribution of simulated estimates.

use crate::trial::Judgement;
use serde::{Deserialize, Serialize};

/// Alternatives of a comparison: first or second.
const ALTERNATIVES: f64 = 2.0;

/// Which step size moves the difference at a reversal that halves it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum StepAtReversal {
    /// The halved one, at once
    #[default]
    New,
    /// The old one; the halved one from the next trial on
    Old,
}

/// Which differences the threshold is the mean of: whether the trials of the first and the last reversal that count do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Averaging {
    /// Both count
    #[default]
    BothEnds,
    /// The trial of the first does not
    AfterFirst,
    /// The trial of the last does not
    BeforeLast,
}

/// Settings of the rule.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WeightedUpDownRule {
    /// First difference.
    pub initial_delta: f64,
    /// First step D1 of a correct answer.
    pub first_step: f64,
    /// Share of correct answers aimed at.
    pub target: f64,
    /// The reversals at which the steps are halved.
    pub halve_at: Vec<u32>,
    /// The reversal after which the track is over.
    pub stop_after: u32,
    /// The reversal from which on differences count.
    pub average_from: u32,
    /// Whether the trials of the first and last of these reversals count.
    pub averaging: Averaging,
    /// Which step is applied at a halving reversal.
    pub step_at_reversal: StepAtReversal,
    /// The difference never becomes smaller than this, which is above 0: without a difference no answer is right or wrong.
    pub floor: f64,
    /// Nor larger than this.
    pub ceiling: f64,
    /// A track that takes longer is over without a threshold.
    pub trials_most: u32,
}

impl Default for WeightedUpDownRule {
    /// The settings of CMU-RI-TR-07-21, section 4.2; of the floor, which the thesis leaves open, 1 %.
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

/// A setting that cannot work.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{setting} {value}: {legal}")]
pub struct InvalidRule {
    /// Its option on the command line.
    pub setting: &'static str,
    /// Its value.
    pub value: String,
    /// What is legal.
    pub legal: String,
}

impl InvalidRule {
    /// A complaint about a setting.
    pub fn new(setting: &'static str, value: impl ToString, legal: impl Into<String>) -> Self {
        Self { setting, value: value.to_string(), legal: legal.into() }
    }
}

impl WeightedUpDownRule {
    /// Settings that cannot work.
    ///
    /// # Errors
    /// Names the first one.
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
            "must be above 0 and below 1 (a base minus all of it is nothing)",
        )?;
        if !(self.floor > 0.0 && self.floor < self.ceiling) {
            let legal = "must be above 0 (no answer to equal stimuli is right) and below --ceiling";
            return Err(InvalidRule::new("--floor", self.floor, legal));
        }
        if !(self.initial_delta > self.floor && self.initial_delta <= self.ceiling) {
            let legal = "must be above --floor and up to --ceiling";
            return Err(InvalidRule::new("--initial", self.initial_delta, legal));
        }
        if self.stop_after == 0 || self.average_from == 0 || self.average_from > self.stop_after {
            let legal = format!("must be 1 to --stop-after ({})", self.stop_after);
            return Err(InvalidRule::new("--average-from", self.average_from, legal));
        }
        if self.trials_most < self.stop_after {
            let legal = format!("must be 1 to {}, the most trials of a track", self.trials_most);
            return Err(InvalidRule::new("--stop-after", self.stop_after, legal));
        }
        Ok(())
    }

    /// D2 over D1: how much further a wrong answer moves than a correct one.
    #[must_use]
    pub fn wrong_ratio(&self) -> f64 {
        self.target / (1.0 - self.target)
    }

    /// D3 over D1: the same for "I don't know".
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

/// A track under way.
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
    /// At the first difference.
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

    /// The difference to present next.
    #[must_use]
    pub fn delta(&self) -> f64 {
        self.delta
    }

    /// The step D1 in force.
    #[must_use]
    pub fn step(&self) -> f64 {
        self.step
    }

    /// Reversals so far.
    #[must_use]
    pub fn reversals(&self) -> u32 {
        self.reversals
    }

    /// Trials so far.
    #[must_use]
    pub fn trials(&self) -> u32 {
        self.trials
    }

    /// Takes an answer in. Returns whether it turned the direction. After the end it changes nothing.
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

    /// Whether the trial just answered counts for the threshold.
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

    /// Whether it is over.
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.reversals >= self.rule.stop_after || self.trials >= self.rule.trials_most
    }

    /// Mean of the differences that count; none before the last reversal, nor if it never came.
    #[must_use]
    pub fn threshold(&self) -> Option<f64> {
        let complete = self.reversals >= self.rule.stop_after && self.counted > 0;
        complete.then(|| self.counted_sum / f64::from(self.counted))
    }
}

#[cfg(test)]
mod tests;
