//! Analysis of studies: thresholds, Weber fractions, trends and effects, compared with published results.

mod blinded;
mod checks;
pub mod designed;
pub mod exclusion;
mod jnd;
mod kinematics;
mod large;
mod magnitude;
mod post_hoc;
pub mod power;
pub mod published;
mod subject;
mod text;

pub use blinded::{BlindedAnalysis, BlindedCell, BlindedRow};
pub use checks::SubjectChecks;
pub use jnd::{JndAnalysis, ThresholdCell, WeberFractions, analyse_jnd};
pub use kinematics::KinematicMeasure;
pub use magnitude::{MagnitudeAnalysis, RatingCell, analyse_magnitude};
pub use post_hoc::{PairTest, PostHoc};
pub use subject::{SubjectCondition, SubjectQuality};
pub use text::{effect_text, exponent_text, p_text, size_interval_text, t_text};

use flotor_statistics::StatisticsError;
use flotor_statistics::anova::{BetweenFactor, Effect, SumOfSquares, WithinFactor};
use flotor_statistics::describe::{MeanInterval, mean_interval};
use flotor_study::estimate::Observation;
use flotor_study::log::{SittingLog, TrialEvent};
use flotor_study::protocol::{Protocol, SubjectNumber};
use flotor_study::sitting::{TrackResult, Verdict};
use flotor_study::trial::{Modality, Phase, Presented};
use serde::Serialize;

/// Python script that reproduces the tables from [`flotor_study::dataset::trials_csv`].
pub const SCRIPT_PYTHON: &str = include_str!("scripts/analysis.py");
/// R script that reproduces the tables, with a placeholder for the table's name.
const SCRIPT_R: &str = include_str!("scripts/analysis.R");

/// Confidence level of every interval.
const CONFIDENCE: f64 = 0.95;

/// Placeholder of the table's name in [`SCRIPT_R`].
const TABLE_IN_R: &str = "\"trials.csv\"";

/// Returns the R script that reproduces the tables from [`flotor_study::dataset::trials_csv`], stored in the script's folder as
/// `table_name`.
#[must_use]
pub fn script_in_r(table_name: &str) -> String {
    let escaped = table_name.replace('\\', "\\\\").replace('"', "\\\"");
    SCRIPT_R.replace(TABLE_IN_R, &format!("\"{escaped}\""))
}

/// Data of one subject.
#[derive(Clone, Debug)]
pub struct SubjectRecord {
    /// Number of the subject.
    pub subject: SubjectNumber,
    /// First modality of the subject.
    pub first_modality: Modality,
    /// Presentations with their answers, in order.
    pub trials: Vec<TrialEvent>,
    /// Results of the completed tracks.
    pub tracks: Vec<TrackResult>,
}

impl SubjectRecord {
    /// Extracts the trials and tracks of a sitting from its log.
    #[must_use]
    pub fn of_log(log: &SittingLog) -> Self {
        let subject = log.begin.subject;
        Self {
            subject,
            first_modality: log.begin.protocol.first_modality().of(subject),
            trials: log.trials.iter().map(|record| record.event.clone()).collect(),
            tracks: log.tracks().to_vec(),
        }
    }

    /// Returns the counted answers: main trials that are not repeated.
    pub fn counted(&self) -> impl Iterator<Item = &TrialEvent> {
        let counts =
            |event: &&TrialEvent| event.trial.phase == Phase::Main && event.verdict != Verdict::Repeated;
        self.trials.iter().filter(counts)
    }

    /// Returns the counted trials with a judged pair: event, observation and base.
    pub fn judged(&self) -> impl Iterator<Item = (&TrialEvent, Observation, f64)> {
        self.counted().filter_map(|event| match (event.trial.presented, event.verdict) {
            (Presented::Pair(pair), Verdict::Judged { judgement, .. }) => {
                Some((event, Observation { delta: pair.delta, judgement }, pair.base))
            }
            _ => None,
        })
    }

    /// Returns the observations of the counted pairs in one condition.
    fn observations(&self, modality: Modality, base: f64) -> Vec<Observation> {
        let here = self.judged().filter(|(event, _, at)| event.trial.modality == modality && *at == base);
        here.map(|(_, observation, _)| observation).collect()
    }
}

/// Estimator of thresholds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Estimator {
    /// Estimate of the procedure: mean of the differences from the first counted reversal on, or posterior mean of
    /// QUEST+
    #[default]
    Procedure,
    /// Maximum a posteriori: threshold of the most likely observer, given all trials at a base
    Map,
}

/// Options of an analysis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AnalysisOptions {
    /// Type of the sums of squares.
    pub sums_of_squares: SumOfSquares,
    /// Normalisation of ratings across subjects.
    pub rating_scale: flotor_study::protocol::RatingScale,
    /// Estimator of thresholds.
    pub estimator: Estimator,
}

/// Reason why a study cannot be analysed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AnalysisError {
    /// Too few complete sittings.
    #[error(
        "an analysis needs 2 or more complete sittings after exclusions, and the study has {complete}; complete more sittings"
    )]
    TooFewSubjects {
        /// Number of complete sittings that no rule excluded.
        complete: usize,
    },
    /// A subject has no threshold in some condition.
    #[error(
        "{subject}: no track at base {base} in modality {modality} reached a threshold; `--each` shows the tracks of the subject"
    )]
    NoThreshold {
        /// Number of the subject.
        subject: SubjectNumber,
        /// Label of the modality.
        modality: &'static str,
        /// Base, in the unit of the stimulus.
        base: f64,
    },
    /// Ratings cannot be normalised as requested.
    #[error("{subject}: {problem}")]
    Ratings {
        /// Number of the subject.
        subject: SubjectNumber,
        /// Description of the problem.
        problem: &'static str,
    },
    /// Error of a statistic.
    #[error(transparent)]
    Statistics(#[from] StatisticsError),
}

/// Analysis of a study, by experiment.
#[derive(Clone, Debug, Serialize)]
#[serde(untagged)]
pub enum Analysis {
    /// Difference experiment (just noticeable difference, JND).
    Jnd(Box<JndAnalysis>),
    /// Magnitude estimation experiment.
    Magnitude(Box<MagnitudeAnalysis>),
}

impl Analysis {
    /// Analyses a study from the records of its complete sittings.
    ///
    /// # Errors
    /// [`AnalysisError`] for too few subjects, a missing threshold or rating, ratings that cannot be normalised, or a statistic
    /// that cannot be computed.
    pub fn of(
        protocol: &Protocol,
        subjects: &[SubjectRecord],
        options: &AnalysisOptions,
    ) -> Result<Self, AnalysisError> {
        if subjects.len() < 2 {
            return Err(AnalysisError::TooFewSubjects { complete: subjects.len() });
        }
        Ok(match protocol {
            Protocol::Jnd(jnd) => Self::Jnd(Box::new(analyse_jnd(jnd, subjects, options)?)),
            Protocol::Magnitude(magnitude) => {
                Self::Magnitude(Box::new(analyse_magnitude(magnitude, subjects, options)?))
            }
        })
    }

    /// Returns each subject's response in each condition, from which the effects are computed.
    #[must_use]
    pub fn responses(&self) -> &[ResponseRow] {
        match self {
            Self::Jnd(analysis) => &analysis.responses,
            Self::Magnitude(analysis) => &analysis.responses,
        }
    }

    /// Formats the result as text, beside the thesis's results where they are comparable.
    #[must_use]
    pub fn to_text(&self) -> String {
        match self {
            Self::Jnd(analysis) => text::jnd(analysis),
            Self::Magnitude(analysis) => text::magnitude(analysis),
        }
    }
}

/// Returns a note if `effects` lack the effect of the order of modalities.
#[must_use]
pub fn order_note(effects: &[Effect]) -> Option<&'static str> {
    effects.iter().all(|effect| effect.effect != "order").then_some(
        "order is not in the model, because the factor needs three subjects or more, and subjects who start with each modality",
    )
}

/// Response of one subject in one condition: a row of the exported table.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ResponseRow {
    /// Label of the subject: `sub-01`.
    pub subject: String,
    /// First modality of the subject.
    pub first_modality: Modality,
    /// Modality of the condition.
    pub modality: Modality,
    /// Base or rated stimulus, in the unit of the stimulus.
    pub stimulus: f64,
    /// Threshold in the unit of the stimulus, or normalised rating.
    pub response: f64,
}

/// Converts `responses[subject][modality by level]` to rows of the exported table.
fn response_rows(subjects: &[SubjectRecord], levels: &[f64], responses: &[Vec<f64>]) -> Vec<ResponseRow> {
    let of = |(record, row): (&SubjectRecord, &Vec<f64>)| {
        let row = conditions(levels).zip(row).map(|((modality, stimulus), response)| ResponseRow {
            subject: record.subject.to_string(),
            first_modality: record.first_modality,
            modality,
            stimulus,
            response: *response,
        });
        row.collect::<Vec<_>>()
    };
    subjects.iter().zip(responses).flat_map(of).collect()
}

/// Returns the within-subject factors: modality and, if there are several levels, the level of the stimulus.
fn within_factors(name: &str, levels: &[f64]) -> Vec<WithinFactor> {
    let factor = |name: &str, levels| WithinFactor { name: name.to_owned(), levels };
    let by_level = (levels.len() > 1).then(|| factor(name, levels.len()));
    [factor("modality", Modality::ALL.len())].into_iter().chain(by_level).collect()
}

/// Returns all pairs of modality and level, in the order of the cells of a subject's row: level varies fastest.
fn conditions(levels: &[f64]) -> impl Iterator<Item = (Modality, f64)> {
    Modality::ALL.into_iter().flat_map(|modality| levels.iter().map(move |level| (modality, *level)))
}

fn column(rows: &[Vec<f64>], index: usize) -> Vec<f64> {
    rows.iter().filter_map(|row| row.get(index).copied()).collect()
}

/// Returns the mean of both modalities at each level.
fn means_of_both(vh: &[f64], h: &[f64]) -> Vec<f64> {
    vh.iter().zip(h).map(|(vh, h)| 0.5 * (vh + h)).collect()
}

/// Returns the mean over subjects with its confidence interval for each condition, from `responses[subject][modality by level]`.
fn mean_responses(
    levels: &[f64],
    responses: &[Vec<f64>],
) -> Result<Vec<(Modality, f64, MeanInterval)>, StatisticsError> {
    let cell = |(index, (modality, level)): (usize, (Modality, f64))| {
        Ok((modality, level, mean_interval(&column(responses, index), CONFIDENCE)?))
    };
    conditions(levels).enumerate().map(cell).collect()
}

/// Returns the between-subject factor of the first modality; empty if all subjects started with the same modality, or there are
/// fewer than three subjects.
fn order_factor(subjects: &[SubjectRecord]) -> Vec<BetweenFactor> {
    let groups: Vec<usize> = subjects.iter().map(|subject| subject.first_modality as usize).collect();
    let both = groups.contains(&0) && groups.contains(&1);
    let order = (both && subjects.len() > 2).then(|| BetweenFactor { name: "order".to_owned(), groups });
    order.into_iter().collect()
}
