//! Track of any method with tracks.

use super::limits::Limits;
use super::outcome::Outcome;
use super::staircase::Staircase;
use super::target_rating::TargetRating;
use crate::procedure;

/// Track in progress.
#[derive(Clone, Debug)]
pub enum Track {
    /// Series of the method of limits.
    Limits(Limits),
    /// Weighted up-down or QUEST+.
    Difference(procedure::Track),
    /// Transformed staircase.
    Staircase(Staircase),
    /// Adaptive rating.
    TargetRating(TargetRating),
}

impl Track {
    /// Returns the level to present next.
    #[must_use]
    pub fn level(&self) -> f64 {
        match self {
            Self::Limits(series) => series.level(),
            Self::Difference(track) => track.delta(),
            Self::Staircase(track) => track.level(),
            Self::TargetRating(track) => track.level(),
        }
    }

    /// Processes the outcome of a trial at the present level; ignores outcomes after the end of the track.
    pub fn answer(&mut self, outcome: Outcome) {
        match self {
            Self::Limits(series) => series.answer(outcome),
            Self::Difference(track) => {
                track.answer(outcome.judgement());
            }
            Self::Staircase(track) => track.answer(outcome),
            Self::TargetRating(track) => track.answer(outcome),
        }
    }

    /// Returns true if the track is over.
    #[must_use]
    pub fn is_done(&self) -> bool {
        match self {
            Self::Limits(series) => series.is_done(),
            Self::Difference(track) => track.is_done(),
            Self::Staircase(track) => track.is_done(),
            Self::TargetRating(track) => track.is_done(),
        }
    }

    /// Returns the threshold, on the scale of the levels; `None` before the end of the track, or if it ended without one.
    #[must_use]
    pub fn threshold(&self) -> Option<f64> {
        match self {
            Self::Limits(series) => series.threshold(),
            Self::Difference(track) => track.threshold(),
            Self::Staircase(track) => track.threshold(),
            Self::TargetRating(track) => track.threshold(),
        }
    }
}
