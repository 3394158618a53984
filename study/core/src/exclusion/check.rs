//! Validation of exclusion rules against an experiment.

use super::ExclusionRules;
use crate::protocol::Protocol;

impl ExclusionRules {
    /// Checks that the values are valid, and that the experiment has the trials that the rules need.
    ///
    /// # Errors
    /// The first invalid rule, as text.
    pub fn check(&self, protocol: &Protocol) -> Result<(), String> {
        let shares = [
            ("most_false_alarms", self.most_false_alarms),
            ("most_missed_obvious", self.most_missed_obvious),
            ("most_wrong_at_large", self.most_wrong_at_large),
            ("least_agreement", self.least_agreement),
            ("most_dont_know", self.most_dont_know),
            ("most_missed_ticks", self.most_missed_ticks),
            ("most_excluded_trials", self.most_excluded_trials),
        ];
        for (rule, share) in shares {
            if let Some(share) = share.filter(|share| !(0.0..=1.0).contains(share)) {
                return Err(format!("exclusion.{rule} is {share}; write a share from 0 to 1"));
            }
        }
        for (rule, value) in [
            ("most_retest_deviation", self.most_retest_deviation),
            ("least_movement_mm", self.least_movement_mm),
        ] {
            if let Some(value) = value.filter(|value| !(*value > 0.0 && value.is_finite())) {
                return Err(format!("exclusion.{rule} is {value}; write a finite number above 0"));
            }
        }
        // A log is JSON, which cannot represent infinity: an infinite longest time would make the log unreadable.
        let are_times =
            |[shortest, longest]: [f64; 2]| 0.0 <= shortest && shortest < longest && longest.is_finite();
        if let Some([shortest, longest]) = self.response_time_s.filter(|times| !are_times(*times)) {
            return Err(format!(
                "exclusion.response_time_s is [{shortest}, {longest}]; write the shortest and the longest time in s, both finite \
                 and 0 or more, the shorter one first"
            ));
        }
        let has_trial_rule = self.least_movement_mm.is_some() || self.response_time_s.is_some();
        if self.most_excluded_trials.is_some() && !has_trial_rule {
            return Err(
                "exclusion.most_excluded_trials needs response_time_s or least_movement_mm; write one of \
                 them"
                    .to_owned(),
            );
        }
        let (catch, has_obvious, repeats, is_jnd) = match protocol {
            Protocol::Jnd(jnd) => (jnd.checks.catch, jnd.checks.obvious.is_some(), jnd.checks.repeats, true),
            Protocol::Magnitude(magnitude) => (0, false, magnitude.repeat_checks, false),
        };
        const PAIRS: &str = "a difference experiment";
        const RATINGS: &str = "an experiment with ratings";
        for (rule, said, is_had, needs, of) in [
            ("most_false_alarms", self.most_false_alarms, catch > 0, "catch_trials of ", PAIRS),
            ("most_missed_obvious", self.most_missed_obvious, has_obvious, "obvious_pairs of ", PAIRS),
            ("most_wrong_at_large", self.most_wrong_at_large, is_jnd, "", PAIRS),
            ("least_agreement", self.least_agreement, is_jnd && repeats > 0, "repeat_checks of ", PAIRS),
            (
                "most_retest_deviation",
                self.most_retest_deviation,
                !is_jnd && repeats > 0,
                "repeat_checks of ",
                RATINGS,
            ),
            ("most_dont_know", self.most_dont_know, is_jnd, "", PAIRS),
        ] {
            if said.is_some() && !is_had {
                return Err(format!("exclusion.{rule} needs {needs}{of}; otherwise remove the rule"));
            }
        }
        Ok(())
    }
}
