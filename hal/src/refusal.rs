//! Why a plugin says no before anything runs.

use std::fmt;

/// What to do about a refusal: the closed set a host maps to exit codes and advice.
#[repr(u32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RefusalKind {
    /// A parameter has a value that cannot be used: change it.
    Parameter = 1,
    /// The request is outside what this plugin can do (rate, demand, capability): choose another plugin or scene.
    Unsupported = 2,
    /// Hardware or a file is missing, busy or not permitted: fix the machine, then retry.
    Resource = 3,
    /// The plugin broke (it panicked, or it answered outside the contract): report it to its author.
    Broken = 4,
}

impl RefusalKind {
    /// Reads a status code from the boundary; anything unknown means the plugin broke the contract.
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

/// A plugin's reason for not creating, opening, preparing or activating. Not real-time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// What to do about it.
    pub kind: RefusalKind,
    /// One sentence for people: which value, what is wrong, what would be right.
    pub reason: String,
}

impl Refusal {
    /// A parameter value cannot be used.
    #[must_use]
    pub fn parameter(reason: impl fmt::Display) -> Self {
        Self { kind: RefusalKind::Parameter, reason: reason.to_string() }
    }

    /// The plugin cannot do what is asked.
    #[must_use]
    pub fn unsupported(reason: impl fmt::Display) -> Self {
        Self { kind: RefusalKind::Unsupported, reason: reason.to_string() }
    }

    /// Something outside the plugin is missing, busy or forbidden.
    #[must_use]
    pub fn resource(reason: impl fmt::Display) -> Self {
        Self { kind: RefusalKind::Resource, reason: reason.to_string() }
    }

    /// The plugin misbehaved.
    #[must_use]
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
