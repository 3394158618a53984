//! Magnitude estimation with free modulus: single stimuli, each rated with any positive number.

use super::{
    AtBoundary, FirstModality, ProtocolError, Stimulus, at_least_one, extremes, positive_and_different,
};
use serde::{Deserialize, Serialize};

/// Normalisation of ratings across subjects with different ranges.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum RatingScale {
    /// Ratings divided by the subject's mean rating
    #[default]
    #[value(name = "mean")]
    DividedByMean,
    /// Ratings divided by the subject's geometric mean (modulus equalisation); needs positive ratings
    #[value(name = "geometric-mean")]
    DividedByGeometricMean,
    /// Ratings unchanged
    Raw,
}

/// Settings of a magnitude-estimation experiment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MagnitudeProtocol {
    /// Varied parameter.
    pub stimulus: Stimulus,
    /// Stimuli, in the stimulus's unit.
    pub values: Vec<f64>,
    /// Number of replications in each modality. A replication has all stimuli once, in random order.
    pub replications: u32,
    /// Rule for the first modality.
    pub first_modality: FirstModality,
    /// Number of stimuli demonstrated before each modality, smallest and largest among them.
    pub demo: u32,
    /// Action when the handle leaves its range.
    pub at_boundary: AtBoundary,
    /// Number of stimuli presented again in each replication to check the consistency of ratings; their ratings do not count.
    #[serde(default, skip_serializing_if = "is_0")]
    pub repeat_checks: u32,
}

#[allow(clippy::trivially_copy_pass_by_ref)] // signature required by serde
fn is_0(number: &u32) -> bool {
    *number == 0
}

impl Default for MagnitudeProtocol {
    /// Returns the settings of CMU-RI-TR-07-21, section 4.1.
    fn default() -> Self {
        Self {
            stimulus: Stimulus::default(),
            values: Self::evenly(12.0, 48.0, 12),
            replications: 3,
            first_modality: FirstModality::default(),
            demo: 5,
            at_boundary: AtBoundary::default(),
            repeat_checks: 0,
        }
    }
}

impl MagnitudeProtocol {
    /// Returns `count` evenly spaced values from `first` to `last`; for a count of 1, only `first`.
    #[must_use]
    pub fn evenly(first: f64, last: f64, count: u32) -> Vec<f64> {
        let steps = f64::from(count.saturating_sub(1).max(1));
        (0..count).map(|index| first + (last - first) * f64::from(index) / steps).collect()
    }

    pub(super) fn check(&self) -> Result<(), ProtocolError> {
        positive_and_different("--range", &self.values)?;
        at_least_one("--replications", self.replications)?;
        if self.values.len() < 3 {
            let value = self.values.len() as f64;
            return Err(ProtocolError::Value {
                what: "--stimuli",
                value,
                legal: "must be 3 or more, for the trend",
            });
        }
        Ok(())
    }

    /// Returns the number of presentations in both modalities, demonstration and checks included, repeats after leaving the
    /// range excluded.
    pub(super) fn presentations(&self) -> u64 {
        let one = self.values.len() as u64 + u64::from(self.repeat_checks);
        2 * (u64::from(self.demo) + u64::from(self.replications) * one)
    }

    /// Returns the smallest and largest stimulus.
    pub(super) fn extremes(&self) -> [f64; 2] {
        extremes(self.values.iter().copied())
    }
}
