//! In which format numbers are kept between operations.
//!
//! The thesis's C source declares every variable `float` and calls the double functions of the math library: an
//! expression is evaluated in double and rounded to binary32 where it is *stored*. `Binary32` repeats that, to
//! measure what it costs; `Binary64` is for everything else.

use flotor_lanes::Real;

/// What a scene asks for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Precision {
    /// Double throughout.
    #[default]
    Double,
    /// Binary32 storage, double intermediates.
    Single,
}

/// A format numbers are stored in.
pub(crate) trait Storage {
    /// The number after a round trip through memory. Real-time: bounded, no allocation.
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

/// To the nearest `f32` and back; beyond its range infinite.
#[allow(clippy::cast_possible_truncation)] // the loss is the point
#[inline(always)]
fn through_single(number: f64) -> f64 {
    f64::from(number as f32)
}
