//! Findings of `flotor doctor`.

use serde::Serialize;

/// Severity of a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Grade {
    Good,
    Note,
    Bad,
}

/// Finding: topic, severity, observation and remedy.
#[derive(Debug, Serialize)]
pub(crate) struct Diagnosis {
    pub(crate) what: &'static str,
    pub(crate) grade: Grade,
    pub(crate) found: String,
    pub(crate) remedy: Option<String>,
}

impl Diagnosis {
    pub(crate) fn good(what: &'static str, found: impl Into<String>) -> Self {
        Self { what, grade: Grade::Good, found: found.into(), remedy: None }
    }

    pub(crate) fn note(what: &'static str, found: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::problem(Grade::Note, what, found, remedy)
    }

    /// Creates a bad finding whose text already contains the remedy.
    pub(crate) fn bad_without_remedy(what: &'static str, found: impl Into<String>) -> Self {
        Self { what, grade: Grade::Bad, found: found.into(), remedy: None }
    }

    pub(crate) fn bad(what: &'static str, found: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::problem(Grade::Bad, what, found, remedy)
    }

    /// Creates a finding of this severity with a remedy.
    pub(crate) fn problem(
        grade: Grade,
        what: &'static str,
        found: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        Self { what, grade, found: found.into(), remedy: Some(remedy.into()) }
    }
}
