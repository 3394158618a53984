//! Analysis of variance with factors between subjects and within them.
//!
//! One row per subject, one response per cell of the within-subject factors. Effects within subjects are tested as a
//! general linear model of orthonormal contrasts: the responses of a subject are multiplied by contrasts of the
//! within-subject factors, and the between-subject design explains those. The sums of squares are traces of the
//! hypothesis and error matrices of that model, which is what `car::Anova` does in R; it stays right for groups of
//! unequal size, where type II and type III differ:
//!
//! - **Type III**: each effect beyond all others, with effects coded to sum to zero.
//! - **Type II**: each effect beyond all others that do not contain it.
//!
//! Greenhouse and Geisser's epsilon (1959) and Huynh and Feldt's (1976, with Lecoutre's correction of 1991) scale the
//! degrees of freedom of effects whose contrasts vary unequally.

mod design;

pub use design::{BetweenFactor, Design, WithinFactor};

use crate::distribution::fisher_above;
use crate::effect_size::{EffectSize, partial_omega_squared};
use crate::linear::{Basis, Matrix};
use crate::{ROUNDING, StatisticsError, count};
use design::Term;
use serde::Serialize;

/// What an effect is tested beyond.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub enum SumOfSquares {
    /// All effects that do not contain it.
    #[serde(rename = "II")]
    Two,
    /// All others.
    #[default]
    #[serde(rename = "III")]
    Three,
}

/// One line of the table.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Effect {
    /// The factors, joined by colons: `modality:base`.
    pub effect: String,
    /// Sum of squares.
    pub sum_of_squares: f64,
    /// Degrees of freedom.
    pub df: f64,
    /// Sum of squares of the error it is tested against.
    pub error_sum_of_squares: f64,
    /// Degrees of freedom of the error.
    pub error_df: f64,
    /// F; NaN (`null` in JSON) where the error is nothing but rounding errors of the responses.
    pub f: f64,
    /// Probability of a larger F without the effect; NaN as [`Self::f`].
    pub p: f64,
    /// Share of what the effect and its error explain together; NaN as [`Self::f`]. Larger in the mean than that of the population,
    /// which [`partial_omega_squared`] estimates.
    pub partial_eta_squared: f64,
    /// Partial omega squared with its interval, without a correction for unequally varying contrasts; none where there is nothing
    /// to test.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub partial_omega_squared: Option<EffectSize>,
    /// The reason why there is no F.
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "reason")]
    pub not_testable: Option<StatisticsError>,
    /// Share of what the effect and all errors explain together (Olejnik and Algina 2003, all factors manipulated).
    pub generalised_eta_squared: f64,
    /// Corrections where the effect has more than one contrast within subjects.
    pub sphericity: Option<Sphericity>,
}

impl Effect {
    /// Whether there is an F: an effect that scaling has removed from all responses has none, nor one without an error.
    #[must_use]
    pub fn is_testable(&self) -> bool {
        self.not_testable.is_none()
    }
}

#[allow(clippy::ref_option)] // as serde asks
fn reason<S: serde::Serializer>(reason: &Option<StatisticsError>, serializer: S) -> Result<S::Ok, S::Error> {
    reason.as_ref().map(ToString::to_string).serialize(serializer)
}

/// Least degrees of freedom that are left of those of the residuals: fewer are rounding errors.
const LEAST_LEFT: f64 = 1.0e-9;

/// How unequally the contrasts of an effect vary, and p-values that include it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Sphericity {
    /// Greenhouse and Geisser's epsilon: 1 where all contrasts vary equally and independently.
    pub epsilon_gg: f64,
    /// p-value with degrees of freedom scaled by it.
    pub p_gg: f64,
    /// Huynh and Feldt's epsilon, which may exceed 1; its least value, one over the contrasts, where a single degree of freedom
    /// is left to the residuals.
    pub epsilon_hf: f64,
    /// p-value with degrees of freedom scaled by it, at most by 1.
    pub p_hf: f64,
}

/// The table of a design.
///
/// Effects come in this order: factors between subjects and their interactions first, then each term within subjects
/// followed by its interactions with those.
#[must_use]
pub fn analyse(design: &Design, kind: SumOfSquares) -> Vec<Effect> {
    let between = design.between_terms();
    let full = Basis::of(&columns(design, between.iter()));
    let rounding = ROUNDING * design.responses().trace_of_square();
    let mut effects = Vec::new();
    let mut error_total = 0.0;
    for within in design.within_terms() {
        let contrasts = design.responses().times(&design.contrasts(&within));
        let error = full.residual_products(&contrasts);
        error_total += error.trace();
        for term in &between {
            if within.is_empty() && term.is_empty() {
                continue; // the grand mean: nobody asks whether it is zero
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

/// The models without and with a term that its sum of squares compares.
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
        (false, false) => Some(StatisticsError::NothingLeft),
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
        generalised_eta_squared: f64::NAN, // known once all errors are
        sphericity: (contrasts > 1 && not_testable.is_none())
            .then(|| sphericity(error, f, df, error_df, count(residual_df))),
        not_testable,
    }
}

fn sphericity(error: &Matrix, f: f64, df: f64, error_df: f64, residual_df: f64) -> Sphericity {
    let contrasts = count(error.columns());
    let epsilon_gg = error.trace() * error.trace() / (contrasts * error.trace_of_square());
    let epsilon_hf = if residual_df > 1.0 {
        // What is left is 0 where all the error there can be varies equally: rounding must not turn its sign.
        let left = (residual_df - contrasts * epsilon_gg).max(LEAST_LEFT);
        ((residual_df + 1.0) * contrasts * epsilon_gg - 2.0) / (contrasts * left)
    } else {
        // A single degree of freedom has a single direction of error: nothing is known of how contrasts vary, and the formula is 0 / 0.
        1.0 / contrasts
    };
    let scaled = |epsilon: f64| {
        // Below its least possible value the estimate is rounding or too small a sample.
        let epsilon = epsilon.clamp(1.0 / contrasts, 1.0);
        fisher_above(f, epsilon * df, epsilon * error_df)
    };
    Sphericity { epsilon_gg, p_gg: scaled(epsilon_gg), epsilon_hf, p_hf: scaled(epsilon_hf) }
}
