//! QUEST+ (Watson 2017) with three answers: each trial is at the difference with the largest expected information.

use super::InvalidRule;
use crate::answer::Judgement;
use crate::estimate::{Estimate, NotBounded, Observation, Posterior, PosteriorGrid, Prior, posterior_mean};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Settings of QUEST+.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct QuestPlusRule {
    /// Number of trials of a track.
    pub trials: u32,
    /// Value of `P(correct) + P(don't know) / 2` at the threshold.
    pub target: f64,
    /// Smallest and largest candidate difference, as fractions of the base.
    pub deltas: [f64; 2],
    /// Prior of the observer.
    pub prior: Prior,
}

impl Default for QuestPlusRule {
    fn default() -> Self {
        Self { trials: 18, target: 0.75, deltas: [0.01, 0.95], prior: Prior::default() }
    }
}

impl QuestPlusRule {
    /// Checks the settings.
    ///
    /// # Errors
    /// The first invalid setting.
    pub fn check(&self) -> Result<(), InvalidRule> {
        if self.trials == 0 {
            return Err(InvalidRule::new("--trials", self.trials, "must be 1 or more"));
        }
        if !(self.target > 0.5 && self.target < 1.0) {
            let legal = "must be above 0.5 (guessing) and below 1";
            return Err(InvalidRule::new("--target", self.target, legal));
        }
        let [least, most] = self.deltas;
        if !(most > 0.0 && most < 1.0) {
            return Err(InvalidRule::new("largest difference", most, "must be above 0 and below 1"));
        }
        if !(least > 0.0 && least < most) {
            let legal = "must be above 0 and below the largest difference";
            return Err(InvalidRule::new("smallest difference", least, legal));
        }
        Ok(())
    }
}

/// QUEST+ track in progress.
#[derive(Clone, Debug)]
pub struct QuestPlus {
    rule: QuestPlusRule,
    grid: Arc<PosteriorGrid>,
    posterior: Posterior,
    delta: f64,
    answers: Vec<Observation>,
}

impl QuestPlus {
    /// Starts a track before its first trial.
    #[must_use]
    pub fn new(rule: &QuestPlusRule) -> Self {
        let [least, most] = rule.deltas;
        let grid = Arc::new(PosteriorGrid::new(&rule.prior, rule.target, least, most));
        let posterior = Posterior::new(&grid);
        let delta = posterior.best_delta(&grid);
        Self { rule: rule.clone(), grid, posterior, delta, answers: Vec::new() }
    }

    /// Returns the difference to present next, as a fraction of the base.
    #[must_use]
    pub fn delta(&self) -> f64 {
        self.delta
    }

    /// Processes an answer; ignored after the end of the track.
    pub fn answer(&mut self, judgement: Judgement) {
        if self.is_done() {
            return;
        }
        let observation = Observation { delta: self.delta, judgement };
        self.answers.push(observation);
        self.posterior.answer(&self.grid, &observation);
        self.delta = self.posterior.best_delta(&self.grid);
    }

    /// Returns true if the track is over.
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.answers.len() >= self.rule.trials as usize
    }

    /// Estimates the observer from the answers so far; also returns the sides on which these answers do not bound the threshold,
    /// `None` if the answers bound both sides.
    #[must_use]
    pub fn estimate(&self) -> (Estimate, Option<NotBounded>) {
        posterior_mean(&self.answers, &self.rule.prior, self.rule.target)
    }
}
