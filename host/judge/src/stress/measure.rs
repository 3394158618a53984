//! What a measure says: values, the bound it is judged by, a verdict, and where the worst was seen.

use crate::tally::Worst;
use flotor_hal::{Pose, rotation_vector};
use serde::{Deserialize, Deserializer, Serialize};
use std::borrow::Cow;

/// Judgement of one measure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
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
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Quantity {
    /// What it is.
    pub name: String,
    /// The number; not a number where there is none.
    #[serde(deserialize_with = "number_or_none")]
    pub value: f64,
    /// Its unit; empty for a pure number.
    pub unit: Cow<'static, str>,
}

/// JSON has no word for what is no number: `null` stands for it.
fn number_or_none<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(from)?.unwrap_or(f64::NAN))
}

/// A pose for people and machines: model frame, rotation vector.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PoseRecord {
    /// Position, m.
    #[serde(deserialize_with = "numbers_or_none")]
    pub position_m: [f64; 3],
    /// Rotation vector, rad.
    #[serde(deserialize_with = "numbers_or_none")]
    pub rotation_rad: [f64; 3],
    /// The quaternion as it was given, where it is no rotation.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "quaternion_or_none")]
    pub orientation_xyzw: Option<[f64; 4]>,
}

fn numbers_or_none<'de, D: Deserializer<'de>, const N: usize>(from: D) -> Result<[f64; N], D::Error>
where
    [Option<f64>; N]: Deserialize<'de>,
{
    Ok(<[Option<f64>; N]>::deserialize(from)?.map(|number| number.unwrap_or(f64::NAN)))
}

fn quaternion_or_none<'de, D: Deserializer<'de>>(from: D) -> Result<Option<[f64; 4]>, D::Error> {
    let numbers = Option::<[Option<f64>; 4]>::deserialize(from)?;
    Ok(numbers.map(|numbers| numbers.map(|number| number.unwrap_or(f64::NAN))))
}

impl From<Pose> for PoseRecord {
    fn from(pose: Pose) -> Self {
        let norm_error = pose.orientation().length_squared() - 1.0;
        // Written so that NaN is no rotation either.
        let is_rotation = norm_error.abs() < 1.0e-6;
        Self {
            position_m: pose.position_m,
            rotation_rad: rotation_vector(pose.orientation()).to_array(),
            orientation_xyzw: (!is_rotation).then_some(pose.orientation_xyzw),
        }
    }
}

/// One line of the score.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Measure {
    /// "M0" to "M10".
    pub id: Cow<'static, str>,
    /// What is measured.
    pub name: Cow<'static, str>,
    /// The number that is judged.
    #[serde(deserialize_with = "number_or_none")]
    pub value: f64,
    /// Its unit; empty for a pure number.
    pub unit: Cow<'static, str>,
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
        let [id, name, unit] = [id, name, unit].map(Cow::Borrowed);
        Self { id, name, value, unit, bound: Some(bound), verdict, pose, comment, values: Vec::new() }
    }

    /// Adds a further number.
    #[must_use]
    pub(super) fn with(mut self, name: impl Into<String>, value: f64, unit: &'static str) -> Self {
        self.values.push(Quantity { name: name.into(), value, unit: Cow::Borrowed(unit) });
        self
    }

    /// Adds a count.
    #[must_use]
    pub(super) fn count(self, name: impl Into<String>, count: u64) -> Self {
        self.with(name, count as f64, "")
    }

    /// A measure that did not come to its end.
    pub(super) fn broken([id, name]: [&'static str; 2], pose: Option<PoseRecord>, why: &str) -> Self {
        let nothing = Worst { value: f64::NAN, pose: None };
        Self { bound: None, pose, ..Self::of([id, name, ""], &nothing, [0.0, 0.0], why) }
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
