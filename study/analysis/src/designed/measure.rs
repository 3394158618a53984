//! Measure of a subject in a condition, by question and method of the design.

use super::record::{Answered, DesignRecord};
use flotor_statistics::StatisticsError;
use flotor_statistics::describe::mean;
use flotor_statistics::detection::{Detection, detection};
use flotor_statistics::distribution::normal_quantile;
use flotor_statistics::probit::{Counts, Probit, probit, spread};
use flotor_study_design::answer::{Answer, Position};
use flotor_study_design::course::Signal;
use flotor_study_design::design::{Condition, Design};
use flotor_study_design::method::Method;
use flotor_study_design::task::Ask;
use serde::Serialize;

/// Kind of the measure in a condition.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum MeasureKind {
    /// Mean threshold of the tracks, on the scale of the levels.
    Threshold,
    /// Difference from 50 to 75 % of the psychometric function, on the scale of the levels.
    Difference,
    /// Share of trials in which the comparison was named.
    Share,
    /// Sensitivity d'.
    Sensitivity,
    /// Mean rating.
    Rating,
    /// Mean logarithm of the magnitude.
    LogMagnitude,
}

/// Measure in a condition.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CellMeasure {
    /// Value that the effects are computed from.
    pub value: f64,
    /// Number of counted trials.
    pub trials: usize,
    /// Further results of the condition.
    pub detail: Detail,
}

/// Further results of a condition.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Detail {
    /// Nothing but the value.
    Mean,
    /// Number of tracks, and of those that ended with a threshold.
    Tracks {
        /// All tracks.
        tracks: usize,
        /// Tracks with a threshold.
        with_threshold: usize,
    },
    /// Psychometric function.
    Psychometric(Probit),
    /// Sensitivity and criterion.
    Detection(Detection),
}

impl MeasureKind {
    /// Returns the kind for a design.
    #[must_use]
    pub fn of(design: &Design) -> Self {
        match (design.method(), &design.task().ask) {
            (Method::Constant { levels, .. }, Ask::Choice { .. }) if levels.len() > 1 => Self::Difference,
            (Method::Constant { .. }, Ask::Choice { .. }) => Self::Share,
            (Method::Constant { .. }, Ask::Detection { .. }) => Self::Sensitivity,
            (Method::Constant { .. }, Ask::Rating { .. }) => Self::Rating,
            (Method::Constant { .. }, Ask::Magnitude) => Self::LogMagnitude,
            _ => Self::Threshold,
        }
    }

    /// Returns the name in JSON and scripts.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Threshold => "threshold",
            Self::Difference => "difference",
            Self::Share => "share",
            Self::Sensitivity => "sensitivity",
            Self::Rating => "rating",
            Self::LogMagnitude => "log-magnitude",
        }
    }

    /// Returns a heading for tables.
    #[must_use]
    pub fn heading(self) -> &'static str {
        match self {
            Self::Threshold => "threshold",
            Self::Difference => "difference at 75 %",
            Self::Share => "share of the comparison",
            Self::Sensitivity => "sensitivity d'",
            Self::Rating => "rating",
            Self::LogMagnitude => "log magnitude",
        }
    }

    /// Computes the measure of a subject in a condition, with its further results.
    ///
    /// # Errors
    /// The reason for a missing measure.
    pub fn in_condition(
        self,
        record: &DesignRecord,
        condition: &Condition,
    ) -> Result<CellMeasure, StatisticsError> {
        let answered: Vec<&Answered> = record.in_condition(condition).collect();
        let detail = match self {
            Self::Threshold => {
                let here = record.tracks.iter().filter(|track| track.condition == *condition);
                let thresholds: Vec<bool> = here.map(|track| track.threshold.is_some()).collect();
                let with_threshold = thresholds.iter().filter(|found| **found).count();
                Detail::Tracks { tracks: thresholds.len(), with_threshold }
            }
            Self::Difference => Detail::Psychometric(probit(&counts(&answered))?),
            Self::Sensitivity => Detail::Detection(sensitivity(&answered)?),
            Self::Share | Self::Rating | Self::LogMagnitude => Detail::Mean,
        };
        Ok(CellMeasure { value: self.value(record, condition)?, trials: answered.len(), detail })
    }

    /// Computes the value that the effects are computed from, without intervals.
    ///
    /// # Errors
    /// The reason for a missing value.
    pub fn value(self, record: &DesignRecord, condition: &Condition) -> Result<f64, StatisticsError> {
        let answered: Vec<&Answered> = record.in_condition(condition).collect();
        match self {
            Self::Threshold => {
                let here = record.tracks.iter().filter(|track| track.condition == *condition);
                let found: Vec<f64> = here.filter_map(|track| track.threshold).collect();
                checked_mean("a threshold", "tracks that came to one", &found)
            }
            Self::Difference => Ok(normal_quantile(0.75) * spread(&counts(&answered))?),
            Self::Sensitivity => Ok(sensitivity(&answered)?.d_prime),
            Self::Share => {
                let shares: Vec<f64> = answered.iter().filter_map(|one| positive(one)).collect();
                checked_mean("a share", "answers", &shares)
            }
            Self::Rating | Self::LogMagnitude => {
                let number = |one: &&Answered| match one.reply.answer {
                    Answer::Rating(point) => Some(point),
                    Answer::Magnitude(number) => Some(libm::log(number)),
                    _ => None,
                };
                let numbers: Vec<f64> = answered.iter().filter_map(number).collect();
                checked_mean("a mean", "answers", &numbers)
            }
        }
    }
}

fn sensitivity(answered: &[&Answered]) -> Result<Detection, StatisticsError> {
    let counts = |signal: Signal| {
        let all = || answered.iter().filter(|one| one.trial.signal == Some(signal));
        [all().filter(|one| one.reply.answer == Answer::Present).count(), all().count()]
    };
    detection(counts(Signal::Present), counts(Signal::Absent))
}

fn checked_mean(what: &'static str, unit: &'static str, values: &[f64]) -> Result<f64, StatisticsError> {
    if values.is_empty() {
        return Err(StatisticsError::TooFew { what, unit, needed: 1, found: 0 });
    }
    Ok(mean(values))
}

/// Returns 1 if the comparison was named, 0 if the standard was, and 0.5 for "I don't know"; `None` for another answer.
fn positive(answered: &Answered) -> Option<f64> {
    let named = |position: Position| f64::from(u8::from(answered.trial.comparison_at == Some(position)));
    match answered.reply.answer {
        Answer::First => Some(named(Position::First)),
        Answer::Second => Some(named(Position::Second)),
        Answer::Unsure => Some(0.5),
        _ => None,
    }
}

/// Returns the counts at each level, in ascending order.
fn counts(answered: &[&Answered]) -> Vec<Counts> {
    let mut counts: Vec<Counts> = Vec::new();
    for one in answered {
        let (Some(level), Some(positive)) = (one.trial.level, positive(one)) else { continue };
        match counts.iter_mut().find(|known| known.level == level) {
            Some(known) => {
                known.positive += positive;
                known.answers += 1.0;
            }
            None => counts.push(Counts { level, positive, answers: 1.0 }),
        }
    }
    counts.sort_by(|a, b| a.level.total_cmp(&b.level));
    counts
}
