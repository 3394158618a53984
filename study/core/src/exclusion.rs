//! Exclusion rules, fixed before data collection, and the exclusions that result. `flotor-analysis` applies the rules.
//!
//! A rule applies to a whole sitting (`most_...`, `least_agreement`) or to single trials (`response_time_s`,
//! `least_movement_mm`). A rating is excluded alone. An excluded trial of an adaptive track excludes the whole track, because
//! the later differences depend on the answer; with an estimate from all answers (`--estimator map`) the trial is excluded
//! alone.

mod check;

use crate::protocol::SubjectNumber;
use crate::trial::{Phase, Trial};
use serde::{Deserialize, Serialize};

/// Exclusion rules of a study; an absent rule excludes nothing.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExclusionRules {
    /// Sitting: maximum fraction of catch trials answered with one of the two equal stimuli.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub most_false_alarms: Option<f64>,
    /// Sitting: maximum fraction of obvious pairs answered without naming the larger stimulus.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub most_missed_obvious: Option<f64>,
    /// Sitting: maximum fraction of wrong answers to differences of 40 % and more.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub most_wrong_at_large: Option<f64>,
    /// Sitting: minimum fraction of repeated pairs with the same answer.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub least_agreement: Option<f64>,
    /// Sitting: maximum standard deviation of a rating between repetitions, as a fraction of the mean rating.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub most_retest_deviation: Option<f64>,
    /// Sitting: maximum fraction of the answer "I don't know".
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub most_dont_know: Option<f64>,
    /// Sitting: maximum fraction of missed ticks while stimuli were felt.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub most_missed_ticks: Option<f64>,
    /// Trial: minimum path length of the handle with each stimulus, up and down added, over all repetitions, mm.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub least_movement_mm: Option<f64>,
    /// Trial: minimum and maximum response time, s.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub response_time_s: Option<[f64; 2]>,
    /// Sitting: maximum fraction of trials excluded by trial rules.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub most_excluded_trials: Option<f64>,
}

/// Reason for exclusion without a rule: a subject has no result in some condition, because trial rules excluded all data of the
/// condition or no track reached a threshold.
pub const EMPTY_CONDITION: &str = "empty_condition";

/// Extent of an exclusion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scope {
    /// The whole sitting of the subject.
    Sitting,
    /// One track, by track number.
    Track(u32),
    /// One trial, by trial number.
    Trial(u32),
}

/// Excluded data and the reason.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Exclusion {
    /// Number of the subject.
    pub subject: SubjectNumber,
    /// Extent of the exclusion.
    pub scope: Scope,
    /// Name of the rule in the study file, or [`EMPTY_CONDITION`].
    pub rule: &'static str,
    /// Value that violates the rule, as text.
    pub found: String,
}

impl Exclusion {
    /// Returns true if this exclusion covers a trial of a subject; only counted (main) trials are covered.
    #[must_use]
    pub fn covers(&self, subject: SubjectNumber, trial: &Trial) -> bool {
        let is_here = match self.scope {
            Scope::Sitting => true,
            Scope::Track(track) => trial.track == track,
            Scope::Trial(number) => trial.number == number,
        };
        self.subject == subject && trial.phase == Phase::Main && is_here
    }

    /// Formats the exclusion as one line.
    #[must_use]
    pub fn to_text(&self, rules: &ExclusionRules) -> String {
        format!("excluded: {}, {} ({})", self.scope, rules.text_of(self.rule), self.found)
    }
}

impl std::fmt::Display for Scope {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Sitting => f.write_str("sitting"),
            Self::Track(track) => write!(f, "track {track}"),
            Self::Trial(trial) => write!(f, "trial {trial}"),
        }
    }
}

impl ExclusionRules {
    /// Returns true if no rule is set.
    #[must_use]
    pub fn are_none(&self) -> bool {
        *self == Self::default()
    }

    /// Returns a warning for a rule whose exclusions depend on the stimulus as well as on the subject; `None` for other rules.
    #[must_use]
    pub fn warning(rule: &str) -> Option<&'static str> {
        (rule == "least_movement_mm").then_some(
            "least_movement_mm depends on the stimulus: the hand moves a stiffer stimulus less, so the rule \
             excludes trials of the stiffest stimuli first",
        )
    }

    /// Formats a rule as in the study file: `most_false_alarms = 0.5`; for a rule that is not set, returns its name.
    #[must_use]
    pub fn text_of(&self, rule: &str) -> String {
        let said = serde_json::to_value(self).unwrap_or_default();
        said.get(rule).map_or_else(|| rule.to_owned(), |value| format!("{rule} = {value}"))
    }

    /// Returns the names of the rules that are set.
    #[must_use]
    pub fn names(&self) -> Vec<String> {
        let said = serde_json::to_value(self).unwrap_or_default();
        said.as_object().map(|rules| rules.keys().cloned().collect()).unwrap_or_default()
    }
}
