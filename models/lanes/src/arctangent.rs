//! Arc tangent as a rational function, for angles with a known tangent of the half angle.
//!
//! A pose gives not angles but sides of triangles, and from them the tangent of *half* the angle without trigonometry:
//! `tan(angle / 2) = opposite / (hypotenuse + adjacent)`, between 0 and 1 up to a right angle. That leaves one smooth
//! function on one interval, without cases:
//!
//! ```text
//! atan(t) = t q(t²)        q(u) = 1 - u P(u) / Q(u),  0 <= u <= 1
//! ```
//!
//! `P` and `Q`, of degrees 5 and 6, minimise the largest relative error of `q` (minimax): 6e-18. All coefficients
//! are positive, so nothing cancels. They were found by weighted least squares on Chebyshev nodes with Lawson's iteration
//! of the weights (Rice, *The Approximation of Functions*, volume 2, 1969), in 40 digits.

use crate::Real;

/// Coefficients of `P`, from the constant term.
const NUMERATOR: [f64; 6] = [
    0.333_333_333_333_331_5,
    0.746_627_814_866_754_2,
    0.585_395_675_695_607_8,
    0.190_851_531_890_948_5,
    0.023_697_973_039_698_48,
    0.000_748_606_855_418_659_9,
];
/// Coefficients of `Q`, from the constant term.
const DENOMINATOR: [f64; 7] = [
    1.0,
    2.839_883_444_599_726_7,
    3.031_545_665_292_95,
    1.507_722_423_057_714_6,
    0.350_394_061_492_237_2,
    0.033_086_271_068_925_74,
    0.000_829_647_470_658_052,
];

/// Returns `q(u) = atan(sqrt u) / sqrt u` for `0 <= u <= 1`, to one unit in the last place. Real-time: bounded, no
/// allocation, no branch.
#[inline(always)]
#[must_use]
pub fn quotient<R: Real>(u: R) -> R {
    let [p0, p1, p2, p3, p4, p5] = NUMERATOR;
    let [q0, q1, q2, q3, q4, q5, q6] = DENOMINATOR;
    // Even and odd powers separately: short dependency chains.
    let u2 = u * u;
    let numerator = ((u2 * p4 + p2) * u2 + p0) + ((u2 * p5 + p3) * u2 + p1) * u;
    let denominator = (((u2 * q6 + q4) * u2 + q2) * u2 + q0) + ((u2 * q5 + q3) * u2 + q1) * u;
    u.like(1.0) - u * numerator / denominator
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Unit in the last place of a positive normal number.
    fn ulp(x: f64) -> f64 {
        f64::from_bits(x.to_bits() + 1) - x
    }

    #[test]
    fn arc_tangent_is_right_to_the_last_bits() {
        // The last subtraction rounds to half a unit; u P / Q <= 0.215 brings four roundings of a quarter of that
        // each. The product with t adds half a unit, the library's own error another.
        let steps = 200_000u32;
        for step in 1..=steps {
            let t = f64::from(step) / f64::from(steps);
            let (found, expected) = (t * quotient(t * t), t.atan());
            assert!((found - expected).abs() <= 2.5 * ulp(expected), "{t}: {found:e} {expected:e}");
        }
        for t in [1e-300, 1e-160, 1e-20, 1e-8, 1e-3] {
            assert!((t * quotient(t * t) - f64::atan(t)).abs() <= ulp(t), "{t}");
        }
        assert_eq!(quotient(0.0), 1.0);
    }
}
