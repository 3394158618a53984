//! Checks a plugin against the rules of the contract, from outside as a host: each rule in its own process, so that a
//! plugin that crashes or hangs costs one rule.
//!
//! - `rule`: list of rules; `checks`: check of one rule, in this process; `outcome`: result of a check; `patience`: timeout of a
//!   check.
//! - `subject`: checked plugin; `life`: all calls of an instance; `untouched` and `guarded` check their side effects.
//! - `path`: poses of the checks; `model`, `live_parameters`, `passive`, `restore`, `locked`: checks of a model.
//! - `device`: checks of a device.

mod checks;
mod device;
mod guarded;
mod life;
mod live_parameters;
mod model;
mod outcome;
mod passive;
pub(crate) mod path;
pub(crate) mod patience;
mod ports;
mod restore;
mod rule;
mod subject;
mod untouched;

pub use checks::check;
pub use outcome::{Figures, Finding, Obstacle, Outcome, Verdict};
pub use rule::Check;

use crate::platform::{anonymous_file, end_at_once, ending_signal, locked, standard_input};
use crate::{watch, wording};
use flotor_hal::conformance::Rule;
use flotor_loader::read_metadata;
use flotor_session::PluginProcess;
use flotor_session::scene::KeyValue;
use patience::Ended;
use std::io::{self, Read, Seek, Write};
use std::path::Path;
use std::process::{Command, ExitStatus, Stdio};
use std::time::Duration;

/// Checks one rule on instances with these settings in this process, which was started for the rule, and writes the verdict
/// into the file on standard input. A step that exceeds `limit` of processor time, or ten times `limit` in waiting, ends
/// the process. Not real-time.
///
/// # Errors
/// If standard input is not a writable file, or no thread can be started.
pub fn deliver(path: &Path, settings: &[KeyValue], wanted: Check, limit: Duration) -> io::Result<()> {
    watch::start(limit, |stuck| {
        // End the process even if the write fails: nothing else ends a call that does not return.
        let _ = write(&Verdict::of(Err(Outcome::Stuck(stuck.to_string()))));
        end_at_once();
    })?;
    write(&Verdict::of(check(path, settings, wanted)))
}

/// Writes a verdict into the file on standard input, where the parent process reads it, apart from the plugin's output.
fn write(verdict: &Verdict) -> io::Result<()> {
    standard_input()?.write_all(&serde_json::to_vec(verdict)?)
}

/// Checks a plugin file against every rule that applies; stops after a failure that makes further checks pointless.
/// `program` returns the command of this program that checks one rule of the file and [delivers](deliver()) the
/// verdict. `patience` limits the processor time of a rule, and also its idle time; the first instance has six times as long,
/// and slow preparations of instances are added. `only` selects rules (empty: all); the metadata are always checked. Not
/// real-time.
#[must_use]
pub fn validate(
    path: &Path,
    only: &[Check],
    patience: Duration,
    program: impl Fn(Check) -> Command,
) -> Vec<Finding> {
    let mut findings = Vec::new();
    let mut note = |check: Check, verdict: Verdict| {
        let is_violated = matches!(verdict.seen, Some(Outcome::Violation(_) | Outcome::Stuck(_)));
        findings.push(Finding::new(check, verdict));
        is_violated
    };
    // Reads the file without running its code.
    let metadata = Check::Contract(Rule::Metadata);
    let read = read_metadata(path);
    let verdict = read.as_ref().map(|_| None).map_err(|error| Outcome::Violation(error.to_string()));
    note(metadata, Verdict::of(verdict));
    let Ok(kind) = read.map(|known| known.kind) else { return findings };
    let is_wanted = |check: &Check| only.is_empty() || only.contains(check);
    let checks = Check::all().filter(|check| *check != metadata && check.applies_to(kind));
    let mut patience = patience;
    for check in checks.filter(is_wanted) {
        let mut command = program(check);
        match check {
            Check::SystemCalls => locked::prepare(&mut command),
            Check::Contract(Rule::InsideMemory) => guarded::with_guard(&mut command),
            _ => {}
        }
        let is_first_instance = check == Check::Contract(Rule::Defaults);
        let own_patience = if is_first_instance { patience * PREPARATION } else { patience };
        let outcome = in_own_process(check, command, own_patience);
        if let (true, Ok(Some((_, ran)))) = (is_first_instance, &outcome) {
            patience = with_preparations(patience, *ran);
        }
        let outcome = outcome.map(|ended| ended.map(|(verdict, _)| verdict));
        let is_fatal = matches!(check, Check::Contract(Rule::Loads | Rule::Defaults));
        let is_stuck = matches!(outcome, Ok(None | Some(Verdict { seen: Some(Outcome::Stuck(_)), .. })));
        let stops = is_fatal || is_stuck;
        let verdict = match outcome {
            Ok(Some(Verdict { seen: Some(Outcome::Stuck(step)), .. })) => {
                Verdict::violated(format!("{step}; the later rules were not checked"))
            }
            Ok(Some(verdict)) => verdict,
            // Not a violation: the guarding allocator is slow, and other rules check that calls end.
            Ok(None) if check == Check::Contract(Rule::InsideMemory) => {
                let patience = wording::time(patience);
                let late = format!(
                    "the life cycle of an instance takes longer than {patience} with the guarding allocator; raise the \
                     limit with `--timeout`"
                );
                Verdict { seen: Some(Outcome::Missing(late)), figures: None }
            }
            Ok(None) => Verdict::violated(format!(
                "the check did not end within {}; the later rules were not checked (raise the limit with `--timeout`)",
                wording::time(own_patience)
            )),
            Err(error) => Verdict::violated(format!("cannot be checked: {error}")),
        };
        if note(check, verdict) && stops {
            break;
        }
    }
    findings
}

/// Describes an end without a verdict.
fn died(check: Check, end: ExitStatus) -> String {
    let Some(signal) = ending_signal(end) else {
        return format!("the process ended without a verdict ({end})");
    };
    if check == Check::SystemCalls && locked::has_caught(signal) {
        return "a step allocated memory or made another system call".to_owned();
    }
    let hint = match check {
        // A sandboxed thread may not read the processor's clock either.
        Check::SystemCalls => "; on this machine a step that reads the clock causes this too",
        Check::Contract(Rule::InsideMemory) => {
            ": a call accessed memory outside its blocks, or damaged a block"
        }
        _ => "",
    };
    format!("the process died by signal {signal}{hint}")
}

/// Timeout factor of the first instance: models prepare once and cache the result.
const PREPARATION: u32 = 6;
/// Maximum number of instances that a rule creates in turn: without a cache, each takes as long as the first.
const INSTANCES: u32 = 4;

/// Returns the timeout of the rules after the first instance, which ran for so long: the requested one, plus the
/// preparation of a rule's instances if that is a substantial part.
fn with_preparations(patience: Duration, first_instance: Duration) -> Duration {
    let preparations = first_instance * INSTANCES;
    if preparations > patience / 10 { patience + preparations } else { patience }
}

/// Runs the check of one rule in its own process; returns verdict and duration, or `None` on timeout.
fn in_own_process(
    check: Check,
    mut command: Command,
    patience: Duration,
) -> io::Result<Option<(Verdict, Duration)>> {
    // A file, not a pipe, which would need a reader. The plugin's output is discarded.
    let mut told = anonymous_file("flotor-verdict")?;
    command.stdin(told.try_clone()?).stdout(Stdio::null()).stderr(Stdio::null());
    let mut child = PluginProcess::start(&mut command)?;
    let Some(Ended { status: end, ran }) = patience::wait(&mut child, patience)? else { return Ok(None) };
    let mut text = Vec::new();
    told.rewind()?;
    told.read_to_end(&mut text)?;
    let verdict = match serde_json::from_slice(&text) {
        Ok(verdict @ Verdict { seen: Some(Outcome::Stuck(_)), .. }) => verdict,
        Ok(verdict) if end.success() => verdict,
        _ => Verdict::violated(died(check, end)),
    };
    Ok(Some((verdict, ran)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_preparation_counts_where_it_would_use_up_the_patience() {
        let patience = Duration::from_secs(3);
        // What a busy machine makes of a model that prepares nothing.
        assert_eq!(with_preparations(patience, Duration::from_millis(70)), patience);
        assert_eq!(with_preparations(patience, Duration::from_secs(2)), Duration::from_secs(11));
    }
}
