//! Series: samples of one curve with their style, and the range that they cover.

use super::axis::{Domain, Extent, Scale};
use super::theme::{Slot, Weight};
use super::trace::Trace;

/// Drawn width, in decades, of a bin that starts at zero on a log axis, where its left edge is infinitely far away.
const OPEN_BIN_DECADES: f64 = 0.5;

/// Labelled samples with their style. Colour, dash and marker depend on the position of the series in its panel unless
/// [`Series::slot`] or [`Series::axis`] sets them. A series with an empty label is not in the legend.
#[derive(Debug, Clone)]
#[must_use]
pub struct Series {
    pub(super) label: String,
    /// Colour and dash; `None`: by the position of the series in its panel.
    slot: Option<Slot>,
    weight: Weight,
    pub(super) shape: Shape,
    /// Number of samples or bins given, drawable or not.
    pub(super) given: usize,
}

/// Samples with the kind of drawing.
#[derive(Debug, Clone)]
pub(super) enum Shape {
    Line(Vec<(f64, f64)>),
    Steps(Vec<(f64, f64)>),
    Points(Vec<(f64, f64)>),
    Histogram(Vec<Bin>),
    Errors(Vec<ErrorBar>),
}

/// Error bar from `low` to `high` at `x`, in the units of the panel's axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorBar {
    /// Position, unit of the x axis.
    pub x: f64,
    /// Lower end, unit of the y axis.
    pub low: f64,
    /// Upper end, unit of the y axis.
    pub high: f64,
}

impl ErrorBar {
    /// Creates an error bar of length `error` to each side of `value`.
    #[must_use]
    pub fn around(x: f64, value: f64, error: f64) -> Self {
        Self { x, low: value - error, high: value + error }
    }

    /// Returns both ends in the coordinates of the scales; `None` if an end cannot be drawn.
    pub(super) fn ends(&self, x: Scale, y: Scale) -> Option<[(f64, f64); 2]> {
        let x = x.forward(self.x)?;
        Some([(x, y.forward(self.low)?), (x, y.forward(self.high)?)])
    }
}

/// Bar of a histogram: `height` over `from..to`, in the units of the panel's axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bin {
    /// Left edge, unit of the x axis.
    pub from: f64,
    /// Right edge, unit of the x axis; a bin with zero or negative width is not drawn.
    pub to: f64,
    /// Height, unit of the y axis.
    pub height: f64,
}

impl Bin {
    /// Sums `(value, count)` pairs in bars of a quarter octave, a factor of 2^(1/4), from `first` (positive) upwards; values below
    /// `first` are in the first bar.
    #[must_use]
    pub fn quarter_octaves(first: f64, counts: impl IntoIterator<Item = (f64, u64)>) -> Vec<Self> {
        const STEP: f64 = 1.189_207_115_002_721; // 2^(1/4)
        let mut heights = Vec::new();
        for (value, count) in counts {
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
            // some two hundred bars for nanoseconds to hours
            let index = (4.0 * libm::log2((value / first).max(1.0))).floor() as usize;
            if heights.len() <= index {
                heights.resize(index + 1, 0.0);
            }
            if let Some(height) = heights.get_mut(index) {
                let count = count as f64;
                *height += count;
            }
        }
        let mut from = first;
        let bin = |height| {
            let bin = Self { from, to: from * STEP, height };
            from *= STEP;
            bin
        };
        heights.into_iter().map(bin).collect()
    }

    /// Returns left and right edge in the coordinates of `scale`; `None` if the bin cannot be drawn.
    pub(super) fn edges(&self, scale: Scale) -> Option<(f64, f64)> {
        let right = scale.forward(self.to)?;
        let left = match scale {
            Scale::Log if self.from == 0.0 => right - OPEN_BIN_DECADES,
            _ => scale.forward(self.from)?,
        };
        (left < right).then_some((left, right))
    }
}

impl Series {
    /// Creates a line of samples `(x, y)`, joined in the given order; x need not increase. A sample that is not finite,
    /// or not positive on a log axis, breaks the line; an isolated sample is drawn as a dot.
    pub fn line(label: impl Into<String>, samples: impl IntoIterator<Item = (f64, f64)>) -> Self {
        Self::new(label, Shape::Line(samples.into_iter().collect()))
    }

    /// Creates a line of the samples of `trace`, joined as in [`Series::line`].
    pub fn trace(label: impl Into<String>, trace: Trace) -> Self {
        let (samples, given) = trace.into_parts();
        Self { given, ..Self::new(label, Shape::Line(samples)) }
    }

    /// Creates a step line of samples `(x, y)`: y is constant until the next x (zero-order hold).
    pub fn steps(label: impl Into<String>, samples: impl IntoIterator<Item = (f64, f64)>) -> Self {
        Self::new(label, Shape::Steps(samples.into_iter().collect()))
    }

    /// Creates markers at the samples `(x, y)`; markers that coincide within a pixel are drawn once.
    pub fn points(label: impl Into<String>, samples: impl IntoIterator<Item = (f64, f64)>) -> Self {
        Self::new(label, Shape::Points(samples.into_iter().collect()))
    }

    /// Creates the filled bars of a histogram; `bins` have to be in order of x. On a log y axis the bars begin at the lower end of
    /// the axis.
    pub fn histogram(label: impl Into<String>, bins: impl IntoIterator<Item = Bin>) -> Self {
        Self::new(label, Shape::Histogram(bins.into_iter().collect()))
    }

    /// Creates error bars with caps at both ends, for standard errors or intervals. Add this series after the series of
    /// the values.
    pub fn errors(label: impl Into<String>, bars: impl IntoIterator<Item = ErrorBar>) -> Self {
        Self::new(label, Shape::Errors(bars.into_iter().collect()))
    }

    fn new(label: impl Into<String>, shape: Shape) -> Self {
        let given = match &shape {
            Shape::Line(samples) | Shape::Steps(samples) | Shape::Points(samples) => samples.len(),
            Shape::Histogram(bins) => bins.len(),
            Shape::Errors(bars) => bars.len(),
        };
        Self { label: label.into(), slot: None, weight: Weight::Full, shape, given }
    }

    /// Sets the palette entry `slot` (counted from 0), so that a quantity has the same style in every panel, or a
    /// theory line the colour of its measured points.
    pub fn slot(mut self, slot: usize) -> Self {
        self.slot = Some(Slot::new(slot));
        self
    }

    /// Sets the colour of vector component 0, 1 or 2 (x, y or z): the line is solid, with the same colour in every panel and picture.
    pub fn axis(mut self, component: usize) -> Self {
        self.slot = Some(Slot::of_axis(component));
        self
    }

    /// Draws the line thin, solid and pale, as one of many similar lines.
    pub fn faint(mut self) -> Self {
        self.weight = Weight::Faint;
        self
    }

    /// Returns colour, dash and marker of the series at `index` in its panel.
    pub(super) fn look(&self, index: usize) -> Slot {
        self.slot.unwrap_or_else(|| Slot::new(index)).with_weight(self.weight)
    }

    /// Returns the x range of the samples that can be drawn, in the coordinates of the x scale.
    pub(super) fn extent_x(&self, x_scale: Scale, y_scale: Scale) -> Extent {
        self.boxes(x_scale, y_scale).map(|(x, _)| x).fold(Extent::EMPTY, Extent::with)
    }

    /// Returns the y range of the samples within the x domain, in the coordinates of the y scale.
    pub(super) fn extent_y(&self, x_domain: &Domain, y_scale: Scale) -> Extent {
        let is_within = |x: &Extent| match &self.shape {
            // A bar that only touches the domain is not visible.
            Shape::Histogram(_) => x.high > x_domain.low && x.low < x_domain.high,
            _ => (x_domain.low..=x_domain.high).contains(&x.low),
        };
        let boxes = self.boxes(x_domain.scale, y_scale);
        boxes.filter(|(x, _)| is_within(x)).map(|(_, y)| y).fold(Extent::EMPTY, Extent::with)
    }

    /// Returns the ranges of x and y of each sample or bar that can be drawn; the range of y is empty for a bar with a height that
    /// cannot be drawn.
    fn boxes(&self, x_scale: Scale, y_scale: Scale) -> Box<dyn Iterator<Item = (Extent, Extent)> + '_> {
        match &self.shape {
            Shape::Line(samples) | Shape::Steps(samples) | Shape::Points(samples) => {
                let point = move |&(x, y): &(f64, f64)| {
                    Some((Extent::of([x_scale.forward(x)?]), Extent::of([y_scale.forward(y)?])))
                };
                Box::new(samples.iter().filter_map(point))
            }
            Shape::Histogram(bins) => {
                let bar = move |bin: &Bin| {
                    let (left, right) = bin.edges(x_scale)?;
                    Some((Extent::of([left, right]), Extent::of(y_scale.forward(bin.height))))
                };
                Box::new(bins.iter().filter_map(bar))
            }
            Shape::Errors(bars) => {
                let bar = move |bar: &ErrorBar| {
                    let [(x, low), (_, high)] = bar.ends(x_scale, y_scale)?;
                    Some((Extent::of([x]), Extent::of([low, high])))
                };
                Box::new(bars.iter().filter_map(bar))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_is_in_the_bar_of_its_quarter_octave() {
        let bins = Bin::quarter_octaves(0.01, [(0.001, 5), (0.009, 2), (1.0, 7), (1000.0, 1)]);
        let count = |at: f64| bins.iter().find(|bin| bin.from <= at && at < bin.to).map(|bin| bin.height);
        assert_eq!(count(0.01), Some(7.0), "what is below the first");
        assert_eq!(count(1.0), Some(7.0));
        assert_eq!(count(1000.0), Some(1.0));
        assert_eq!(bins.iter().map(|bin| bin.height).sum::<f64>(), 15.0);
    }
}
