//! Blinded results: codes replace the conditions, so that differences are visible but not their direction.

use super::{Analysis, ResponseRow};
use flotor_statistics::anova::Effect;
use flotor_statistics::describe::mean;
use flotor_study::blinding::Codes;
use serde::Serialize;

/// Response in a coded condition: a row of the exported table.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BlindedRow {
    /// Label of the subject: `sub-01`.
    pub subject: String,
    /// Code of the subject's first modality.
    pub first_modality: &'static str,
    /// Code of the modality.
    pub modality: &'static str,
    /// Code of the base or rated stimulus.
    pub level: usize,
    /// Threshold as a fraction of the base, or normalised rating.
    pub response: f64,
}

/// Mean response in one coded condition.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BlindedCell {
    /// Code of modality and level: `A2`.
    pub condition: String,
    /// Mean over subjects of the thresholds as fractions of the base, or of the normalised ratings.
    pub mean: f64,
}

/// Analysis with coded conditions.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BlindedAnalysis {
    /// Task label: "jnd" or "magnitude".
    pub task: &'static str,
    /// Number of analysed sittings.
    pub subjects: usize,
    /// Effects of the analysis of variance; their names show the factors, not the direction.
    pub anova: Vec<Effect>,
    /// Means by condition, in the order of the codes.
    pub cells: Vec<BlindedCell>,
    /// Responses from which the effects are computed.
    #[serde(skip)]
    pub responses: Vec<BlindedRow>,
}

impl BlindedAnalysis {
    /// Replaces the conditions of a result with codes, divides thresholds by their base, and averages the responses in each
    /// condition.
    #[must_use]
    pub fn of(analysis: &Analysis, codes: &Codes) -> Self {
        let (task, subjects, anova) = match analysis {
            Analysis::Jnd(jnd) => (jnd.task, jnd.subjects, jnd.anova.clone()),
            Analysis::Magnitude(magnitude) => (magnitude.task, magnitude.subjects, magnitude.anova.clone()),
        };
        // A threshold in the unit of the stimulus would reveal its base.
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

    /// Formats the analysis as a text page.
    #[must_use]
    pub fn to_text(&self) -> String {
        super::text::blinded(self)
    }
}
