//! Extension `flotor.soft-range/1`: where a live number of a model is usefully moved by hand.
//!
//! The legal range of a parameter is all that a model can compute, often many powers of ten. A slider over it is of no use and
//! does harm: a few pixels are a change no hand expects. A slider covers the soft range instead, and a host moves a live
//! number at a rate that comes from it. A value beyond it is legal, and is typed.
//!
//! For what a model does not declare, a host takes [`SoftRange::around`] the value in force.

use crate::abi::Str;
use crate::abi::interface::table;
use crate::abi::layout::layout;
#[cfg(feature = "loader")]
use crate::abi::loader::Plugin;
use crate::{ForceModel, Parameter, ParameterKind};

/// The soft range of one parameter, in its unit. 40 bytes.
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
    /// How many times a positive value may grow or shrink in a range nobody declared.
    const FACTOR: f64 = 3.0;
    /// Half of the width of a range about zero that nobody declared, as a share of the legal range.
    const SHARE: f64 = 0.05;
    /// Steps of a range nobody declared.
    const STEPS: f64 = 100.0;

    /// Of the parameter with this id: smallest and largest number, and the step of a key, in the parameter's unit.
    #[must_use]
    pub const fn new(id: &'static str, min: f64, max: f64, step: f64) -> Self {
        Self { id: Str::new(id), min, max, step }
    }

    /// A range for a parameter whose model declares none: from a third of a value to three times it, and about zero a
    /// twentieth of the legal range to both sides; never beyond the legal range. `None` for what is no number, or has no width.
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

    /// The part of it that is legal; `None` for what is no number, and where nothing of it is left.
    #[must_use]
    pub fn within(self, parameter: &'static Parameter) -> Option<Self> {
        let is_number = matches!(parameter.kind(), ParameterKind::Real);
        let (min, max) = (self.min.max(parameter.min()), self.max.min(parameter.max()));
        let is_range = min.is_finite() && max.is_finite() && min < max && self.step > 0.0;
        (is_number && is_range).then_some(Self { min, max, ..self })
    }

    /// Id of the parameter.
    #[must_use]
    pub const fn id(&self) -> &str {
        self.id.as_str()
    }

    /// Smallest number.
    #[must_use]
    pub const fn min(&self) -> f64 {
        self.min
    }

    /// Largest number.
    #[must_use]
    pub const fn max(&self) -> f64 {
        self.max
    }

    /// The step of a key.
    #[must_use]
    pub const fn step(&self) -> f64 {
        self.step
    }

    /// How fast a live request moves the number, in its unit per second: a tenth of the range in 50 ms.
    #[must_use]
    pub fn rate_per_s(&self) -> f64 {
        (self.max - self.min) * 0.1 / 0.05
    }
}

/// A force model that says where its numbers are usefully moved.
pub trait SoftRangeModel: ForceModel {
    /// One for each parameter it says so of.
    const SOFT_RANGES: &'static [SoftRange];
}

/// `flotor.soft-range/1`: see [`SoftRangeModel`].
#[repr(C)]
#[derive(Clone, Copy)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct SoftRangeTable {
    /// Bytes of this table as the plugin knows it.
    pub size: u32,
    /// Number of ranges.
    pub range_count: u32,
    /// The ranges, constant.
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

#[cfg(feature = "loader")]
impl Plugin {
    /// What a model declares; empty for one that does not, and for a device.
    #[must_use]
    pub fn soft_ranges(&self) -> &'static [SoftRange] {
        match self.model_extensions().and_then(|extensions| extensions.soft_range) {
            Some(table) if !table.ranges.is_null() && table.range_count > 0 => {
                // SAFETY: a table's list is a static array of `range_count` ranges of the checked layout.
                unsafe { std::slice::from_raw_parts(table.ranges, table.range_count as usize) }
            }
            _ => &[],
        }
    }

    /// The soft range of a parameter, declared or [around](SoftRange::around) the value in force; `None` for what is no
    /// number. Not real-time.
    #[must_use]
    pub fn soft_range(&self, index: usize, value: f64) -> Option<SoftRange> {
        let parameter = self.parameters().get(index)?;
        let declared = self.soft_ranges().iter().find(|range| range.id() == parameter.id());
        declared.and_then(|range| range.within(parameter)).or_else(|| SoftRange::around(parameter, value))
    }
}

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
