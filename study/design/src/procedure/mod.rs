//! Adaptive procedures: choice of the next difference, end of a track, and threshold.
//!
//! Differences are fractions of the base (0.4: the comparison differs by 40 %).

mod quest_plus;
mod weighted_up_down;

pub use quest_plus::{QuestPlus, QuestPlusRule};
pub use weighted_up_down::{Averaging, InvalidRule, StepAtReversal, WeightedUpDown, WeightedUpDownRule};

use crate::answer::Judgement;
use crate::estimate::NotBounded;
use serde::{Deserialize, Serialize};

/// Adaptive procedure with its settings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Procedure {
    /// Unforced weighted up-down (Kaernbach 2001).
    WeightedUpDown(WeightedUpDownRule),
    /// QUEST+ with a fixed number of trials.
    QuestPlus(QuestPlusRule),
}

impl Default for Procedure {
    fn default() -> Self {
        Self::WeightedUpDown(WeightedUpDownRule::default())
    }
}

impl Procedure {
    /// Checks the settings.
    ///
    /// # Errors
    /// The first invalid setting.
    pub fn check(&self) -> Result<(), InvalidRule> {
        match self {
            Self::WeightedUpDown(rule) => rule.check(),
            Self::QuestPlus(rule) => rule.check(),
        }
    }

    /// Starts a new track.
    #[must_use]
    pub fn start(&self) -> Track {
        match self {
            Self::WeightedUpDown(rule) => Track::WeightedUpDown(WeightedUpDown::new(rule)),
            Self::QuestPlus(rule) => Track::QuestPlus(Box::new(QuestPlus::new(rule))),
        }
    }

    /// Returns the expected number of trials per track. For weighted up-down this is 18, regardless of the settings: the number
    /// for the thesis's settings and observers like its subjects.
    #[must_use]
    pub fn trials_about(&self) -> u32 {
        match self {
            Self::WeightedUpDown(_) => 18,
            Self::QuestPlus(rule) => rule.trials,
        }
    }

    /// Returns a lower bound of the number of trials per track. For weighted up-down this is the number of reversals; a track
    /// has more trials, because the first trial cannot be a reversal.
    #[must_use]
    pub fn trials_least(&self) -> u32 {
        match self {
            Self::WeightedUpDown(rule) => rule.stop_after,
            Self::QuestPlus(rule) => rule.trials,
        }
    }

    /// Returns the largest difference a track can present, as a fraction of the base.
    #[must_use]
    pub fn largest_delta(&self) -> f64 {
        match self {
            Self::WeightedUpDown(rule) => rule.ceiling,
            Self::QuestPlus(rule) => rule.deltas[1],
        }
    }

    /// Returns the value of `P(correct) + P(don't know) / 2` at the threshold.
    #[must_use]
    pub fn target(&self) -> f64 {
        match self {
            Self::WeightedUpDown(rule) => rule.target,
            Self::QuestPlus(rule) => rule.target,
        }
    }
}

/// Track in progress.
#[derive(Clone, Debug)]
pub enum Track {
    /// Unforced weighted up-down.
    WeightedUpDown(WeightedUpDown),
    /// QUEST+.
    QuestPlus(Box<QuestPlus>),
}

impl Track {
    /// Returns the difference to present next, as a fraction of the base.
    #[must_use]
    pub fn delta(&self) -> f64 {
        match self {
            Self::WeightedUpDown(track) => track.delta(),
            Self::QuestPlus(track) => track.delta(),
        }
    }

    /// Processes an answer. Returns true for a reversal of the direction; always false for QUEST+. Ignores answers after the
    /// end of the track.
    pub fn answer(&mut self, judgement: Judgement) -> bool {
        match self {
            Self::WeightedUpDown(track) => track.answer(judgement),
            Self::QuestPlus(track) => {
                track.answer(judgement);
                false
            }
        }
    }

    /// Returns true if the track is over.
    #[must_use]
    pub fn is_done(&self) -> bool {
        match self {
            Self::WeightedUpDown(track) => track.is_done(),
            Self::QuestPlus(track) => track.is_done(),
        }
    }

    /// Returns the sides on which the answers do not bound the threshold; `None` if the answers bound both sides, before the end of
    /// the track, and for weighted up-down.
    #[must_use]
    pub fn not_bounded(&self) -> Option<NotBounded> {
        match self {
            Self::WeightedUpDown(_) => None,
            Self::QuestPlus(track) => track.is_done().then(|| track.estimate().1).flatten(),
        }
    }

    /// Returns the threshold, as a fraction of the base; `None` before the end of the track, or if the track ended without a
    /// threshold.
    #[must_use]
    pub fn threshold(&self) -> Option<f64> {
        match self {
            Self::WeightedUpDown(track) => track.threshold(),
            Self::QuestPlus(track) => track.is_done().then(|| track.estimate().0.threshold),
        }
    }
}
