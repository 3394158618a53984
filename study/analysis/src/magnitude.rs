//! Analysis of ratings: normalisation, trend over the stimuli, effects of stimulus, modality and order.

use super::kinematics::{KinematicMeasure, measures};
use super::published::ThesisComparison;
use super::{
    AnalysisError, AnalysisOptions, PostHoc, ResponseRow, SubjectRecord, conditions, mean_responses,
    means_of_both, order_factor, post_hoc, response_rows, within_factors,
};
use flotor_statistics::Outcome;
use flotor_statistics::anova::{Design, Effect, analyse};
use flotor_statistics::describe::{MeanInterval, mean};
use flotor_statistics::trend::{self, LinearTrend};
use flotor_study::protocol::{MagnitudeProtocol, RatingScale};
use flotor_study::trial::{Modality, Presented, Response};
use serde::Serialize;

/// Mean rating of a stimulus: a point of figure 17 in CMU-RI-TR-07-21.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RatingCell {
    /// Modality of the condition.
    pub modality: Modality,
    /// Stimulus, in the unit of its parameter.
    pub stimulus: f64,
    /// Mean normalised rating over subjects.
    pub rating: MeanInterval,
}

/// Analysis of a magnitude experiment. The field names are a stable interface for scripts.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MagnitudeAnalysis {
    /// Task label: "magnitude".
    pub task: &'static str,
    /// Number of analysed sittings.
    pub subjects: usize,
    /// Normalisation of the ratings across subjects.
    pub rating_scale: RatingScale,
    /// R² of the linear trend of the mean ratings over the stimuli; NaN (`null` in JSON) without a trend.
    pub linear_r2: f64,
    /// Linear trend of the mean ratings, averaged over modalities.
    pub trend: Outcome<LinearTrend>,
    /// Effects of order, modality and stimulus, and their interactions, on normalised ratings.
    pub anova: Vec<Effect>,
    /// Ratings by condition.
    pub ratings: Vec<RatingCell>,
    /// Mean number of counted ratings per subject.
    pub trials_per_subject: f64,
    /// Number of presentations, over all subjects, repeated because the handle left its range.
    pub repeated: usize,
    /// Pairwise comparisons of the modalities at each stimulus.
    pub post_hoc: Vec<PostHoc>,
    /// Movement measures; empty if a subject has no movement data in a condition.
    pub kinematics: Vec<KinematicMeasure>,
    /// Comparability with the thesis.
    #[serde(skip)]
    pub thesis: ThesisComparison,
    /// Responses from which the effects are computed.
    #[serde(skip)]
    pub responses: Vec<ResponseRow>,
}

/// Analyses the ratings of a study.
///
/// # Errors
/// [`AnalysisError`] if ratings cannot be normalised as requested, a stimulus was never rated in a modality, or a statistic cannot
/// be computed, for instance with fewer than two subjects.
pub fn analyse_magnitude(
    protocol: &MagnitudeProtocol,
    subjects: &[SubjectRecord],
    options: &AnalysisOptions,
) -> Result<MagnitudeAnalysis, AnalysisError> {
    let rows = subjects.iter().map(|subject| scaled(protocol, subject, options.rating_scale));
    let rows = rows.collect::<Result<Vec<_>, _>>()?;
    let stimuli = &protocol.values;
    let design = Design::new(order_factor(subjects), within_factors("stimulus", stimuli), &rows)?;
    let both = |row: &Vec<f64>| {
        let (vh, h) = row.split_at(stimuli.len());
        means_of_both(vh, h)
    };
    let trend = Outcome::from(trend::linear(stimuli, &rows.iter().map(both).collect::<Vec<_>>()));
    let ratings = mean_responses(stimuli, &rows)?.into_iter();
    let counted: Vec<f64> = subjects.iter().map(|subject| subject.counted().count() as f64).collect();
    let repeats =
        |subject: &SubjectRecord| subject.trials.iter().filter(|event| event.trial.repeat > 0).count();
    Ok(MagnitudeAnalysis {
        task: "magnitude",
        subjects: subjects.len(),
        rating_scale: options.rating_scale,
        linear_r2: trend.tested().map_or(f64::NAN, |trend| trend.r_squared),
        trend,
        anova: analyse(&design, options.sums_of_squares),
        ratings: ratings
            .map(|(modality, stimulus, rating)| RatingCell { modality, stimulus, rating })
            .collect(),
        trials_per_subject: mean(&counted),
        repeated: subjects.iter().map(repeats).sum(),
        post_hoc: post_hoc::modalities("stimulus", stimuli, &rows),
        kinematics: measures(stimuli, subjects, options)?,
        thesis: ThesisComparison::magnitude(protocol),
        responses: response_rows(subjects, stimuli, &rows),
    })
}

/// Returns a subject's mean normalised ratings, modality by stimulus.
fn scaled(
    protocol: &MagnitudeProtocol,
    record: &SubjectRecord,
    scale: RatingScale,
) -> Result<Vec<f64>, AnalysisError> {
    let subject = record.subject;
    let refuse = |problem| Err(AnalysisError::Ratings { subject, problem });
    let rated = |event: &flotor_study::log::TrialEvent| match (event.trial.presented, event.response) {
        (Presented::One { value }, Response::Rating(rating)) => Some((event.trial.modality, value, rating)),
        _ => None,
    };
    let ratings: Vec<(Modality, f64, f64)> = record.counted().filter_map(rated).collect();
    let all: Vec<f64> = ratings.iter().map(|(_, _, rating)| *rating).collect();
    let unit = match scale {
        RatingScale::Raw => 1.0,
        RatingScale::DividedByMean => {
            let unit = mean(&all);
            if unit.is_nan() || unit <= 0.0 {
                return refuse(
                    "the mean of the ratings is not above 0, so the ratings cannot be divided by the mean; use --ratings raw",
                );
            }
            unit
        }
        RatingScale::DividedByGeometricMean => {
            if all.iter().any(|rating| *rating <= 0.0) {
                return refuse(
                    "a rating is not above 0, so there is no geometric mean; use --ratings mean or raw",
                );
            }
            libm::exp(mean(&all.iter().map(|rating| libm::log(*rating)).collect::<Vec<_>>()))
        }
    };
    let cell = |(modality, stimulus)| {
        let same = ratings.iter().filter(|(m, value, _)| *m == modality && *value == stimulus);
        let values: Vec<f64> = same.map(|(_, _, rating)| rating / unit).collect();
        (!values.is_empty()).then(|| mean(&values))
    };
    let cells: Option<Vec<f64>> = conditions(&protocol.values).map(cell).collect();
    cells.map_or_else(|| refuse("a stimulus was never rated; complete more sittings"), Ok)
}
