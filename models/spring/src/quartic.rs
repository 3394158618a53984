//! Bending energy of fourth order in the angles, from the exact rod.
//!
//! Stiffnesses independent of the angles are accurate for small angles only. The next term needs no further equation to be
//! solved: the shape of the linear column makes the energy of second order stationary, so the energy of fourth order is the
//! exact rod's energy *evaluated on that shape* (a shape correction would enter with order six).
//!
//! **Derivation.** Of the rod's sections, let `n` be the normals. Eliminating strains and end force exactly, the
//! rod of free length `L0` with ends a chord `L e` apart stores
//!
//! ```text
//! W = 1/2 ∫ alpha |n'|² + L0/2 g.(1/beta + rho <n n>)⁻¹ g,   g = (L / L0) e - <n>,   rho = 1/gamma - 1/beta
//! ```
//!
//! (`<>` is the mean along the rod). With `n = e cos|theta| + theta sin|theta| / |theta|`, `p = 1 - L/L0`,
//! `c = 1 - gamma/beta`, `sigma = 1 - c p`, and a bar for `|theta|²`, the terms of fourth order are
//!
//! ```text
//! W4 = L0/2 ( gamma (sigma - 1/2)² <bar>² + gamma p (1/12 - (1 - sigma)/3) <bar²>
//!           - 2 beta sigma (2 sigma/3 - 1/2) <theta>.<bar theta> + 2 beta sigma c (sigma - 1/2) <bar> <theta>²
//!           - beta² rho sigma² (<theta>.<theta theta>.<theta> - c <theta>⁴) )
//!      - alpha/6 ∫ (theta x theta')² - 2 b/3 (S x D)²
//! ```
//!
//! The last term is due to the angle between the plates, which [`crate::energy`] measures on the sphere. With
//! `theta = S sway(u) + D bow(u)` of [`crate::shape`] this is a form in two vectors with four coefficients,
//!
//! ```text
//! W4 = c0 S⁴ + c1 S² D² + c2 (S.D)² + c3 D⁴
//! ```
//!
//! functions of the length alone. They are fitted once per spring by polynomials in `L`; `D` is scaled with a
//! *magnification* that removes the buckling pole from the coefficients. Twist at fourth order (`w² S²`, `w² D²`) is
//! neglected: it is the softening of a twisted column (Greenhill), about 1e-3 of the stiffness for a twist of a tenth of
//! a radian, and larger close to buckling.
//!
//! The series is invalid once the magnified angles are of order one; there the term fades out.

use std::f64::consts::PI;

use flotor_hal::glam::DVec4;

use crate::beam_column::Column;
use crate::rigidity::{Rigidities, Spring};
use crate::shape::{KNEE, REACH, Shape, relative_length};
use flotor_lanes::chebyshev::interpolated;
use flotor_lanes::entire::EntireFunctions;
use flotor_lanes::saturation::{Saturated, saturate_above, saturate_below};
use flotor_lanes::{Real, polynomial};

/// Number of terms of the fit: relative error below 2e-4 of the coefficients of short springs, 1e-2 of the slender one.
const TERMS: usize = 12;

/// Range of relative lengths of the fit, unless the argument limits it further: from below the solid length of common
/// springs to nearly twice the free length.
const SHORTEST: f64 = 0.2;
const LONGEST: f64 = 1.8;

/// Relative length at either end within which the coefficients saturate, if the range is wide enough.
const MARGIN: f64 = 0.05;

/// Squared magnified angle (rad²) at which the term has faded to one half.
const FADING_SQUARE: f64 = 1.0;

/// Argument of the first buckling of the column.
const POLE: f64 = PI * PI;

/// Five-point Gauss-Legendre rule on -1..1 (Abramowitz and Stegun, table 25.4): nodes and weights.
const GAUSS: [(f64, f64); 5] = [
    (-0.906_179_845_938_664, 0.236_926_885_056_189_08),
    (-0.538_469_310_105_683_1, 0.478_628_670_499_366_47),
    (0.0, 0.568_888_888_888_888_9),
    (0.538_469_310_105_683_1, 0.478_628_670_499_366_47),
    (0.906_179_845_938_664, 0.236_926_885_056_189_08),
];

/// Panels of the rule on half the rod: resolves the end layers of a rod in tension (`z = -60`) to 1e-6.
const PANELS: u32 = 4;

/// Energy of fourth order and its partial derivatives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct QuarticEnergy<R = f64> {
    pub(crate) energy_j: R,
    /// Derivatives with respect to the squared angles lower normal to chord, upper normal to chord, lower to upper normal.
    pub(crate) by_squares: [R; 3],
    /// Derivative with respect to the length of the chord.
    pub(crate) by_length: R,
}

/// Coefficients of the form at one length.
#[derive(Clone, Copy)]
pub(crate) struct QuarticForm<R> {
    /// `(c0, c1, c2, c3)`
    coefficients: [R; 4],
    /// Derivatives of the coefficients with respect to the length.
    by_length: [R; 4],
}

/// Coefficients of one spring as functions of the length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Quartic {
    /// Powers of the length mapped to -1..1, for `(c0, c1, c2, c3)`, each per newton of `gamma`.
    powers: [[f64; TERMS]; 4],
    gamma_n: f64,
    shortest: Limit,
    longest: Limit,
    middle_m: f64,
    mapping_per_m: f64,
}

/// Saturation of the length before an end of the fit.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Limit {
    knee_m: f64,
    reach_m: f64,
}

impl Quartic {
    /// Fits the coefficients. The coefficients are proportional to the rigidities, and are fitted for a spring with `gamma` of one
    /// newton. Real-time: bounded (tens of microseconds), no allocation.
    pub(crate) fn new(spring: &Spring) -> Self {
        let free_length_m = spring.geometry().free_length_m;
        let rigidities = &spring.rigidities_per_gamma();
        let load = rigidities.gamma_n * free_length_m * free_length_m / (4.0 * rigidities.alpha_n_m2);
        let excess = 1.0 - rigidities.gamma_n / rigidities.beta_n;
        let at_argument = |z| relative_length(load, excess, z);
        let shortest = at_argument(KNEE + REACH).unwrap_or(0.0).max(SHORTEST);
        let knee = at_argument(KNEE).unwrap_or(0.0).max(SHORTEST + MARGIN);
        let longest = at_argument(EntireFunctions::MIN_ARGUMENT).unwrap_or(LONGEST);
        let longest = longest.min(LONGEST).min(longest_with_shape(excess));
        let margin = MARGIN.min(0.5 * (longest - 1.0));
        // Lengths from `shortest` to `longest` are mapped to -1 to 1, where the polynomials are fitted.
        let (middle, half_width) = (0.5 * (longest + shortest), 0.5 * (longest - shortest));
        let powers =
            interpolated(|mapped| coefficients(rigidities, free_length_m, middle + half_width * mapped));
        Self {
            powers: std::array::from_fn(|which| powers.map(|powers: DVec4| powers[which])),
            gamma_n: spring.rigidities().gamma_n,
            shortest: Limit { knee_m: knee * free_length_m, reach_m: (knee - shortest) * free_length_m },
            longest: Limit { knee_m: (longest - margin) * free_length_m, reach_m: margin * free_length_m },
            middle_m: middle * free_length_m,
            mapping_per_m: 1.0 / (half_width * free_length_m),
        }
    }

    /// Returns the coefficients of a spring of other stiffness but equal proportions, see
    /// [`Spring::is_proportional_to`]. Real-time: bounded, no allocation; nanoseconds.
    pub(crate) fn with_gamma(self, gamma_n: f64) -> Self {
        Self { gamma_n, ..self }
    }

    /// Evaluates the energy of a form at the argument `z` (saturated, with `dz/dL`) and the squared angles. Real-time:
    /// bounded, no allocation.
    #[inline(always)]
    pub(crate) fn at<R: Real>(
        &self,
        form: &QuarticForm<R>,
        z: R,
        z_by_length: R,
        squares: [R; 3],
    ) -> QuarticEnergy<R> {
        let ([c0, c1, c2, c3], [c0_slope, c1_slope, c2_slope, c3_slope]) =
            (form.coefficients, form.by_length);
        // The magnification 1 + z_p / (z_p - z) with its pole z_p, and the derivative with respect to z.
        let pole = (z.like(POLE) - z).inverse() * POLE;
        let magnification = pole + 1.0;
        let by_argument = pole * pole * (1.0 / POLE);

        // S² and the magnified D² and S.D, from the squared angles of the ends and between the plates.
        let [lower, upper, plates] = squares;
        let (across, along) = (plates * 0.25, (upper - lower) * 0.25);
        let sway = (lower + upper) * 0.5 - across;
        let magnified = magnification * magnification;
        let bow = magnified * across;
        let mixed = magnification * along;

        let (sway2, both, mixed2, bow2) = (sway * sway, sway * bow, mixed * mixed, bow * bow);
        let value = (c0 * sway2 + c1 * both) + (c2 * mixed2 + c3 * bow2);
        let value_slope = (c0_slope * sway2 + c1_slope * both) + (c2_slope * mixed2 + c3_slope * bow2);
        // Fades with the square of the magnified amplitude: the error of the fading is of order eight.
        let amplitude = (sway + bow) * (1.0 / FADING_SQUARE);
        let fading = (amplitude * amplitude + 1.0).inverse();
        let weight = fading * self.gamma_n;
        let by_amplitude = amplitude * (fading * weight) * value * (-2.0 / FADING_SQUARE);

        let by_sway = weight * (c0 * (sway * 2.0) + c1 * bow) + by_amplitude;
        let by_bow = weight * (c1 * sway + c3 * (bow * 2.0)) + by_amplitude;
        let by_mixed = weight * (c2 * mixed) * 2.0;
        let by_magnification = by_bow * (magnification * across * 2.0) + by_mixed * along;
        let (half, quarter) = (by_sway * 0.5, magnification * by_mixed * 0.25);
        QuarticEnergy {
            energy_j: weight * value,
            by_squares: [half - quarter, half + quarter, (magnified * by_bow - by_sway) * 0.25],
            by_length: weight * value_slope + by_magnification * (by_argument * z_by_length),
        }
    }

    /// Returns the coefficients at a length. Real-time: bounded, no allocation.
    #[inline(always)]
    pub(crate) fn form_at<R: Real>(&self, length_m: R) -> QuarticForm<R> {
        let Self { shortest, longest, .. } = *self;
        let below = saturate_below(length_m, shortest.knee_m, shortest.reach_m);
        let Saturated { value, slope, .. } = saturate_above(below.value, longest.knee_m, longest.reach_m);
        let slope = slope * below.slope * self.mapping_per_m;
        let mapped = (value - self.middle_m) * self.mapping_per_m;
        let [p0, p1, p2, p3] = &self.powers;
        // One after the other: interleaved, they exceed the registers and take 13 ns more per tick.
        let ([c0, c0_slope], [c1, c1_slope]) = (polynomial(mapped, p0), polynomial(mapped, p1));
        let ([c2, c2_slope], [c3, c3_slope]) = (polynomial(mapped, p2), polynomial(mapped, p3));
        QuarticForm {
            coefficients: [c0, c1, c2, c3],
            by_length: [c0_slope * slope, c1_slope * slope, c2_slope * slope, c3_slope * slope],
        }
    }
}

/// Returns the relative length half way to the loss of shear stiffness of a rod with `G > E`; infinity for other rods,
/// which have shear stiffness at all lengths.
fn longest_with_shape(excess: f64) -> f64 {
    if excess < 0.0 { 1.0 - 0.5 / excess } else { f64::INFINITY }
}

/// Means of products of the two shapes along the rod. Mixed means of odd order in the bow vanish.
#[derive(Clone, Copy, Default)]
struct Means {
    sway: f64,
    sway2: f64,
    sway3: f64,
    sway4: f64,
    bow2: f64,
    bow4: f64,
    sway_bow2: f64,
    sway2_bow2: f64,
    /// Mean of `(sway bow' - bow sway')²`.
    sweep2: f64,
}

impl Means {
    fn of(shape: &Shape) -> Self {
        let mut means = Self::default();
        let half_panel = 0.25 / f64::from(PANELS);
        for panel in 0..PANELS {
            for (node, weight) in GAUSS {
                let u = half_panel * (f64::from(2 * panel + 1) + node);
                // Both halves of the rod have equal means.
                means.add(shape, u, 2.0 * half_panel * weight);
            }
        }
        means
    }

    fn add(&mut self, shape: &Shape, u: f64, weight: f64) {
        // One node of the quadrature of the means over the rod.
        let [sway, bow] = shape.lean(u);
        let (s, b) = (sway.value, bow.value);
        let sweep = s * bow.slope - b * sway.slope;
        self.sway += weight * s;
        self.sway2 += weight * (s * s);
        self.sway3 += weight * (s * s * s);
        self.sway4 += weight * (s * s * s * s);
        self.bow2 += weight * (b * b);
        self.bow4 += weight * (b * b * b * b);
        self.sway_bow2 += weight * (s * b * b);
        self.sway2_bow2 += weight * (s * s * b * b);
        self.sweep2 += weight * (sweep * sweep);
    }
}

/// Returns `(c0, c1, c2, c3)` at a relative length, with the pole removed; zero without a shape.
fn coefficients(rigidities: &Rigidities, free_length_m: f64, relative: f64) -> DVec4 {
    let Rigidities { alpha_n_m2: alpha, beta_n: beta, gamma_n: gamma, .. } = *rigidities;
    let length_m = relative * free_length_m;
    let Some((z, shape)) = Shape::argument(rigidities, free_length_m, length_m)
        .and_then(|z| Some((z, Shape::new(rigidities, free_length_m, length_m, z)?)))
    else {
        return DVec4::ZERO;
    };
    let m = Means::of(&shape);
    let p = 1.0 - relative;
    let c = 1.0 - gamma / beta;
    let sigma = 1.0 - c * p;

    // The factors of `W4` in the module documentation, in its order.
    let squared_mean = gamma * (sigma - 0.5) * (sigma - 0.5);
    let mean_square = gamma * p * (1.0 / 12.0 - (1.0 - sigma) / 3.0);
    let cubic = -2.0 * beta * sigma * (2.0 / 3.0 * sigma - 0.5);
    let shortening = 2.0 * beta * sigma * c * (sigma - 0.5);
    let tilting = -beta * (beta / gamma - 1.0) * sigma * sigma;

    // With theta = S sway + D bow: the coefficients of S⁴, S² D², (S.D)² and D⁴.
    let mean2 = m.sway * m.sway;
    let sway = squared_mean * m.sway2 * m.sway2
        + mean_square * m.sway4
        + cubic * m.sway * m.sway3
        + (shortening + tilting) * mean2 * m.sway2
        - c * tilting * mean2 * mean2;
    let both = 2.0 * squared_mean * m.sway2 * m.bow2
        + 2.0 * mean_square * m.sway2_bow2
        + cubic * m.sway * m.sway_bow2
        + shortening * mean2 * m.bow2;
    let mixed =
        4.0 * mean_square * m.sway2_bow2 + 2.0 * cubic * m.sway * m.sway_bow2 + tilting * mean2 * m.bow2;
    let bow = squared_mean * m.bow2 * m.bow2 + mean_square * m.bow4;

    // (S x D)² = S² D² - (S.D)²
    let axial_force_n = gamma * p;
    let column = Column::new(rigidities).ends(axial_force_n, length_m, free_length_m);
    let carry = 0.5 * (column.sway_n_per_rad * length_m - column.bow_nm_per_rad);
    let out_of_plane = -alpha / (6.0 * free_length_m) * m.sweep2 - 2.0 / 3.0 * carry;

    let half_length = 0.5 * free_length_m;
    let shrink = (POLE - z) / (2.0 * POLE - z);
    let shrink2 = shrink * shrink;
    DVec4::new(
        half_length * sway,
        (half_length * both + out_of_plane) * shrink2,
        (half_length * mixed - out_of_plane) * shrink2,
        half_length * bow * (shrink2 * shrink2),
    )
}

#[cfg(test)]
mod tests;
