//! What a measure says: values, the bound it is judged by, a verdict, and where the worst was seen.

use crate::tally::Worst;
use flotor_hal::{Pose, rotation_vector};
use serde::Serialize;

/// Judgement of one measure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// Within the bound.
    Pass,
    /// Beyond the bound, short of what is felt or unsafe; or there is no bound to judge by.
    Note,
    /// Beyond what is acceptable.
    Fail,
}

impl Verdict {
    /// The word of reports.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Verdict::Pass => "pass",
            Verdict::Note => "note",
            Verdict::Fail => "fail",
        }
    }

    /// Pass up to `bound`, fail beyond `limit`, a note between; NaN fails.
    pub(super) fn of(value: f64, bound: f64, limit: f64) -> Self {
        if value <= bound {
            Verdict::Pass
        } else if value <= limit {
            Verdict::Note
        } else {
            Verdict::Fail
        }
    }
}

/// A number with its name and unit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Quantity {
    /// What it is.
    pub name: String,
    /// The number; not a number where there is none.
    pub value: f64,
    /// Its unit; empty for a pure number.
    pub unit: &'static str,
}

/// A pose for people and machines: model frame, rotation vector.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PoseRecord {
    /// Position, m.
    pub position_m: [f64; 3],
    /// Rotation vector, rad.
    pub rotation_rad: [f64; 3],
}

impl From<Pose> for PoseRecord {
    fn from(pose: Pose) -> Self {
        Self { position_m: pose.position_m, rotation_rad: rotation_vector(pose.orientation()).to_array() }
    }
}

/// One line of the score.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Measure {
    /// "M0" to "M8".
    pub id: &'static str,
    /// What is measured.
    pub name: &'static str,
    /// The number that is judged.
    pub value: f64,
    /// Its unit; empty for a pure number.
    pub unit: &'static str,
    /// The largest value that passes; absent where the literature gives none.
    pub bound: Option<f64>,
    /// The judgement.
    pub verdict: Verdict,
    /// Where the worst was seen.
    pub pose: Option<PoseRecord>,
    /// Comment on the number.
    #[serde(rename = "remark")]
    pub comment: String,
    /// Everything else that was measured.
    pub values: Vec<Quantity>,
}

impl Measure {
    /// The worst that was seen: it passes up to `bound` and fails beyond `limit`.
    pub(super) fn of(
        [id, name, unit]: [&'static str; 3],
        worst: &Worst,
        [bound, limit]: [f64; 2],
        comment: impl Into<String>,
    ) -> Self {
        let (value, verdict) = (worst.value, Verdict::of(worst.value, bound, limit));
        let (pose, comment) = (worst.pose.map(PoseRecord::from), comment.into());
        Self { id, name, value, unit, bound: Some(bound), verdict, pose, comment, values: Vec::new() }
    }

    /// Adds a further number.
    #[must_use]
    pub(super) fn with(mut self, name: impl Into<String>, value: f64, unit: &'static str) -> Self {
        self.values.push(Quantity { name: name.into(), value, unit });
        self
    }

    /// Adds a count.
    #[must_use]
    pub(super) fn count(self, name: impl Into<String>, count: u64) -> Self {
        self.with(name, count as f64, "")
    }

    /// A measure that got no answer from the model has shown nothing: a note, whatever the number.
    #[must_use]
    pub(super) fn unless_unanswered(mut self, answered: u64) -> Self {
        if answered == 0 {
            self.value = f64::NAN;
            self.verdict = Verdict::Note;
            "the model gave no answer to judge".clone_into(&mut self.comment);
        }
        self
    }
}
