//! Changes of parameters, and reports on changes.

use crate::{ChangeOutcome, PluginIndex};
use flotor_hal::Tick;

/// Parameter number that stands for the weight of a model.
pub const WEIGHT: u32 = u32::MAX;
/// Parameter number that stands for the plugin itself, in a report on its replacement; the value is the new generation.
pub const PLUGIN: u32 = u32::MAX - 1;

/// New value of a parameter. The numbers of plugin and parameter come from a schema: see `Controls` of `flotor-session`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParameterChange {
    /// Number of the plugin in the run.
    pub plugin: PluginIndex,
    /// Generation of the plugin that the change was checked against; the loop rejects a change of a model's parameter for another
    /// generation.
    pub generation: u16,
    /// Index into the plugin's schema, [`WEIGHT`], or in a report [`PLUGIN`].
    pub parameter: u32,
    /// New value, in the parameter's unit; for a choice, its index.
    pub value: f64,
    /// Pace at which the value changes.
    pub pace: Pace,
}

/// Pace of a parameter change: in one step, or at a rate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pace {
    /// In one step, before the next tick.
    AtOnce,
    /// At a rate, from the current value.
    Gradual {
        /// Initial value of the parameter, in its unit: start of the movement if the parameter has not changed since.
        from: f64,
        /// Rate in the parameter's unit per second.
        per_s: f64,
    },
}

/// Report on a change of a parameter, or on the replacement of a plugin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChangeReport {
    /// Tick before which the change was applied or rejected.
    pub tick: u64,
    /// Time of the tick, ns.
    pub time_ns: u64,
    /// Reported change.
    pub change: ParameterChange,
    /// Result of the change.
    pub outcome: ChangeOutcome,
}

impl ChangeReport {
    /// Creates a report on a change before a tick. Real-time: bounded, no allocation.
    #[must_use]
    pub fn at(tick: &Tick, change: ParameterChange, outcome: ChangeOutcome) -> Self {
        Self { tick: tick.index, time_ns: tick.time_ns, change, outcome }
    }
}
