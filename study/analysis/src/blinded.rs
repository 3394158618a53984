//! Results under codes: whether anything differs can be seen, but not what is which.

use super::{Analysis, ResponseRow};
use flotor_statistics::anova::Effect;
use flotor_statistics::describe::mean;
use flotor_study::blinding::Codes;
use serde::Serialize;

/// A response under a coded condition: a row of the table for other programs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BlindedRow {
    /// Who: `sub-01`.
    pub subject: String,
    /// Code of the modality they started with.
    pub first_modality: &'static str,
    /// Code of the modality.
    pub modality: &'static str,
    /// Code of the base, or of the stimulus rated.
    pub level: usize,
    /// Threshold as a share of the base, or scaled rating.
    pub response: f64,
}

/// The mean under one coded condition.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BlindedCell {
    /// Modality and level: `A2`.
    pub condition: String,
    /// Mean over subjects: of thresholds as shares of the base, or of scaled ratings.
    pub mean: f64,
}

/// An analysis under codes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BlindedAnalysis {
    /// "jnd" or "magnitude".
    pub task: &'static str,
    /// Sittings analysed.
    pub subjects: usize,
    /// Effects; their names tell what was varied, not which way it went.
    pub anova: Vec<Effect>,
    /// Means by condition, in the order of the codes.
    pub cells: Vec<BlindedCell>,
    /// What they are computed from.
    #[serde(skip)]
    pub responses: Vec<BlindedRow>,
}

impl BlindedAnalysis {
    /// Puts codes over a result.
    #[must_use]
    pub fn of(analysis: &Analysis, codes: &Codes) -> Self {
        let (task, subjects, anova) = match analysis {
            Analysis::Jnd(jnd) => (jnd.task, jnd.subjects, jnd.anova.clone()),
            Analysis::Magnitude(magnitude) => (magnitude.task, magnitude.subjects, magnitude.anova.clone()),
        };
        // A threshold in the unit of the stimulus would give its base away.
        let unit = |row: &ResponseRow| if task == "jnd" { row.stimulus } else { 1.0 };
        let blinded = |row: &ResponseRow| BlindedRow {
            subject: row.subject.clone(),
            first_modality: codes.modality(row.first_modality),
            modality: codes.modality(row.modality),
            level: codes.level(row.stimulus),
            response: row.response / unit(row),
        };
        let mut responses: Vec<BlindedRow> = analysis.responses().iter().map(blinded).collect();
        responses.sort_by(|a, b| (&a.subject, a.modality, a.level).cmp(&(&b.subject, b.modality, b.level)));
        let mut conditions: Vec<(&'static str, usize)> =
            responses.iter().map(|row| (row.modality, row.level)).collect();
        conditions.sort_unstable();
        conditions.dedup();
        let cell = |(modality, level): &(&'static str, usize)| {
            let here = responses.iter().filter(|row| row.modality == *modality && row.level == *level);
            let values: Vec<f64> = here.map(|row| row.response).collect();
            BlindedCell { condition: format!("{modality}{level}"), mean: mean(&values) }
        };
        let cells = conditions.iter().map(cell).collect();
        Self { task, subjects, anova, cells, responses }
    }

    /// The page for people.
    #[must_use]
    pub fn to_text(&self) -> String {
        super::text::blinded(self)
    }
}
