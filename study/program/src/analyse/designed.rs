//! `flotor analyse` for a study of one's own design.

use super::AnalyseArguments;
use crate::of_dataset;
use flotor_analysis::designed::{DesignAnalysis, DesignRecord, Language, script};
use flotor_command::{CommandError, note, print_result, style, write_text};
use flotor_study::designed::{DesignedData, DesignedLog, trials_tsv};
use flotor_study::log::ObserverKind;
use flotor_study_design::design::Design;
use serde::Serialize;
use std::path::Path;

/// Result with the origin of its answers.
#[derive(Serialize)]
struct Report<'a> {
    observer: ObserverKind,
    #[serde(flatten)]
    analysis: &'a DesignAnalysis,
}

/// Analyses the sessions of a designed study, complete or not.
pub(super) fn run(arguments: &AnalyseArguments, data: &DesignedData) -> Result<(), CommandError> {
    if arguments.blind || arguments.each || arguments.html.is_some() {
        return Err(CommandError::Usage(format!(
            "{}: --blind, --each and --html are for the protocols jnd, magnitude and force; a study of one's own design has text, --json, \
             --csv and --trials",
            arguments.data.display()
        )));
    }
    let logs = data.logs().map_err(of_dataset)?;
    let Some(begin) = logs.first().map(|log| &log.begin) else { return Ok(()) };
    for log in logs.iter().filter(|log| !log.complete) {
        let session = log.begin.session;
        note(format_args!(
            "{}, session {}: incomplete after {} steps; its answers are included",
            session.subject,
            session.session,
            log.steps.len()
        ));
    }
    let observer = begin.observer_kind();
    if let Some(restriction) = observer.restriction() {
        note(format_args!(
            "{restriction}: the result is one random draw; another --seed than {} gives another result",
            begin.session.seed
        ));
    }
    let analysis = DesignAnalysis::of(&begin.design, &DesignRecord::of_logs(&logs));
    let title = super::titled(begin.design.study().to_owned(), observer);
    let report = Report { observer, analysis: &analysis };
    print_result(arguments.json.file(), &report, || {
        format!("{}\n{}", style::title(&title), analysis.to_text())
    })?;
    write_text(arguments.csv.as_deref(), || responses(&analysis))?;
    match &arguments.trials {
        Some(path) => write_trials(path, &logs, &begin.design),
        None => Ok(()),
    }
}

/// Writes the table of trials, and scripts in the same folder that repeat the rows of the analysis.
fn write_trials(path: &Path, logs: &[DesignedLog], design: &Design) -> Result<(), CommandError> {
    if path.extension().is_none_or(|extension| extension != "csv") {
        let path = path.display();
        return Err(CommandError::Usage(format!("--trials {path}: name a file that ends in .csv")));
    }
    write_text(Some(path), || comma_separated(logs))?;
    let table = path.file_name().unwrap_or_default().to_string_lossy();
    for (extension, language) in [("py", Language::Python), ("R", Language::R)] {
        write_text(Some(&path.with_extension(extension)), || script(design, language, &table))?;
    }
    Ok(())
}

/// Returns the measures of every subject in every condition as a comma-separated table.
fn responses(analysis: &DesignAnalysis) -> String {
    let factors: Vec<&String> =
        analysis.cells.first().map_or(Vec::new(), |cell| cell.condition.keys().collect());
    let names = factors.iter().map(|name| name.as_str());
    let head: Vec<&str> = ["subject"].into_iter().chain(names).chain(["response"]).collect();
    let mut text = head.join(",") + "\n";
    for cell in &analysis.cells {
        let levels =
            factors.iter().map(|name| cell.condition.get(*name).map_or(String::new(), ToString::to_string));
        let value = cell.measure.tested().map_or("n/a".to_owned(), |measure| measure.value.to_string());
        let cells = [cell.subject.clone()].into_iter().chain(levels).chain([value]);
        text += &(cells.collect::<Vec<_>>().join(",") + "\n");
    }
    text
}

/// Returns the table of trials with commas.
fn comma_separated(logs: &[DesignedLog]) -> String {
    trials_tsv(logs).replace(',', " ").replace('\t', ",")
}
