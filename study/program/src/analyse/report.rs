//! Report of an analysis, also its JSON output.

use super::provenance::Provenance;
use flotor_analysis::exclusion::NotApplied;
use flotor_analysis::{Analysis, SubjectChecks};
use flotor_study::exclusion::Exclusion;
use flotor_study::log::ObserverKind;
use serde::Serialize;

/// Analysis with its provenance, checks and exclusions.
#[derive(Serialize)]
pub(crate) struct Report<'a> {
    pub(crate) observer: ObserverKind,
    #[serde(flatten)]
    pub(crate) analysis: &'a Analysis,
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    pub(crate) checks: &'a [SubjectChecks],
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    pub(crate) excluded: &'a [Exclusion],
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    pub(crate) not_applied: &'a [NotApplied],
    pub(crate) provenance: &'a Provenance,
}
