//! Refusal of a plugin to create, open, prepare or activate.

use std::fmt;

/// Kind of a refusal: a closed set that a host maps to exit codes and advice.
#[repr(u32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RefusalKind {
    /// A parameter has an unusable value: change the value.
    Parameter = 1,
    /// The plugin does not support the request (rate, demand, capability): choose another plugin or scene.
    Unsupported = 2,
    /// Hardware or a file is missing, busy or not permitted: fix the machine, then retry.
    Resource = 3,
    /// The plugin panicked or violated the contract: report this to its author.
    Broken = 4,
}

impl RefusalKind {
    /// Converts a refusal code of the ABI; an unknown code counts as [`Self::Broken`].
    #[must_use]
    pub const fn from_code(code: u32) -> Self {
        match code {
            1 => Self::Parameter,
            2 => Self::Unsupported,
            3 => Self::Resource,
            _ => Self::Broken,
        }
    }
}

/// Refusal to create, open, prepare or activate, with its reason. Not real-time.
#[derive(Clone, Debug, PartialEq, Eq)]
#[must_use]
pub struct Refusal {
    /// Kind of the refusal, which determines the remedy.
    pub kind: RefusalKind,
    /// Reason in one sentence for users: value, problem and remedy.
    pub reason: String,
}

impl Refusal {
    /// Builds a refusal of a parameter value.
    pub fn parameter(reason: impl fmt::Display) -> Self {
        Self { kind: RefusalKind::Parameter, reason: reason.to_string() }
    }

    /// Builds a refusal of a request that the plugin does not support.
    pub fn unsupported(reason: impl fmt::Display) -> Self {
        Self { kind: RefusalKind::Unsupported, reason: reason.to_string() }
    }

    /// Builds a refusal because a resource outside the plugin is missing, busy or forbidden.
    pub fn resource(reason: impl fmt::Display) -> Self {
        Self { kind: RefusalKind::Resource, reason: reason.to_string() }
    }

    /// Builds a refusal because the plugin panicked or violated the contract.
    pub fn broken(reason: impl fmt::Display) -> Self {
        Self { kind: RefusalKind::Broken, reason: reason.to_string() }
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.reason)
    }
}

impl std::error::Error for Refusal {}
