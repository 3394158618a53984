//! What changed while the loop ran.

/// A parameter or weight that changed in a run, or was to.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// The tick before which it changed: the first that saw the new value.
    pub tick: u64,
    /// The time of that tick, ns.
    pub time_ns: u64,
    /// Name of the plugin in the scene.
    pub plugin: String,
    /// What of it changed.
    pub subject: ChangeSubject,
    /// Id of the parameter, or the host's word for what is not one.
    pub parameter: String,
    /// The value as a person would type it.
    pub value: String,
    /// The value as the plugin got it; for a choice, its index.
    pub number: f64,
    /// If the plugin itself was replaced, what was set for the new one, as written.
    pub settings: Vec<(String, String)>,
    /// What the plugin made of it.
    pub outcome: ChangeOutcome,
}

/// What of a plugin changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChangeSubject {
    /// A parameter of its schema.
    Parameter,
    /// The part of its wrench that is felt, which the host mixes: it moves there at the rate of its fade.
    Weight,
    /// The plugin itself was replaced: `parameter` is the id of the new one, `value` its version.
    Plugin,
}

/// How a plugin took a change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChangeOutcome {
    /// The value is in force from this tick on.
    Applied,
    /// The plugin said no: the value does not fit its others. The old one stays.
    Refused,
    /// The plugin panicked over it.
    Broke,
}
