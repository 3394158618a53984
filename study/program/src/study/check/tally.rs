//! Balance of a study over all its subjects.

use super::rows::BlockRow;
use flotor_study_design::answer::Position;
use flotor_study_design::course::Session;
use flotor_study_design::design::{Condition, Design};
use flotor_study_design::factor::Vary;
use serde::Serialize;
use std::collections::BTreeMap;

/// Balance of a study over all its subjects; each range is the smallest and the largest count.
#[derive(Serialize)]
pub(super) struct Balance {
    /// Smallest and largest number of times that a block condition is at a place of the order.
    pub(super) at_each_place: [usize; 2],
    /// Smallest and largest number of times that a block condition follows another one.
    pub(super) after_each_other: [usize; 2],
    /// Smallest and largest number of subjects for a combination of levels between subjects.
    pub(super) subjects_in_each_group: [usize; 2],
    /// Share of the pairs whose comparison is first; `None` without pairs.
    pub(super) comparison_first: Option<f64>,
}

/// Counts for the balance.
#[derive(Default)]
pub(super) struct Tally {
    places: BTreeMap<(usize, String), usize>,
    transitions: BTreeMap<(String, String), usize>,
    groups: BTreeMap<u16, String>,
    first: usize,
    pairs: usize,
}

impl Tally {
    pub(super) fn pair(&mut self, comparison_at: Option<Position>) {
        self.pairs += usize::from(comparison_at.is_some());
        self.first += usize::from(comparison_at == Some(Position::First));
    }

    pub(super) fn group(&mut self, session: Session, design: &Design, condition: &Condition) {
        let between = design.factors().iter().filter(|factor| factor.vary != Vary::Within);
        let levels: Vec<String> =
            between.filter_map(|factor| condition.get(&factor.name).map(ToString::to_string)).collect();
        self.groups.entry(session.subject.get()).or_insert_with(|| levels.join(" "));
    }

    pub(super) fn blocks(&mut self, blocks: &[BlockRow]) {
        for (place, block) in blocks.iter().enumerate() {
            *self.places.entry((place, block.condition.clone())).or_default() += 1;
        }
        for two in blocks.windows(2) {
            if let [before, after] = two {
                *self.transitions.entry((before.condition.clone(), after.condition.clone())).or_default() +=
                    1;
            }
        }
    }

    pub(super) fn balance(&self, design: &Design) -> Balance {
        let blocks = design.block_conditions().len();
        let places = blocks * self.places.keys().map(|(place, _)| place + 1).max().unwrap_or(0);
        let mut groups: BTreeMap<&String, usize> = BTreeMap::new();
        self.groups.values().for_each(|group| *groups.entry(group).or_default() += 1);
        Balance {
            at_each_place: range(self.places.values(), places),
            after_each_other: range(
                self.transitions
                    .iter()
                    .filter(|((before, after), _)| before != after)
                    .map(|(_, count)| count),
                blocks * blocks.saturating_sub(1),
            ),
            subjects_in_each_group: range(groups.values(), groups.len()),
            comparison_first: (self.pairs > 0).then(|| self.first as f64 / self.pairs as f64),
        }
    }
}

/// Returns the smallest and the largest of the counts of `cells` cells; a cell without a count has 0.
fn range<'a>(counts: impl Iterator<Item = &'a usize>, cells: usize) -> [usize; 2] {
    let counts: Vec<usize> = counts.copied().collect();
    let most = counts.iter().copied().max().unwrap_or(0);
    let least = if counts.len() < cells { 0 } else { counts.iter().copied().min().unwrap_or(0) };
    [least, most]
}
