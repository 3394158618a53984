//! The experiments, with every choice in them.
//!
//! A protocol says what is presented; which subject gets what in which order follows from the subject's number and the
//! seed ([`crate::sitting`]).

mod jnd;
mod magnitude;

pub use jnd::{ComparisonSide, JndDemo, JndProtocol, PresentationOrder};
pub use magnitude::{MagnitudeProtocol, RatingScale};

use crate::procedure::InvalidRule;
use crate::trial::Modality;
use serde::{Deserialize, Serialize};

/// What is varied: a parameter of a force model.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Stimulus {
    /// Name of the model in the scene.
    pub model: String,
    /// Id of its parameter.
    pub parameter: String,
}

/// What people are asked about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Quality {
    /// How stiff it is.
    Stiffness,
    /// How strong.
    Force,
}

impl Stimulus {
    /// Name and unit, from the parameter's id, whose unit stands in it: `gamma_n` is gamma in newtons.
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

    /// Returns true where the value is proportional to a stiffness.
    #[must_use]
    pub fn is_stiffness(&self) -> bool {
        self.parameter.starts_with("gamma") || self.parameter.contains("stiffness")
    }

    /// What people are asked about when this is varied: a force where the parameter is one, else stiffness.
    #[must_use]
    pub fn quality(&self) -> Quality {
        if self.parameter.starts_with("force") { Quality::Force } else { Quality::Stiffness }
    }
}

impl Default for Stimulus {
    /// The spring's axial rigidity, as in CMU-RI-TR-07-21.
    fn default() -> Self {
        Self { model: "spring".to_owned(), parameter: "gamma_n".to_owned() }
    }
}

impl std::fmt::Display for Stimulus {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}.{}", self.model, self.parameter)
    }
}

/// Which modality a subject starts with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FirstModality {
    /// Subjects of odd number start with vision and haptics, those of even number with haptics alone.
    #[default]
    BySubjectNumber,
    /// All start with the same.
    Always(Modality),
}

impl FirstModality {
    /// The modality this subject starts with.
    #[must_use]
    pub fn of(self, subject: SubjectNumber) -> Modality {
        match self {
            Self::Always(modality) => modality,
            Self::BySubjectNumber if subject.get() % 2 == 1 => Modality::Vh,
            Self::BySubjectNumber => Modality::H,
        }
    }
}

/// What happens when the handle was pushed out of its range during a trial.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AtBoundary {
    /// The trial is presented again, up to so many times; its answer counts only then.
    Repeat {
        /// Repeats of one trial.
        most: u32,
    },
    /// The answer counts, the hit is noted.
    Keep,
}

impl Default for AtBoundary {
    fn default() -> Self {
        Self::Repeat { most: 3 }
    }
}

/// Trials that check whether a subject does what they are asked; none of them counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Checks {
    /// Pairs without any difference, in each track.
    pub catch: u32,
    /// Pairs of the track presented once more in the same order, in each track.
    pub repeats: u32,
    /// Pairs with a difference that everybody feels, in each track.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub obvious: Option<ObviousPairs>,
}

/// Pairs with a difference that everybody feels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ObviousPairs {
    /// Pairs in each track.
    pub count: u32,
    /// Their difference, as a share of the base.
    pub delta: f64,
}

impl Checks {
    /// Whether there are none, as in protocols from before there were any.
    #[must_use]
    pub fn are_none(&self) -> bool {
        *self == Self::default()
    }

    /// Checks in a track.
    #[must_use]
    pub fn in_a_track(self) -> u32 {
        self.catch + self.repeats + self.obvious.map_or(0, |pairs| pairs.count)
    }
}

/// Number of a subject, from 1: all that is known of a person here.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "u16", into = "u16")]
pub struct SubjectNumber(u16);

impl SubjectNumber {
    /// Largest number; three digits in file names.
    pub const MOST: u16 = 999;

    /// A number from 1 to 999.
    #[must_use]
    pub fn new(number: u16) -> Option<Self> {
        (1..=Self::MOST).contains(&number).then_some(Self(number))
    }

    /// The number.
    #[must_use]
    pub fn get(self) -> u16 {
        self.0
    }
}

impl TryFrom<u16> for SubjectNumber {
    type Error = String;

    fn try_from(number: u16) -> Result<Self, String> {
        Self::new(number).ok_or_else(|| format!("subject number {number}: must be 1 to {}", Self::MOST))
    }
}

impl From<SubjectNumber> for u16 {
    fn from(number: SubjectNumber) -> Self {
        number.0
    }
}

impl std::fmt::Display for SubjectNumber {
    /// As in file names: `sub-07`.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "sub-{:02}", self.0)
    }
}

/// An experiment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "task", rename_all = "kebab-case")]
pub enum Protocol {
    /// Just noticeable difference.
    Jnd(JndProtocol),
    /// Magnitude estimation.
    Magnitude(MagnitudeProtocol),
}

/// A protocol that cannot be carried out.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ProtocolError {
    /// A list that may not be.
    #[error("{list} is empty; give at least one value")]
    Empty {
        /// Which.
        list: &'static str,
    },
    /// A value that may not be.
    #[error("{what} {value}: {legal}")]
    Value {
        /// Which.
        what: &'static str,
        /// Its value.
        value: f64,
        /// What is legal.
        legal: &'static str,
    },
    /// A setting of the procedure.
    #[error(transparent)]
    Rule(#[from] InvalidRule),
    /// Stimuli outside the range the model declares.
    #[error(
        "stimulus {stimulus} = {value} is outside its range {least} to {most}; change the values or the difference"
    )]
    Range {
        /// What is varied.
        stimulus: String,
        /// The value outside.
        value: f64,
        /// Smallest legal.
        least: f64,
        /// Largest legal.
        most: f64,
    },
}

impl Protocol {
    /// Word of the task in file names.
    #[must_use]
    pub fn task(&self) -> &'static str {
        match self {
            Self::Jnd(_) => "jnd",
            Self::Magnitude(_) => "magnitude",
        }
    }

    /// The levels of the stimulus that are analysed: bases, or stimuli rated.
    #[must_use]
    pub fn levels(&self) -> &[f64] {
        match self {
            Self::Jnd(protocol) => &protocol.bases,
            Self::Magnitude(protocol) => &protocol.values,
        }
    }

    /// What is varied.
    #[must_use]
    pub fn stimulus(&self) -> &Stimulus {
        match self {
            Self::Jnd(protocol) => &protocol.stimulus,
            Self::Magnitude(protocol) => &protocol.stimulus,
        }
    }

    /// What happens when the handle leaves its range.
    #[must_use]
    pub fn at_boundary(&self) -> AtBoundary {
        match self {
            Self::Jnd(protocol) => protocol.at_boundary,
            Self::Magnitude(protocol) => protocol.at_boundary,
        }
    }

    /// Which modality comes first.
    #[must_use]
    pub fn first_modality(&self) -> FirstModality {
        match self {
            Self::Jnd(protocol) => protocol.first_modality,
            Self::Magnitude(protocol) => protocol.first_modality,
        }
    }

    /// Presentations of a sitting, about: adaptive tracks take more or fewer.
    #[must_use]
    pub fn presentations_about(&self) -> u64 {
        match self {
            Self::Jnd(protocol) => protocol.presentations_about(),
            Self::Magnitude(protocol) => protocol.presentations(),
        }
    }

    /// Stimuli of one presentation.
    #[must_use]
    pub fn stimuli_in_a_trial(&self) -> f64 {
        match self {
            Self::Jnd(_) => 2.0,
            Self::Magnitude(_) => 1.0,
        }
    }

    /// Whether it can be carried out at all.
    ///
    /// # Errors
    /// The first thing that cannot be.
    pub fn check(&self) -> Result<(), ProtocolError> {
        match self {
            Self::Jnd(protocol) => protocol.check(),
            Self::Magnitude(protocol) => protocol.check(),
        }
    }

    /// Whether there are trials that check the subject.
    #[must_use]
    pub fn has_checks(&self) -> bool {
        match self {
            Self::Jnd(protocol) => !protocol.checks.are_none(),
            Self::Magnitude(protocol) => protocol.repeat_checks > 0,
        }
    }

    /// Smallest and largest stimulus that may be presented.
    #[must_use]
    pub fn extremes(&self) -> [f64; 2] {
        match self {
            Self::Jnd(protocol) => protocol.extremes(),
            Self::Magnitude(protocol) => protocol.extremes(),
        }
    }

    /// Whether all stimuli lie in the range of the parameter.
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
        Err(ProtocolError::Value { what, value: *value, legal: "must be a finite number above 0, each once" })
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
