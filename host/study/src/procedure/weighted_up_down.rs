//! The unforced weighted up-down rule (Kaernbach, Perception & Psychophysics 63:1377, 2001).
//!
//! A correct answer makes the difference smaller by a step D1, a wrong one larger by `D2 = D1 p / (1 - p)`, and "I
//! don't know" larger by `D3 = D1 (p - 1/m) / (1 - p)` (his equations 5 and 7), with p the share of correct answers
//! aimed at and m = 2 alternatives. Where the expected step is zero, `P(correct) + P(don't know) / m = p`.
//!
//! What CMU-RI-TR-07-21 (section 4.2) leaves open is an option here, and its default reproduces the published
//! distribution of simulated estimates.

use crate::trial::Judgement;
use serde::{Deserialize, Serialize};

/// Alternatives of a comparison: first or second.
const ALTERNATIVES: f64 = 2.0;

/// Which step size moves the difference at a reversal that halves it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum StepAtReversal {
    /// The halved one, at once
    #[default]
    New,
    /// The old one; the halved one from the next trial on
    Old,
}

/// Which differences the threshold is the mean of: whether the trials of the first and the last reversal that count do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Averaging {
    /// Both count
    #[default]
    BothEnds,
    /// The trial of the first does not
    AfterFirst,
    /// The trial of the last does not
    BeforeLast,
}

/// Settings of the rule.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WeightedUpDownRule {
    /// First difference.
    pub initial_delta: f64,
    /// First step D1 of a correct answer.
    pub first_step: f64,
    /// Share of correct answers aimed at.
    pub target: f64,
    /// The reversals at which the steps are halved.
    pub halve_at: Vec<u32>,
    /// The reversal after which the track is over.
    pub stop_after: u32,
    /// The reversal from which on differences count.
    pub average_from: u32,
    /// Whether the trials of the first and last of these reversals count.
    pub averaging: Averaging,
    /// Which step is applied at a halving reversal.
    pub step_at_reversal: StepAtReversal,
    /// The difference never becomes smaller than this.
    pub floor: f64,
    /// Nor larger than this.
    pub ceiling: f64,
    /// A track that takes longer is over without a threshold.
    pub trials_most: u32,
}

impl Default for WeightedUpDownRule {
    /// The settings of CMU-RI-TR-07-21, section 4.2.
    fn default() -> Self {
        Self {
            initial_delta: 0.40,
            first_step: 0.10,
            target: 0.75,
            halve_at: vec![2, 4],
            stop_after: 8,
            average_from: 4,
            averaging: Averaging::BothEnds,
            step_at_reversal: StepAtReversal::New,
            floor: 0.0,
            ceiling: 0.95,
            trials_most: 200,
        }
    }
}

/// A setting that cannot work.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{setting} {value}: {legal}")]
pub struct InvalidRule {
    /// Its option on the command line.
    pub setting: &'static str,
    /// Its value.
    pub value: String,
    /// What is legal.
    pub legal: String,
}

impl InvalidRule {
    /// A complaint about a setting.
    pub fn new(setting: &'static str, value: impl ToString, legal: impl Into<String>) -> Self {
        Self { setting, value: value.to_string(), legal: legal.into() }
    }
}

impl WeightedUpDownRule {
    /// Settings that cannot work.
    ///
    /// # Errors
    /// Names the first one.
    pub fn check(&self) -> Result<(), InvalidRule> {
        let share = |setting, value: f64, least: f64, most: f64, legal| {
            let inside = value > least && value < most;
            if inside { Ok(()) } else { Err(InvalidRule::new(setting, value, legal)) }
        };
        share("--step", self.first_step, 0.0, 1.0, "legal is above 0 and below 1")?;
        share("--target", self.target, 0.5, 1.0, "legal is above 0.5 (guessing) and below 1")?;
        share(
            "--ceiling",
            self.ceiling,
            0.0,
            1.0,
            "legal is above 0 and below 1 (a base minus all of it is nothing)",
        )?;
        if !(self.floor >= 0.0 && self.floor < self.ceiling) {
            return Err(InvalidRule::new("--floor", self.floor, "legal is 0 to below --ceiling"));
        }
        if !(self.initial_delta > self.floor && self.initial_delta <= self.ceiling) {
            let legal = "legal is above --floor and up to --ceiling";
            return Err(InvalidRule::new("--initial", self.initial_delta, legal));
        }
        if self.stop_after == 0 || self.average_from == 0 || self.average_from > self.stop_after {
            let legal = format!("legal is 1 to --stop-after ({})", self.stop_after);
            return Err(InvalidRule::new("--average-from", self.average_from, legal));
        }
        if self.trials_most < self.stop_after {
            let legal = format!("legal is 1 to {}, the most trials of a track", self.trials_most);
            return Err(InvalidRule::new("--stop-after", self.stop_after, legal));
        }
        Ok(())
    }

    /// D2 over D1: how much further a wrong answer moves than a correct one.
    #[must_use]
    pub fn wrong_ratio(&self) -> f64 {
        self.target / (1.0 - self.target)
    }

    /// D3 over D1: the same for "I don't know".
    #[must_use]
    pub fn unsure_ratio(&self) -> f64 {
        (self.target - 1.0 / ALTERNATIVES) / (1.0 - self.target)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Direction {
    Down,
    Up,
}

/// A track under way.
#[derive(Clone, Debug)]
pub struct WeightedUpDown {
    rule: WeightedUpDownRule,
    delta: f64,
    step: f64,
    direction: Option<Direction>,
    reversals: u32,
    trials: u32,
    counted_sum: f64,
    counted: u32,
}

impl WeightedUpDown {
    /// At the first difference.
    #[must_use]
    pub fn new(rule: &WeightedUpDownRule) -> Self {
        Self {
            delta: rule.initial_delta,
            step: rule.first_step,
            rule: rule.clone(),
            direction: None,
            reversals: 0,
            trials: 0,
            counted_sum: 0.0,
            counted: 0,
        }
    }

    /// The difference to present next.
    #[must_use]
    pub fn delta(&self) -> f64 {
        self.delta
    }

    /// The step D1 in force.
    #[must_use]
    pub fn step(&self) -> f64 {
        self.step
    }

    /// Reversals so far.
    #[must_use]
    pub fn reversals(&self) -> u32 {
        self.reversals
    }

    /// Trials so far.
    #[must_use]
    pub fn trials(&self) -> u32 {
        self.trials
    }

    /// Takes an answer in. Returns whether it turned the direction. After the end it changes nothing.
    pub fn answer(&mut self, judgement: Judgement) -> bool {
        if self.is_done() {
            return false;
        }
        self.trials += 1;
        let direction = if judgement == Judgement::Correct { Direction::Down } else { Direction::Up };
        let turned = self.direction.is_some_and(|before| before != direction);
        self.direction = Some(direction);
        let mut step = self.step;
        if turned {
            self.reversals += 1;
            if self.rule.halve_at.contains(&self.reversals) {
                self.step *= 0.5;
                if self.rule.step_at_reversal == StepAtReversal::New {
                    step = self.step;
                }
            }
        }
        if self.counts(turned) {
            self.counted_sum += self.delta;
            self.counted += 1;
        }
        let moved = match judgement {
            Judgement::Correct => -step,
            Judgement::Wrong => step * self.rule.wrong_ratio(),
            Judgement::Unsure => step * self.rule.unsure_ratio(),
        };
        self.delta = (self.delta + moved).clamp(self.rule.floor, self.rule.ceiling);
        turned
    }

    /// Whether the trial just answered counts for the threshold.
    fn counts(&self, turned: bool) -> bool {
        let WeightedUpDownRule { average_from, stop_after, averaging, .. } = self.rule;
        let first = turned && self.reversals == average_from;
        let last = self.reversals >= stop_after;
        self.reversals >= average_from
            && match averaging {
                Averaging::BothEnds => true,
                Averaging::AfterFirst => !first,
                Averaging::BeforeLast => !last,
            }
    }

    /// Whether it is over.
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.reversals >= self.rule.stop_after || self.trials >= self.rule.trials_most
    }

    /// Mean of the differences that count; none before the last reversal, nor if it never came.
    #[must_use]
    pub fn threshold(&self) -> Option<f64> {
        let complete = self.reversals >= self.rule.stop_after && self.counted > 0;
        complete.then(|| self.counted_sum / f64::from(self.counted))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Judgement::{Correct, Unsure, Wrong};

    /// D2/D1 and D3/D1 of Kaernbach's equations for two alternatives.
    #[test]
    fn step_ratios() {
        let table = [(2.0 / 3.0, 2.0, 0.5), (0.70, 7.0 / 3.0, 2.0 / 3.0), (0.75, 3.0, 1.0), (0.80, 4.0, 1.5)];
        for (target, wrong, unsure) in table {
            let rule = WeightedUpDownRule { target, ..WeightedUpDownRule::default() };
            assert!((rule.wrong_ratio() - wrong).abs() < 1.0e-12);
            assert!((rule.unsure_ratio() - unsure).abs() < 1.0e-12);
        }
    }

    /// A track by hand: every difference, reversal, halving and the mean.
    #[test]
    fn a_track_by_hand() {
        let mut track = WeightedUpDown::new(&WeightedUpDownRule::default());
        // Answer, difference it was given at (in percent), reversals after it.
        let script = [
            (Correct, 40.0, 0),
            (Correct, 30.0, 0),
            (Wrong, 20.0, 1),   // up by 30
            (Correct, 50.0, 2), // halved to 5, at once
            (Correct, 45.0, 2),
            (Unsure, 40.0, 3),  // up by 5
            (Correct, 45.0, 4), // halved to 2.5; counts from here
            (Correct, 42.5, 4),
            (Unsure, 40.0, 5),
            (Correct, 42.5, 6),
            (Wrong, 40.0, 7), // up by 7.5
            (Correct, 47.5, 8),
        ];
        for (index, (judgement, percent, reversals)) in script.into_iter().enumerate() {
            assert!((track.delta() * 100.0 - percent).abs() < 1.0e-9, "trial {index}: {}", track.delta());
            assert!(!track.is_done());
            let before = track.reversals();
            assert_eq!(track.answer(judgement), reversals > before, "trial {index}");
            assert_eq!(track.reversals(), reversals, "trial {index}");
        }
        assert!(track.is_done());
        let mean = (45.0 + 42.5 + 40.0 + 42.5 + 40.0 + 47.5) / 600.0;
        assert!((track.threshold().unwrap() - mean).abs() < 1.0e-12);
    }

    #[test]
    fn what_was_left_open_changes_what_it_says() {
        let threshold = |rule: WeightedUpDownRule| {
            let mut track = WeightedUpDown::new(&rule);
            for judgement in [Wrong, Correct, Wrong, Correct, Wrong, Correct, Wrong, Correct, Wrong] {
                track.answer(judgement);
            }
            track.threshold().unwrap()
        };
        let base = WeightedUpDownRule { initial_delta: 0.3, ..WeightedUpDownRule::default() };
        let with = |change: fn(&mut WeightedUpDownRule)| {
            let mut rule = base.clone();
            change(&mut rule);
            threshold(rule)
        };
        let default = threshold(base.clone());
        assert_ne!(default, with(|rule| rule.averaging = Averaging::AfterFirst));
        assert_ne!(default, with(|rule| rule.averaging = Averaging::BeforeLast));
        assert_ne!(default, with(|rule| rule.step_at_reversal = StepAtReversal::Old));
        assert_ne!(default, with(|rule| rule.ceiling = 0.5));
    }

    #[test]
    fn the_difference_stays_between_floor_and_ceiling_and_an_endless_track_ends() {
        let mut track = WeightedUpDown::new(&WeightedUpDownRule::default());
        while !track.is_done() {
            track.answer(Correct);
            assert!(track.delta() >= 0.0);
        }
        assert_eq!((track.trials(), track.threshold()), (200, None));
        let mut track = WeightedUpDown::new(&WeightedUpDownRule::default());
        (0..50).for_each(|_| {
            track.answer(Wrong);
        });
        assert_eq!(track.delta(), 0.95);
    }

    #[test]
    fn impossible_settings_are_refused() {
        let refused = |change: fn(&mut WeightedUpDownRule)| {
            let mut rule = WeightedUpDownRule::default();
            change(&mut rule);
            rule.check().unwrap_err().to_string()
        };
        assert_eq!(WeightedUpDownRule::default().check(), Ok(()));
        assert_eq!(
            refused(|rule| rule.target = 0.5),
            "--target 0.5: legal is above 0.5 (guessing) and below 1"
        );
        assert_eq!(refused(|rule| rule.first_step = f64::NAN), "--step NaN: legal is above 0 and below 1");
        assert_eq!(
            refused(|rule| rule.initial_delta = 0.0),
            "--initial 0: legal is above --floor and up to --ceiling"
        );
        assert_eq!(refused(|rule| rule.floor = -0.1), "--floor -0.1: legal is 0 to below --ceiling");
        assert_eq!(refused(|rule| rule.average_from = 9), "--average-from 9: legal is 1 to --stop-after (8)");
    }
}
