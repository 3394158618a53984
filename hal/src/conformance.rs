//! Conformance rules for plugins, as data: `flotor validate`, the tests and the book print this one list.

use crate::abi::PluginKind;

/// Rule of the contract that can be checked from outside.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Rule {
    /// The metadata section can be read and names kind, id, version, contract and entry.
    Metadata,
    /// The library links, its entry is valid, and its layouts equal the host's.
    Loads,
    /// Every parameter has id, doc and a default inside its range, and no id occurs twice.
    Schema,
    /// An instance can be created from defaults alone.
    Defaults,
    /// The outputs of a model are finite at home and near home.
    FiniteNearHome,
    /// NaN and infinity in the pose cause a status, not NaN and not a panic.
    SurvivesNotFinite,
    /// Poses far outside any workspace cause finite outputs and no panic.
    SurvivesFarPoses,
    /// After `reset` the same poses produce the same bits.
    ResetRepeats,
    /// After a restore of a saved state the same poses produce the same bits, also in another instance.
    RestoreRepeats,
    /// With one port a shared object repeats the bits of a step; with several, the output at each is finite, whatever pose the
    /// others have, and independent of what they demand.
    Ports,
    /// 99 of 100 steps take less than half a period at 1 kHz.
    TimeBudget,
    /// An instance returns the same results alone, alternately with another instance, and on two threads.
    Independent,
    /// No thread is left running by `create`, `prepare`, a step or `destroy`.
    NoThreads,
    /// The force of a model without a history is minus the gradient of its energy: units and frame agree.
    EnergyGradient,
    /// A device's declared limits, ranges and rates are numbers that a host can enforce.
    Capabilities,
    /// Activate, read, write, deactivate and activate again all work.
    Lifecycle,
    /// After `safe_stop` from another thread the device exerts no wrench and still returns samples.
    SafeStop,
    /// Reads and writes take less than half a period, a stop less than 100 ms, the rest of the life cycle less than 2 s.
    DeviceTime,
    /// Every offered extension returns valid data, and the instance works afterwards.
    Extensions,
    /// No call changes the state of the host's process: signals, floating-point mode, environment, working folder,
    /// limits, files.
    HostUntouched,
    /// No call reads or writes memory other than the plugin's own and the arguments of the call.
    InsideMemory,
}

impl Rule {
    /// All rules, in the order of the checks.
    pub const ALL: [Rule; 21] = [
        Rule::Metadata,
        Rule::Loads,
        Rule::Schema,
        Rule::Defaults,
        Rule::FiniteNearHome,
        Rule::SurvivesNotFinite,
        Rule::SurvivesFarPoses,
        Rule::ResetRepeats,
        Rule::RestoreRepeats,
        Rule::Ports,
        Rule::TimeBudget,
        Rule::Independent,
        Rule::NoThreads,
        Rule::EnergyGradient,
        Rule::Capabilities,
        Rule::Lifecycle,
        Rule::SafeStop,
        Rule::DeviceTime,
        Rule::Extensions,
        Rule::HostUntouched,
        Rule::InsideMemory,
    ];

    /// Returns the short name of the rule in reports, such as `time-budget`.
    #[must_use]
    pub const fn id(self) -> &'static str {
        match self {
            Rule::Metadata => "metadata",
            Rule::Loads => "loads",
            Rule::Schema => "schema",
            Rule::Defaults => "defaults",
            Rule::FiniteNearHome => "finite-near-home",
            Rule::SurvivesNotFinite => "survives-not-finite",
            Rule::SurvivesFarPoses => "survives-far-poses",
            Rule::ResetRepeats => "reset-repeats",
            Rule::RestoreRepeats => "restore-repeats",
            Rule::Ports => "ports",
            Rule::TimeBudget => "time-budget",
            Rule::Independent => "independent",
            Rule::NoThreads => "no-threads",
            Rule::EnergyGradient => "energy-gradient",
            Rule::Capabilities => "capabilities",
            Rule::Lifecycle => "lifecycle",
            Rule::SafeStop => "safe-stop",
            Rule::DeviceTime => "device-time",
            Rule::Extensions => "extensions",
            Rule::HostUntouched => "host-untouched",
            Rule::InsideMemory => "inside-memory",
        }
    }

    /// Returns the requirement in one sentence, for reports.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Rule::Metadata => "the metadata section names kind, id, version, contract and entry",
            Rule::Loads => "the library links, and its structs equal the host's",
            Rule::Schema => "every parameter has an id of its own, a doc and a default inside its range",
            Rule::Defaults => "an instance can be created with all parameters at their defaults",
            Rule::FiniteNearHome => "at home and near home the wrench is finite",
            Rule::SurvivesNotFinite => "NaN and infinity in the pose cause a status, not NaN and not a panic",
            Rule::SurvivesFarPoses => "poses far outside any workspace cause finite outputs and no panic",
            Rule::ResetRepeats => "after reset the same poses produce the same bits",
            Rule::RestoreRepeats => {
                "after a restore of a saved state the same poses produce the same bits, also in another instance"
            }
            Rule::Ports => {
                "a shared object with one port repeats the bits of a step, and is finite at every one of several ports"
            }
            Rule::TimeBudget => "99 of 100 steps need less than half a period at 1 kHz",
            Rule::Independent => {
                "an instance returns the same results alone, alternately with another instance, \
            and on two threads"
            }
            Rule::NoThreads => "neither create, prepare, a step nor destroy leaves a thread behind",
            Rule::EnergyGradient => {
                "the force of a model without a history is minus the gradient of its energy"
            }
            Rule::Capabilities => "declared limits, ranges and rates are numbers that a host can enforce",
            Rule::Lifecycle => "activate, read, write, deactivate and activate again all work",
            Rule::SafeStop => {
                "after safe_stop from another thread the device exerts no wrench and still returns samples"
            }
            Rule::DeviceTime => {
                "reads and writes need less than half a period, a stop less than 100 ms, the rest of the life cycle less than 2 s"
            }
            Rule::Extensions => {
                "every offered extension returns valid data, and the instance works afterwards"
            }
            Rule::HostUntouched => {
                "no call changes the host's signals, floating-point mode, environment, folder, limits or files"
            }
            Rule::InsideMemory => "no call reads or writes memory other than its own and its arguments",
        }
    }

    /// Returns the rule with the short name `id`; `None` if unknown.
    #[must_use]
    pub fn from_id(id: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|rule| rule.id() == id)
    }

    /// Returns true if the rule applies to plugins of this kind.
    #[must_use]
    pub const fn applies_to(self, kind: PluginKind) -> bool {
        match self {
            Rule::Metadata
            | Rule::Loads
            | Rule::Schema
            | Rule::Defaults
            | Rule::Extensions
            | Rule::HostUntouched
            | Rule::InsideMemory => true,
            Rule::FiniteNearHome
            | Rule::SurvivesNotFinite
            | Rule::SurvivesFarPoses
            | Rule::ResetRepeats
            | Rule::RestoreRepeats
            | Rule::Ports
            | Rule::TimeBudget
            | Rule::Independent
            | Rule::NoThreads
            | Rule::EnergyGradient => matches!(kind, PluginKind::Model),
            Rule::Capabilities | Rule::Lifecycle | Rule::SafeStop | Rule::DeviceTime => {
                matches!(kind, PluginKind::Device)
            }
        }
    }
}
