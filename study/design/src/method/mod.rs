//! Psychophysical methods: the level of the next trial, and the result of a track.
//!
//! A level is a number on the scale of the stimulus ([`crate::stimulus::Scale`]).

mod check;
mod limits;
mod outcome;
mod staircase;
mod target_rating;
mod track;

pub use limits::{Direction, Limits};
pub use outcome::Outcome;
pub use staircase::{Staircase, StaircaseRule};
pub use target_rating::{TargetRating, TargetRatingRule};
pub use track::Track;

use crate::error::DesignError;
use crate::procedure::{Procedure, QuestPlusRule, WeightedUpDownRule};
use check::{different, in_order, positive, reversals, share};
use serde::{Deserialize, Serialize};

/// Psychophysical method with its settings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Method {
    /// Constant stimuli: each level equally often, in random order.
    Constant {
        /// Levels; empty for stimuli without levels.
        #[serde(default)]
        levels: Vec<f64>,
        /// Number of trials at each level, in each condition of a block.
        repetitions: u32,
    },
    /// Method of limits: ascending and descending series in alternation, each up to the change of the answer.
    Limits {
        /// Levels in ascending order.
        levels: Vec<f64>,
        /// Number of series in each condition of a block.
        series: u32,
    },
    /// Weighted up-down (Kaernbach 1991, 2001).
    WeightedUpDown {
        /// Number of tracks in each condition of a block.
        #[serde(default = "one")]
        tracks: u32,
        /// Settings of the rule.
        #[serde(default)]
        rule: WeightedUpDownRule,
    },
    /// Transformed up-down staircase (Levitt 1971).
    Staircase {
        /// Number of tracks in each condition of a block.
        #[serde(default = "one")]
        tracks: u32,
        /// Settings of the rule.
        #[serde(default)]
        rule: StaircaseRule,
    },
    /// QUEST+ (Watson 2017) with a fixed number of trials.
    QuestPlus {
        /// Number of tracks in each condition of a block.
        #[serde(default = "one")]
        tracks: u32,
        /// Settings of the rule.
        #[serde(default)]
        rule: QuestPlusRule,
    },
    /// Adaptive rating: the level whose rating is a target (Kesten 1958).
    TargetRating {
        /// Number of tracks in each condition of a block.
        #[serde(default = "one")]
        tracks: u32,
        /// Settings of the rule.
        rule: TargetRatingRule,
    },
}

fn one() -> u32 {
    1
}

impl Method {
    /// Returns the name in a study file.
    #[must_use]
    pub fn word(&self) -> &'static str {
        match self {
            Self::Constant { .. } => "constant",
            Self::Limits { .. } => "limits",
            Self::WeightedUpDown { .. } => "weighted-up-down",
            Self::Staircase { .. } => "staircase",
            Self::QuestPlus { .. } => "quest-plus",
            Self::TargetRating { .. } => "target-rating",
        }
    }

    /// Returns the number of tracks in each condition of a block; 0 for constant stimuli.
    #[must_use]
    pub fn tracks(&self) -> u32 {
        match self {
            Self::Constant { .. } => 0,
            Self::Limits { series, .. } => *series,
            Self::WeightedUpDown { tracks, .. }
            | Self::Staircase { tracks, .. }
            | Self::QuestPlus { tracks, .. }
            | Self::TargetRating { tracks, .. } => *tracks,
        }
    }

    /// Starts a track; `None` for constant stimuli. `index` counts the tracks of a condition from 0: series of limits alternate.
    #[must_use]
    pub fn start(&self, index: u32) -> Option<Track> {
        Some(match self {
            Self::Constant { .. } => return None,
            Self::Limits { levels, .. } => Track::Limits(Limits::new(levels, Direction::of_series(index))),
            Self::WeightedUpDown { rule, .. } => {
                Track::Difference(Procedure::WeightedUpDown(rule.clone()).start())
            }
            Self::QuestPlus { rule, .. } => Track::Difference(Procedure::QuestPlus(rule.clone()).start()),
            Self::Staircase { rule, .. } => Track::Staircase(Staircase::new(rule)),
            Self::TargetRating { rule, .. } => Track::TargetRating(TargetRating::new(rule)),
        })
    }

    /// Returns the smallest and the largest level that may be presented; `None` for stimuli without levels.
    #[must_use]
    pub fn extremes(&self) -> Option<[f64; 2]> {
        match self {
            Self::Constant { levels, .. } | Self::Limits { levels, .. } => {
                let least = levels.iter().copied().min_by(f64::total_cmp)?;
                let most = levels.iter().copied().max_by(f64::total_cmp)?;
                Some([least, most])
            }
            Self::WeightedUpDown { rule, .. } => Some([rule.floor, rule.ceiling]),
            Self::Staircase { rule, .. } => Some([rule.floor, rule.ceiling]),
            Self::QuestPlus { rule, .. } => Some(rule.deltas),
            Self::TargetRating { rule, .. } => Some([rule.floor, rule.ceiling]),
        }
    }

    /// Returns the level of practice trials: the one that is easiest to judge.
    #[must_use]
    pub fn practice_level(&self) -> f64 {
        match self {
            Self::Constant { levels, .. } | Self::Limits { levels, .. } => {
                levels.iter().copied().max_by(f64::total_cmp).unwrap_or(1.0)
            }
            Self::WeightedUpDown { rule, .. } => rule.initial_delta,
            Self::Staircase { rule, .. } => rule.initial,
            Self::QuestPlus { rule, .. } => rule.deltas[1],
            Self::TargetRating { rule, .. } => rule.initial,
        }
    }

    /// Checks the settings.
    pub(crate) fn check(&self) -> Result<(), DesignError> {
        if self.tracks() == 0 && !matches!(self, Self::Constant { .. }) {
            return Err(DesignError::new("method.tracks", "0 tracks: write 1 or more"));
        }
        match self {
            Self::Constant { levels, repetitions } => {
                if *repetitions == 0 {
                    return Err(DesignError::new("method.repetitions", "0 repetitions: write 1 or more"));
                }
                different("method.levels", levels)
            }
            Self::Limits { levels, .. } => {
                different("method.levels", levels)?;
                let is_ascending = levels.windows(2).all(|two| matches!(two, [low, high] if low < high));
                if levels.len() < 2 || !is_ascending {
                    let problem = "a series needs two or more levels: write them in ascending order";
                    return Err(DesignError::new("method.levels", problem));
                }
                Ok(())
            }
            Self::WeightedUpDown { rule, .. } => {
                in_order("method.rule", [rule.floor, rule.initial_delta, rule.ceiling])?;
                positive("method.rule.first_step", rule.first_step)?;
                share("method.rule.target", rule.target)?;
                reversals([rule.average_from, rule.stop_after, rule.trials_most])
            }
            Self::Staircase { rule, .. } => rule.check(),
            Self::QuestPlus { rule, .. } => rule.check().map_err(|wrong| {
                DesignError::new(
                    "method.rule",
                    &format!("{} {}: {}", wrong.setting, wrong.value, wrong.legal),
                )
            }),
            Self::TargetRating { rule, .. } => rule.check(),
        }
    }
}
