//! Statistics of the perception experiments: numbers in, numbers out. Knows neither trials nor devices.
//!
//! - [`describe`]: means, deviations, confidence intervals.
//! - [`t_test`]: one sample, pairs, two groups (Welch, Student).
//! - [`regression`]: a straight line.
//! - [`anova`]: analysis of variance with factors between and within subjects, sums of squares of type II and III,
//!   corrections for lack of sphericity.
//! - [`trend`]: the linear part of an effect within subjects.
//! - [`effect_size`], [`multiple`]: sizes of effects with intervals; corrections for several tests.
//! - [`quadrature`]: integrals and quantiles of a density.
//! - [`distribution`]: normal, Student's t, Fisher's F. A p-value is computed as the tail it is, never as one minus
//!   the rest, so that it has its digits however small it is.
//!
//! A number that data do not give is an [`Outcome`] with its reason, and the others stay.
//!
//! Every result is compared with R or with the certified values of NIST to 1e-9, relative (`tests/`). Nothing here
//! is real-time.

pub mod anova;
pub mod describe;
pub mod distribution;
pub mod effect_size;
mod linear;
pub mod multiple;
pub mod quadrature;
pub mod regression;
mod special;
pub mod t_test;
pub mod trend;

use serde::Serialize;

/// Why a number cannot be had.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum StatisticsError {
    /// There are fewer numbers than the result needs.
    #[error("{what} needs at least {needed} {unit}, there are {found}")]
    TooFew {
        /// The result.
        what: &'static str,
        /// What there is too little of.
        unit: &'static str,
        /// How many it takes.
        needed: usize,
        /// How many there are.
        found: usize,
    },
    /// A number is NaN or infinite.
    #[error("{what}: value {index} is not finite")]
    NotFinite {
        /// The result.
        what: &'static str,
        /// Which value, counted from 0.
        index: usize,
    },
    /// Lists that belong together differ in length.
    #[error("{what}: {left} values on one side, {right} on the other")]
    Lengths {
        /// The result.
        what: &'static str,
        /// Length of the first list.
        left: usize,
        /// Length of the second.
        right: usize,
    },
    /// Without variation there is nothing to compare with.
    #[error("{what}: the values do not vary")]
    Constant {
        /// The result.
        what: &'static str,
    },
    /// Pairs that are equal in every subject.
    #[error("no difference in any subject")]
    NoDifference,
    /// Differences without variation between subjects.
    #[error("the same difference in every subject")]
    SameDifference,
    /// Means without variation.
    #[error("equal means at all levels")]
    EqualMeans,
    /// An effect in subjects that do not differ in it.
    #[error("no variation between subjects to test it against")]
    NoError,
    /// Responses from which scaling has removed an effect and its error.
    #[error("scaling of the responses removes the effect")]
    NothingLeft,
    /// A design of an analysis of variance that cannot be analysed.
    #[error("analysis of variance: {0}")]
    Design(String),
}

/// A statistic, or the reason why the data give none. One that cannot be computed takes no other away.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Outcome<T> {
    /// The statistic.
    Tested(T),
    /// None, for a reason.
    NotTestable {
        /// The reason.
        #[serde(serialize_with = "as_text")]
        not_testable: StatisticsError,
    },
}

impl<T> Outcome<T> {
    /// Returns the statistic, if there is one.
    pub fn tested(&self) -> Option<&T> {
        self.result().ok()
    }

    /// Returns the statistic or the reason.
    ///
    /// # Errors
    /// The reason why there is no statistic.
    pub fn result(&self) -> Result<&T, &StatisticsError> {
        match self {
            Self::Tested(tested) => Ok(tested),
            Self::NotTestable { not_testable } => Err(not_testable),
        }
    }

    /// Describes the outcome: the statistic in words of its own, or "not testable" with the reason.
    pub fn to_text(&self, text: impl FnOnce(&T) -> String) -> String {
        self.result().map_or_else(not_testable_text, text)
    }

    /// Converts the statistic.
    pub fn map<U>(self, of: impl FnOnce(T) -> U) -> Outcome<U> {
        match self {
            Self::Tested(tested) => Outcome::Tested(of(tested)),
            Self::NotTestable { not_testable } => Outcome::NotTestable { not_testable },
        }
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

/// Describes a statistic that could not be computed.
#[must_use]
pub fn not_testable_text(reason: &StatisticsError) -> String {
    format!("not testable: {reason}")
}

fn as_text<S: serde::Serializer>(reason: &StatisticsError, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(reason)
}

/// Squares below this share of those of the responses are rounding errors, whose relative size is 1e-16.
const ROUNDING: f64 = 1.0e-20;

/// All of a list is finite, and there is enough of it.
fn check(what: &'static str, values: &[f64], needed: usize) -> Result<(), StatisticsError> {
    if let Some(index) = values.iter().position(|value| !value.is_finite()) {
        return Err(StatisticsError::NotFinite { what, index });
    }
    if values.len() < needed {
        return Err(StatisticsError::TooFew { what, unit: "values", needed, found: values.len() });
    }
    Ok(())
}

/// A count as a number; counts here are far below 2^53.
fn count(n: usize) -> f64 {
    n as f64
}
