//! Storage format of numbers between operations.
//!
//! The thesis's C source declares every variable `float` and calls the double functions of the math library: an
//! expression is evaluated in double and rounded to binary32 where it is *stored*. `Binary32` reproduces this rounding,
//! to measure its effect; `Binary64` is for everything else.

use flotor_lanes::Real;

/// Storage precision of a law.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Precision {
    /// Binary64 storage and intermediate results.
    #[default]
    Double,
    /// Binary32 storage, binary64 intermediate results.
    Single,
}

/// Storage format of numbers.
pub(crate) trait Storage {
    /// Rounds a number to the storage format. Real-time: bounded, no allocation.
    fn store<R: Real>(number: R) -> R;
}

/// IEEE 754 double.
pub(crate) enum Binary64 {}

/// IEEE 754 single.
pub(crate) enum Binary32 {}

impl Storage for Binary64 {
    #[inline(always)]
    fn store<R: Real>(number: R) -> R {
        number
    }
}

impl Storage for Binary32 {
    #[inline(always)]
    fn store<R: Real>(number: R) -> R {
        number.map(through_single)
    }
}

/// Rounds to the nearest `f32`; infinite beyond the range of `f32`.
#[allow(clippy::cast_possible_truncation)] // the rounding is intended
#[inline(always)]
fn through_single(number: f64) -> f64 {
    f64::from(number as f32)
}
