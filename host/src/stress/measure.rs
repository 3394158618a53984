//! What a measure says: values, the bound it is judged by, a verdict, and where the worst was seen.

use flotor_hal::{Pose, math, rotation_vector};
use serde::Serialize;
use std::collections::BTreeMap;

/// Judgement of one measure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
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

    /// The graver of two.
    pub(super) fn and(self, other: Self) -> Self {
        if self.gravity() >= other.gravity() { self } else { other }
    }

    const fn gravity(self) -> u8 {
        match self {
            Verdict::Pass => 0,
            Verdict::Note => 1,
            Verdict::Fail => 2,
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
    /// What to know beside the number, in words.
    pub remark: String,
    /// Everything else that was measured.
    pub values: Vec<Quantity>,
}

impl Measure {
    /// Adds a further number.
    #[must_use]
    pub(super) fn with(mut self, name: impl Into<String>, value: f64, unit: &'static str) -> Self {
        self.values.push(Quantity { name: name.into(), value, unit });
        self
    }

    /// A measure that got no answer from the model has shown nothing: a note, whatever the number.
    #[must_use]
    pub(super) fn unless_unanswered(mut self, answered: u64) -> Self {
        if answered == 0 {
            self.value = f64::NAN;
            self.verdict = Verdict::Note;
            "the model gave no answer to judge".clone_into(&mut self.remark);
        }
        self
    }
}

/// The largest value so far, and the pose it was seen at. Of equals the first stays, so results do not depend
/// on how work was split.
#[derive(Clone, Copy, Debug)]
pub(super) struct Worst {
    pub(super) value: f64,
    pub(super) pose: Option<Pose>,
}

impl Worst {
    pub(super) const NONE: Self = Self { value: 0.0, pose: None };

    pub(super) fn offer(&mut self, value: f64, pose: Pose) {
        if value > self.value {
            *self = Self { value, pose: Some(pose) };
        }
    }

    pub(super) fn merge(&mut self, later: Self) {
        if later.value > self.value {
            *self = later;
        }
    }

    pub(super) fn record(&self) -> Option<PoseRecord> {
        self.pose.map(PoseRecord::from)
    }
}

/// How often a positive quantity fell into each twentieth of a decade.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Decades(BTreeMap<i32, u64>);

/// Bins per decade.
const BINS_PER_DECADE: f64 = 20.0;
/// What is smaller counts as this: below rounding of anything that is measured here.
const SMALLEST: f64 = 1.0e-18;

impl Decades {
    /// Counts one value.
    pub(super) fn count(&mut self, value: f64) {
        if value.is_nan() {
            return;
        }
        #[allow(clippy::cast_possible_truncation)] // a few thousand at most
        let bin = (math::log10(value.clamp(SMALLEST, f64::MAX)) * BINS_PER_DECADE).floor() as i32;
        *self.0.entry(bin).or_default() += 1;
    }

    pub(super) fn merge(&mut self, later: &Self) {
        for (bin, count) in &later.0 {
            *self.0.entry(*bin).or_default() += count;
        }
    }

    /// Lower edge, upper edge and count of every bin from the first to the last that counted something.
    #[must_use]
    pub fn bins(&self) -> Vec<(f64, f64, u64)> {
        let (Some((first, _)), Some((last, _))) = (self.0.first_key_value(), self.0.last_key_value()) else {
            return Vec::new();
        };
        let edge = |bin: i32| math::pow(10.0, f64::from(bin) / BINS_PER_DECADE);
        let bins = *first..=*last;
        bins.map(|bin| (edge(bin), edge(bin + 1), self.0.get(&bin).copied().unwrap_or(0))).collect()
    }
}

impl Serialize for Decades {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let filled = self.bins().into_iter().filter(|(.., count)| *count > 0);
        serializer.collect_seq(filled)
    }
}
