//! Round steps along an axis, and powers of ten.

/// Tolerance of ticks at the ends, as a fraction of the span (rounding of `k * step`).
pub(super) const END_TOLERANCE: f64 = 1e-9;

/// Step width of 1, 2 or 5 times a power of ten.
#[derive(Debug, Clone, Copy)]
pub(super) struct NiceStep {
    mantissa: f64,
    pub(super) exponent: i32,
}

impl NiceStep {
    /// Returns the smallest nice step that is not below `least`.
    pub(super) fn at_least(least: f64) -> Self {
        let exponent = exponent_of(least);
        let leading = least / power_of_ten(exponent);
        let fits = |mantissa: &f64| leading <= mantissa * (1.0 + END_TOLERANCE);
        match [1.0, 2.0, 5.0].into_iter().find(fits) {
            Some(mantissa) => Self { mantissa, exponent },
            None => Self { mantissa: 1.0, exponent: exponent + 1 },
        }
    }

    pub(super) fn size(self) -> f64 {
        self.mantissa * power_of_ten(self.exponent)
    }

    /// Returns the number of minor steps per step, chosen so that minor steps are round too: 0.2 for 1, 0.5 for 2, 1 for 5.
    pub(super) fn subdivisions(self) -> f64 {
        if self.mantissa == 2.0 { 4.0 } else { 5.0 }
    }
}

/// Returns the decimal exponent of a positive number: 2 for 100 and for 999.
pub(super) fn exponent_of(value: f64) -> i32 {
    let estimate = to_integer(value.max(f64::MIN_POSITIVE).log10().floor());
    // log10 of a number just below a power of ten may round up to it.
    if power_of_ten(estimate) > value { estimate - 1 } else { estimate }
}

pub(super) fn power_of_ten(exponent: i32) -> f64 {
    10.0_f64.powi(exponent)
}

/// Converts an integral `f64` to `i32`, clamped to ±400: beyond all decimal exponents of `f64`.
#[expect(clippy::cast_possible_truncation, reason = "held within ±400 first")]
pub(super) fn to_integer(value: f64) -> i32 {
    value.clamp(-400.0, 400.0) as i32
}
