//! What a command line chooses of what is shown: the same in a window, a picture and a file of traces.

use crate::quantity::Quantity;

/// The choices; what is not chosen is as it is without them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Chosen {
    /// Number of the device that numbers and traces are of.
    pub device: usize,
    /// The traces, in the order of menus; empty: not chosen.
    traces: Vec<Quantity>,
    /// Axis of force over position; none: not shown.
    pub force_position: Option<usize>,
}

impl Chosen {
    /// Of a device, its traces, and force over position along an axis.
    #[must_use]
    pub fn new(device: usize, mut traces: Vec<Quantity>, force_position: Option<usize>) -> Self {
        traces.sort();
        traces.dedup();
        Self { device, traces, force_position }
    }

    /// The traces, in the order of menus; none where none were chosen.
    #[must_use]
    pub fn traces(&self) -> Option<&[Quantity]> {
        (!self.traces.is_empty()).then_some(&self.traces)
    }
}
