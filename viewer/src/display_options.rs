//! Display options of the command line, for a window, a picture or a file of traces.

use flotor_history::quantity::Quantity;

/// Display options; each has a default.
#[derive(Clone, Debug, Default, PartialEq)]
#[must_use]
pub struct DisplayOptions {
    /// Number of the device for numbers and traces, from 0.
    pub device: usize,
    /// Traces in the order of menus; empty: the default.
    traces: Vec<Quantity>,
    /// Axis of force over position (0 to 2); `None`: not shown.
    pub force_position: Option<usize>,
    /// Force of an arrow of full length, N; `None`: the largest force of the run.
    pub arrow_force_n: Option<f64>,
}

impl DisplayOptions {
    /// Creates options for a device, traces, and force over position along an axis, with automatic scaling of arrows.
    pub fn new(device: usize, mut traces: Vec<Quantity>, force_position: Option<usize>) -> Self {
        traces.sort();
        traces.dedup();
        Self { device, traces, force_position, arrow_force_n: None }
    }

    /// Sets the force of an arrow of full length, N; `None`: the largest force of the run.
    pub fn with_arrow_force(self, arrow_force_n: Option<f64>) -> Self {
        Self { arrow_force_n, ..self }
    }

    /// Returns the traces in the order of menus; `None` for the default.
    #[must_use]
    pub fn traces(&self) -> Option<&[Quantity]> {
        (!self.traces.is_empty()).then_some(&self.traces)
    }
}
