//! Result of a measure: values, bound, verdict, and the pose of the worst value.

use crate::tally::Worst;
use flotor_hal::{Pose, rotation_vector};
use serde::{Deserialize, Deserializer, Serialize};
use std::borrow::Cow;

/// Verdict of one measure, the most severe last.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Verdict {
    /// Within the bound.
    #[serde(rename = "pass")]
    Pass,
    /// Beyond the bound, but neither perceptible nor unsafe.
    #[serde(rename = "note")]
    Note,
    /// The sample has nothing to which the bound applies.
    #[serde(rename = "nothing to judge")]
    NothingToJudge,
    /// The uncertainty of the measurement exceeds the bound.
    #[serde(rename = "not resolved")]
    NotResolved,
    /// Beyond the acceptable limit, or not completed.
    #[serde(rename = "fail")]
    Fail,
}

impl Verdict {
    /// Returns the name in reports.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Verdict::Pass => "pass",
            Verdict::Note => "note",
            Verdict::NothingToJudge => "nothing to judge",
            Verdict::NotResolved => "not resolved",
            Verdict::Fail => "fail",
        }
    }

    /// Judges a value: pass up to `bound`, fail beyond `limit`, a note between; NaN fails.
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

/// Number with its name and unit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Quantity {
    /// Name of the quantity.
    pub name: String,
    /// Value; NaN if the quantity has no value.
    #[serde(deserialize_with = "number_or_none")]
    pub value: f64,
    /// Unit; empty for a pure number.
    pub unit: Cow<'static, str>,
}

/// Deserialises a number; JSON represents NaN and infinity as `null`.
fn number_or_none<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(from)?.unwrap_or(f64::NAN))
}

/// Pose in reports: model frame, rotation vector.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PoseRecord {
    /// Position, m.
    #[serde(deserialize_with = "numbers_or_none")]
    pub position_m: [f64; 3],
    /// Rotation vector, rad.
    #[serde(deserialize_with = "numbers_or_none")]
    pub rotation_rad: [f64; 3],
    /// Original quaternion if it does not describe a rotation, else `None`.
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
        // Written so that NaN counts as not a rotation.
        let is_rotation = norm_error.abs() < 1.0e-6;
        Self {
            position_m: pose.position_m,
            rotation_rad: rotation_vector(pose.orientation()).to_array(),
            orientation_xyzw: (!is_rotation).then_some(pose.orientation_xyzw),
        }
    }
}

/// Result of one measure: a row of the score.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[must_use]
pub struct Measure {
    /// Identifier, "M0" to "M11".
    pub id: Cow<'static, str>,
    /// Name of the measure.
    pub name: Cow<'static, str>,
    /// Judged value.
    #[serde(deserialize_with = "number_or_none")]
    pub value: f64,
    /// Unit of the value; empty for a pure number.
    pub unit: Cow<'static, str>,
    /// Largest value that passes; `None` for a measure that was not completed.
    pub bound: Option<f64>,
    /// Verdict on the value.
    pub verdict: Verdict,
    /// Pose of the worst value; `None` if the value belongs to no pose.
    pub pose: Option<PoseRecord>,
    /// Comment on value and verdict.
    #[serde(rename = "remark")]
    pub comment: String,
    /// Further measured values.
    pub values: Vec<Quantity>,
}

impl Measure {
    /// Judges the worst value: passes up to `bound`, fails beyond `limit`.
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
    pub(super) fn with(mut self, name: impl Into<String>, value: f64, unit: &'static str) -> Self {
        self.values.push(Quantity { name: name.into(), value, unit: Cow::Borrowed(unit) });
        self
    }

    /// Adds a count.
    pub(super) fn count(self, name: impl Into<String>, count: u64) -> Self {
        self.with(name, count as f64, "")
    }

    /// Creates a failed measure that was not completed.
    pub(super) fn broken([id, name]: [&'static str; 2], pose: Option<PoseRecord>, why: &str) -> Self {
        let nothing = Worst { value: f64::NAN, pose: None };
        Self { bound: None, pose, ..Self::of([id, name, ""], &nothing, [0.0, 0.0], why) }
    }

    /// Replaces value and verdict of a measure with an empty sample.
    pub(super) fn unless_empty(mut self, sample: u64, why: &str) -> Self {
        if sample == 0 {
            (self.value, self.verdict, self.pose) = (f64::NAN, Verdict::NothingToJudge, None);
            why.clone_into(&mut self.comment);
        }
        self
    }

    /// Replaces a pass by "not resolved" if the value may be as large as `possible`, beyond the bound.
    pub(super) fn unless_uncertain(mut self, possible: f64, why: impl FnOnce() -> String) -> Self {
        // Written so that NaN counts as beyond the bound.
        let is_within = self.bound.is_some_and(|bound| possible <= bound);
        if self.verdict == Verdict::Pass && !is_within {
            (self.verdict, self.comment) = (Verdict::NotResolved, why());
        }
        self
    }
}

/// Reason for an empty sample after every call failed.
pub(super) const NO_ANSWER: &str = "the model returned no result to judge";
