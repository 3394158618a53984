//! Orders of conditions, counterbalanced over subjects.

use crate::random::{Purpose, Stream};
use serde::{Deserialize, Serialize};

/// Order of the blocks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Order {
    /// Order of the file, for all subjects.
    Fixed,
    /// Rows of a cyclic Latin square: after n subjects each condition was at each place once.
    #[default]
    Latin,
    /// Rows of a cyclic Latin square, the same row in each repetition: blocks alternate.
    Alternate,
    /// Rows of a Williams square (Williams, Aust. J. Sci. Res. A 2:149, 1949): a Latin square in which each condition also follows each
    /// other one equally often; n rows for an even number of conditions, 2n for an odd one.
    Williams,
    /// All permutations, in turn.
    Balanced,
    /// Drawn from the seed for each subject.
    Random,
}

impl Order {
    /// Largest number of conditions for [`Order::Balanced`]; 5! = 120 orders.
    pub const MOST_PERMUTED: usize = 5;

    /// Returns the number of rows after which the orders are balanced; `None` for orders that are not balanced over rows.
    #[must_use]
    pub fn rows(self, count: usize) -> Option<usize> {
        match self {
            Self::Fixed | Self::Random => None,
            Self::Latin | Self::Alternate => Some(count),
            Self::Williams if count.is_multiple_of(2) => Some(count),
            Self::Williams => Some(2 * count),
            Self::Balanced => Some((1..=count).product()),
        }
    }

    /// Returns a row: a permutation of the indices of `count` conditions. Conditions have random places in the first row, drawn once
    /// for a study; `draw` names the stream of a row that is drawn.
    #[must_use]
    pub fn row(self, count: usize, row: usize, seed: u64, draw: (u16, u32)) -> Vec<usize> {
        let mut labels: Vec<usize> = (0..count).collect();
        match self {
            Self::Fixed => return labels,
            Self::Random => {
                Stream::new(seed, Purpose::Schedule, draw.0, draw.1).shuffle(&mut labels);
                return labels;
            }
            Self::Latin | Self::Alternate | Self::Williams | Self::Balanced => {
                // Subject 0 does not exist: the stream is that of the study.
                Stream::new(seed, Purpose::Schedule, 0, 0).shuffle(&mut labels);
            }
        }
        let row = row % self.rows(count).unwrap_or(1).max(1);
        let places: Vec<usize> = match self {
            Self::Williams => williams(count, row),
            Self::Balanced => permutation(count, row),
            _ => (0..count).map(|place| (row + place) % count).collect(),
        };
        places.into_iter().filter_map(|place| labels.get(place).copied()).collect()
    }
}

/// Returns a row of a Williams square: the zigzag 0, n - 1, 1, n - 2, ... shifted by the row; from row n on mirrored.
fn williams(count: usize, row: usize) -> Vec<usize> {
    let zigzag = |place: usize| if place.is_multiple_of(2) { place / 2 } else { count - place.div_ceil(2) };
    let mut order: Vec<usize> = (0..count).map(|place| (zigzag(place) + row) % count).collect();
    if row >= count {
        order.reverse();
    }
    order
}

/// Returns the permutation with a number in lexicographic order.
fn permutation(count: usize, number: usize) -> Vec<usize> {
    let mut left: Vec<usize> = (0..count).collect();
    let mut rest = number;
    let pick = |remaining: usize| {
        let of_each: usize = (1..remaining).product();
        let index = (rest / of_each).min(left.len().saturating_sub(1));
        rest %= of_each;
        left.remove(index)
    };
    (1..=count).rev().map(pick).collect()
}
