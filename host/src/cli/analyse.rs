//! `flotor analyse`: a study's data in, thresholds, effects and tests out.

use super::{CommandError, style, write_json};
use clap::{Args, ValueEnum};
use flotor_statistics::anova::SumOfSquares;
use flotor_study::analysis::{Analysis, AnalysisOptions, BlindedAnalysis, Estimator, SubjectRecord};
use flotor_study::apparatus::report::html;
use flotor_study::blinding::Codes;
use flotor_study::dataset::{Dataset, DatasetError};
use flotor_study::protocol::RatingScale;
use std::path::PathBuf;

/// Analyse a study
#[derive(Args)]
#[command(
    after_help = "Every event log is verified first: a changed line is refused with its number. Sittings that \
    never came to an end are\nleft out, and said so.\n\n\
    Examples:\n  \
    flotor analyse data\n  \
    flotor analyse data --json result.json --type II"
)]
pub(crate) struct AnalyseArguments {
    /// Folder given to `study --out`
    #[arg(value_name = "DIR")]
    data: PathBuf,
    /// Write the result as JSON (- for standard output)
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write a page with figures and all numbers
    #[arg(long, value_name = "FILE.html")]
    html: Option<PathBuf>,
    /// Write every subject's response under every condition, for R or Python
    #[arg(long, value_name = "FILE.csv")]
    csv: Option<PathBuf>,
    /// Codes in place of modalities and stimuli, nothing of the report beside them
    #[arg(long, conflicts_with = "html")]
    blind: bool,
    /// How thresholds are found
    #[arg(long, value_enum, default_value_t)]
    estimator: EstimatorOption,
    /// Sums of squares of the analysis of variance
    #[arg(long = "type", value_enum, default_value_t)]
    sums: SumsOption,
    /// How ratings of subjects with different scales are made comparable
    #[arg(long, value_enum, default_value_t)]
    ratings: RatingsOption,
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

/// `--estimator`
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
enum EstimatorOption {
    /// As the procedure says: the mean of the last differences, or the belief of QUEST+
    #[default]
    Procedure,
    /// The most likely observer, from all trials at a base
    Map,
}

/// `--ratings`
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
enum RatingsOption {
    /// Divided by the subject's mean
    #[default]
    Mean,
    /// Divided by the subject's geometric mean
    GeometricMean,
    /// As they are
    Raw,
}

pub(crate) fn run(arguments: &AnalyseArguments) -> Result<(), CommandError> {
    let logs = Dataset::at(&arguments.data).logs().map_err(|error| match error {
        DatasetError::File { .. } => CommandError::Failed(error.to_string()),
        other => CommandError::Usage(other.to_string()),
    })?;
    for log in logs.iter().filter(|log| !log.complete) {
        let subject = log.begin.subject;
        eprintln!(
            "{} {subject} broke off after {} trials: left out",
            style::warning("note:"),
            log.trials.len()
        );
    }
    let Some(first) = logs.first() else { return Ok(()) };
    let complete = logs.iter().filter(|log| log.complete).map(SubjectRecord::of_log);
    let subjects: Vec<SubjectRecord> = complete.collect();
    let options = AnalysisOptions {
        sums_of_squares: match arguments.sums {
            SumsOption::Two => SumOfSquares::Two,
            SumsOption::Three => SumOfSquares::Three,
        },
        rating_scale: match arguments.ratings {
            RatingsOption::Mean => RatingScale::DividedByMean,
            RatingsOption::GeometricMean => RatingScale::DividedByGeometricMean,
            RatingsOption::Raw => RatingScale::Raw,
        },
        estimator: match arguments.estimator {
            EstimatorOption::Procedure => Estimator::Procedure,
            EstimatorOption::Map => Estimator::Map,
        },
    };
    let protocol = &first.begin.protocol;
    let analysis = Analysis::of(protocol, &subjects, &options)
        .map_err(|error| CommandError::Usage(format!("{}: {error}", arguments.data.display())))?;
    if arguments.blind {
        let codes = Codes::new(protocol, first.begin.seed);
        return tell_blinded(arguments, &BlindedAnalysis::of(&analysis, &codes));
    }
    if arguments.json.as_ref().is_none_or(|path| path.as_os_str() != "-") {
        say!("{}", style::title(&format!("{} of {}", protocol.task(), protocol.stimulus())));
        say!("{}", analysis.to_text());
    }
    if let Some(path) = &arguments.html {
        std::fs::write(path, html(&first.begin, &subjects, &analysis))
            .map_err(|cause| CommandError::file(path, "cannot write the page", cause))?;
    }
    if let Some(path) = &arguments.csv {
        write_csv(path, analysis.responses()).map_err(|error| {
            CommandError::file(path, "cannot write the table", std::io::Error::other(error))
        })?;
    }
    arguments.json.as_ref().map_or(Ok(()), |path| write_json(path, &analysis))
}

/// Results under codes.
fn tell_blinded(arguments: &AnalyseArguments, analysis: &BlindedAnalysis) -> Result<(), CommandError> {
    if arguments.json.as_ref().is_none_or(|path| path.as_os_str() != "-") {
        say!("{}\n{}", style::title(analysis.task), analysis.to_text());
    }
    if let Some(path) = &arguments.csv {
        write_csv(path, &analysis.responses).map_err(|error| {
            CommandError::file(path, "cannot write the table", std::io::Error::other(error))
        })?;
    }
    arguments.json.as_ref().map_or(Ok(()), |path| write_json(path, analysis))
}

fn write_csv(path: &std::path::Path, rows: &[impl serde::Serialize]) -> Result<(), csv::Error> {
    let mut writer = csv::Writer::from_path(path)?;
    rows.iter().try_for_each(|row| writer.serialize(row))?;
    Ok(writer.flush()?)
}
