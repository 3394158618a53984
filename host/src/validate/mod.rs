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
    /// What was seen that violates it.
    pub violation: Option<String>,
    /// Why it could not be checked here: what the plugin needs is not there.
    pub unchecked: Option<String>,
}

impl Finding {
    fn new(rule: Rule, seen: Option<Seen>) -> Self {
        let (violation, unchecked) = match seen {
            None => (None, None),
            Some(Seen::Violation(seen)) => (Some(seen), None),
            Some(Seen::Missing(what)) => (None, Some(what)),
        };
        Self { rule: rule.id(), text: rule.text(), violation, unchecked }
    }
}

/// Why a rule is not known to hold.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Seen {
    /// It does not.
    Violation(String),
    /// The plugin needs something that is not there (a device, a permission): neither its fault nor a proof.
    Missing(String),
}

/// What the process that checks one rule prints.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Verdict {
    /// `None` if the rule holds, else what was seen.
    pub(crate) seen: Option<Seen>,
}

/// How often a process is looked at.
const LOOK: Duration = Duration::from_millis(2);

/// Checks a plugin file against every rule that applies; stops at the first that makes the rest pointless. Not
/// real-time. A rule may take `patience`; `program` starts this program once more, to check one rule of the file and print a [`Verdict`].
#[must_use]
pub(crate) fn validate(path: &Path, patience: Duration, program: impl Fn(Rule) -> Command) -> Vec<Finding> {
    let mut findings = Vec::new();
    let mut note = |rule: Rule, seen: Option<Seen>| {
        let is_violated = matches!(seen, Some(Seen::Violation(_)));
        findings.push(Finding::new(rule, seen));
        is_violated
    };
    // Reads the file and runs nothing of it.
    let kind = match read_metadata(path) {
        Ok(metadata) => {
            note(Rule::Metadata, None);
            metadata.kind
        }
        Err(error) => {
            note(Rule::Metadata, Some(Seen::Violation(error.to_string())));
            return findings;
        }
    };
    let rules = Rule::ALL.into_iter().filter(|rule| *rule != Rule::Metadata && rule.applies_to(kind));
    for rule in rules {
        let outcome =
            apart(program(rule), patience).unwrap_or_else(|error| Outcome::NotChecked(error.to_string()));
        let stops = matches!(outcome, Outcome::Hung) || matches!(rule, Rule::Loads | Rule::Defaults);
        if note(rule, outcome.seen(patience)) && stops {
            break;
        }
    }
    findings
}

/// How the check of one rule ended.
enum Outcome {
    Holds,
    Not(Seen),
    /// The process ended before there was a verdict.
    Died(ExitStatus),
    Hung,
    NotChecked(String),
}

impl Outcome {
    fn seen(self, patience: Duration) -> Option<Seen> {
        Some(Seen::Violation(match self {
            Self::Holds => return None,
            Self::Not(seen) => return Some(seen),
            Self::Died(end) => match end.signal() {
                Some(signal) => format!("it ended the process by signal {signal}"),
                None => format!("it ended the process ({end})"),
            },
            Self::Hung => {
                format!("it did not come back within {patience:?}; the rules after it were not checked")
            }
            Self::NotChecked(error) => format!("cannot be checked: {error}"),
        }))
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
        Some(verdict) if end.success() => verdict.seen.map_or(Outcome::Holds, Outcome::Not),
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
