//! Minimum of the energy of the offset: a semismooth Newton method with an exact line search.
//!
//! The energy `E(w) = w^T w / 2 + sum over contacts` is convex with a second derivative of at least 1, and once continuously
//! differentiable, so it has exactly one minimum. Each step solves with the second derivative of the piece that the iterate is
//! on; the method ends in finitely many steps where all pieces are quadratic (L. Qi, J. Sun, "A nonsmooth version of Newton's
//! method", Mathematical Programming 58, 1993), and the line search makes it converge from everywhere.

use crate::law::{FrictionLaw, NormalLaw};
use crate::linear::{self, Vector6};

/// Derivatives of gap and stretch of a contact with respect to the coordinates of the offset.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Rows {
    pub(crate) normal: Vector6,
    pub(crate) tangents: [Vector6; 2],
}

/// Terms of a contact in the energy of one tick, at the pose of the handle.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Term {
    pub(crate) rows: Rows,
    pub(crate) depth_m: f64,
    pub(crate) stretch_m: [f64; 2],
    pub(crate) normal: NormalLaw,
    pub(crate) friction: FrictionLaw,
}

impl Term {
    /// Returns depth and stretch at an offset.
    #[inline]
    pub(crate) fn at(&self, offset: &Vector6) -> (f64, [f64; 2]) {
        let [first, second] = self.stretch_m;
        let [along_first, along_second] = &self.rows.tangents;
        (
            self.depth_m - linear::dot(&self.rows.normal, offset),
            [first + linear::dot(along_first, offset), second + linear::dot(along_second, offset)],
        )
    }

    fn has_friction(&self) -> bool {
        self.friction.limit_n > 0.0
    }
}

/// Largest number of Newton steps. A tick takes one to four, a tool that jumps up to 14 (the test `random_sets` prints them).
pub(crate) const MAX_STEPS: u32 = 40;
/// Maximum number of slopes evaluated in a line search.
const MAX_SLOPES: u32 = 40;
/// Fraction of the initial slope below which a line search ends.
const SLOPE_TOLERANCE: f64 = 1.0e-3;
/// Multiple of the rounding error of a gradient at which the minimum is reached: each sum has at most 16 * 3 + 1 terms.
const ROUNDINGS: f64 = 8.0;

/// Result of a minimisation.
pub(crate) struct Minimum {
    pub(crate) offset: Vector6,
    /// False if the steps ended before the minimum.
    pub(crate) is_reached: bool,
    pub(crate) steps: u32,
}

/// Returns the offset of minimum energy, or after `most_steps` the iterate with the smallest gradient. Real-time: bounded, no
/// allocation.
pub(crate) fn minimize(terms: &[Term], start: &Vector6, most_steps: u32) -> Minimum {
    let mut offset = *start;
    let mut best = Minimum { offset, is_reached: false, steps: 0 };
    let mut smallest = f64::INFINITY;
    for steps in 0..=most_steps {
        let (gradient, rounding) = gradient(terms, &offset);
        let square = linear::dot(&gradient, &gradient);
        if square < smallest {
            (smallest, best.offset) = (square, offset);
        }
        best.steps = steps;
        if square <= rounding * rounding {
            return Minimum { offset, is_reached: true, steps };
        }
        let newton = linear::solve(second_derivative(terms, &offset), &gradient);
        let direction = newton.map(|part| -part);
        let first = linear::dot(&gradient, &direction);
        let enough = SLOPE_TOLERANCE * first.abs() + rounding * norm(&direction);
        let length = step_length(terms, &offset, &direction, enough);
        linear::add(&mut offset, &direction, length);
    }
    best
}

/// Returns the gradient of the energy, and the size of its rounding error.
#[inline]
fn gradient(terms: &[Term], offset: &Vector6) -> (Vector6, f64) {
    let mut gradient = *offset;
    let size: f64 = offset.iter().map(|part| part.abs()).sum();
    let mut rounding = size;
    for term in terms {
        let rows = &term.rows;
        let (depth, stretch) = term.at(offset);
        let (force, slope) = term.normal.at(depth);
        if slope > 0.0 {
            linear::add(&mut gradient, &rows.normal, -force);
            let length = norm(&rows.normal);
            rounding += length * (force + slope * (term.depth_m.abs() + length * size));
        }
        if term.has_friction() {
            let friction = term.friction.at(stretch);
            let factor = term.friction.stiffness_n_per_m * friction.held;
            for (tangent, stretch) in rows.tangents.iter().zip(stretch) {
                linear::add(&mut gradient, tangent, factor * stretch);
                let length = norm(tangent);
                rounding += length * factor * (2.0 * stretch.abs() + length * size);
            }
        }
    }
    (gradient, ROUNDINGS * f64::EPSILON * rounding)
}

fn norm(vector: &Vector6) -> f64 {
    linear::dot(vector, vector).sqrt()
}

/// Returns the second derivative of the energy at an offset.
#[inline]
fn second_derivative(terms: &[Term], offset: &Vector6) -> linear::Symmetric6 {
    let mut matrix = linear::IDENTITY;
    for term in terms {
        let rows = &term.rows;
        let (depth, stretch) = term.at(offset);
        let (_, slope) = term.normal.at(depth);
        if slope > 0.0 {
            linear::add_square(&mut matrix, &rows.normal, slope);
        }
        if !term.has_friction() {
            continue;
        }
        let friction = term.friction.at(stretch);
        let factor = term.friction.stiffness_n_per_m * friction.held;
        let [first, second] = &rows.tangents;
        match friction.sliding {
            None => {
                linear::add_square(&mut matrix, first, factor);
                linear::add_square(&mut matrix, second, factor);
            }
            // Sliding friction has a constant magnitude: its derivative is perpendicular to the sliding direction.
            Some([along_first, along_second]) => {
                let mut across = [0.0; 6];
                linear::add(&mut across, first, -along_second);
                linear::add(&mut across, second, along_first);
                linear::add_square(&mut matrix, &across, factor);
            }
        }
    }
    matrix
}

/// Returns the length of the step along a direction of descent at which the slope of the energy is 0.
///
/// The slope never falls along the line. Newton's method on the slope, inside an interval that contains the root.
#[inline]
fn step_length(terms: &[Term], offset: &Vector6, direction: &Vector6, enough: f64) -> f64 {
    let (mut below, mut above) = (0.0, f64::INFINITY);
    let mut length = 1.0;
    for _ in 0..MAX_SLOPES {
        let (slope, curvature) = slope(terms, offset, direction, length);
        if slope.abs() <= enough {
            return length;
        }
        if slope < 0.0 {
            below = length;
        } else {
            above = length;
        }
        let next = length - slope / curvature;
        // At least a sixteenth of the interval is excluded by each slope.
        length = if above.is_infinite() {
            next.clamp(below * 1.1, below * 8.0)
        } else {
            let margin = (above - below) / 16.0;
            next.clamp(below + margin, above - margin)
        };
    }
    below
}

/// Returns first and second derivative of the energy along a line.
#[inline]
fn slope(terms: &[Term], offset: &Vector6, direction: &Vector6, length: f64) -> (f64, f64) {
    let mut there = *offset;
    linear::add(&mut there, direction, length);
    let mut slope = linear::dot(&there, direction);
    let mut curvature = linear::dot(direction, direction);
    for term in terms {
        let rows = &term.rows;
        let (depth, stretch) = term.at(&there);
        let (force, rise) = term.normal.at(depth);
        if rise > 0.0 {
            let along = linear::dot(&rows.normal, direction);
            slope -= force * along;
            curvature += rise * along * along;
        }
        if term.has_friction() {
            let friction = term.friction.at(stretch);
            let factor = term.friction.stiffness_n_per_m * friction.held;
            let [first, second] = rows.tangents.each_ref().map(|tangent| linear::dot(tangent, direction));
            let [stretch_first, stretch_second] = stretch;
            slope += factor * (stretch_first * first + stretch_second * second);
            curvature += factor
                * match friction.sliding {
                    None => first * first + second * second,
                    Some([along_first, along_second]) => {
                        let across = along_first * second - along_second * first;
                        across * across
                    }
                };
        }
    }
    (slope, curvature)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sixteen stiff contacts whose planes cut off a corner of the offsets.
    fn corner() -> [Term; 16] {
        std::array::from_fn(|contact| {
            let part = |row: usize| (((contact * 7 + row * 5) % 11) as f64 - 5.0) / 10.0;
            Term {
                rows: Rows {
                    normal: std::array::from_fn(part),
                    tangents: [std::array::from_fn(|row| part(row + 1)); 2],
                },
                depth_m: 0.1 * (contact as f64 - 4.0),
                stretch_m: [0.02 * contact as f64, -0.1],
                normal: NormalLaw::new(1.0e3, 0.0, 0.0),
                friction: FrictionLaw { stiffness_n_per_m: 1.0e3, limit_n: 0.5 * contact as f64 },
            }
        })
    }

    #[test]
    fn the_best_iterate_is_returned_where_the_steps_end_too_early() {
        let terms = corner();
        let solved = minimize(&terms, &[0.0; 6], MAX_STEPS);
        assert!(solved.is_reached);
        assert!(solved.steps > 2, "{} steps: the case is too easy", solved.steps);
        let length = |offset: &Vector6| norm(&gradient(&terms, offset).0);
        let mut last = length(&[0.0; 6]);
        for most in 0..solved.steps {
            let ended = minimize(&terms, &[0.0; 6], most);
            assert_eq!((ended.is_reached, ended.steps), (false, most));
            assert!(length(&ended.offset) <= last, "after {most} steps");
            last = length(&ended.offset);
        }
    }
}
