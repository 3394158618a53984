//! Adaptive procedures: which difference comes next, when it is enough, and what the threshold is.
//!
//! Differences are shares of the base (0.4: the comparison differs by 40 %).

mod quest_plus;
mod weighted_up_down;

pub use quest_plus::{QuestPlus, QuestPlusRule};
pub use weighted_up_down::{Averaging, InvalidRule, StepAtReversal, WeightedUpDown, WeightedUpDownRule};

use crate::estimate::NotBounded;
use crate::trial::Judgement;
use serde::{Deserialize, Serialize};

/// A procedure and its settings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Procedure {
    /// Unforced weighted up-down (Kaernbach 2001).
    WeightedUpDown(WeightedUpDownRule),
    /// Trials where they tell most, a fixed number of them.
    QuestPlus(QuestPlusRule),
}

impl Default for Procedure {
    fn default() -> Self {
        Self::WeightedUpDown(WeightedUpDownRule::default())
    }
}

impl Procedure {
    /// Settings that cannot work.
    ///
    /// # Errors
    /// Names the first one.
    pub fn check(&self) -> Result<(), InvalidRule> {
        match self {
            Self::WeightedUpDown(rule) => rule.check(),
            Self::QuestPlus(rule) => rule.check(),
        }
    }

    /// A new track.
    #[must_use]
    pub fn start(&self) -> Track {
        match self {
            Self::WeightedUpDown(rule) => Track::WeightedUpDown(WeightedUpDown::new(rule)),
            Self::QuestPlus(rule) => Track::QuestPlus(Box::new(QuestPlus::new(rule))),
        }
    }

    /// Trials a track takes, about: an adaptive one ends when it has turned often enough (18 with the thesis's settings
    /// and observers like its subjects).
    #[must_use]
    pub fn trials_about(&self) -> u32 {
        match self {
            Self::WeightedUpDown(_) => 18,
            Self::QuestPlus(rule) => rule.trials,
        }
    }

    /// Trials a track takes at least: each reversal is one, and no first trial is a reversal.
    #[must_use]
    pub fn trials_least(&self) -> u32 {
        match self {
            Self::WeightedUpDown(rule) => rule.stop_after,
            Self::QuestPlus(rule) => rule.trials,
        }
    }

    /// The largest difference a track can ask for.
    #[must_use]
    pub fn largest_delta(&self) -> f64 {
        match self {
            Self::WeightedUpDown(rule) => rule.ceiling,
            Self::QuestPlus(rule) => rule.deltas[1],
        }
    }

    /// The share of correct answers whose difference is the threshold.
    #[must_use]
    pub fn target(&self) -> f64 {
        match self {
            Self::WeightedUpDown(rule) => rule.target,
            Self::QuestPlus(rule) => rule.target,
        }
    }
}

/// One run of a procedure.
#[derive(Clone, Debug)]
pub enum Track {
    /// Unforced weighted up-down.
    WeightedUpDown(WeightedUpDown),
    /// QUEST+.
    QuestPlus(Box<QuestPlus>),
}

impl Track {
    /// The difference to present next.
    #[must_use]
    pub fn delta(&self) -> f64 {
        match self {
            Self::WeightedUpDown(track) => track.delta(),
            Self::QuestPlus(track) => track.delta(),
        }
    }

    /// Takes an answer in. Returns whether it turned the direction.
    pub fn answer(&mut self, judgement: Judgement) -> bool {
        match self {
            Self::WeightedUpDown(track) => track.answer(judgement),
            Self::QuestPlus(track) => {
                track.answer(judgement);
                false
            }
        }
    }

    /// Whether it is over.
    #[must_use]
    pub fn is_done(&self) -> bool {
        match self {
            Self::WeightedUpDown(track) => track.is_done(),
            Self::QuestPlus(track) => track.is_done(),
        }
    }

    /// The ends of the threshold that the answers do not bound, once the track is over.
    #[must_use]
    pub fn not_bounded(&self) -> Option<NotBounded> {
        match self {
            Self::WeightedUpDown(_) => None,
            Self::QuestPlus(track) => track.is_done().then(|| track.estimate().1).flatten(),
        }
    }

    /// The threshold, once it is over.
    #[must_use]
    pub fn threshold(&self) -> Option<f64> {
        match self {
            Self::WeightedUpDown(track) => track.threshold(),
            Self::QuestPlus(track) => track.is_done().then(|| track.estimate().0.threshold),
        }
    }
}
