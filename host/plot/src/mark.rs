//! Marks: reference lines under the data, and faults over the data.

use super::axis::{Domain, Extent, Scale};

/// Reference line under the data, or a fault, with a label outside the plotting area. An automatic range is widened to include the
/// mark; a mark outside a fixed range is not drawn.
#[derive(Debug, Clone)]
pub struct Mark {
    pub(super) direction: Direction,
    pub(super) label: String,
    pub(super) look: MarkLook,
    at: f64,
}

/// Style of a mark.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum MarkLook {
    /// A thin dashed line.
    Reference,
    /// A solid line with a cross at its top, in the colour of faults.
    Fault,
}

/// Axis on which a mark's value lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Direction {
    X,
    Y,
}

impl Mark {
    /// Creates a vertical reference line at `x`, in the unit of the x axis; with an empty label it has no name.
    pub fn at_x(x: f64, label: impl Into<String>) -> Self {
        Self { direction: Direction::X, label: label.into(), look: MarkLook::Reference, at: x }
    }

    /// Creates a fault at `x`, in the unit of the x axis: a line over the whole height with a cross.
    pub fn fault_at_x(x: f64, label: impl Into<String>) -> Self {
        Self { look: MarkLook::Fault, ..Self::at_x(x, label) }
    }

    /// Creates a horizontal reference line at `y`, in the unit of the y axis; with an empty label it has no name.
    pub fn at_y(y: f64, label: impl Into<String>) -> Self {
        Self { direction: Direction::Y, ..Self::at_x(y, label) }
    }

    /// Returns the coordinate of the mark in `domain`; `None` if it is outside or cannot be drawn (NaN, infinity).
    pub(super) fn visible(&self, domain: &Domain) -> Option<f64> {
        domain.scale.forward(self.at).filter(|at| (domain.low..=domain.high).contains(at))
    }

    /// Extends `extent` to the mark, if the mark can be drawn.
    pub(super) fn include_in(&self, extent: &mut Extent, scale: Scale) {
        scale.forward(self.at).into_iter().for_each(|at| extent.include(at));
    }
}
