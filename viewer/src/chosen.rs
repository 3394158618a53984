//! What a command line chooses of what is shown: the same in a window, a picture and a file of traces.

use flotor_history::quantity::Quantity;

/// The choices; what is not chosen is as it is without them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Chosen {
    /// Number of the device that numbers and traces are of.
    pub device: usize,
    /// The traces, in the order of menus; empty: not chosen.
    traces: Vec<Quantity>,
    /// Axis of force over position; none: not shown.
    pub force_position: Option<usize>,
    /// Force that arrows are scaled for, N; none: the largest of the run.
    pub arrow_force_n: Option<f64>,
}

impl Chosen {
    /// Of a device, its traces, and force over position along an axis; arrows fit.
    #[must_use]
    pub fn new(device: usize, mut traces: Vec<Quantity>, force_position: Option<usize>) -> Self {
        traces.sort();
        traces.dedup();
        Self { device, traces, force_position, arrow_force_n: None }
    }

    /// With arrows scaled for this force, N.
    #[must_use]
    pub fn with_arrow_force(self, arrow_force_n: Option<f64>) -> Self {
        Self { arrow_force_n, ..self }
    }

    /// The traces, in the order of menus; none where none were chosen.
    #[must_use]
    pub fn traces(&self) -> Option<&[Quantity]> {
        (!self.traces.is_empty()).then_some(&self.traces)
    }
}
