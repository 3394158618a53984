//! How people moved: mean speed, acceleration and force along the vertical, over stimulus and modality.

use super::{AnalysisError, AnalysisOptions, SubjectRecord, conditions, within_factors};
use flotor_statistics::anova::{Design, Effect, analyse};
use flotor_statistics::describe::mean;
use flotor_study::kinematics::StimulusKinematics;
use flotor_study::log::TrialEvent;
use flotor_study::trial::Presented;
use serde::Serialize;

/// A measure of movement: its name, and the number it is.
type Measure = (&'static str, fn(&StimulusKinematics) -> f64);

/// The measures of CMU-RI-TR-07-21, section 4.3.
const MEASURES: [Measure; 3] = [
    ("mean speed", |one| one.mean_speed_m_per_s),
    ("mean acceleration", |one| one.mean_acceleration_m_per_s2),
    ("mean force", |one| one.mean_force_n),
];

/// One measure: means and effects.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct KinematicMeasure {
    /// What was measured, in SI units.
    pub measure: &'static str,
    /// Modality x stimulus.
    pub anova: Vec<Effect>,
    /// Mean over subjects and modalities at each level of the stimulus, in order.
    pub means: Vec<f64>,
}

/// Analyses movements over the levels of the stimulus (bases, or stimuli rated). Nothing where some were not measured.
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
        found.push(KinematicMeasure { measure, anova, means: (0..levels.len()).map(at).collect() });
    }
    Ok(found)
}

/// Means of one subject, modality by level; none if one of them was never measured.
fn cells(levels: &[f64], record: &SubjectRecord, value: fn(&StimulusKinematics) -> f64) -> Option<Vec<f64>> {
    let level_of = |event: &TrialEvent| match event.trial.presented {
        Presented::One { value } => value,
        Presented::Pair(pair) => pair.base,
    };
    let cell = |(modality, level)| {
        let is_here = |event: &&TrialEvent| event.trial.modality == modality && level_of(event) == level;
        let felt = record.counted().filter(is_here).flat_map(|event| &event.exploration.kinematics);
        let values: Vec<f64> = felt.map(value).collect();
        (!values.is_empty()).then(|| mean(&values))
    };
    conditions(levels).map(cell).collect()
}
