//! Piecewise cubic curve over the measured displacements.

use super::{FORCE, Form, Scales, around, signed};

/// Forces at the knots, which divide the measured displacements equally.
pub(super) const KNOTS: [Form; 17] = [
    knot("force_00_n"),
    knot("force_01_n"),
    knot("force_02_n"),
    knot("force_03_n"),
    knot("force_04_n"),
    knot("force_05_n"),
    knot("force_06_n"),
    knot("force_07_n"),
    knot("force_08_n"),
    knot("force_09_n"),
    knot("force_10_n"),
    knot("force_11_n"),
    knot("force_12_n"),
    knot("force_13_n"),
    knot("force_14_n"),
    knot("force_15_n"),
    knot("force_16_n"),
];

/// The prior only affects knots without samples nearby.
const fn knot(id: &'static str) -> Form {
    around(signed(id, FORCE), 0.0, 10.0)
}

/// Returns the force, N, at each sample: cubic between knots, with slopes of central differences (Catmull and Rom 1974).
pub(super) fn force_n(knots_n: &[f64], scales: &Scales, displacement_m: &[f64]) -> Vec<f64> {
    let last = knots_n.len().saturating_sub(1);
    let knot = |index: usize| knots_n.get(index.min(last)).copied().unwrap_or(f64::NAN);
    let slope = |index: usize| {
        let knots = (index + 1).min(last) - index.saturating_sub(1);
        (knot(index + 1) - knot(index.saturating_sub(1))) / knots as f64
    };
    let at = |x: &f64| {
        let place = (x - scales.lowest_m) / scales.span_m * last as f64;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // 0 to the number of pieces
        let index = (place.max(0.0) as usize).min(last.saturating_sub(1));
        let s = place - index as f64;
        let (from, rise) = (knot(index), knot(index + 1) - knot(index));
        let (first, second) = (slope(index) - rise, rise - slope(index + 1));
        from + s * rise + s * (1.0 - s) * ((1.0 - s) * first + s * second)
    };
    displacement_m.iter().map(at).collect()
}
