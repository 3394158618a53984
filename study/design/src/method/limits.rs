//! Series of the method of limits (Fechner 1860): the levels in order, up to the change of the answer.

use super::outcome::Outcome;

/// Direction of a series.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// From the lowest level up, to the first positive outcome.
    Ascending,
    /// From the highest level down, to the first outcome that is not positive.
    Descending,
}

impl Direction {
    /// Returns the direction of a series, counted from 0: they alternate, so that errors of habituation and of expectation cancel.
    #[must_use]
    pub fn of_series(index: u32) -> Self {
        if index.is_multiple_of(2) { Self::Ascending } else { Self::Descending }
    }
}

/// Series in progress.
#[derive(Clone, Debug)]
pub struct Limits {
    /// Levels in the order of presentation; never empty.
    levels: Vec<f64>,
    direction: Direction,
    presented: usize,
    change: Option<f64>,
}

impl Limits {
    /// Starts a series over ascending levels.
    #[must_use]
    pub fn new(ascending: &[f64], direction: Direction) -> Self {
        let mut levels = ascending.to_vec();
        if direction == Direction::Descending {
            levels.reverse();
        }
        Self { levels, direction, presented: 0, change: None }
    }

    /// Returns the level to present next; the last level after the end.
    #[must_use]
    pub fn level(&self) -> f64 {
        self.levels.get(self.presented).or(self.levels.last()).copied().unwrap_or(0.0)
    }

    /// Processes an outcome; ignored after the end of the series.
    pub fn answer(&mut self, outcome: Outcome) {
        if self.is_done() {
            return;
        }
        let is_positive = outcome == Outcome::Positive;
        let level = self.level();
        if is_positive == (self.direction == Direction::Ascending) {
            // A change at the first level lies outside the series.
            let before = self.presented.checked_sub(1).and_then(|index| self.levels.get(index));
            self.change = before.map(|before| 0.5 * (before + level));
            self.presented = self.levels.len();
        } else {
            self.presented += 1;
        }
    }

    /// Returns true if the series is over.
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.presented >= self.levels.len()
    }

    /// Returns the middle of the two levels between which the answer changed; `None` if it changed outside the series.
    #[must_use]
    pub fn threshold(&self) -> Option<f64> {
        self.change
    }
}
