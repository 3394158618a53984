//! Ticks: round values along an axis, with labels of the same number of decimals.
//!
//! Linear steps are 1, 2 or 5 times a power of ten (the classic nice numbers: Heckbert, "Nice numbers for graph labels", Graphics
//! Gems, 1990). Log axes have labels at decades, at 1-2-5 if there is room, and as a linear axis if the range is too small for
//! either.

use super::axis::{Domain, Scale};
use super::step::{END_TOLERANCE, NiceStep, exponent_of, power_of_ten, to_integer};
use super::text;

/// Magnitude at and above which tick labels leave out a power of ten, which the axis label then contains.
const LARGEST_PLAIN: f64 = 1e5;
/// Magnitude below which tick labels leave out a power of ten, which the axis label then contains.
const SMALLEST_PLAIN: f64 = 1e-2;

/// Decades labelled in plain digits (0.001 to 10 000); if one is outside, all labels of the axis are powers of ten.
const PLAIN_DECADES: std::ops::RangeInclusive<i32> = -3..=4;

/// Ticks of one axis; positions are fractions of its domain. The default is an axis without ticks.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Ticks {
    pub(super) major: Vec<Tick>,
    pub(super) minor: Vec<f64>,
    /// Power of ten that the labels leave out.
    pub(super) exponent: i32,
}

/// Labelled tick.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Tick {
    pub(super) position: f64,
    pub(super) label: String,
}

/// Space that a label needs along its axis.
#[derive(Debug, Clone, Copy)]
pub(super) enum Spacing {
    /// Labels one below the other, at least `pitch_px` apart.
    Vertical { pitch_px: f64 },
    /// Labels side by side, with a gap of at least `gap_px` between their texts.
    Horizontal { gap_px: f64, font_px: f64 },
}

impl Spacing {
    fn pitch_px(self, ticks: &Ticks) -> f64 {
        match self {
            Self::Vertical { pitch_px } => pitch_px,
            Self::Horizontal { gap_px, font_px } => {
                ticks.major.iter().map(|tick| text::width_px(&tick.label, font_px)).fold(0.0, f64::max)
                    + gap_px
            }
        }
    }
}

impl Ticks {
    /// Returns the densest ticks with enough distance between their labels on an axis of `length_px`.
    pub(super) fn fit(domain: &Domain, length_px: f64, spacing: Spacing) -> Self {
        let most = match spacing {
            Spacing::Vertical { pitch_px } => length_px / pitch_px,
            Spacing::Horizontal { gap_px, .. } => length_px / (2.0 * gap_px),
        };
        let mut most = most.clamp(2.0, 20.0);
        loop {
            let ticks = Self::at_most(domain, most);
            if most <= 2.0 || ticks.closest() * length_px >= spacing.pitch_px(&ticks) {
                return ticks;
            }
            most = (most - 1.0).max(2.0);
        }
    }

    /// Places labels at `values`, without minor ticks; values outside the axis are left out.
    pub(super) fn at(domain: &Domain, values: &[f64]) -> Self {
        let tick = |value: &f64| {
            let position = domain.fraction(domain.scale.forward(*value)?);
            let tick = Tick { position, label: value.to_string() };
            (-END_TOLERANCE..=1.0 + END_TOLERANCE).contains(&position).then_some(tick)
        };
        Self { major: values.iter().filter_map(tick).collect(), ..Self::default() }
    }

    /// Places at most about `most` ticks.
    fn at_most(domain: &Domain, most: f64) -> Self {
        match domain.scale {
            Scale::Linear => linear(domain.low, domain.high, most, |value| domain.fraction(value)),
            Scale::Log => log(domain, most),
        }
    }

    /// Returns the distance of the two closest labelled ticks, as a fraction of the axis.
    fn closest(&self) -> f64 {
        self.major
            .windows(2)
            .filter_map(|pair| Some((pair.last()?.position - pair.first()?.position).abs()))
            .fold(f64::INFINITY, f64::min)
    }
}

/// Places multiples of a nice step within `low..=high`, mapped by `fraction`.
fn linear(low: f64, high: f64, most: f64, fraction: impl Fn(f64) -> f64) -> Ticks {
    let step = NiceStep::at_least((high - low) / most);
    let exponent = left_out_exponent(low.abs().max(high.abs()));
    let decimals = usize::try_from(exponent - step.exponent).unwrap_or(0);
    let unit = power_of_ten(exponent);
    let major = multiples(low, high, step.size())
        .map(|value| Tick { position: fraction(value), label: text::decimal(value / unit, decimals) })
        .collect();
    let minor = multiples(low, high, step.size() / step.subdivisions()).map(fraction).collect();
    Ticks { major, minor, exponent }
}

/// Returns the multiples of `step` from `low` to `high`.
fn multiples(low: f64, high: f64, step: f64) -> impl Iterator<Item = f64> {
    let tolerance = END_TOLERANCE * (high - low);
    let first = ((low - tolerance) / step).ceil();
    std::iter::successors(Some(first), |index| Some(index + 1.0))
        .map(move |index| index * step)
        .take_while(move |&value| value <= high + tolerance)
}

/// Returns the exponent of ten, a multiple of three, that labels of values up to `magnitude` leave out.
fn left_out_exponent(magnitude: f64) -> i32 {
    let is_plain = (SMALLEST_PLAIN..LARGEST_PLAIN).contains(&magnitude);
    if is_plain { 0 } else { exponent_of(magnitude).div_euclid(3) * 3 }
}

/// Places ticks of a log axis: at decades, at 1-2-5 in each decade, or in linear steps, whichever gives enough labels.
fn log(domain: &Domain, most: f64) -> Ticks {
    const DIGITS_1_2_5: [f64; 3] = [1.0, 2.0, 5.0];
    let minor = log_positions(domain, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0], 1);
    let dense = log_positions(domain, &DIGITS_1_2_5, 1);
    if dense.len() < 2 {
        let place = |value: f64| domain.fraction(value.max(f64::MIN_POSITIVE).log10());
        return linear(domain.scale.backward(domain.low), domain.scale.backward(domain.high), most, place);
    }
    // 2 and 5 divide a decade unevenly: the closest pair (1-2 or 5-10, 0.30 decade) determines whether the labels fit.
    let fits_dense = domain.span() / 0.30 <= most;
    let stride = (1..).find(|&stride| domain.span() / f64::from(stride) <= most).unwrap_or(1);
    let decades = log_positions(domain, &[1.0], stride);
    let is_plain = |ticks: &[LogTick]| ticks.iter().all(|tick| PLAIN_DECADES.contains(&tick.decade));
    // Beyond plain digits, `2×10⁵` between decades adds more clutter than information.
    let wants_dense = fits_dense && (is_plain(&dense) || decades.len() < 3);
    let chosen = if wants_dense || decades.len() < 2 { dense } else { decades };
    let plain = is_plain(&chosen);
    let major =
        chosen.iter().map(|tick| Tick { position: tick.position, label: tick.label(plain) }).collect();
    Ticks { major, minor: minor.iter().map(|tick| tick.position).collect(), exponent: 0 }
}

/// Tick `digit * 10^decade` of a log axis.
struct LogTick {
    digit: f64,
    decade: i32,
    position: f64,
}

impl LogTick {
    fn label(&self, plain: bool) -> String {
        let decimals = usize::try_from(-self.decade).unwrap_or(0);
        match (plain, self.digit == 1.0) {
            (true, _) => text::decimal(self.digit * power_of_ten(self.decade), decimals),
            (false, true) => format!("10{}", text::superscript(self.decade)),
            (false, false) => format!("{}×10{}", self.digit, text::superscript(self.decade)),
        }
    }
}

/// Places the given digits in every `stride`-th decade of the domain.
fn log_positions(domain: &Domain, digits: &[f64], stride: i32) -> Vec<LogTick> {
    let tolerance = END_TOLERANCE * domain.span();
    let inside = domain.low - tolerance..=domain.high + tolerance;
    (to_integer(domain.low.floor())..=to_integer(domain.high.ceil()))
        .filter(|decade| decade.rem_euclid(stride) == 0)
        .flat_map(|decade| digits.iter().map(move |&digit| (digit, decade)))
        .map(|(digit, decade)| (digit, decade, f64::from(decade) + digit.log10()))
        .filter(|(_, _, coordinate)| inside.contains(coordinate))
        .map(|(digit, decade, coordinate)| LogTick { digit, decade, position: domain.fraction(coordinate) })
        .collect()
}
