//! Statistics for the perception experiments: pure numerics, independent of trials and devices.
//!
//! - [`describe`]: means, standard deviations, confidence intervals.
//! - [`t_test`]: one sample, pairs, two groups (Welch, Student).
//! - [`regression`]: straight line by least squares.
//! - [`anova`]: analysis of variance with factors between and within subjects, sums of squares of type II and III,
//!   corrections for lack of sphericity.
//! - [`trend`]: linear trend of an effect within subjects.
//! - [`rank`]: tests by ranks (Wilcoxon, Friedman, Kruskal and Wallis).
//! - [`probit`]: psychometric function of counts; [`detection`]: sensitivity and criterion of yes/no answers.
//! - [`effect_size`], [`multiple`]: effect sizes with intervals; corrections for multiple tests.
//! - [`quadrature`]: integrals and quantiles of a density.
//! - [`distribution`]: normal, Student's t, Fisher's F, chi-square. A small p-value is computed directly as a tail, not as one minus the
//!   other tail, so that it keeps its relative precision.
//!
//! A statistic that the data cannot give is an [`Outcome`] with the reason; other results are unaffected.
//!
//! Every result is compared with R or with the certified values of NIST to 1e-9, relative (`tests/`). Nothing here
//! is real-time.

pub mod anova;
pub mod describe;
pub mod detection;
pub mod distribution;
pub mod effect_size;
mod linear;
pub mod multiple;
pub mod probit;
pub mod quadrature;
pub mod rank;
pub mod regression;
mod special;
pub mod t_test;
pub mod trend;

use serde::Serialize;

/// Reason why a statistic cannot be computed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum StatisticsError {
    /// Too few values for the result.
    #[error("{what} needs at least {needed} {unit}, but has {found}")]
    TooFew {
        /// Name of the result.
        what: &'static str,
        /// Unit of the counts.
        unit: &'static str,
        /// Required number.
        needed: usize,
        /// Available number.
        found: usize,
    },
    /// A number is NaN or infinite.
    #[error("{what}: value {} is not finite; correct the value", index + 1)]
    NotFinite {
        /// Name of the result.
        what: &'static str,
        /// Index of the value, from 0.
        index: usize,
    },
    /// Paired lists differ in length.
    #[error("{what}: {left} values are paired with {right}; give equally many")]
    Lengths {
        /// Name of the result.
        what: &'static str,
        /// Length of the first list.
        left: usize,
        /// Length of the second list.
        right: usize,
    },
    /// The values (of a fitted line, the abscissae) do not vary, so the statistic is undefined.
    #[error("{what}: the values do not vary, so the statistic is undefined")]
    Constant {
        /// Name of the result.
        what: &'static str,
    },
    /// Both values of a pair are equal in every subject.
    #[error("no difference in any subject")]
    NoDifference,
    /// The differences of pairs, or the linear contrasts, do not vary between subjects.
    #[error("the same difference in every subject")]
    SameDifference,
    /// The means are equal at all levels.
    #[error("equal means at all levels")]
    EqualMeans,
    /// The effect does not vary between subjects, so the error sum of squares is zero.
    #[error("no variation between subjects, which the test requires")]
    NoError,
    /// Neither the effect nor its error varies, for example after division of the responses by each subject's mean.
    #[error("scaling of the responses removes the effect")]
    RemovedByScaling,
    /// The answers change from none to all at one level, so that no finite slope fits best.
    #[error("the answers change from none to all between two levels; add levels between them, or trials")]
    Separated,
    /// The share of positive answers does not rise with the level.
    #[error("the share of positive answers does not rise with the level")]
    NotRising,
    /// All values are tied or all differences are 0, so that ranks carry no information.
    #[error("all values are tied")]
    Tied,
    /// The design of an analysis of variance is invalid.
    #[error("analysis of variance: {0}")]
    Design(String),
}

impl Serialize for StatisticsError {
    /// Writes the error as its text.
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// Statistic, or the reason why it cannot be computed. A missing statistic does not affect others.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Outcome<T> {
    /// Computed statistic.
    Tested(T),
    /// No statistic.
    NotTestable {
        /// Reason for the missing statistic.
        not_testable: StatisticsError,
    },
}

impl<T> Outcome<T> {
    /// Returns the statistic; `None` if it could not be computed.
    pub fn tested(&self) -> Option<&T> {
        self.result().ok()
    }

    /// Returns the statistic or the reason for its absence.
    ///
    /// # Errors
    /// The reason for the missing statistic.
    pub fn result(&self) -> Result<&T, &StatisticsError> {
        match self {
            Self::Tested(tested) => Ok(tested),
            Self::NotTestable { not_testable } => Err(not_testable),
        }
    }

    /// Formats the statistic with `text`; if it is missing, returns `not testable: ` and the reason.
    pub fn to_text(&self, text: impl FnOnce(&T) -> String) -> String {
        self.result().map_or_else(not_testable_text, text)
    }
}

impl<T> From<Result<T, StatisticsError>> for Outcome<T> {
    fn from(result: Result<T, StatisticsError>) -> Self {
        match result {
            Ok(tested) => Self::Tested(tested),
            Err(not_testable) => Self::NotTestable { not_testable },
        }
    }
}

/// Formats the reason for a missing statistic: `not testable: ` and the reason.
#[must_use]
pub fn not_testable_text(reason: &StatisticsError) -> String {
    format!("not testable: {reason}")
}

/// Fraction of the sum of squared responses below which a sum of squares counts as zero. Relative rounding errors are about
/// 1e-16, their squares about 1e-32.
const ROUNDING: f64 = 1.0e-20;

/// Checks that all values are finite and that there are at least `needed`.
fn check(what: &'static str, values: &[f64], needed: usize) -> Result<(), StatisticsError> {
    if let Some(index) = values.iter().position(|value| !value.is_finite()) {
        return Err(StatisticsError::NotFinite { what, index });
    }
    if values.len() < needed {
        return Err(StatisticsError::TooFew { what, unit: "values", needed, found: values.len() });
    }
    Ok(())
}

/// Checks that two paired lists have the same length.
fn check_lengths(what: &'static str, left: usize, right: usize) -> Result<(), StatisticsError> {
    if left == right { Ok(()) } else { Err(StatisticsError::Lengths { what, left, right }) }
}

/// Converts a count to `f64`; counts are far below 2^53.
fn count(n: usize) -> f64 {
    n as f64
}
