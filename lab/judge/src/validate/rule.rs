//! Rules of the contract, and further checks of this host.

use flotor_hal::abi::PluginKind;
use flotor_hal::conformance::Rule;

/// Single check of a plugin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Check {
    /// Rule of the contract's own list.
    Contract(Rule),
    /// The wrench is finite in motion too.
    FiniteInMotion,
    /// Force and status do not depend on the demand for other outputs, and the torque not on the demand for energy.
    Demand,
    /// Live parameters can be set in time and report their value.
    LiveParameters,
    /// Wrench and energy are zero outside the declared active region.
    Activity,
    /// A stateless law generates no energy.
    Passive,
    /// A step makes no system call.
    SystemCalls,
}

impl Check {
    /// Checks of this host beyond the contract's list, in this order.
    const OF_THE_HOST: [Self; 6] = [
        Self::FiniteInMotion,
        Self::Demand,
        Self::LiveParameters,
        Self::Activity,
        Self::Passive,
        Self::SystemCalls,
    ];

    /// Returns all checks in their order.
    pub fn all() -> impl Iterator<Item = Self> {
        Rule::ALL.into_iter().map(Self::Contract).chain(Self::OF_THE_HOST)
    }

    /// Returns the short name on the command line and in reports.
    #[must_use]
    pub const fn id(self) -> &'static str {
        match self {
            Self::Contract(rule) => rule.id(),
            Self::FiniteInMotion => "finite-in-motion",
            Self::Demand => "demand",
            Self::LiveParameters => "live-parameters",
            Self::Activity => "activity",
            Self::Passive => "passive",
            Self::SystemCalls => "no-system-calls",
        }
    }

    /// Returns the requirement as text.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Self::Contract(rule) => rule.text(),
            Self::FiniteInMotion => "the wrench is finite while the handle moves, slowly and fast",
            Self::Demand => {
                "force and status do not depend on which other outputs are requested, nor torque on the request for energy"
            }
            Self::LiveParameters => "live parameters can be set in time and report their value",
            Self::Activity => "outside the active region, wrench and energy are zero",
            Self::Passive => {
                "a model without a history generates no energy on a closed path, or forward and back along a path"
            }
            Self::SystemCalls => "a step allocates no memory, starts no thread and makes no system call",
        }
    }

    /// Finds the check with a short name; `None` for an unknown name.
    #[must_use]
    pub fn from_id(id: &str) -> Option<Self> {
        Self::all().find(|check| check.id() == id)
    }

    /// Returns true if the check applies to plugins of this kind.
    #[must_use]
    pub const fn applies_to(self, kind: PluginKind) -> bool {
        match self {
            Self::Contract(rule) => rule.applies_to(kind),
            _ => matches!(kind, PluginKind::Model),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_check_is_found_by_its_own_name() {
        for check in Check::all() {
            assert_eq!(Check::from_id(check.id()), Some(check));
        }
        assert_eq!(Check::from_id("no such rule"), None);
    }
}
