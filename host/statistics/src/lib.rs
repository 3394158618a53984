//! Statistics of the perception experiments: numbers in, numbers out. Knows neither trials nor devices.
//!
//! - [`describe`]: means, deviations, confidence intervals.
//! - [`t_test`]: one sample, pairs, two groups (Welch, Student).
//! - [`regression`]: a straight line.
//! - [`anova`]: analysis of variance with factors between and within subjects, sums of squares of type II and III,
//!   corrections for lack of sphericity.
//! - [`trend`]: the linear part of an effect within subjects.
//! - [`distribution`]: normal, Student's t, Fisher's F. A p-value is computed as the tail it is, never as one minus
//!   the rest, so that it has its digits however small it is.
//!
//! Every result is compared with R or with the certified values of NIST to 1e-9, relative (`tests/`). Nothing here
//! is real-time.

pub mod anova;
pub mod describe;
pub mod distribution;
pub mod effect_size;
mod linear;
pub mod multiple;
pub mod regression;
mod special;
pub mod t_test;
pub mod trend;

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
    /// A design of an analysis of variance that cannot be analysed.
    #[error("analysis of variance: {0}")]
    Design(String),
}

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
