//! Settings of the experiments.
//!
//! A protocol defines the stimuli; the order for each subject follows from the subject's number and the seed
//! ([`crate::sitting`]).

mod jnd;
mod magnitude;

pub use flotor_study_design::subject::SubjectNumber;
pub use jnd::{ComparisonSide, JndDemo, JndProtocol, PresentationOrder};
pub use magnitude::{MagnitudeProtocol, RatingScale};

use crate::trial::Modality;
use flotor_study_design::procedure::InvalidRule;
use serde::{Deserialize, Serialize};

/// Varied parameter of a force model.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Stimulus {
    /// Name of the model in the scene.
    pub model: String,
    /// Id of the model's parameter.
    pub parameter: String,
}

/// Quality of the stimulus that the subject judges.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Quality {
    /// Stiffness of the object.
    Stiffness,
    /// Strength of the force.
    Force,
}

impl Stimulus {
    /// Returns name and unit, from the unit suffix of the parameter's id (`gamma_n`: `gamma`, `N`); the unit is empty without a
    /// known suffix.
    #[must_use]
    pub fn name_and_unit(&self) -> (String, &'static str) {
        const UNITS: [(&str, &str); 9] = [
            ("_n_per_m", "N/m"),
            ("_ns_per_m", "N s/m"),
            ("_n_mm2", "N mm²"),
            ("_mm2", "mm²"),
            ("_mpa", "MPa"),
            ("_mm", "mm"),
            ("_nm", "N m"),
            ("_kg", "kg"),
            ("_n", "N"),
        ];
        let found = UNITS.iter().find_map(|(end, unit)| Some((self.parameter.strip_suffix(end)?, *unit)));
        let (name, unit) = found.unwrap_or((&self.parameter, ""));
        (name.replace('_', " "), unit)
    }

    /// Returns true if, by its id, the parameter is proportional to a stiffness.
    #[must_use]
    pub fn is_stiffness(&self) -> bool {
        self.parameter.starts_with("gamma") || self.parameter.contains("stiffness")
    }

    /// Returns the judged quality: force if the parameter's id begins with `force`, else stiffness.
    #[must_use]
    pub fn quality(&self) -> Quality {
        if self.parameter.starts_with("force") { Quality::Force } else { Quality::Stiffness }
    }
}

impl Default for Stimulus {
    /// Returns the spring's axial rigidity, as in CMU-RI-TR-07-21.
    fn default() -> Self {
        Self { model: "spring".to_owned(), parameter: "gamma_n".to_owned() }
    }
}

impl std::fmt::Display for Stimulus {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}.{}", self.model, self.parameter)
    }
}

/// Rule for the first modality of a subject.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FirstModality {
    /// Odd subject numbers start with vision and haptics, even ones with haptics alone.
    #[default]
    BySubjectNumber,
    /// All subjects start with the same modality.
    Always(Modality),
}

impl FirstModality {
    /// Returns the first modality of a subject.
    #[must_use]
    pub fn of(self, subject: SubjectNumber) -> Modality {
        match self {
            Self::Always(modality) => modality,
            Self::BySubjectNumber if subject.get() % 2 == 1 => Modality::Vh,
            Self::BySubjectNumber => Modality::H,
        }
    }
}

/// Action when the handle was pushed out of its range during a trial.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AtBoundary {
    /// Presents the trial again, up to `most` times; earlier answers do not count.
    Repeat {
        /// Maximum number of repeats of one trial.
        most: u32,
    },
    /// Counts the answer and logs that the handle left its range.
    Keep,
}

impl Default for AtBoundary {
    fn default() -> Self {
        Self::Repeat { most: 3 }
    }
}

/// Numbers of check trials, which test the subject's attention; their answers do not count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Checks {
    /// Number of catch trials (pairs of equal stimuli) per track.
    pub catch: u32,
    /// Number of pairs per track that are presented again in the same order.
    pub repeats: u32,
    /// Pairs with an obvious difference; `None` without them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub obvious: Option<ObviousPairs>,
}

/// Pairs with an obvious difference.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ObviousPairs {
    /// Number of pairs per track.
    pub count: u32,
    /// Difference, as a fraction of the base.
    pub delta: f64,
}

impl Checks {
    /// Returns true if there are no checks, as in protocols of earlier versions.
    #[must_use]
    pub fn are_none(&self) -> bool {
        *self == Self::default()
    }

    /// Returns the number of checks per track.
    #[must_use]
    pub fn in_a_track(self) -> u32 {
        self.catch + self.repeats + self.obvious.map_or(0, |pairs| pairs.count)
    }
}

/// Experiment with its settings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "task", rename_all = "kebab-case")]
pub enum Protocol {
    /// Difference experiment (just noticeable difference, JND).
    Jnd(JndProtocol),
    /// Magnitude estimation experiment.
    Magnitude(MagnitudeProtocol),
}

/// Invalid setting of a protocol.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ProtocolError {
    /// A list of values is empty.
    #[error("{list} is empty; give at least one value")]
    Empty {
        /// Command-line option of the list.
        list: &'static str,
    },
    /// A value is invalid.
    #[error("{what} {value}: {legal}")]
    Value {
        /// Command-line option or name of the value.
        what: &'static str,
        /// Rejected value.
        value: f64,
        /// Description of the legal values.
        legal: &'static str,
    },
    /// Invalid setting of the procedure.
    #[error(transparent)]
    Rule(#[from] InvalidRule),
    /// A stimulus is outside the range of the model's parameter.
    #[error(
        "stimulus {stimulus} = {value} is outside its range {least} to {most}; choose other --bases or a \
         smaller --ceiling (weighted up-down), or, for ratings, another --range"
    )]
    Range {
        /// The varied parameter.
        stimulus: String,
        /// Value outside the range.
        value: f64,
        /// Smallest legal value.
        least: f64,
        /// Largest legal value.
        most: f64,
    },
}

impl Protocol {
    /// Returns the task label for file names and results.
    #[must_use]
    pub fn task(&self) -> &'static str {
        match self {
            Self::Jnd(_) => "jnd",
            Self::Magnitude(_) => "magnitude",
        }
    }

    /// Returns the analysed levels of the stimulus: bases, or rated stimuli.
    #[must_use]
    pub fn levels(&self) -> &[f64] {
        match self {
            Self::Jnd(protocol) => &protocol.bases,
            Self::Magnitude(protocol) => &protocol.values,
        }
    }

    /// Returns the varied parameter.
    #[must_use]
    pub fn stimulus(&self) -> &Stimulus {
        match self {
            Self::Jnd(protocol) => &protocol.stimulus,
            Self::Magnitude(protocol) => &protocol.stimulus,
        }
    }

    /// Returns the action when the handle leaves its range.
    #[must_use]
    pub fn at_boundary(&self) -> AtBoundary {
        match self {
            Self::Jnd(protocol) => protocol.at_boundary,
            Self::Magnitude(protocol) => protocol.at_boundary,
        }
    }

    /// Returns the rule for the first modality.
    #[must_use]
    pub fn first_modality(&self) -> FirstModality {
        match self {
            Self::Jnd(protocol) => protocol.first_modality,
            Self::Magnitude(protocol) => protocol.first_modality,
        }
    }

    /// Returns the expected number of presentations in a sitting; the number varies with the length of adaptive tracks.
    #[must_use]
    pub fn presentations_about(&self) -> u64 {
        match self {
            Self::Jnd(protocol) => protocol.presentations_about(),
            Self::Magnitude(protocol) => protocol.presentations(),
        }
    }

    /// Returns the number of stimuli per presentation.
    #[must_use]
    pub fn stimuli_in_a_trial(&self) -> f64 {
        match self {
            Self::Jnd(_) => 2.0,
            Self::Magnitude(_) => 1.0,
        }
    }

    /// Checks the settings.
    ///
    /// # Errors
    /// The first invalid setting.
    pub fn check(&self) -> Result<(), ProtocolError> {
        match self {
            Self::Jnd(protocol) => protocol.check(),
            Self::Magnitude(protocol) => protocol.check(),
        }
    }

    /// Returns true if the protocol has check trials.
    #[must_use]
    pub fn has_checks(&self) -> bool {
        match self {
            Self::Jnd(protocol) => !protocol.checks.are_none(),
            Self::Magnitude(protocol) => protocol.repeat_checks > 0,
        }
    }

    /// Returns the smallest and largest stimulus that may be presented.
    #[must_use]
    pub fn extremes(&self) -> [f64; 2] {
        match self {
            Self::Jnd(protocol) => protocol.extremes(),
            Self::Magnitude(protocol) => protocol.extremes(),
        }
    }

    /// Checks that all stimuli lie in the range of the parameter.
    ///
    /// # Errors
    /// [`ProtocolError::Range`] with the first value outside.
    pub fn check_range(&self, least: f64, most: f64) -> Result<(), ProtocolError> {
        let outside = self.extremes().into_iter().find(|value| !(least..=most).contains(value));
        outside.map_or(Ok(()), |value| {
            Err(ProtocolError::Range { stimulus: self.stimulus().to_string(), value, least, most })
        })
    }
}

fn positive_and_different(what: &'static str, values: &[f64]) -> Result<(), ProtocolError> {
    if values.is_empty() {
        return Err(ProtocolError::Empty { list: what });
    }
    let is_right = |value: f64| {
        value.is_finite() && value > 0.0 && values.iter().filter(|other| **other == value).count() == 1
    };
    let wrong = values.iter().find(|value| !is_right(**value));
    wrong.map_or(Ok(()), |value| {
        Err(ProtocolError::Value {
            what,
            value: *value,
            legal: "must be finite, above 0 and different from the others",
        })
    })
}

fn at_least_one(what: &'static str, number: u32) -> Result<(), ProtocolError> {
    if number > 0 {
        Ok(())
    } else {
        Err(ProtocolError::Value { what, value: 0.0, legal: "must be 1 or more" })
    }
}

fn extremes(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[least, most], value| [least.min(value), most.max(value)])
}
