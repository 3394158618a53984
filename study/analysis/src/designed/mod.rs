//! Analysis of a designed study: what each subject did in each condition, and the effects of the factors.
//!
//! - `record`: answers of a subject, over all sessions.
//! - `measure`: threshold, psychometric function, sensitivity or mean answer in a condition.
//! - `power`: effects found in simulated studies.
//! - `effects`: analysis of variance with factors between and within subjects, and tests by ranks.

mod effects;
mod measure;
mod power;
mod record;
mod script;
mod text;

pub use effects::{DesignEffects, LevelPair, RankEffect};
pub use measure::{CellMeasure, Detail, MeasureKind};
pub use power::{EffectPower, power_of, study_of};
pub use record::{Answered, DesignRecord};
pub use script::{Language, script};

use crate::CONFIDENCE;
use flotor_statistics::describe::{MeanInterval, mean_interval};
use flotor_statistics::{Outcome, StatisticsError};
use flotor_study_design::design::{Condition, Design};
use flotor_study_design::subject::SubjectNumber;
use serde::Serialize;

/// Result of one subject in one condition.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SubjectCell {
    /// Label of the subject: `sub-01`.
    pub subject: String,
    /// Levels of all factors.
    pub condition: Condition,
    /// Measure, or the reason for its absence.
    pub measure: Outcome<CellMeasure>,
}

/// Mean over subjects in one condition.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ConditionMean {
    /// Levels of all factors.
    pub condition: Condition,
    /// Mean with its interval of 95 %, or the reason for its absence.
    pub mean: Outcome<MeanInterval>,
}

/// Analysis of a designed study.
#[derive(Clone, Debug, Serialize)]
pub struct DesignAnalysis {
    /// Name of the study.
    pub task: String,
    /// Kind of the measure.
    pub measure: MeasureKind,
    /// Number of subjects.
    pub subjects: usize,
    /// Measures of each subject in each condition.
    pub cells: Vec<SubjectCell>,
    /// Means over subjects in each condition.
    pub means: Vec<ConditionMean>,
    /// Labels of subjects that lack a condition and are not part of the effects.
    pub omitted: Vec<String>,
    /// Effects of the factors.
    pub effects: DesignEffects,
}

impl DesignAnalysis {
    /// Analyses the records of a study: any number of subjects, complete or not.
    #[must_use]
    pub fn of(design: &Design, records: &[DesignRecord]) -> Self {
        let measure = MeasureKind::of(design);
        let mut cells = Vec::new();
        let mut rows: Vec<(SubjectNumber, Vec<Option<f64>>)> = Vec::new();
        for record in records {
            let mut row = Vec::new();
            for condition in record.conditions(design) {
                let found = measure.in_condition(record, &condition);
                row.push(found.as_ref().ok().map(|found| found.value));
                let subject = record.subject.to_string();
                cells.push(SubjectCell { subject, condition, measure: found.into() });
            }
            rows.push((record.subject, row));
        }
        let is_whole = |row: &[Option<f64>]| row.iter().all(Option::is_some);
        let omitted =
            rows.iter().filter(|(_, row)| !is_whole(row)).map(|(subject, _)| subject.to_string()).collect();
        let whole: Vec<(&DesignRecord, Vec<f64>)> = records
            .iter()
            .zip(&rows)
            .filter(|(_, (_, row))| is_whole(row))
            .map(|(record, (_, row))| (record, row.iter().copied().flatten().collect()))
            .collect();
        let means = means(&cells);
        let effects = DesignEffects::of(design, &whole);
        Self {
            task: design.study().to_owned(),
            measure,
            subjects: records.len(),
            cells,
            means,
            omitted,
            effects,
        }
    }

    /// Formats the result as text.
    #[must_use]
    pub fn to_text(&self) -> String {
        text::analysis(self)
    }
}

/// Returns the mean over subjects in each condition, in the order of the first occurrence.
fn means(cells: &[SubjectCell]) -> Vec<ConditionMean> {
    let mut conditions: Vec<&Condition> = Vec::new();
    for cell in cells {
        if !conditions.contains(&&cell.condition) {
            conditions.push(&cell.condition);
        }
    }
    let mean = |condition: &Condition| {
        let here = cells.iter().filter(|cell| cell.condition == *condition);
        let values: Vec<f64> = here.filter_map(|cell| Some(cell.measure.tested()?.value)).collect();
        let mean: Result<MeanInterval, StatisticsError> = mean_interval(&values, CONFIDENCE);
        ConditionMean { condition: condition.clone(), mean: mean.into() }
    };
    conditions.into_iter().map(mean).collect()
}
