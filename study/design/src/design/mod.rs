//! Design of a study: factors, stimulus, task, method, blocks and questionnaires.

mod check;
mod draft;

pub use draft::{Blocks, Draft, TrackOrder};

use crate::error::DesignError;
use crate::factor::{Factor, Vary, combinations};
use crate::form::Questionnaire;
use crate::method::Method;
use crate::stimulus::{Standard, Stimulus};
use crate::task::Task;
use crate::value::{Setting, Value};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Values of factors, by name.
pub type Condition = BTreeMap<String, Value>;

/// Checked design.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Draft", into = "Draft")]
pub struct Design(Draft);

impl TryFrom<Draft> for Design {
    type Error = DesignError;

    fn try_from(draft: Draft) -> Result<Self, DesignError> {
        check::draft(&draft)?;
        Ok(Self(draft))
    }
}

impl From<Design> for Draft {
    fn from(design: Design) -> Self {
        design.0
    }
}

impl Design {
    /// Returns the name of the task in file names.
    #[must_use]
    pub fn study(&self) -> &str {
        &self.0.study
    }

    /// Returns the factors in the order of the file.
    #[must_use]
    pub fn factors(&self) -> &[Factor] {
        &self.0.factors
    }

    /// Returns the stimulus; `None` if a trial presents its condition alone.
    #[must_use]
    pub fn stimulus(&self) -> Option<&Stimulus> {
        self.0.stimulus.as_ref()
    }

    /// Returns the question of every trial.
    #[must_use]
    pub fn task(&self) -> &Task {
        &self.0.task
    }

    /// Returns the method.
    #[must_use]
    pub fn method(&self) -> &Method {
        &self.0.method
    }

    /// Returns blocks and sessions.
    #[must_use]
    pub fn blocks(&self) -> &Blocks {
        &self.0.blocks
    }

    /// Returns the questionnaires.
    #[must_use]
    pub fn questionnaires(&self) -> &[Questionnaire] {
        &self.0.questionnaires
    }

    /// Returns all combinations of the levels of the chosen factors, the last one varying fastest.
    fn conditions(&self, is_chosen: impl Fn(&Factor) -> bool) -> Vec<Condition> {
        let chosen: Vec<&Factor> = self.0.factors.iter().filter(|factor| is_chosen(factor)).collect();
        let counts: Vec<usize> = chosen.iter().map(|factor| factor.values.len()).collect();
        let condition = |levels: Vec<usize>| {
            let pairs = chosen.iter().zip(levels);
            pairs
                .filter_map(|(factor, level)| Some((factor.name.clone(), factor.values.get(level)?.clone())))
                .collect()
        };
        combinations(&counts).into_iter().map(condition).collect()
    }

    /// Returns the conditions of the blocks: combinations of the factors that are constant within a block.
    #[must_use]
    pub fn block_conditions(&self) -> Vec<Condition> {
        self.conditions(|factor| self.0.blocks.by.contains(&factor.name))
    }

    /// Returns the conditions within a block: combinations of the factors within subjects that are mixed.
    #[must_use]
    pub fn mixed_conditions(&self) -> Vec<Condition> {
        let by = &self.0.blocks.by;
        self.conditions(|factor| factor.vary == Vary::Within && !by.contains(&factor.name))
    }

    /// Returns all combinations of the factors within subjects, the last one varying fastest.
    #[must_use]
    pub fn within_conditions(&self) -> Vec<Condition> {
        self.conditions(|factor| factor.vary == Vary::Within)
    }

    /// Returns the value of the stimulus's setting at a level in a condition, in the unit of the setting.
    #[must_use]
    pub fn value(&self, condition: &Condition, level: f64) -> Option<Value> {
        match self.0.stimulus.as_ref()? {
            Stimulus::Graded { standard, scale, side, .. } => {
                let standard = match standard {
                    Standard::Number(number) => *number,
                    Standard::Factor(factor) => condition.get(factor)?.number()?,
                };
                Some(Value::Number(scale.value(standard, *side, level)))
            }
            Stimulus::Categorical { present, absent, .. } => {
                Some(if level == 0.0 { absent.clone() } else { present.clone() })
            }
        }
    }

    /// Returns the settings of a condition, in the order of the factors.
    #[must_use]
    pub fn settings(&self, condition: &Condition) -> Vec<(Setting, Value)> {
        let setting = |factor: &Factor| Some((factor.setting.clone()?, condition.get(&factor.name)?.clone()));
        self.0.factors.iter().filter_map(setting).collect()
    }
}
