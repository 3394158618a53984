//! Outcome of a rule: holds, is violated, or could not be checked.

use super::rule::Check;
use flotor_hal::RefusalKind;
use flotor_loader::LoadError;
use flotor_session::THREAD_ADVICE;
use serde::{Deserialize, Serialize};

/// Result of one check; the rule holds if there is neither `violation` nor `unchecked`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// Short name of the rule.
    pub rule: &'static str,
    /// Requirement of the rule.
    pub text: &'static str,
    /// Violation that was found, or description of a step that did not return; `None` if the check found neither.
    pub violation: Option<String>,
    /// Reason why the rule could not be checked; `None` if the rule was checked.
    pub unchecked: Option<String>,
    /// Category of the reason in `unchecked`; `None` if the rule was checked.
    pub obstacle: Option<Obstacle>,
    /// Figures measured by the check; `None` for a check that measures none.
    pub figures: Option<Figures>,
}

/// Reason category of a rule that could not be checked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Obstacle {
    /// This system cannot check the rule for any plugin.
    System,
    /// Something that the plugin or the check needs is missing.
    Requirement,
    /// The plugin has nothing that the rule applies to.
    Subject,
}

/// Measurements of a stateless model near home. No contract limits them; they reveal a confusion of newtons per metre
/// with newtons per millimetre.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Figures {
    /// Largest stiffness, N/m.
    pub stiffness_n_per_m: f64,
    /// Largest damping, N·s/m.
    pub damping_ns_per_m: f64,
}

impl Finding {
    /// Returns true if the rule does not apply to this plugin.
    #[must_use]
    pub fn has_nothing_to_judge(&self) -> bool {
        self.obstacle == Some(Obstacle::Subject)
    }

    pub(super) fn new(check: Check, verdict: Verdict) -> Self {
        let Verdict { seen, figures } = verdict;
        let (violation, unchecked, obstacle) = match seen {
            None => (None, None, None),
            Some(Outcome::Violation(seen) | Outcome::Stuck(seen)) => (Some(seen), None, None),
            Some(Outcome::Missing(what)) => (None, Some(what), Some(Obstacle::Requirement)),
            Some(Outcome::UnsupportedSystem(why)) => (None, Some(why), Some(Obstacle::System)),
            Some(Outcome::NothingToJudge(why)) => (None, Some(why), Some(Obstacle::Subject)),
        };
        Self { rule: check.id(), text: check.text(), violation, unchecked, obstacle, figures }
    }
}

/// Reason why a check did not pass: violation, step that did not return, missing requirement, or rule not applicable.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Outcome {
    /// The rule is violated.
    Violation(String),
    /// A step did not return, so the outcome is unknown.
    Stuck(String),
    /// The plugin or the check needs something that is missing (a device, a permission): neither a violation nor a proof.
    Missing(String),
    /// This system cannot check the rule for any plugin.
    #[serde(rename = "notonthissystem")]
    UnsupportedSystem(String),
    /// The rule does not apply to this plugin, or nothing in the sample could violate it.
    NothingToJudge(String),
}

impl Outcome {
    /// Returns the finding for a check whose thread could not be started.
    pub(crate) fn no_thread(cause: &std::io::Error) -> Self {
        Self::Missing(format!("cannot start a thread for the check: {cause}; {THREAD_ADVICE}"))
    }

    /// Returns the finding that the rule does not apply, for this reason.
    pub(super) fn nothing_to_judge(why: &str) -> Self {
        Self::NothingToJudge(why.to_owned())
    }
}

impl From<String> for Outcome {
    fn from(violation: String) -> Self {
        Self::Violation(violation)
    }
}

/// Converts a load error; a missing, busy or forbidden resource is not a violation.
impl From<LoadError> for Outcome {
    fn from(error: LoadError) -> Self {
        match error {
            LoadError::Refused { refusal, .. }
                if refusal.kind == RefusalKind::Resource && is_told(&refusal.reason) =>
            {
                Self::Missing(refusal.reason)
            }
            other => Self::Violation(other.to_string()),
        }
    }
}

/// Returns true if a refusal names a reason; the loader replaces a missing one, or invalid text.
fn is_told(reason: &str) -> bool {
    !reason.starts_with("no reason given") && !reason.contains(char::REPLACEMENT_CHARACTER)
}

/// Result of the process that checks one rule.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    /// Outcome; `None` if the rule holds.
    pub seen: Option<Outcome>,
    /// Figures measured by the check; `None` for a check that measures none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub figures: Option<Figures>,
}

impl Verdict {
    /// Converts the result of a check.
    pub fn of(checked: Result<Option<Figures>, Outcome>) -> Self {
        match checked {
            Ok(figures) => Self { seen: None, figures },
            Err(seen) => Self { seen: Some(seen), figures: None },
        }
    }

    pub(super) fn violated(seen: String) -> Self {
        Self { seen: Some(Outcome::Violation(seen)), figures: None }
    }
}
