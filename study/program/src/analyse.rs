//! `flotor analyse`: computes thresholds, effects and tests from the data of a study.

pub(crate) mod choices;
mod designed;
pub(crate) mod provenance;
pub(crate) mod report;

use crate::page::html;
use choices::Choices;
use clap::Args;
use flotor_analysis::exclusion::{Applied, apply};
use flotor_analysis::{Analysis, BlindedAnalysis, SubjectChecks, SubjectQuality, SubjectRecord};
use flotor_analysis::{SCRIPT_PYTHON, script_in_r};
use flotor_command::options::JsonOption;
use flotor_command::tables::to_csv;
use flotor_command::{CommandError, note, print_result, style, write_text};
use flotor_study::blinding::Codes;
use flotor_study::dataset::{Dataset, trials_csv};
use flotor_study::designed::DesignedData;
use flotor_study::exclusion::Exclusion;
use flotor_study::log::{Begin, Incident, ObserverKind, SittingLog};
use flotor_study::protocol::Protocol;
use provenance::Provenance;
use report::Report;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Analyse the data of a perception experiment
#[derive(Args)]
#[command(
    after_help = "The command verifies every event log first. If a line of a log was changed, the command rejects \
    the data and prints the number of the line. It omits incomplete sittings, with a note.\n\n\
    Examples:\n  \
    flotor analyse data\n  \
    flotor analyse data --json result.json --type II"
)]
pub(crate) struct AnalyseArguments {
    /// Folder of the study, written by `flotor study` (--out)
    #[arg(value_name = "DIR")]
    data: PathBuf,
    #[command(flatten)]
    json: JsonOption,
    /// Write an HTML page with figures and all numbers
    #[arg(long, value_name = "FILE.html")]
    html: Option<PathBuf>,
    /// Write the response of every subject in every condition, for R or Python
    #[arg(long, value_name = "FILE.csv")]
    csv: Option<PathBuf>,
    /// Write one row for each trial of the complete sittings, and beside it scripts in R and Python that reproduce the tables with
    /// the defaults of --estimator, --type and --ratings
    #[arg(long, value_name = "FILE.csv", conflicts_with = "blind")]
    trials: Option<PathBuf>,
    /// Report each subject separately, incomplete ones too: tracks, psychometric functions, suspicious answers
    #[arg(long, conflicts_with_all = ["html", "csv", "blind"])]
    each: bool,
    /// Show codes instead of modalities and stimuli, without the values of the thesis
    #[arg(long, conflicts_with = "html")]
    blind: bool,
    #[command(flatten)]
    choices: Choices,
}

pub(crate) fn run(arguments: &AnalyseArguments) -> Result<(), CommandError> {
    let designed = DesignedData::at(&arguments.data);
    if designed.is_here() {
        return designed::run(arguments, &designed);
    }
    let logs = Dataset::at(&arguments.data).logs().map_err(crate::of_dataset)?;
    let Some(begin) = logs.first().map(|first| first.begin.clone()) else { return Ok(()) };
    // With fewer than two complete sittings, such as in a pilot study, only results of single subjects are possible.
    if arguments.each || logs.iter().filter(|log| log.complete).count() < 2 {
        arguments.refuse_tables()?;
    }
    if arguments.each {
        return tell_each(arguments, &logs);
    }
    let logs = complete(arguments, logs)?;
    if logs.len() < 2 {
        return tell_each(arguments, &logs);
    }
    let observer = begin.observer_kind();
    if let Some(restriction) = observer.restriction() {
        note(format_args!(
            "{restriction}: the result is one random draw; another --seed than {} gives another result",
            begin.seed
        ));
    }
    let protocol = &begin.protocol;
    let subjects: Vec<SubjectRecord> = logs.iter().map(SubjectRecord::of_log).collect();
    let checks: Vec<SubjectChecks> = match protocol.has_checks() {
        true => subjects.iter().map(SubjectChecks::of).collect(),
        false => Vec::new(),
    };
    let options = arguments.choices.options();
    let rules = begin.exclusion();
    let applied = apply(&rules, protocol, subjects, options.estimator, begin.rate_hz());
    let subjects = &applied.kept;
    if !applied.excluded.is_empty() {
        let (kept, excluded) = (subjects.len(), applied.excluded.len());
        note(format_args!("{kept} sittings after exclusions ({excluded} exclusions)"));
    }
    let analysis = Analysis::of(protocol, subjects, &options).map_err(|error| {
        // Print the exclusions, a possible cause, except in a blinded analysis.
        if !applied.excluded.is_empty() && !arguments.blind {
            note(format_args!("exclusions:\n{}", applied.to_text(&rules)));
        }
        CommandError::Usage(format!("{}: {error}", arguments.data.display()))
    })?;
    if arguments.blind {
        let codes = Codes::new(protocol, begin.seed);
        return tell_blinded(arguments, &BlindedAnalysis::of(&analysis, &codes), observer);
    }
    let provenance = Provenance::of(&begin, &logs, arguments.choices, &applied);
    let Applied { excluded, not_applied, .. } = &applied;
    let report = Report {
        observer,
        analysis: &analysis,
        checks: &checks,
        excluded,
        not_applied,
        provenance: &provenance,
    };
    print_result(arguments.json.file(), &report, || report_text(&begin, &report, &applied))?;
    write_text(arguments.html.as_deref(), || html(&begin, &report, &applied))?;
    write_text(arguments.csv.as_deref(), || {
        let head = ["subject", "first_modality", "modality", "stimulus", "response", "observer"];
        to_csv(head, analysis.responses().iter().map(|row| (row, observer)))
    })?;
    match &arguments.trials {
        Some(path) => write_trials(path, arguments.choices, &logs, protocol, excluded),
        None => Ok(()),
    }
}

impl AnalyseArguments {
    /// Returns an error if an option needs a table of all subjects.
    fn refuse_tables(&self) -> Result<(), CommandError> {
        if self.blind || [&self.html, &self.csv, &self.trials].into_iter().any(Option::is_some) {
            return Err(CommandError::Usage(
                "the tables of single subjects (--each, or fewer than two complete sittings) are unblinded, and only --json \
                 stores them; omit --blind, --html, --csv and --trials"
                    .to_owned(),
            ));
        }
        Ok(())
    }
}

/// Returns the complete sittings, and prints a note on each incomplete one; an error if no sitting is complete.
fn complete(arguments: &AnalyseArguments, logs: Vec<SittingLog>) -> Result<Vec<SittingLog>, CommandError> {
    let (complete, others): (Vec<_>, Vec<_>) = logs.into_iter().partition(|log| log.complete);
    if complete.is_empty() {
        let (data, each): (_, Vec<String>) =
            (arguments.data.display(), others.iter().map(incomplete).collect());
        return Err(CommandError::Usage(format!(
            "{data}: no sitting is complete ({}); `--each` shows the incomplete sittings",
            each.join(", ")
        )));
    }
    for log in &others {
        note(format_args!("{}, omitted", incomplete(log)));
    }
    Ok(complete)
}

/// Formats the analysis, checks, exclusions and provenance for the terminal.
fn report_text(begin: &Begin, report: &Report<'_>, applied: &Applied) -> String {
    let (protocol, rules) = (&begin.protocol, begin.exclusion());
    let title = titled(format!("{} of {}", protocol.task(), protocol.stimulus()), report.observer);
    let analysed = format!("{}\n{}", style::title(&title), report.analysis.to_text());
    let has_exclusions = !rules.are_none() || !applied.excluded.is_empty();
    let excluded = has_exclusions.then(|| applied.to_text(&rules));
    let checked = (!report.checks.is_empty()).then(|| checks_text(report.checks));
    let blocks = [Some(analysed), checked, excluded, Some(report.provenance.to_text())];
    blocks.into_iter().flatten().collect::<Vec<_>>().join("\n\n")
}

/// Writes a table with a row for each trial, and scripts in the same folder that reproduce the tables of the analysis.
fn write_trials(
    path: &Path,
    choices: Choices,
    logs: &[SittingLog],
    protocol: &Protocol,
    excluded: &[Exclusion],
) -> Result<(), CommandError> {
    if path.extension().is_none_or(|extension| extension != "csv") {
        let path = path.display();
        return Err(CommandError::Usage(format!("--trials {path}: name a file that ends in .csv")));
    }
    if !choices.deviations(Choices::default(), protocol).is_empty() {
        note(format_args!(
            "the scripts beside {} use the defaults of --estimator, --type and --ratings: their tables differ from these tables",
            path.display()
        ));
    }
    write_text(Some(path), || trials_csv(logs, excluded))?;
    write_text(Some(&path.with_extension("py")), || SCRIPT_PYTHON.to_owned())?;
    let table = path.file_name().unwrap_or_default().to_string_lossy();
    write_text(Some(&path.with_extension("R")), || script_in_r(&table))
}

/// Blinded result with the origin of its answers.
#[derive(Serialize)]
struct WithObserver<'a, T> {
    observer: ObserverKind,
    #[serde(flatten)]
    result: &'a T,
}

/// Appends the restriction for simulated answers, if any, to a title.
fn titled(title: String, observer: ObserverKind) -> String {
    match observer.restriction() {
        Some(restriction) => format!("{title}: {restriction}"),
        None => title,
    }
}

fn checks_text(checks: &[SubjectChecks]) -> String {
    let line = |one: &SubjectChecks| format!("\n  {:<30}{}", one.subject, one.to_text());
    format!("  Checks{}", checks.iter().map(line).collect::<String>())
}

/// Formats subject and number of trials of an incomplete sitting.
fn incomplete(log: &SittingLog) -> String {
    format!("{}: incomplete after {} trials", log.begin.subject, log.trials.len())
}

/// Data quality of one subject, with the origin of the answers.
#[derive(Serialize)]
struct Each {
    observer: ObserverKind,
    complete: bool,
    #[serde(flatten)]
    quality: SubjectQuality,
}

impl Each {
    fn of(log: &SittingLog, choices: Choices) -> Self {
        let (protocol, record) = (&log.begin.protocol, SubjectRecord::of_log(log));
        let incidents: Vec<Incident> = log.incidents.iter().map(|(.., incident)| incident.clone()).collect();
        let mut quality = SubjectQuality::of(protocol, &record, &incidents);
        let withdrawn = log.withdrawn.len();
        quality.flags.extend((withdrawn > 0).then(|| format!("{withdrawn} answers withdrawn and replaced")));
        if log.complete {
            let rules = log.begin.exclusion();
            let applied = apply(&rules, protocol, vec![record], choices.estimator, log.begin.rate_hz());
            quality.flags.extend(applied.excluded.iter().map(|one| one.to_text(&rules)));
        } else {
            let trials = log.trials.len();
            quality.flags.insert(0, format!("incomplete after {trials} trials: not part of the data"));
        }
        Self { observer: log.begin.observer_kind(), complete: log.complete, quality }
    }
}

/// Prints the data quality of each subject.
fn tell_each(arguments: &AnalyseArguments, logs: &[SittingLog]) -> Result<(), CommandError> {
    let each: Vec<Each> = logs.iter().map(|log| Each::of(log, arguments.choices)).collect();
    let text = || {
        let restriction = each.first().and_then(|one| one.observer.restriction());
        let blocks = each.iter().zip(logs).map(|(one, log)| one.quality.to_text() + &incidents_text(log));
        let title = restriction.map(|restriction| style::title(&format!("each subject: {restriction}")));
        title.into_iter().chain(blocks).collect::<Vec<_>>().join("\n\n")
    };
    print_result(arguments.json.file(), &each, text)
}

/// Formats the incidents of a log, one per line; all missed ticks in one line.
fn incidents_text(log: &SittingLog) -> String {
    let (mut lines, mut missed) = (String::new(), Vec::new());
    for (trials, time, incident) in &log.incidents {
        if let Incident::MissedTicks { ticks } = incident {
            missed.push(*ticks);
            continue;
        }
        let time = time.map_or(String::new(), |time| format!("  {time}"));
        lines += &format!("\n  after {trials} trials{time}: {incident}");
    }
    if !missed.is_empty() {
        let ticks = Incident::MissedTicks { ticks: missed.iter().sum() };
        lines += &format!("\n  while {} stimuli were felt: {ticks}", missed.len());
    }
    lines
}

/// Prints blinded results.
fn tell_blinded(
    arguments: &AnalyseArguments,
    analysis: &BlindedAnalysis,
    observer: ObserverKind,
) -> Result<(), CommandError> {
    let title = titled(analysis.task.to_owned(), observer);
    let text = || format!("{}\n{}", style::title(&title), analysis.to_text());
    print_result(arguments.json.file(), &WithObserver { observer, result: analysis }, text)?;
    write_text(arguments.csv.as_deref(), || {
        let head = ["subject", "first_modality", "modality", "level", "response", "observer"];
        to_csv(head, analysis.responses.iter().map(|row| (row, observer)))
    })
}
