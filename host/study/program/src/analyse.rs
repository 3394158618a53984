//! `flotor analyse`: thresholds, effects and tests from the data of a study.

use crate::page::html;
use clap::{Args, ValueEnum};
use flotor_analysis::exclusion::{Applied, NotApplied, apply};
use flotor_analysis::{
    Analysis, AnalysisOptions, BlindedAnalysis, Estimator, SubjectChecks, SubjectQuality, SubjectRecord,
};
use flotor_analysis::{SCRIPT_PYTHON, script_in_r};
use flotor_command::options::JsonOption;
use flotor_command::tables::to_csv;
use flotor_command::{CommandError, note, print_result, style, write_text};
use flotor_statistics::anova::SumOfSquares;
use flotor_study::blinding::Codes;
use flotor_study::dataset::{Dataset, trials_csv};
use flotor_study::exclusion::Exclusion;
use flotor_study::log::{Incident, SittingLog};
use flotor_study::protocol::{Protocol, RatingScale};
use serde::Serialize;
use std::path::PathBuf;

/// Analyse the data of a perception experiment
#[derive(Args)]
#[command(
    after_help = "The command verifies every event log first. If a line of a log was changed, the command refuses the \
    data and gives the number of the line. It omits incomplete sittings, with a note.\n\n\
    Examples:\n  \
    flotor analyse data\n  \
    flotor analyse data --json result.json --type II"
)]
pub(crate) struct AnalyseArguments {
    /// Folder given to `study --out`
    #[arg(value_name = "DIR")]
    data: PathBuf,
    #[command(flatten)]
    json: JsonOption,
    /// Write an HTML page with figures and all numbers
    #[arg(long, value_name = "FILE.html")]
    html: Option<PathBuf>,
    /// Write every subject's response under every condition, for R or Python
    #[arg(long, value_name = "FILE.csv")]
    csv: Option<PathBuf>,
    /// Write one row for each trial of the complete sittings, and beside it a script in R and one in Python that repeat
    /// the tables, as they are with the defaults of --estimator, --type and --ratings
    #[arg(long, value_name = "FILE.csv", conflicts_with = "blind")]
    trials: Option<PathBuf>,
    /// Every subject by themselves, also those who have not finished: tracks, psychometric functions, what is suspicious
    #[arg(long, conflicts_with_all = ["html", "csv", "blind"])]
    each: bool,
    /// Codes instead of modalities and stimuli, without the values of the thesis
    #[arg(long, conflicts_with = "html")]
    blind: bool,
    /// Threshold estimator
    #[arg(long, value_enum, default_value_t)]
    estimator: Estimator,
    /// Sums of squares of the analysis of variance
    #[arg(long = "type", value_enum, default_value_t)]
    sums: SumsOption,
    /// Normalisation of the ratings between subjects
    #[arg(long, value_enum, default_value_t)]
    ratings: RatingScale,
}

/// `--type`
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
enum SumsOption {
    /// Each effect beyond those that do not contain it
    #[value(name = "II")]
    Two,
    /// Each effect beyond all others
    #[default]
    #[value(name = "III")]
    Three,
}

pub(crate) fn run(arguments: &AnalyseArguments) -> Result<(), CommandError> {
    let logs = Dataset::at(&arguments.data).logs().map_err(crate::of_dataset)?;
    let Some(first) = logs.first() else { return Ok(()) };
    // A pilot is analysed before there is anybody to compare it with.
    let is_pilot = logs.iter().filter(|log| log.complete).count() < 2;
    if arguments.each || is_pilot {
        let needs_all = [&arguments.html, &arguments.csv, &arguments.trials].into_iter().any(Option::is_some);
        if arguments.blind || needs_all {
            return Err(CommandError::Usage(
                "the tables of each subject are not blind and go into no file but --json; with --blind, --html, --csv or \
                 --trials, at least two complete sittings are needed, without --each"
                    .to_owned(),
            ));
        }
        return tell_each(arguments, &logs);
    }
    for log in logs.iter().filter(|log| !log.complete) {
        note(format_args!("{}: incomplete after {} trials, omitted", log.begin.subject, log.trials.len()));
    }
    if !first.begin.is_of_a_person() {
        note(format_args!(
            "simulated observers, seed {}: one of many draws, and no result about people; another --seed gives another",
            first.begin.seed
        ));
    }
    let complete = logs.iter().filter(|log| log.complete).map(SubjectRecord::of_log);
    let subjects: Vec<SubjectRecord> = complete.collect();
    let checks: Vec<SubjectChecks> = match first.begin.protocol.has_checks() {
        true => subjects.iter().map(SubjectChecks::of).collect(),
        false => Vec::new(),
    };
    let options = AnalysisOptions {
        sums_of_squares: match arguments.sums {
            SumsOption::Two => SumOfSquares::Two,
            SumsOption::Three => SumOfSquares::Three,
        },
        rating_scale: arguments.ratings,
        estimator: arguments.estimator,
    };
    let protocol = &first.begin.protocol;
    let rules = first.begin.exclusion();
    let applied = apply(&rules, protocol, subjects, options.estimator, first.begin.rate_hz());
    let subjects = &applied.kept;
    if !applied.excluded.is_empty() {
        let (kept, excluded) = (subjects.len(), applied.excluded.len());
        note(format_args!(
            "the exclusion rules of the study file leave {kept} sittings ({excluded} exclusions)"
        ));
    }
    let analysis = Analysis::of(protocol, subjects, &options).map_err(|error| {
        // What the rules took may be why; whoever must not know conditions does not see it.
        if !rules.are_none() && !arguments.blind {
            note(format_args!("what the rules of the study file took:\n{}", applied.to_text(&rules)));
        }
        CommandError::Usage(format!("{}: {error}", arguments.data.display()))
    })?;
    if arguments.blind {
        let codes = Codes::new(protocol, first.begin.seed);
        return tell_blinded(arguments, &BlindedAnalysis::of(&analysis, &codes));
    }
    let text = || {
        let title = format!("{} of {}", protocol.task(), protocol.stimulus());
        let analysed = format!("{}\n{}", style::title(&title), analysis.to_text());
        let excluded = (!rules.are_none()).then(|| applied.to_text(&rules));
        let checked = (!checks.is_empty()).then(|| checks_text(&checks));
        [Some(analysed), checked, excluded].into_iter().flatten().collect::<Vec<_>>().join("\n\n")
    };
    let Applied { excluded, not_applied, .. } = &applied;
    let report = Report { analysis: &analysis, checks: &checks, excluded, not_applied };
    print_result(arguments.json.file(), &report, text)?;
    write_text(arguments.html.as_deref(), || html(&first.begin, subjects, &analysis, &applied))?;
    write_text(arguments.csv.as_deref(), || to_csv([], analysis.responses()))?;
    let Some(path) = &arguments.trials else { return Ok(()) };
    if path.extension().is_none_or(|extension| extension != "csv") {
        let path = path.display();
        return Err(CommandError::Usage(format!("--trials {path}: name a file that ends in .csv")));
    }
    let usual = AnalysisOptions::default();
    let of_this_task = match protocol {
        Protocol::Jnd(_) => AnalysisOptions { rating_scale: usual.rating_scale, ..options },
        Protocol::Magnitude(_) => AnalysisOptions { estimator: usual.estimator, ..options },
    };
    if of_this_task != usual {
        note(format_args!(
            "the scripts beside {} know the defaults of --estimator, --type and --ratings: their tables differ from these",
            path.display()
        ));
    }
    let complete: Vec<SittingLog> = logs.into_iter().filter(|log| log.complete).collect();
    write_text(Some(path), || trials_csv(&complete, &applied.excluded))?;
    write_text(Some(&path.with_extension("py")), || SCRIPT_PYTHON.to_owned())?;
    let table = path.file_name().unwrap_or_default().to_string_lossy();
    write_text(Some(&path.with_extension("R")), || script_in_r(&table))
}

/// A result with what came of checks and exclusion rules; the keys beside those of the analysis are there where the study has them.
#[derive(Serialize)]
struct Report<'a> {
    #[serde(flatten)]
    analysis: &'a Analysis,
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    checks: &'a [SubjectChecks],
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    excluded: &'a [Exclusion],
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    not_applied: &'a [NotApplied],
}

fn checks_text(checks: &[SubjectChecks]) -> String {
    let line = |one: &SubjectChecks| format!("\n  {:<30}{}", one.subject, one.to_text());
    format!("  Checks{}", checks.iter().map(line).collect::<String>())
}

/// Every subject by themselves.
fn tell_each(arguments: &AnalyseArguments, logs: &[SittingLog]) -> Result<(), CommandError> {
    let of = |log: &SittingLog| {
        let (protocol, record) = (&log.begin.protocol, SubjectRecord::of_log(log));
        let incidents: Vec<Incident> = log.incidents.iter().map(|(.., incident)| incident.clone()).collect();
        let mut quality = SubjectQuality::of(protocol, &record, &incidents);
        let withdrawn = log.withdrawn.len();
        quality
            .flags
            .extend((withdrawn > 0).then(|| format!("{withdrawn} answers taken back and given anew")));
        if log.complete {
            let rules = log.begin.exclusion();
            let applied = apply(&rules, protocol, vec![record], arguments.estimator, log.begin.rate_hz());
            quality.flags.extend(applied.excluded.iter().map(|one| one.to_text(&rules)));
        }
        quality
    };
    let each: Vec<SubjectQuality> = logs.iter().map(of).collect();
    let text = || {
        let with_incidents = |(quality, log): (&SubjectQuality, &SittingLog)| {
            let lines = log.incidents.iter().map(|(trials, time, incident)| {
                let time = time.map_or(String::new(), |time| format!("  {time}"));
                format!("\n  after {trials} trials{time}: {incident}")
            });
            quality.to_text() + &lines.collect::<String>()
        };
        each.iter().zip(logs).map(with_incidents).collect::<Vec<_>>().join("\n\n")
    };
    print_result(arguments.json.file(), &each, text)
}

/// Results under codes.
fn tell_blinded(arguments: &AnalyseArguments, analysis: &BlindedAnalysis) -> Result<(), CommandError> {
    let text = || format!("{}\n{}", style::title(analysis.task), analysis.to_text());
    print_result(arguments.json.file(), analysis, text)?;
    write_text(arguments.csv.as_deref(), || to_csv([], &analysis.responses))
}
