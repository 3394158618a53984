//! Changes to plugins while the loop runs.

/// Change of a parameter or weight, or replacement of a plugin, in a run; applied or rejected.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// Tick before which the change took place: the first with the new value.
    pub tick: u64,
    /// Time of this tick, ns.
    pub time_ns: u64,
    /// Name of the plugin in the scene.
    pub plugin: String,
    /// Kind of change.
    pub subject: ChangeSubject,
    /// Id of the parameter; `weight` for a weight, the id of the new plugin for a replacement.
    pub parameter: String,
    /// The value as a person would type it.
    pub value: String,
    /// Value passed to the plugin; for a choice, its index.
    pub number: f64,
    /// Settings of the new plugin after a replacement, as written.
    pub settings: Vec<(String, String)>,
    /// Result of the change.
    pub outcome: ChangeOutcome,
}

/// Kind of change of a plugin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChangeSubject {
    /// A parameter of its schema.
    Parameter,
    /// The blend weight of its wrench, which the host applies: it moves to the new value at the rate of its fade.
    Weight,
    /// The plugin itself was replaced: `parameter` is the id of the new one, `value` its version.
    Plugin,
}

/// Result of a change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChangeOutcome {
    /// The value is in force from this tick on.
    Applied,
    /// The plugin rejected the value, which does not fit its other values. The old one remains.
    Refused,
    /// The plugin panicked on the change.
    Broke,
}
