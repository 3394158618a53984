//! Marks: reference lines and shaded bands under the data.

use super::axis::{Domain, Extent, Scale};

/// A reference under the data: a line at one value or a shaded band between two, with a label outside the
/// plotting area. A mark widens an automatic range so that it is seen; outside a fixed range it is left out.
#[derive(Debug, Clone)]
pub struct Mark {
    pub(super) direction: Direction,
    pub(super) label: String,
    from: f64,
    to: f64,
}

/// The axis on which a mark's values lie.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Direction {
    X,
    Y,
}

impl Mark {
    /// A vertical line at `x`, in the unit of the x axis.
    pub fn at_x(x: f64, label: impl Into<String>) -> Self {
        Self::between(Direction::X, x, x, label)
    }

    /// A horizontal line at `y`, in the unit of the y axis.
    pub fn at_y(y: f64, label: impl Into<String>) -> Self {
        Self::between(Direction::Y, y, y, label)
    }

    /// A band between two x values in either order. An infinite end reaches the edge of the panel.
    pub fn between_x(from: f64, to: f64, label: impl Into<String>) -> Self {
        Self::between(Direction::X, from, to, label)
    }

    /// A band between two y values in either order. An infinite end reaches the edge of the panel.
    pub fn between_y(from: f64, to: f64, label: impl Into<String>) -> Self {
        Self::between(Direction::Y, from, to, label)
    }

    fn between(direction: Direction, from: f64, to: f64, label: impl Into<String>) -> Self {
        let (from, to) = if from <= to { (from, to) } else { (to, from) };
        Self { direction, label: label.into(), from, to }
    }

    /// The part of the mark inside `domain`, in its coordinates; both ends are equal for a line. Nothing when
    /// the mark lies outside or has no place (NaN, a line at infinity).
    pub(super) fn visible(&self, domain: &Domain) -> Option<(f64, f64)> {
        if self.from == self.to {
            let at = domain.scale.forward(self.from)?;
            return (domain.low..=domain.high).contains(&at).then_some((at, at));
        }
        let from = self.end(self.from, domain)?.max(domain.low);
        let to = self.end(self.to, domain)?.min(domain.high);
        (from < to).then_some((from, to))
    }

    /// The coordinate of an end of a band; ends that the scale cannot show reach the edge they point at.
    fn end(&self, value: f64, domain: &Domain) -> Option<f64> {
        match domain.scale.forward(value) {
            Some(coordinate) => Some(coordinate),
            None if value.is_nan() => None,
            None if value > 0.0 => Some(domain.high),
            None => Some(domain.low),
        }
    }

    /// Widens `extent` by the ends that can be drawn.
    pub(super) fn include_in(&self, extent: &mut Extent, scale: Scale) {
        for coordinate in [self.from, self.to].into_iter().filter_map(|value| scale.forward(value)) {
            extent.include(coordinate);
        }
    }
}
