//! Checks a plugin against the rules of the contract, from outside, the way a host meets it: each rule in a process of
//! its own, so that a plugin that crashes or hangs costs one rule.

mod checks;

pub use checks::check;

use flotor_hal::abi::loader::read_metadata;
use flotor_hal::conformance::Rule;
use serde::{Deserialize, Serialize};
use std::io::{self, Read};
use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// Outcome of one rule.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// Short name of the rule.
    pub rule: &'static str,
    /// What it demands.
    pub text: &'static str,
    /// `None` if it holds, else what was seen.
    pub violation: Option<String>,
}

/// What the process that checks one rule prints.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Verdict {
    /// `None` if the rule holds, else what was seen.
    pub(crate) violation: Option<String>,
}

/// How often a process is looked at.
const LOOK: Duration = Duration::from_millis(2);

/// Checks a plugin file against every rule that applies; stops at the first that makes the rest pointless. Not
/// real-time. A rule may take `patience`; `program` starts this program once more, to check one rule of the file and print a [`Verdict`].
#[must_use]
pub(crate) fn validate(path: &Path, patience: Duration, program: impl Fn(Rule) -> Command) -> Vec<Finding> {
    let mut findings = Vec::new();
    let mut note = |rule: Rule, violation: Option<String>| {
        let holds = violation.is_none();
        findings.push(Finding { rule: rule.id(), text: rule.text(), violation });
        holds
    };
    // Reads the file and runs nothing of it.
    let kind = match read_metadata(path) {
        Ok(metadata) => {
            note(Rule::Metadata, None);
            metadata.kind
        }
        Err(error) => {
            note(Rule::Metadata, Some(error.to_string()));
            return findings;
        }
    };
    let rules = Rule::ALL.into_iter().filter(|rule| *rule != Rule::Metadata && rule.applies_to(kind));
    for rule in rules {
        let outcome =
            apart(program(rule), patience).unwrap_or_else(|error| Outcome::NotChecked(error.to_string()));
        let stops = matches!(outcome, Outcome::Hung) || matches!(rule, Rule::Loads | Rule::Defaults);
        let violation = outcome.violation(patience);
        if !note(rule, violation) && stops {
            break;
        }
    }
    findings
}

/// How the check of one rule ended.
enum Outcome {
    Holds,
    Violated(String),
    /// The process ended before there was a verdict.
    Died(ExitStatus),
    Hung,
    NotChecked(String),
}

impl Outcome {
    fn violation(self, patience: Duration) -> Option<String> {
        Some(match self {
            Self::Holds => return None,
            Self::Violated(seen) => seen,
            Self::Died(end) => match end.signal() {
                Some(signal) => format!("it ended the process by signal {signal}"),
                None => format!("it ended the process ({end})"),
            },
            Self::Hung => {
                format!("it did not come back within {patience:?}; the rules after it were not checked")
            }
            Self::NotChecked(error) => format!("cannot be checked: {error}"),
        })
    }
}

/// Runs the check of one rule in a process of its own.
fn apart(mut command: Command, patience: Duration) -> io::Result<Outcome> {
    // What a plugin prints is its own business, not part of the verdict.
    let mut child = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::null()).spawn()?;
    let Some(end) = wait(&mut child, patience)? else { return Ok(Outcome::Hung) };
    let mut text = String::new();
    if let Some(mut stdout) = child.stdout.take() {
        stdout.read_to_string(&mut text)?;
    }
    // The verdict is the last line; a plugin may have printed before.
    let verdict = text.lines().last().and_then(|line| serde_json::from_str::<Verdict>(line).ok());
    Ok(match verdict {
        Some(verdict) if end.success() => verdict.violation.map_or(Outcome::Holds, Outcome::Violated),
        _ => Outcome::Died(end),
    })
}

/// Waits for the end of a process; `None` if it took too long and was ended.
fn wait(child: &mut Child, patience: Duration) -> io::Result<Option<ExitStatus>> {
    let started = Instant::now();
    while started.elapsed() < patience {
        if let Some(end) = child.try_wait()? {
            return Ok(Some(end));
        }
        std::thread::sleep(LOOK);
    }
    child.kill()?;
    child.wait()?;
    Ok(None)
}
