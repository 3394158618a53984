//! Provenance of a result: origin of the answers, plan, and all settings needed to reproduce the result.

use super::choices::Choices;
use crate::study::plan::{Planned, planned};
use flotor_analysis::exclusion::Applied;
use flotor_study::exclusion::ExclusionRules;
use flotor_study::log::{Begin, ObserverKind, Plan, SittingLog, digest};
use flotor_study::procedure::Procedure;
use flotor_study::protocol::Protocol;
use serde::Serialize;
use std::collections::BTreeMap;

/// Provenance of a result.
#[derive(Serialize)]
pub(crate) struct Provenance {
    /// Origin of the answers.
    #[serde(skip)]
    pub(crate) observer: ObserverKind,
    /// Seed of order, presentation and simulated answers.
    seed: u64,
    /// Version of the program that ran the study.
    version: String,
    /// Digest of the configuration of the sittings ([`Begin::config_hash`]).
    configuration: String,
    /// Options of the analysis that affect this task.
    options: BTreeMap<&'static str, String>,
    /// Adaptive procedure of a difference experiment; `None` for ratings.
    #[serde(skip_serializing_if = "Option::is_none")]
    threshold_rule: Option<Procedure>,
    /// Exclusion rules of the study file.
    exclusion_rules: ExclusionRules,
    /// SHA-256 of the exclusion rules as JSON.
    exclusion_sha256: String,
    /// Study file; `None` without one.
    #[serde(skip_serializing_if = "Option::is_none")]
    study_file: Option<StudyFile>,
    /// Agreement of the analysis with the study file.
    plan: Agreement,
}

/// Study file of the sittings.
#[derive(Serialize)]
struct StudyFile {
    name: String,
    sha256: String,
    text: String,
    /// Description of the planned analysis.
    analysis: String,
}

/// Agreement of an analysis with the study file.
#[derive(Serialize)]
#[serde(rename_all = "kebab-case")]
enum Agreement {
    /// The study has no study file.
    NoPlan,
    /// Options and number of subjects match the study file, and all its exclusion rules were applied.
    AsPlanned,
    /// Deviations from the study file, one text each.
    NotAsPlanned(Vec<String>),
    /// This version cannot parse the study file in the log.
    Unknown,
}

impl Provenance {
    /// Builds the provenance of an analysis.
    pub(crate) fn of(begin: &Begin, logs: &[SittingLog], choices: Choices, applied: &Applied) -> Self {
        let rules = begin.exclusion();
        let planned = begin.plan.as_ref().map(|plan| planned(&plan.text));
        let study_file = begin.plan.as_ref().map(|Plan { file, sha256, text, .. }| StudyFile {
            name: file.clone(),
            sha256: sha256.clone(),
            text: text.clone(),
            analysis: planned.iter().flatten().map(|planned| planned.analysis.clone()).collect(),
        });
        Self {
            observer: begin.observer_kind(),
            seed: begin.seed,
            version: begin.version.clone(),
            configuration: begin.config_hash(),
            options: choices.of_task(&begin.protocol).into_iter().collect(),
            threshold_rule: match &begin.protocol {
                Protocol::Jnd(jnd) => Some(jnd.procedure.clone()),
                Protocol::Magnitude(_) => None,
            },
            exclusion_sha256: digest(&serde_json::to_string(&rules).unwrap_or_default()),
            exclusion_rules: rules,
            study_file,
            plan: match planned {
                None => Agreement::NoPlan,
                Some(None) => Agreement::Unknown,
                Some(Some(planned)) => Agreement::of(&planned, begin, logs, choices, applied),
            },
        }
    }

    /// Returns the lines of the provenance as names and values, in order.
    pub(crate) fn lines(&self) -> Vec<(&'static str, String)> {
        let observer = self.observer.restriction().unwrap_or("people").to_owned();
        let options: Vec<String> =
            self.options.iter().map(|(name, value)| format!("--{name} {value}")).collect();
        let mut lines = vec![("observer", observer)];
        match &self.study_file {
            None => lines.push(("study file", "none".to_owned())),
            Some(file) => {
                lines.push(("study file", file.name.clone()));
                lines.push(("its SHA-256", file.sha256.clone()));
                lines.push(("planned analysis", format!("\"{}\"", file.analysis)));
            }
        }
        lines.push(("analysis", self.plan.to_text()));
        lines.push(("options", options.join(", ")));
        if self.exclusion_rules.are_none() {
            lines.push(("exclusion rules", "none".to_owned()));
        } else {
            lines.push(("exclusion rules, SHA-256", self.exclusion_sha256.clone()));
        }
        lines.push(("seed", self.seed.to_string()));
        lines.push(("version", format!("flotor {}", self.version)));
        lines.push(("configuration", self.configuration.clone()));
        lines
    }

    /// Formats the provenance as a text block.
    pub(crate) fn to_text(&self) -> String {
        let line = |(name, value): (&'static str, String)| format!("\n  {name:<30}{value}");
        format!("  Provenance{}", self.lines().into_iter().map(line).collect::<String>())
    }

    /// Returns name and text of the study file; `None` without one.
    pub(crate) fn study_file(&self) -> Option<(&str, &str)> {
        self.study_file.as_ref().map(|file| (file.name.as_str(), file.text.as_str()))
    }
}

impl Agreement {
    fn of(
        planned: &Planned,
        begin: &Begin,
        logs: &[SittingLog],
        choices: Choices,
        applied: &Applied,
    ) -> Self {
        let mut deviations = choices.deviations(planned.choices, &begin.protocol);
        let complete = logs.iter().filter(|log| log.complete).count();
        deviations.extend(
            planned
                .subjects
                .filter(|planned| *planned != complete)
                .map(|planned| format!("complete sittings: {complete}, planned {planned}")),
        );
        deviations.extend(applied.not_applied.iter().map(|rule| format!("not applied: {rule}")));
        if deviations.is_empty() { Self::AsPlanned } else { Self::NotAsPlanned(deviations) }
    }

    fn to_text(&self) -> String {
        match self {
            Self::NoPlan => "without a plan".to_owned(),
            Self::AsPlanned => "as planned".to_owned(),
            Self::NotAsPlanned(deviations) => format!("not as planned: {}", deviations.join("; ")),
            Self::Unknown => "the log has no plan that this version can read".to_owned(),
        }
    }
}
