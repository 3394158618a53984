//! Difference experiment (just noticeable difference, JND): pairs of stimuli, with an adaptive track for each base in each
//! replication.

use super::{
    AtBoundary, Checks, FirstModality, ProtocolError, Stimulus, at_least_one, extremes,
    positive_and_different,
};
use flotor_study_design::procedure::{InvalidRule, Procedure};
use serde::{Deserialize, Serialize};

/// Side of the base on which the comparison lies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum ComparisonSide {
    /// Above the base
    #[default]
    Above,
    /// Below the base
    Below,
    /// Drawn for each trial
    Random,
}

/// Order of presentation within a pair.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum PresentationOrder {
    /// Drawn for each trial
    #[default]
    Random,
    /// The base first
    BaseFirst,
    /// The comparison first
    ComparisonFirst,
}

/// Demonstration before the first trial, in each modality: three pairs of four stimuli, which show the range of bases and the
/// kinds of difference (large, close, nearly equal).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct JndDemo {
    /// True if the demonstration is presented.
    pub shown: bool,
    /// Small but noticeable difference, as a fraction of the larger stimulus.
    pub close: f64,
    /// Barely noticeable difference, as a fraction of the larger stimulus.
    pub nearly_equal: f64,
}

impl Default for JndDemo {
    /// Returns a difference slightly above the Weber fractions of the thesis, and about a fifth of them; the thesis gives only
    /// the kinds of difference.
    fn default() -> Self {
        Self { shown: true, close: 0.20, nearly_equal: 0.03 }
    }
}

/// Settings of a just-noticeable-difference experiment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JndProtocol {
    /// Varied parameter.
    pub stimulus: Stimulus,
    /// Bases, in the stimulus's unit.
    pub bases: Vec<f64>,
    /// Number of replications. A replication has one track for each base, in one modality; the modality alternates.
    pub replications: u32,
    /// Rule for the first modality.
    pub first_modality: FirstModality,
    /// Adaptive procedure.
    pub procedure: Procedure,
    /// Side of the comparison.
    pub side: ComparisonSide,
    /// Order within a pair.
    pub order: PresentationOrder,
    /// Action when the handle leaves its range.
    pub at_boundary: AtBoundary,
    /// Practice before the first trial.
    pub demo: JndDemo,
    /// Numbers of check trials in each track.
    #[serde(default, skip_serializing_if = "Checks::are_none")]
    pub checks: Checks,
}

impl Default for JndProtocol {
    /// Returns the settings of CMU-RI-TR-07-21, section 4.2.
    fn default() -> Self {
        Self {
            stimulus: Stimulus::default(),
            bases: vec![17.0, 26.0, 35.0],
            replications: 4,
            first_modality: FirstModality::default(),
            procedure: Procedure::default(),
            side: ComparisonSide::default(),
            order: PresentationOrder::default(),
            at_boundary: AtBoundary::default(),
            demo: JndDemo::default(),
            checks: Checks::default(),
        }
    }
}

impl JndProtocol {
    /// Smallest obvious difference, as a fraction of the base: the first difference of a track in the thesis, more than twice
    /// the mean threshold of its subjects.
    pub const LARGE_DELTA: f64 = 0.4;

    pub(super) fn check(&self) -> Result<(), ProtocolError> {
        positive_and_different("--bases", &self.bases)?;
        at_least_one("--replications", self.replications)?;
        self.procedure.check()?;
        if !self.checks.are_none() && self.procedure.trials_least() < 2 {
            let value = f64::from(self.procedure.trials_least());
            let what = match self.procedure {
                Procedure::WeightedUpDown(_) => "--stop-after",
                Procedure::QuestPlus(_) => "--trials",
            };
            let legal = "must be 2 or more with --catch-trials, --repeat-checks or --obvious-pairs";
            return Err(ProtocolError::Value { what, value, legal });
        }
        if let Some(pairs) = self.checks.obvious {
            at_least_one("--obvious-pairs", pairs.count)?;
            let (least, most) = (Self::LARGE_DELTA, self.procedure.largest_delta());
            if !(least..=most).contains(&pairs.delta) {
                let legal = format!("must be {least} to {most}, the largest difference of a track");
                return Err(InvalidRule::new("--obvious-difference", pairs.delta, legal).into());
            }
        }
        for (what, value) in [("close", self.demo.close), ("nearly equal", self.demo.nearly_equal)] {
            if !(0.0..1.0).contains(&value) {
                return Err(ProtocolError::Value { what, value, legal: "must be a share from 0 to below 1" });
            }
        }
        Ok(())
    }

    /// Returns the smallest and largest value that can be presented.
    pub(super) fn extremes(&self) -> [f64; 2] {
        let [least, most] = extremes(self.bases.iter().copied());
        let delta = self.procedure.largest_delta();
        match self.side {
            ComparisonSide::Above => [least, most * (1.0 + delta)],
            ComparisonSide::Below => [least * (1.0 - delta), most],
            ComparisonSide::Random => [least * (1.0 - delta), most * (1.0 + delta)],
        }
    }

    /// Returns the expected number of presentations, practice and checks included.
    pub(super) fn presentations_about(&self) -> u64 {
        let practice = if self.demo.shown { 6 } else { 0 };
        practice
            + u64::from(self.procedure.trials_about() + self.checks.in_a_track())
                * u64::from(self.replications)
                * self.bases.len() as u64
    }

    /// Returns the four stimuli of the demonstration: lowest base, highest base, a stimulus close to the highest base, and a
    /// stimulus nearly equal to the third.
    #[must_use]
    pub fn demo_values(&self) -> [f64; 4] {
        let [least, most] = extremes(self.bases.iter().copied());
        let close = most * (1.0 - self.demo.close);
        [least, most, close, close * (1.0 - self.demo.nearly_equal)]
    }
}
