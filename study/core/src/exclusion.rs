//! Rules of exclusion, decided before there are data, and their findings. `flotor-analysis` applies them.
//!
//! A rule is about a whole sitting (`most_...`, `least_agreement`), or about single trials (`response_time_s`,
//! `least_movement_mm`). A trial of ratings is left out by itself. A trial of an adaptive track takes the track with it, because
//! the differences after it follow from its answer; only an estimate from all answers (`--estimator map`) can do without
//! that trial alone.

mod check;

use crate::protocol::SubjectNumber;
use crate::trial::{Phase, Trial};
use serde::{Deserialize, Serialize};

/// The rules of a study; what is not said excludes nothing.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExclusionRules {
    /// Sitting: largest share of catch trials in which one of two equal stimuli was named.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub most_false_alarms: Option<f64>,
    /// Sitting: largest share of obvious pairs whose larger stimulus was not named.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub most_missed_obvious: Option<f64>,
    /// Sitting: largest share of wrong answers to differences of 40 % and more.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub most_wrong_at_large: Option<f64>,
    /// Sitting: least share of repeated pairs with the same answer.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub least_agreement: Option<f64>,
    /// Sitting: largest deviation of a repeated rating, as a share of the mean rating.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub most_retest_deviation: Option<f64>,
    /// Sitting: largest share of "I don't know".
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub most_dont_know: Option<f64>,
    /// Sitting: largest share of missed ticks while stimuli were felt.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub most_missed_ticks: Option<f64>,
    /// Trial: least way of the handle with each stimulus, up and down together and as often as it was felt, mm.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub least_movement_mm: Option<f64>,
    /// Trial: shortest and longest time to the answer, s.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub response_time_s: Option<[f64; 2]>,
    /// Sitting: largest share of trials that the rules about trials exclude.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub most_excluded_trials: Option<f64>,
}

/// No rule of the file: a subject has no result in some condition, because the rules about trials left nothing, or because no track
/// came to a threshold.
pub const EMPTY_CONDITION: &str = "empty_condition";

/// What is excluded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scope {
    /// Everything of the subject.
    Sitting,
    /// One track, by its number.
    Track(u32),
    /// One trial, by its number.
    Trial(u32),
}

/// Something that was excluded.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Exclusion {
    /// Whose.
    pub subject: SubjectNumber,
    /// What.
    pub scope: Scope,
    /// By which rule, as the study file has it, or [`EMPTY_CONDITION`].
    pub rule: &'static str,
    /// What was found.
    pub found: String,
}

impl Exclusion {
    /// Whether a trial that would count is excluded by this.
    #[must_use]
    pub fn covers(&self, subject: SubjectNumber, trial: &Trial) -> bool {
        let is_here = match self.scope {
            Scope::Sitting => true,
            Scope::Track(track) => trial.track == track,
            Scope::Trial(number) => trial.number == number,
        };
        self.subject == subject && trial.phase == Phase::Main && is_here
    }
}

impl Exclusion {
    /// One line for people.
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
    /// Whether there are no rules.
    #[must_use]
    pub fn are_none(&self) -> bool {
        *self == Self::default()
    }

    /// Returns what a rule depends on beside the subject, if it depends on the condition.
    #[must_use]
    pub fn caution(rule: &str) -> Option<&'static str> {
        (rule == "least_movement_mm").then_some(
            "least_movement_mm depends on the stimulus: the same hand moves a stiffer one less, so trials of the stiffest go first",
        )
    }

    /// The rule as the study file has it: `most_false_alarms = 0.5`.
    #[must_use]
    pub fn text_of(&self, rule: &str) -> String {
        let said = serde_json::to_value(self).unwrap_or_default();
        said.get(rule).map_or_else(|| rule.to_owned(), |value| format!("{rule} = {value}"))
    }

    /// The rules by name.
    #[must_use]
    pub fn names(&self) -> Vec<String> {
        let said = serde_json::to_value(self).unwrap_or_default();
        said.as_object().map(|rules| rules.keys().cloned().collect()).unwrap_or_default()
    }
}
