//! Changes to plugins while the loop runs.

use serde::{Deserialize, Serialize};

/// Change of a parameter or weight, or replacement of a plugin, in a run; applied or rejected.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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
    /// Value as text, as a user would type it.
    pub value: String,
    /// Value passed to the plugin as a number; for a choice, its index.
    pub number: f64,
    /// Result of the change.
    pub outcome: ChangeOutcome,
    /// Settings of the new plugin after a replacement, as written.
    #[serde(default)]
    pub settings: Vec<(String, String)>,
}

impl Change {
    /// Returns true if both changes concern the same parameter, weight or replacement of the same plugin and have the
    /// same outcome, so that the later change replaces the earlier. A rejected value implies nothing about the present
    /// value.
    #[must_use]
    pub fn is_of_the_same(&self, other: &Self) -> bool {
        let of = |change: &Self| (change.subject, change.outcome);
        of(self) == of(other) && self.parameter == other.parameter && self.plugin == other.plugin
    }
}

/// Kind of change of a plugin.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ChangeSubject {
    /// A parameter of the plugin's schema.
    Parameter,
    /// The blend weight of the plugin's wrench; the host moves the weight to the new value at the rate of the fade.
    Weight,
    /// The plugin was replaced: `parameter` is the id of the new plugin, `value` its version.
    Plugin,
}

/// Result of a change.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ChangeOutcome {
    /// The value is in force from this tick on.
    Applied,
    /// The plugin rejected the value, for example because the value is inconsistent with other parameters; the old
    /// value stays in force.
    Refused,
    /// The plugin panicked on the change.
    Broke,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_changes_are_of_the_same_whatever_their_values() {
        let change = Change {
            tick: 1,
            time_ns: 1_000_000,
            plugin: "spring".to_owned(),
            subject: ChangeSubject::Parameter,
            parameter: "gamma_n".to_owned(),
            value: "9".to_owned(),
            number: 9.0,
            outcome: ChangeOutcome::Applied,
            settings: Vec::new(),
        };
        let later =
            Change { tick: 2, time_ns: 2_000_000, value: "5".to_owned(), number: 5.0, ..change.clone() };
        assert!(change.is_of_the_same(&later) && later.is_of_the_same(&change));
        for other in [
            Change { plugin: "load".to_owned(), ..change.clone() },
            Change { subject: ChangeSubject::Weight, ..change.clone() },
            Change { parameter: "turns".to_owned(), ..change.clone() },
            Change { outcome: ChangeOutcome::Refused, ..change.clone() },
        ] {
            assert!(!change.is_of_the_same(&other), "{other:?}");
        }
    }
}
