//! Interpolation by polynomials at the Chebyshev nodes, four functions at a time.

use std::f64::consts::PI;

use flotor_hal::glam::DVec4;
use flotor_hal::math;

/// Interpolates the four components of `function` on -1..1 at `TERMS` (at least two) Chebyshev nodes, and returns the
/// coefficients of the powers, from the constant on. Real-time: bounded, no allocation.
#[must_use]
pub fn interpolated<const TERMS: usize>(mut function: impl FnMut(f64) -> DVec4) -> [DVec4; TERMS] {
    let terms = TERMS as f64;
    let mut chebyshev = [DVec4::ZERO; TERMS];
    for node in 0..TERMS {
        let angle = PI * (node as f64 + 0.5) / terms;
        let mapped = math::cos(angle);
        let value = function(mapped) * (2.0 / terms);
        // T(n+1) = 2 x T(n) - T(n-1)
        let (mut current, mut next) = (1.0, mapped);
        for coefficient in &mut chebyshev {
            *coefficient += value * current;
            (current, next) = (next, 2.0 * mapped * next - current);
        }
    }
    chebyshev[0] *= 0.5;

    // The recurrence again, in powers.
    let mut powers = [DVec4::ZERO; TERMS];
    let (mut current, mut next) = ([0.0; TERMS], [0.0; TERMS]);
    current[0] = 1.0;
    next[1] = 1.0;
    for coefficient in chebyshev {
        for (power, weight) in powers.iter_mut().zip(current) {
            *power += coefficient * weight;
        }
        let mut after = [0.0; TERMS];
        for (i, weight) in next.iter().enumerate().take(TERMS - 1) {
            after[i + 1] = 2.0 * weight;
        }
        for (weight, previous) in after.iter_mut().zip(current) {
            *weight -= previous;
        }
        (current, next) = (next, after);
    }
    powers
}
