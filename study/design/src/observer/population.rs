//! Distribution of simulated subjects of a designed study.

use crate::design::Design;
use crate::error::DesignError;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Distribution of simulated subjects of a designed study, table `[simulated]` of a study file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Population {
    /// Threshold of a choice at 75 %, on the scale of the levels; of a detection, the level with a sensitivity d' of 1.
    pub threshold: f64,
    /// Criterion for "I don't know", in standard deviations of the noise.
    pub unsure_criterion: f64,
    /// Evidence above which a signal is reported, in standard deviations of the noise.
    pub yes_criterion: f64,
    /// Bias to the second interval, in standard deviations of the noise.
    pub bias: f64,
    /// Share of trials answered by chance.
    pub lapse: f64,
    /// Spread between subjects: of the logarithm of the threshold, of a rating in steps, of the logarithm of a magnitude.
    pub subject_spread: f64,
    /// Additional spread between the conditions of a subject.
    pub condition_spread: f64,
    /// Noise of a rating in steps of the scale, or of the logarithm of a magnitude.
    pub noise: f64,
    /// Change of a rating with the level of the stimulus, in steps of the scale for each unit of the level.
    pub slope: f64,
    /// Effect of each level of a factor: a factor of the threshold or of the magnitude, or an addition to the rating in steps.
    pub effect: BTreeMap<String, Vec<f64>>,
}

impl Default for Population {
    /// Returns people who compare stiffness: a threshold of 14 % with a spread of a fifth.
    fn default() -> Self {
        Self {
            threshold: 0.14,
            unsure_criterion: 0.5,
            yes_criterion: 0.5,
            bias: 0.0,
            lapse: 0.02,
            subject_spread: 0.2,
            condition_spread: 0.1,
            noise: 0.7,
            slope: 5.0,
            effect: BTreeMap::new(),
        }
    }
}

impl Population {
    /// Checks the table against a design.
    ///
    /// # Errors
    /// The first wrong key.
    pub fn check(&self, design: &Design) -> Result<(), DesignError> {
        let Self { threshold, lapse, subject_spread, condition_spread, noise, .. } = self;
        if !(*threshold > 0.0 && threshold.is_finite()) {
            return Err(DesignError::new(
                "simulated.threshold",
                &format!("{threshold}: write a number above 0"),
            ));
        }
        if !(0.0..1.0).contains(lapse) {
            return Err(DesignError::new(
                "simulated.lapse",
                &format!("{lapse}: write a share from 0 to below 1"),
            ));
        }
        for (key, value) in [
            ("simulated.subject_spread", subject_spread),
            ("simulated.condition_spread", condition_spread),
            ("simulated.noise", noise),
        ] {
            if !(*value >= 0.0 && value.is_finite()) {
                return Err(DesignError::new(key, &format!("{value}: write a number of 0 or above")));
            }
        }
        for (name, effects) in &self.effect {
            let key = format!("simulated.effect.{name}");
            let factor = design.factors().iter().find(|factor| factor.name == *name);
            let Some(factor) = factor else {
                return Err(DesignError::new(&key, "there is no such factor; write the name of a factor"));
            };
            let (given, levels) = (effects.len(), factor.values.len());
            if given != levels {
                let problem = format!("{given} effects for {levels} levels; write one for each");
                return Err(DesignError::new(&key, &problem));
            }
            if effects.iter().any(|effect| !effect.is_finite()) {
                return Err(DesignError::new(&key, "an effect is not finite; write finite numbers"));
            }
        }
        Ok(())
    }
}
