//! Process-wide state of plugin calls, and notices for the user.

use super::call::Call;
use crate::platform::MachineState;
use flotor_servo::StopSwitch;
use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::fmt;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Notice for the user about plugin calls and the watchdog process.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Notice {
    /// A plugin call has not returned after 5 s, or after half its time limit if that is shorter.
    Waiting {
        /// Name of the device or model in the scene, or path of the plugin file.
        who: String,
        /// Call in progress.
        call: Call,
        /// Time limit of the call.
        limit: Duration,
    },
    /// A plugin changed the state of the process during a call.
    Changed {
        /// Name of the device or model in the scene.
        who: String,
        /// Names of the changed parts, which the host has restored.
        restored: Vec<&'static str>,
        /// Names of changed environment variables, which the host does not restore: other threads may read the variables at any
        /// time.
        variables: Vec<String>,
    },
    /// The watchdog process has ended and the run continues without it.
    Unguarded,
}

impl fmt::Display for Notice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Waiting { who, call, limit } => {
                write!(f, "waiting for `{who}` to return from {call}, for up to {} s", limit.as_secs_f64())
            }
            Self::Changed { who, restored, variables } => {
                write!(f, "`{who}` changed ")?;
                if !restored.is_empty() {
                    write!(f, "{} of the host, which the host restored as far as permitted", restored.join(", "))?;
                }
                if !variables.is_empty() {
                    let joined = if restored.is_empty() { "" } else { "; the plugin also changed " };
                    write!(
                        f,
                        "{joined}environment variables of the host ({}), which the host does not restore",
                        variables.join(", ")
                    )?;
                }
                Ok(())
            }
            Self::Unguarded => f.write_str(
                "the watchdog process has ended, so no process stops the devices if this program is killed; end this \
                 run and start the program again",
            ),
        }
    }
}

static ON_NOTICE: OnceLock<fn(&Notice)> = OnceLock::new();
/// Switch whose stop request ends the wait for a call before a run.
static STOP: OnceLock<StopSwitch> = OnceLock::new();
/// True once a thread with plugin code was abandoned.
static HAS_ABANDONED: AtomicBool = AtomicBool::new(false);

/// Sets the callback for notices: slow calls, changes of the process by plugins, and the end of the watchdog process. Only the first
/// call has an effect.
pub fn on_notice(notify: fn(&Notice)) {
    let _ = ON_NOTICE.set(notify);
}

pub(crate) fn notify(notice: &Notice) {
    if let Some(notify) = ON_NOTICE.get() {
        notify(notice);
    }
}

/// Sets the switch whose stop request ends the wait for a plugin call before a run, when nothing is energised. Only the first call
/// has an effect.
pub fn stop_waits_with(stop: &StopSwitch) {
    let _ = STOP.set(stop.clone());
}

/// Returns true unless a stop or an emergency stop was requested.
pub(crate) fn is_to_begin() -> bool {
    STOP.get().is_none_or(|stop| !stop.is_stop_requested() && stop.emergency().is_none())
}

/// Returns true if a thread was abandoned in plugin code: exit handlers of the process may wait for that thread for ever.
#[must_use]
pub fn is_abandoned() -> bool {
    HAS_ABANDONED.load(Ordering::Relaxed)
}

/// Records that a thread with plugin code is abandoned.
pub(crate) fn abandon() {
    HAS_ABANDONED.store(true, Ordering::Relaxed);
}

/// Runs `make`, which calls plugin code, then restores the changed state of the process and notifies the user of the changes.
pub(crate) fn keeping_machine<T>(who: &str, make: impl FnOnce() -> T) -> T {
    let (before, variables) = (MachineState::now(), environment());
    let made = make();
    let (restored, variables) = (before.restore(), changed_variables(&variables, &environment()));
    if !(restored.is_empty() && variables.is_empty()) {
        notify(&Notice::Changed { who: who.to_owned(), restored, variables });
    }
    made
}

/// Returns the environment variables by name.
fn environment() -> BTreeMap<OsString, OsString> {
    std::env::vars_os().collect()
}

/// Returns the names of variables that were added, changed or removed.
fn changed_variables(
    before: &BTreeMap<OsString, OsString>,
    after: &BTreeMap<OsString, OsString>,
) -> Vec<String> {
    let names: BTreeSet<&OsString> = before.keys().chain(after.keys()).collect();
    let changed = names.into_iter().filter(|name| before.get(*name) != after.get(*name));
    changed.map(|name| name.display().to_string()).collect()
}
