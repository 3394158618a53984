//! Elementary functions with the same bits on every machine. Real-time: bounded, no allocation.
//!
//! The functions of `f64` come from the system's C library; the last bit of their results depends on its version and on the
//! processor. The functions here are those of the crate `libm`, plain sums and products in source order; [`crate::glam`] uses
//! `libm` too. Angles are in radians. Functions that IEEE 754 rounds exactly (`sqrt`, `abs`, `floor`, `%`) are the same everywhere.
//! A product and a sum are two roundings everywhere: `f64::mul_add` is a slow call where the processor has no instruction for it.

pub use libm::{
    acos, asin, atan, atan2, cbrt, cos, cosh, exp, expm1 as exp_m1, hypot, log as ln, log1p as ln_1p, log2,
    log10, pow, sin, sincos as sin_cos, sinh, tan, tanh,
};

/// Returns `base` to an integer power by repeated squaring; the order of the products in `f64::powi` depends on the
/// compiler.
#[inline]
#[must_use]
pub fn powi(base: f64, exponent: i32) -> f64 {
    let (mut square, mut left, mut power) = (base, exponent.unsigned_abs(), 1.0);
    while left > 0 {
        if left % 2 == 1 {
            power *= square;
        }
        square *= square;
        left /= 2;
    }
    if exponent < 0 { 1.0 / power } else { power }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bits computed in 50 digits and rounded, where `libm` rounds so; its `exp(1)` is the next number above.
    #[test]
    fn functions_have_these_bits_on_every_machine() {
        for (found, expected) in [
            (sin(1.0), 0x3fea_ed54_8f09_0cee),
            (cos(1.0), 0x3fe1_4a28_0fb5_068c),
            (exp(1.0), 0x4005_bf0a_8b14_5769 + 1),
            (ln(10.0), 0x4002_6bb1_bbb5_5516),
            (pow(2.0, 0.5), 0x3ff6_a09e_667f_3bcd),
            (atan2(1.0, -1.0), 0x4002_d97c_7f33_21d2),
        ] {
            assert_eq!(found.to_bits(), expected, "{found}");
        }
    }

    #[test]
    fn whole_powers_go_both_ways() {
        assert_eq!([0, 1, 2, 5, -2].map(|exponent| powi(2.0, exponent)), [1.0, 2.0, 4.0, 32.0, 0.25]);
        assert_eq!(powi(3.0, 2), 9.0);
    }
}
