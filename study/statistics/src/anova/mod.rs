//! Analysis of variance with factors between subjects and within them.
//!
//! The data have one row per subject, with one response per cell of the within-subject factors. Effects within subjects are
//! tested by a multivariate linear model of orthonormal contrasts: the responses of a subject are multiplied by contrasts of
//! the within-subject factors, and the between-subject design explains the products. The sums of squares are traces of the
//! hypothesis and error matrices of that model, as in `car::Anova` of R; they are valid for groups of unequal size, where type
//! II and type III differ:
//!
//! - **Type III**: each effect adjusted for all others, with effects coded to sum to zero.
//! - **Type II**: each effect adjusted for all others that do not contain it.
//!
//! Greenhouse and Geisser's epsilon (1959) and Huynh and Feldt's (1976, with Lecoutre's correction of 1991) scale the degrees
//! of freedom of effects that violate sphericity, because their contrasts have unequal variances or are correlated.

mod design;

pub use design::{BetweenFactor, Design, WithinFactor};

use crate::distribution::fisher_above;
use crate::effect_size::{EffectSize, partial_omega_squared};
use crate::linear::{Basis, Matrix};
use crate::{ROUNDING, StatisticsError, count};
use design::Term;
use serde::Serialize;

/// Type of the sums of squares.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub enum SumOfSquares {
    /// Type II: adjusted for all effects that do not contain the tested one.
    #[serde(rename = "II")]
    Two,
    /// Type III: adjusted for all other effects.
    #[default]
    #[serde(rename = "III")]
    Three,
}

/// Row of the analysis-of-variance table: one effect.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Effect {
    /// Names of the factors, joined by colons: `modality:base`.
    pub effect: String,
    /// Sum of squares of the effect.
    pub sum_of_squares: f64,
    /// Degrees of freedom of the effect.
    pub df: f64,
    /// Sum of squares of the error.
    pub error_sum_of_squares: f64,
    /// Degrees of freedom of the error.
    pub error_df: f64,
    /// F statistic; NaN (`null` in JSON) if the error consists of rounding errors only.
    pub f: f64,
    /// p-value, without sphericity correction; NaN if [`Self::f`] is NaN.
    pub p: f64,
    /// Partial eta squared: fraction of the effect in the sum of squares of effect and error; NaN if [`Self::f`] is NaN. Biased
    /// upwards, unlike [`partial_omega_squared`].
    pub partial_eta_squared: f64,
    /// Partial omega squared with its interval, without sphericity correction; `None` without a test.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub partial_omega_squared: Option<EffectSize>,
    /// Reason for a missing F.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub not_testable: Option<StatisticsError>,
    /// Generalised eta squared: fraction of the effect in the sum of squares of effect and all errors (Olejnik and Algina 2003,
    /// all factors manipulated).
    pub generalised_eta_squared: f64,
    /// Sphericity corrections; `None` for a single within-subject contrast or without a test.
    pub sphericity: Option<Sphericity>,
}

impl Effect {
    /// Returns true if the effect has an F statistic. An effect without error, or removed by scaling of all responses, has
    /// none.
    #[must_use]
    pub fn is_testable(&self) -> bool {
        self.not_testable.is_none()
    }
}

/// Lower limit of the denominator of the Huynh-Feldt epsilon; a smaller difference is rounding error.
const LEAST_LEFT: f64 = 1.0e-9;

/// Sphericity estimates and corrected p-values.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Sphericity {
    /// Greenhouse-Geisser epsilon: 1 if the orthonormal contrasts have equal variances and are uncorrelated (sphericity).
    pub epsilon_gg: f64,
    /// p-value with degrees of freedom scaled by `epsilon_gg` within its limits, one over the number of contrasts and 1.
    pub p_gg: f64,
    /// Huynh-Feldt epsilon (corrected by Lecoutre), which may exceed 1. With a single degree of freedom of the residuals, it is one
    /// over the number of contrasts.
    pub epsilon_hf: f64,
    /// p-value with degrees of freedom scaled by `epsilon_hf` within its limits, one over the number of contrasts and 1.
    pub p_hf: f64,
}

/// Computes the analysis-of-variance table of a design.
///
/// Order of the effects: factors between subjects and their interactions, then each term within subjects followed by its
/// interactions with the between-subject terms.
#[must_use]
pub fn analyse(design: &Design, kind: SumOfSquares) -> Vec<Effect> {
    let between = design.between_terms();
    let full = Basis::of(&columns(design, between.iter()));
    let rounding = ROUNDING * design.responses.trace_of_square();
    let mut effects = Vec::new();
    let mut error_total = 0.0;
    for within in design.within_terms() {
        let contrasts = design.responses.times(&design.contrasts(&within));
        let error = full.residual_products(&contrasts);
        error_total += error.trace();
        for term in &between {
            if within.is_empty() && term.is_empty() {
                continue; // grand mean: not tested
            }
            let (smaller, larger) = nested(design, &between, term, kind);
            let hypothesis = larger.products_beyond(&smaller, &contrasts);
            let term_df = larger.rank() - smaller.rank();
            let name = design.name(term, &within);
            effects.push(test(
                name,
                (&hypothesis, &error),
                term_df,
                design.subjects() - full.rank(),
                rounding,
            ));
        }
    }
    for effect in &mut effects {
        effect.generalised_eta_squared = effect.sum_of_squares / (effect.sum_of_squares + error_total);
    }
    effects
}

/// Returns the models without and with a term, whose difference is the term's sum of squares.
fn nested(design: &Design, all: &[Term], term: &Term, kind: SumOfSquares) -> (Basis, Basis) {
    let kept = |other: &&Term| match kind {
        SumOfSquares::Two => !other.contains(term),
        SumOfSquares::Three => *other != term,
    };
    let smaller = columns(design, all.iter().filter(kept));
    let larger = smaller.beside(&design.coded(term));
    (Basis::of(&smaller), Basis::of(&larger))
}

fn columns<'a>(design: &Design, terms: impl Iterator<Item = &'a Term>) -> Matrix {
    let empty = Matrix::from_fn(design.subjects(), 0, |_, _| 0.0);
    terms.fold(empty, |columns, term| columns.beside(&design.coded(term)))
}

fn test(
    effect: String,
    (hypothesis, error): (&Matrix, &Matrix),
    term_df: usize,
    residual_df: usize,
    rounding: f64,
) -> Effect {
    let contrasts = error.columns();
    let (df, error_df) = (count(term_df * contrasts), count(residual_df * contrasts));
    let (squares, error_squares) = (hypothesis.trace(), error.trace());
    let not_testable = match (squares > rounding, error_squares > rounding) {
        (_, true) => None,
        (false, false) => Some(StatisticsError::RemovedByScaling),
        (true, false) => Some(StatisticsError::NoError),
    };
    let tested = |value: f64| if not_testable.is_none() { value } else { f64::NAN };
    let f = tested((squares / df) / (error_squares / error_df));
    Effect {
        effect,
        sum_of_squares: squares,
        df,
        error_sum_of_squares: error_squares,
        error_df,
        f,
        p: tested(fisher_above(f, df, error_df)),
        partial_eta_squared: tested(squares / (squares + error_squares)),
        partial_omega_squared: not_testable.is_none().then(|| partial_omega_squared(f, df, error_df)),
        generalised_eta_squared: f64::NAN, // set when all errors are known
        sphericity: (contrasts > 1 && not_testable.is_none())
            .then(|| sphericity(error, f, df, error_df, count(residual_df))),
        not_testable,
    }
}

fn sphericity(error: &Matrix, f: f64, df: f64, error_df: f64, residual_df: f64) -> Sphericity {
    let contrasts = count(error.columns());
    let epsilon_gg = error.trace() * error.trace() / (contrasts * error.trace_of_square());
    let epsilon_hf = if residual_df > 1.0 {
        // The difference is 0 if the error varies equally in all directions: rounding must not change its sign.
        let left = (residual_df - contrasts * epsilon_gg).max(LEAST_LEFT);
        ((residual_df + 1.0) * contrasts * epsilon_gg - 2.0) / (contrasts * left)
    } else {
        // With one degree of freedom the error has one direction: the variances of contrasts are unknown, and the formula is 0 / 0.
        1.0 / contrasts
    };
    let scaled = |epsilon: f64| {
        // Below the minimum the estimate is due to rounding or too small a sample.
        let epsilon = epsilon.clamp(1.0 / contrasts, 1.0);
        fisher_above(f, epsilon * df, epsilon * error_df)
    };
    Sphericity { epsilon_gg, p_gg: scaled(epsilon_gg), epsilon_hf, p_hf: scaled(epsilon_hf) }
}
