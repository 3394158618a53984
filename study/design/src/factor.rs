//! Factors of a design, and the assignment of their levels to subjects.

use crate::random::{Purpose, Stream};
use crate::subject::SubjectNumber;
use crate::value::{Setting, Value};
use serde::{Deserialize, Serialize};

/// Factor of a design.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Factor {
    /// Name in tables, such as `delay`.
    pub name: String,
    /// Setting that takes the level; `None` if only the stimulus uses it, as its standard.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub setting: Option<Setting>,
    /// Levels.
    pub values: Vec<Value>,
    /// Assignment of the levels to subjects.
    #[serde(default)]
    pub vary: Vary,
}

/// Assignment of the levels of a factor to subjects.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Vary {
    /// Each subject has all levels.
    #[default]
    Within,
    /// Each subject has one level, in turn by subject number; several such factors are crossed.
    Between,
    /// Each subject has one level, drawn from the seed.
    BetweenRandom,
}

/// Combinations of levels, one index for each factor in the order of the factors; the last factor varies fastest. One empty
/// combination for no factors.
#[must_use]
pub fn combinations(counts: &[usize]) -> Vec<Vec<usize>> {
    counts.iter().fold(vec![Vec::new()], |all, count| {
        let extended = all.into_iter().flat_map(|start| {
            (0..*count).map(move |level| start.iter().copied().chain([level]).collect::<Vec<_>>())
        });
        extended.collect()
    })
}

/// Returns the level of each factor that varies between subjects, as an index; `None` for the other factors. Subjects whose
/// numbers differ by the number of combinations have the same levels.
#[must_use]
pub fn between_levels(factors: &[Factor], seed: u64, subject: SubjectNumber) -> Vec<Option<usize>> {
    let mut rest = usize::from(subject.get()) - 1;
    let level = |(index, factor): (usize, &Factor)| {
        let count = factor.values.len();
        match factor.vary {
            Vary::Within => None,
            Vary::Between => {
                let level = rest % count.max(1);
                rest /= count.max(1);
                Some(level)
            }
            Vary::BetweenRandom => {
                // A stream of its own for each factor, so that the draws are independent.
                let name = u32::try_from(index).unwrap_or(u32::MAX);
                Some(Stream::new(seed, Purpose::Assignment, subject.get(), name).below(count))
            }
        }
    };
    factors.iter().enumerate().map(level).collect()
}

/// Returns the number of groups of subjects that are filled in turn.
#[must_use]
pub fn groups(factors: &[Factor]) -> usize {
    let counts = factors.iter().filter(|factor| factor.vary == Vary::Between).map(|one| one.values.len());
    counts.product()
}
