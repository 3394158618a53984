//! Axes: quantity, unit, scale, and the range ([`Domain`]) that an axis covers.
//!
//! Every value passes [`Scale::forward`], which rejects values that cannot be drawn. All geometry after that is linear: a log axis
//! is a linear axis of decimal logarithms.

use super::quantity::Quantity;
use super::step::NiceStep;
use super::text;

/// Largest magnitude that is drawn; larger values count as infinite, so that the difference of two values never overflows.
pub(super) const LARGEST_DRAWABLE: f64 = 1e300;

/// Relative width below which a range counts as a constant with rounding errors, and is widened as a constant.
const NARROWEST_RELATIVE_SPAN: f64 = 1e-9;

/// Space between the data and the ends of a padded axis, as a fraction of the data's span.
const PADDING: f64 = 0.06;

/// Minimum range of a logarithmic axis, in decades: smaller differences are not visible.
const LEAST_DECADES: f64 = 0.1;

/// Largest distance from the data to a round value at which a tight axis ends there, as a fraction of the data's span.
const ROUNDING_REACH: f64 = 0.015;

/// Space below the top of the lowest bar of a histogram on a log axis, in decades, so that a single count is visible as a bar.
const LOG_FLOOR_DECADES: f64 = 0.3;

/// Largest distance from zero, for data of one sign, at which the axis is extended to zero, as a fraction of the farthest value.
const SNAP_TO_ZERO: f64 = 0.25;

/// Axis of a panel: label, unit, linear or logarithmic scale, and range, automatic by default.
#[derive(Debug, Clone)]
#[must_use]
pub struct Axis {
    pub(super) label: String,
    pub(super) unit: String,
    pub(super) scale: Scale,
    pub(super) fixed: Option<(f64, f64)>,
    pub(super) levels: Vec<f64>,
    least: f64,
    includes_zero: bool,
}

impl Axis {
    /// Creates a linear axis; `unit` is empty for a pure number.
    pub fn linear(label: impl Into<String>, unit: impl Into<String>) -> Self {
        Self {
            label: label.into(),
            unit: unit.into(),
            scale: Scale::Linear,
            fixed: None,
            levels: Vec::new(),
            least: 0.0,
            includes_zero: false,
        }
    }

    /// Creates a linear axis in the unit of `quantity`, with the minimum range of `quantity`; values have to be given
    /// in that unit.
    pub fn of(label: impl Into<String>, quantity: Quantity) -> Self {
        let (unit, per_si) = quantity.unit();
        Self::linear(label, unit).least_range(quantity.least_range_si() * per_si)
    }

    /// Creates a decimal-logarithmic axis; `unit` is empty for a pure number.
    pub fn log(label: impl Into<String>, unit: impl Into<String>) -> Self {
        Self { scale: Scale::Log, least: LEAST_DECADES, ..Self::linear(label, unit) }
    }

    /// Fixes the range, in the unit of the axis; the order of the ends does not matter. A range that cannot be drawn (not finite,
    /// empty, not positive on a log axis) is ignored in favour of the automatic range.
    pub fn range(mut self, low: f64, high: f64) -> Self {
        self.fixed = Some((low.min(high), low.max(high)));
        self
    }

    /// Widens an automatic range to at least `span`, in the unit of the axis, so that rounding errors do not look like
    /// a signal. Ignored on a logarithmic axis, which has a minimum range of its own, and for a `span` that is negative
    /// or not finite.
    pub fn least_range(mut self, span: f64) -> Self {
        if self.scale == Scale::Linear && (0.0..LARGEST_DRAWABLE).contains(&span) {
            self.least = span;
        }
        self
    }

    /// Extends an automatic range of a linear axis to zero, so that drawn lengths are proportional to values.
    pub fn with_zero(mut self) -> Self {
        self.includes_zero = true;
        self
    }

    /// Places tick labels on an x axis at these values only, for example the levels of an experiment; no values: automatic ticks.
    pub fn levels(mut self, levels: impl IntoIterator<Item = f64>) -> Self {
        self.levels = levels.into_iter().collect();
        self
    }

    /// Returns the unit in parentheses, scaled by the power of ten that the tick labels leave out: `(10⁻⁶ N)`.
    pub(super) fn unit_label(&self, exponent: i32) -> String {
        let power = if exponent == 0 { String::new() } else { format!("10{}", text::superscript(exponent)) };
        match (power.is_empty(), self.unit.is_empty()) {
            (true, true) => String::new(),
            (true, false) => format!("({})", self.unit),
            (false, true) => format!("({power})"),
            (false, false) => format!("({power} {})", self.unit),
        }
    }

    /// Returns label and unit, either of which may be empty: `Force (10⁻⁶ N)`.
    pub(super) fn name(&self, exponent: i32) -> String {
        format!("{} {}", self.label, self.unit_label(exponent)).trim().to_owned()
    }

    /// Returns the range that the axis covers for data within `extent`.
    pub(super) fn domain(&self, mut extent: Extent, fit: Fit) -> Domain {
        if self.includes_zero && self.scale == Scale::Linear && !extent.is_empty() {
            extent.include(0.0);
        }
        let fixed = self.fixed.and_then(|(low, high)| {
            let ends = (self.scale.forward(low)?, self.scale.forward(high)?);
            (!is_narrow(ends.0, ends.1)).then_some(ends)
        });
        let (low, high) = fixed.unwrap_or_else(|| fit.apply(self.scale, extent, self.least));
        Domain { scale: self.scale, low, high }
    }
}

/// Mapping from values to distances along an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Scale {
    Linear,
    Log,
}

impl Scale {
    /// Returns the coordinate of `value` along the axis (the value, or its decimal logarithm); `None` if it
    /// cannot be drawn.
    pub(super) fn forward(self, value: f64) -> Option<f64> {
        match self {
            Self::Linear => (value.abs() <= LARGEST_DRAWABLE).then_some(value),
            Self::Log => (value > 0.0 && value <= LARGEST_DRAWABLE).then(|| value.log10()),
        }
    }

    /// Returns the value at a coordinate.
    pub(super) fn backward(self, coordinate: f64) -> f64 {
        match self {
            Self::Linear => coordinate,
            Self::Log => 10.0_f64.powf(coordinate),
        }
    }
}

/// Least and greatest coordinate so far; `low > high` without a coordinate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Extent {
    pub(super) low: f64,
    pub(super) high: f64,
}

impl Extent {
    pub(super) const EMPTY: Self = Self { low: f64::INFINITY, high: f64::NEG_INFINITY };

    /// Returns the range of the coordinates.
    pub(super) fn of(coordinates: impl IntoIterator<Item = f64>) -> Self {
        let mut extent = Self::EMPTY;
        coordinates.into_iter().for_each(|coordinate| extent.include(coordinate));
        extent
    }

    pub(super) fn is_empty(&self) -> bool {
        self.low > self.high
    }

    pub(super) fn include(&mut self, coordinate: f64) {
        self.low = self.low.min(coordinate);
        self.high = self.high.max(coordinate);
    }

    pub(super) fn with(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }
}

/// Rule for the automatic range around the data.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Fit {
    /// Ends where the data end, or at a round value just beyond: the x axis of lines.
    Tight,
    /// Space at both ends, but stops at zero if zero is near: the y axis of lines, both axes of markers.
    Padded,
    /// Begins at zero, or below the least value on a log axis: the y axis of bars.
    OnZero,
}

impl Fit {
    /// Returns the range around the data, at least `least` wide.
    fn apply(self, scale: Scale, extent: Extent, least: f64) -> (f64, f64) {
        let Extent { mut low, mut high } = extent;
        if extent.is_empty() {
            return (0.0, 1.0);
        }
        if self == Self::OnZero && scale == Scale::Linear {
            (low, high) = (low.min(0.0), high.max(0.0));
        }
        if is_narrow(low, high) {
            return around_constant(scale, low, high, least);
        }
        if high - low < least {
            (low, high) = widened(self, scale, [low, high], least);
        }
        let room = PADDING * (high - low);
        let (padded_low, padded_high) = (low - room, high + room);
        match (self, scale) {
            (Self::Tight, Scale::Log) => (low, high),
            (Self::Tight, Scale::Linear) => rounded_outward(low, high),
            (Self::Padded, Scale::Log) => (padded_low, padded_high),
            (Self::OnZero, Scale::Log) => (low - LOG_FLOOR_DECADES, padded_high),
            (Self::Padded | Self::OnZero, Scale::Linear) => (
                if low >= 0.0 && low <= SNAP_TO_ZERO * high { 0.0 } else { padded_low },
                if high <= 0.0 && high >= SNAP_TO_ZERO * low { 0.0 } else { padded_high },
            ),
        }
    }
}

/// Moves each end to the round value just beyond it, if one is near: 0 to 9.999 s is shown as 0 to 10 s.
fn rounded_outward(low: f64, high: f64) -> (f64, f64) {
    let reach = ROUNDING_REACH * (high - low);
    let step = NiceStep::at_least((high - low) / 10.0).size();
    let (round_low, round_high) = ((low / step).floor() * step, (high / step).ceil() * step);
    (
        if low - round_low <= reach { round_low } else { low },
        if round_high - high <= reach { round_high } else { high },
    )
}

/// Returns true if two ends are too close to distinguish, in particular equal.
fn is_narrow(low: f64, high: f64) -> bool {
    high - low <= NARROWEST_RELATIVE_SPAN * low.abs().max(high.abs()) || high - low < 1.0 / LARGEST_DRAWABLE
}

/// Moves the ends apart to a span of `least`: away from zero for bars on a linear axis, otherwise to both sides.
fn widened(fit: Fit, scale: Scale, [low, high]: [f64; 2], least: f64) -> (f64, f64) {
    if fit == Fit::OnZero && scale == Scale::Linear {
        return if high > 0.0 { (low, low + least) } else { (high - least, high) };
    }
    let middle = 0.5 * low + 0.5 * high;
    (middle - 0.5 * least, middle + 0.5 * least)
}

/// Returns a range with a constant in its middle: a tenth of the constant's magnitude to either side and at least half
/// of `least`; one unit around zero without a minimum range; a third of a decade on a log axis.
fn around_constant(scale: Scale, low: f64, high: f64, least: f64) -> (f64, f64) {
    let middle = 0.5 * low + 0.5 * high;
    let room = match scale {
        Scale::Log => 1.0 / 3.0,
        Scale::Linear if middle.abs() < 1.0 / LARGEST_DRAWABLE && least == 0.0 => 1.0,
        Scale::Linear => (0.1 * middle.abs()).max(0.5 * least),
    };
    (middle - room, middle + room)
}

/// Range that an axis covers, in scale coordinates. `low < high`, both finite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Domain {
    pub(super) scale: Scale,
    pub(super) low: f64,
    pub(super) high: f64,
}

impl Domain {
    pub(super) fn span(&self) -> f64 {
        self.high - self.low
    }

    /// Returns the position of a coordinate: 0 at the low end, 1 at the high end, below 0 or above 1 outside.
    pub(super) fn fraction(&self, coordinate: f64) -> f64 {
        (coordinate - self.low) / self.span()
    }
}
