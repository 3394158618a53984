//! Errors that prevent or end a run.

use super::plugin_report::PluginNames;
use crate::calls::CallError;
use crate::long_call::Exceeded;
use crate::registry::LookupError;
use crate::scene::SceneError;
use flotor_hal::Refusal;
use flotor_live::Pressed;
use flotor_loader::{LoadError, Metadata};
use flotor_servo::{Stuck, THREAD_ADVICE};

/// Reason why a run did not start, or failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RunError {
    /// The scene is not valid.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A plugin of the scene is unknown or was rejected.
    #[error(transparent)]
    Lookup(#[from] LookupError),
    /// A plugin refused its settings or a call.
    #[error(transparent)]
    Plugin(#[from] LoadError),
    /// Scene and device do not fit; the error lists all mismatches.
    #[error("the scene does not fit the device `{device}`: {}", mismatches.join("; "))]
    Mismatch {
        /// Id of the device's plugin; of several devices, the name in the scene.
        device: String,
        /// Mismatches, each with a remedy.
        mismatches: Vec<String>,
    },
    /// A call before the run did not return, was stopped, or had no thread.
    #[error(transparent)]
    Calls(#[from] CallError),
    /// The servo thread failed, with a verb phrase for the message.
    #[error("internal error: the servo thread {0}; please report this error with the scene")]
    Thread(&'static str),
    /// The state of the run cannot be saved or restored, with the cause.
    #[error("the state of the run cannot be saved or restored: {0}")]
    Unsaved(String),
    /// The system cannot start the thread for this part of the run.
    #[error("cannot start the thread for {0}, so no device was moved; {THREAD_ADVICE}")]
    NoThread(&'static str),
    /// The scene requires an independent stop (`require_independent_stop`), and the watchdog process cannot be started.
    #[error(
        "cannot start the watchdog process: {0}; `[limits] require_independent_stop = true` requires this process; \
         correct the cause, or remove that line"
    )]
    WatchdogProcess(std::io::Error),
    /// Only the watchdog process stops a device after the end of this process, and one kill of their control group ends both processes.
    #[error(
        "the force of `{device}` would stay on if the control group (cgroup) `{group}` were killed, for \
         example at a service or container stop or when memory runs out: the watchdog process belongs to the \
         same group, and the device has no watchdog of its own. Start the program as `flotor doctor` \
         describes, or accept the risk with `[limits] accept_shared_control_group = true` or \
         `--accept-shared-control-group`"
    )]
    SharedControlGroup {
        /// Name of the device in the scene.
        device: String,
        /// Control group of both processes.
        group: String,
    },
    /// The emergency stop of the machine is pressed (with its press), or was pressed while the run started (`None`); nothing was
    /// energised.
    #[error("{}", latched(.0.as_ref()))]
    Latched(Option<Pressed>),
    /// A call of the loop did not return; the devices are stopped.
    #[error("`{who}` did not return from {} in tick {}{limit}", stuck.place.call(), stuck.tick)]
    Hung {
        /// Name of the plugin in the scene, its number if unknown, or "host".
        who: String,
        /// Tick and place of the call.
        stuck: Stuck,
        /// Limit that the call has exceeded.
        limit: Exceeded,
    },
}

impl RunError {
    /// Creates the error of a loop that is stuck in a call, with the name of the blocking plugin.
    pub(super) fn hung(stuck: Stuck, names: &PluginNames, limit: Exceeded) -> Self {
        Self::Hung { who: names.at(stuck.place), stuck, limit }
    }

    /// Creates the error of a plugin that refused its settings or a call.
    pub(super) fn refused(metadata: &Metadata, refusal: Refusal) -> Self {
        let Metadata { path, id, .. } = metadata.clone();
        Self::Plugin(LoadError::Refused { path, id, refusal })
    }

    /// Returns true if a stop request before the run is the reason.
    #[must_use]
    pub const fn is_stopped(&self) -> bool {
        matches!(self, Self::Calls(CallError::Stopped) | Self::Lookup(LookupError::Calls(CallError::Stopped)))
    }

    /// Returns true if the scene or the command line is the cause, not a plugin.
    #[must_use]
    pub fn is_configuration(&self) -> bool {
        match self {
            Self::Scene(_) | Self::Mismatch { .. } | Self::SharedControlGroup { .. } => true,
            Self::Lookup(LookupError::Unknown { .. } | LookupError::Ambiguous { .. }) => true,
            Self::Lookup(LookupError::Refused(error)) | Self::Plugin(error) => error.is_configuration(),
            _ => false,
        }
    }
}

/// Formats the reason why nothing may be energised.
fn latched(pressed: Option<&Pressed>) -> String {
    match pressed {
        Some(pressed) => format!(
            "the emergency stop of this machine is pressed ({pressed}): nothing is energised; `flotor release` releases it"
        ),
        None => "the emergency stop of this machine was pressed while the run started: start the run again"
            .to_owned(),
    }
}
