//! Extension `flotor.soft-range/1`: range in which a live parameter of a model is usefully changed by hand.
//!
//! The legal range of a parameter often spans many powers of ten. A slider over the legal range would be useless and
//! dangerous: a few pixels could change the force abruptly. A slider covers the soft range instead, and a host changes a
//! live parameter at a rate derived from the soft range. A value beyond the soft range is legal, but has to be typed.
//!
//! For a parameter without a declared soft range, a host uses [`SoftRange::around`] the current value.

use crate::abi::Str;
use crate::abi::interface::table;
use crate::abi::layout::layout;
use crate::{ForceModel, Parameter, ParameterKind};

/// Soft range of one parameter, in its unit. 40 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct SoftRange {
    id: Str,
    min: f64,
    max: f64,
    step: f64,
}

impl SoftRange {
    /// Factor by which a positive value may grow or shrink in an undeclared range.
    const FACTOR: f64 = 3.0;
    /// Half width of an undeclared range about zero, as a fraction of the legal range.
    const SHARE: f64 = 0.05;
    /// Number of steps of an undeclared range.
    const STEPS: f64 = 100.0;

    /// Declares the soft range of a parameter: smallest and largest number, and the step per key press, in the
    /// parameter's unit.
    #[must_use]
    pub const fn new(id: &'static str, min: f64, max: f64, step: f64) -> Self {
        Self { id: Str::new(id), min, max, step }
    }

    /// Returns a soft range about `value`, within the legal range, for a parameter without a declared soft range. For a positive
    /// value of a parameter that cannot be negative: from a third of the value to three times the value. Otherwise the range
    /// extends to both sides of the value by twice its magnitude, at least by a twentieth of the legal range. `None` for a
    /// parameter that is not a number with a finite range.
    #[must_use]
    pub fn around(parameter: &'static Parameter, value: f64) -> Option<Self> {
        let value = if value.is_finite() { value } else { parameter.default() };
        let (low, high) = if value > 0.0 && parameter.min() >= 0.0 {
            (value / Self::FACTOR, value * Self::FACTOR)
        } else {
            let width = parameter.max() - parameter.min();
            let half = (value.abs() * (Self::FACTOR - 1.0)).max(width * Self::SHARE);
            (value - half, value + half)
        };
        Self::new(parameter.id(), low, high, (high - low) / Self::STEPS).within(parameter)
    }

    /// Returns the legal part of the range; `None` for a parameter that is not a number, if no part is legal, or if the
    /// step is not positive.
    #[must_use]
    pub fn within(self, parameter: &'static Parameter) -> Option<Self> {
        let is_number = matches!(parameter.kind(), ParameterKind::Real);
        let (min, max) = (self.min.max(parameter.min()), self.max.min(parameter.max()));
        let is_range = min.is_finite() && max.is_finite() && min < max && self.step > 0.0;
        (is_number && is_range).then_some(Self { min, max, ..self })
    }

    /// Returns the id of the parameter.
    #[must_use]
    pub const fn id(&self) -> &str {
        self.id.as_str()
    }

    /// Returns the lower end of the soft range, in the parameter's unit.
    #[must_use]
    pub const fn min(&self) -> f64 {
        self.min
    }

    /// Returns the upper end of the soft range, in the parameter's unit.
    #[must_use]
    pub const fn max(&self) -> f64 {
        self.max
    }

    /// Returns the step per key press, in the parameter's unit.
    #[must_use]
    pub const fn step(&self) -> f64 {
        self.step
    }

    /// Returns the rate at which a live request changes the number, in its unit per second: a tenth of the range in 50 ms.
    #[must_use]
    pub fn rate_per_s(&self) -> f64 {
        (self.max - self.min) * 0.1 / 0.05
    }
}

/// Force model that declares soft ranges of its parameters.
pub trait SoftRangeModel: ForceModel {
    /// Soft ranges, one per declared parameter.
    const SOFT_RANGES: &'static [SoftRange];
}

/// Function table `flotor.soft-range/1`: see [`SoftRangeModel`].
#[repr(C)]
#[derive(Clone, Copy)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct SoftRangeTable {
    /// Size of this table in the plugin's build, bytes.
    pub size: u32,
    /// Number of ranges.
    pub range_count: u32,
    /// Soft ranges, constant.
    pub ranges: *const SoftRange,
}

layout! {
    SoftRange { id, min, max, step }
    SoftRangeTable { size, range_count, ranges }
}
table!(SoftRangeTable: "flotor.soft-range/1", M: [SoftRangeModel] {
    range_count: M::SOFT_RANGES.len() as u32,
    ranges: M::SOFT_RANGES.as_ptr(),
});

#[cfg(test)]
mod tests {
    use super::*;
    use crate::choices;

    const SCHEMA: &[Parameter] = &[
        Parameter::real("gamma_n", "N", 0.01, 10_000.0, 20.0, "Rigidity").live(),
        Parameter::real("offset_mm", "mm", -100.0, 100.0, 0.0, "Offset").live(),
        Parameter::choice("law", choices!["fast", "exact"], 0, "Law").live(),
        Parameter::real("friction", "1", 0.0, 1.0, 0.5, "Friction").live(),
    ];

    fn around(index: usize, value: f64) -> Option<[f64; 2]> {
        SoftRange::around(&SCHEMA[index], value).map(|range| [range.min(), range.max()])
    }

    #[test]
    fn a_range_nobody_declared_is_about_the_value_and_legal() {
        assert_eq!(around(0, 30.0), Some([10.0, 90.0]));
        assert_eq!(around(0, f64::NAN), Some([20.0 / 3.0, 60.0]));
        assert_eq!(around(0, 9000.0), Some([3000.0, 10_000.0]));
        assert_eq!(around(1, 0.0), Some([-10.0, 10.0]));
        assert_eq!(around(1, -50.0), Some([-100.0, 50.0]));
        assert_eq!(around(2, 0.0), None);
        assert_eq!(around(3, 0.0), Some([0.0, 0.05]));
    }

    #[test]
    fn what_a_model_declares_is_cut_to_what_is_legal_or_not_used() {
        let range = |min, max, step| SoftRange::new("gamma_n", min, max, step).within(&SCHEMA[0]);
        let cut = range(-5.0, 60.0, 0.5).expect("it has a legal part");
        assert_eq!((cut.min(), cut.max(), cut.step()), (0.01, 60.0, 0.5));
        assert_eq!(cut.rate_per_s(), (60.0 - 0.01) * 2.0);
        for (min, max, step) in
            [(20_000.0, 30_000.0, 1.0), (60.0, 12.0, 1.0), (12.0, 60.0, 0.0), (f64::NAN, 1.0, 1.0)]
        {
            // The smallest legal number takes the place of one that is none.
            assert!(range(min, max, step).is_none_or(|range| range.min() == 0.01), "{min} {max} {step}");
        }
    }
}
