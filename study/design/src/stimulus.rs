//! Stimulus: the setting that varies within a trial, or from trial to trial within a condition.

use crate::value::{Setting, Value};
use serde::{Deserialize, Serialize};

/// Stimulus of a design: a setting of the scene, and its values in the intervals of a trial.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "StimulusTable", into = "StimulusTable")]
pub enum Stimulus {
    /// Numbers: a standard, and comparisons or signals at levels.
    Graded {
        /// Setting of the scene.
        setting: Setting,
        /// Value without a difference, in the unit of the setting.
        standard: Standard,
        /// Scale of the levels.
        scale: Scale,
        /// Side of the standard on which the levels lie.
        side: Side,
    },
    /// Two choices, such as `on` and `off`.
    Categorical {
        /// Setting of the scene.
        setting: Setting,
        /// Value of the signal or the comparison.
        present: Value,
        /// Value without the signal, or of the standard.
        absent: Value,
    },
}

/// Value without a difference.
#[derive(Clone, Debug, PartialEq)]
pub enum Standard {
    /// Number in the unit of the setting.
    Number(f64),
    /// Level of the factor of this name.
    Factor(String),
}

/// Scale of levels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scale {
    /// Share of the standard: standard (1 + level).
    #[default]
    Share,
    /// Difference in the unit of the setting: standard + level.
    Difference,
}

/// Side of the standard on which positive levels lie.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Side {
    /// Above the standard.
    #[default]
    Above,
    /// Below the standard.
    Below,
}

impl Stimulus {
    /// Returns the setting.
    #[must_use]
    pub fn setting(&self) -> &Setting {
        match self {
            Self::Graded { setting, .. } | Self::Categorical { setting, .. } => setting,
        }
    }
}

impl Scale {
    /// Returns the value at a level, in the unit of the standard.
    #[must_use]
    pub fn value(self, standard: f64, side: Side, level: f64) -> f64 {
        let level = match side {
            Side::Above => level,
            Side::Below => -level,
        };
        match self {
            Self::Share => standard * (1.0 + level),
            Self::Difference => standard + level,
        }
    }
}

/// Table of a stimulus in a study file.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StimulusTable {
    setting: Setting,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    standard: Option<Value>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    scale: Option<Scale>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    side: Option<Side>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    present: Option<Value>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    absent: Option<Value>,
}

impl TryFrom<StimulusTable> for Stimulus {
    type Error = String;

    fn try_from(table: StimulusTable) -> Result<Self, String> {
        let StimulusTable { setting, standard, scale, side, present, absent } = table;
        match (standard, present, absent) {
            (Some(standard), None, None) => {
                let standard = match standard {
                    Value::Number(number) => Standard::Number(number),
                    Value::Choice(factor) => Standard::Factor(factor),
                };
                let (scale, side) = (scale.unwrap_or_default(), side.unwrap_or_default());
                Ok(Self::Graded { setting, standard, scale, side })
            }
            (None, Some(present), Some(absent)) if scale.is_none() && side.is_none() => {
                Ok(Self::Categorical { setting, present, absent })
            }
            (None, Some(_), Some(_)) => {
                Err("stimulus: `scale` and `side` belong to a `standard`; remove them".to_owned())
            }
            _ => Err("stimulus: write `standard` (a number or a factor), or both `present` and `absent`"
                .to_owned()),
        }
    }
}

impl From<Stimulus> for StimulusTable {
    fn from(stimulus: Stimulus) -> Self {
        let none =
            |setting| Self { setting, standard: None, scale: None, side: None, present: None, absent: None };
        match stimulus {
            Stimulus::Graded { setting, standard, scale, side } => {
                let standard = match standard {
                    Standard::Number(number) => Value::Number(number),
                    Standard::Factor(factor) => Value::Choice(factor),
                };
                Self { standard: Some(standard), scale: Some(scale), side: Some(side), ..none(setting) }
            }
            Stimulus::Categorical { setting, present, absent } => {
                Self { present: Some(present), absent: Some(absent), ..none(setting) }
            }
        }
    }
}
