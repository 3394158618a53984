//! Analysis of movements: effects of stimulus and modality on mean speed, acceleration and force along the vertical.
//!
//! For pairs, only the movement with the base is analysed. An adaptive procedure presents larger comparisons where thresholds
//! are larger, and the same hand moves a larger stimulus differently: the comparisons would add an effect of the threshold to
//! each modality.

use super::{
    AnalysisError, AnalysisOptions, CONFIDENCE, SubjectRecord, conditions, means_of_both, within_factors,
};
use flotor_statistics::anova::{Design, Effect, analyse};
use flotor_statistics::describe::{MeanInterval, deviation, mean, mean_interval};
use flotor_study::kinematics::StimulusKinematics;
use flotor_study::log::TrialEvent;
use flotor_study::trial::{Position, Presented};
use serde::Serialize;

/// Name and accessor of a movement measure.
type Measure = (&'static str, fn(&StimulusKinematics) -> f64);

/// Movement measures of CMU-RI-TR-07-21, section 4.3.
const MEASURES: [Measure; 3] = [
    ("mean speed", |one| one.mean_speed_m_per_s),
    ("mean acceleration", |one| one.mean_acceleration_m_per_s2),
    ("mean force", |one| one.mean_force_n),
];

/// Analysis of one movement measure.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct KinematicMeasure {
    /// Name of the measure: "mean speed" (m/s), "mean acceleration" (m/s²) or "mean force" (N).
    pub measure: &'static str,
    /// Effects of modality, stimulus and their interaction.
    pub anova: Vec<Effect>,
    /// Mean over subjects and modalities at each level of the stimulus, in order.
    pub means: Vec<f64>,
    /// Standard error of each mean over subjects.
    pub standard_errors: Vec<f64>,
    /// Mean over subjects of the exponent of a power law in the stimulus: 1 for direct, -1 for inverse proportionality; `None`
    /// for a single level, or if a subject's mean is not above 0.
    pub exponent: Option<MeanInterval>,
}

/// Analyses movements over the levels of the stimulus (bases, or rated stimuli). Empty if a subject has no movement data in a
/// condition.
pub(super) fn measures(
    levels: &[f64],
    subjects: &[SubjectRecord],
    options: &AnalysisOptions,
) -> Result<Vec<KinematicMeasure>, AnalysisError> {
    let mut found = Vec::new();
    for (measure, value) in MEASURES {
        let rows: Option<Vec<Vec<f64>>> =
            subjects.iter().map(|subject| cells(levels, subject, value)).collect();
        let Some(rows) = rows else { return Ok(Vec::new()) };
        let design = Design::new(Vec::new(), within_factors("stimulus", levels), &rows)?;
        let anova = analyse(&design, options.sums_of_squares);
        let at = |level: usize| {
            let both = rows.iter().flat_map(|row| row.iter().skip(level).step_by(levels.len()));
            mean(&both.copied().collect::<Vec<_>>())
        };
        let means = (0..levels.len()).map(at).collect();
        let standard_errors =
            (0..levels.len()).map(|level| standard_error(&rows, level, levels.len())).collect();
        let exponents: Option<Vec<f64>> = rows.iter().map(|row| exponent(levels, row)).collect();
        let exponent = exponents.and_then(|exponents| mean_interval(&exponents, CONFIDENCE).ok());
        found.push(KinematicMeasure { measure, anova, means, standard_errors, exponent });
    }
    Ok(found)
}

/// Returns the standard error over subjects of the mean of both modalities at a level; NaN for one subject.
fn standard_error(rows: &[Vec<f64>], level: usize, levels: usize) -> f64 {
    let of_subject =
        |row: &Vec<f64>| mean(&row.iter().skip(level).step_by(levels).copied().collect::<Vec<_>>());
    let means: Vec<f64> = rows.iter().map(of_subject).collect();
    deviation(&means) / (means.len() as f64).sqrt()
}

/// Returns the exponent of a power law for one subject: the least-squares slope of the log measure, averaged over modalities,
/// over the log stimulus; `None` for a single level, or if a mean is not above 0.
fn exponent(levels: &[f64], row: &[f64]) -> Option<f64> {
    let (vh, h) = row.split_at_checked(levels.len())?;
    let x: Vec<f64> = levels.iter().map(|level| libm::log(*level)).collect();
    let y: Vec<f64> = means_of_both(vh, h).into_iter().map(libm::log).collect();
    let (mean_x, mean_y) = (mean(&x), mean(&y));
    let products = x.iter().zip(&y).map(|(x, y)| (x - mean_x) * (y - mean_y)).sum::<f64>();
    let squares = x.iter().map(|x| (x - mean_x) * (x - mean_x)).sum::<f64>();
    let slope = products / squares;
    slope.is_finite().then_some(slope)
}

/// Returns a measure's means for one subject, modality by level; `None` if a condition was never measured.
fn cells(levels: &[f64], record: &SubjectRecord, value: fn(&StimulusKinematics) -> f64) -> Option<Vec<f64>> {
    let cell = |(modality, level)| {
        let here = record.counted().filter(|event| event.trial.modality == modality);
        let felt = here.flat_map(|event| with_level(event, level));
        let values: Vec<f64> = felt.map(value).collect();
        (!values.is_empty()).then(|| mean(&values))
    };
    conditions(levels).map(cell).collect()
}

/// Returns the movements with the rated stimulus or the base of a pair, if it is `level`; repeated presentations within the
/// trial included.
fn with_level(event: &TrialEvent, level: f64) -> impl Iterator<Item = &StimulusKinematics> {
    let presented = event.trial.presented;
    let (place, stimuli) = match presented {
        Presented::One { .. } => (0, 1),
        Presented::Pair(pair) => (usize::from(pair.comparison_at == Position::First), 2),
    };
    let felt = event.exploration.kinematics.iter().skip(place).step_by(stimuli);
    felt.filter(move |_| presented.level() == level)
}
