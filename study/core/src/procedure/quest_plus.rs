//! Trials placed where their answer tells most, in the manner of QUEST+ (Watson 2017), with three answers.

use super::InvalidRule;
use crate::estimate::{Estimate, NotBounded, Observation, Posterior, PosteriorGrid, Prior, posterior_mean};
use crate::trial::Judgement;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Settings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct QuestPlusRule {
    /// Trials of a track.
    pub trials: u32,
    /// Share of correct answers whose difference is the threshold.
    pub target: f64,
    /// Smallest and largest difference to choose from.
    pub deltas: [f64; 2],
    /// What is held likely beforehand.
    pub prior: Prior,
}

impl Default for QuestPlusRule {
    fn default() -> Self {
        Self { trials: 18, target: 0.75, deltas: [0.01, 0.95], prior: Prior::default() }
    }
}

impl QuestPlusRule {
    /// Settings that cannot work.
    ///
    /// # Errors
    /// Names the first one.
    pub fn check(&self) -> Result<(), InvalidRule> {
        if self.trials == 0 {
            return Err(InvalidRule::new("--trials", self.trials, "must be 1 or more"));
        }
        if !(self.target > 0.5 && self.target < 1.0) {
            return Err(InvalidRule::new(
                "--target",
                self.target,
                "must be above 0.5 (guessing) and below 1",
            ));
        }
        let [least, most] = self.deltas;
        if !(least > 0.0 && least < most && most < 1.0) {
            return Err(InvalidRule::new(
                "smallest difference",
                least,
                "must be above 0 and below the largest",
            ));
        }
        Ok(())
    }
}

/// A track under way.
#[derive(Clone, Debug)]
pub struct QuestPlus {
    rule: QuestPlusRule,
    grid: Arc<PosteriorGrid>,
    posterior: Posterior,
    delta: f64,
    answers: Vec<Observation>,
}

impl QuestPlus {
    /// Before the first trial.
    #[must_use]
    pub fn new(rule: &QuestPlusRule) -> Self {
        let [least, most] = rule.deltas;
        let grid = Arc::new(PosteriorGrid::new(&rule.prior, rule.target, least, most));
        let posterior = Posterior::new(&grid);
        let delta = posterior.best_delta(&grid);
        Self { rule: rule.clone(), grid, posterior, delta, answers: Vec::new() }
    }

    /// The difference to present next.
    #[must_use]
    pub fn delta(&self) -> f64 {
        self.delta
    }

    /// Takes an answer in. After the end it changes nothing.
    pub fn answer(&mut self, judgement: Judgement) {
        if self.is_done() {
            return;
        }
        let observation = Observation { delta: self.delta, judgement };
        self.answers.push(observation);
        self.posterior.answer(&self.grid, &observation);
        self.delta = self.posterior.best_delta(&self.grid);
    }

    /// Whether it is over.
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.answers.len() >= self.rule.trials as usize
    }

    /// Estimates the observer from the answers so far, with the ends of the threshold that they do not bound.
    #[must_use]
    pub fn estimate(&self) -> (Estimate, Option<NotBounded>) {
        posterior_mean(&self.answers, &self.rule.prior, self.rule.target)
    }
}
