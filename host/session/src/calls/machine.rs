//! State of the process around plugin code: restored, or reported if it cannot be.

use super::process::{Notice, notify};
use crate::platform::MachineState;
use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;

/// Runs plugin code, `make`, and restores the state of the process afterwards.
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
