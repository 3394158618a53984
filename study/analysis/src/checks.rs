//! Results of the check trials of a subject: catch trials, obvious pairs and repeated trials.

use super::SubjectRecord;
use flotor_statistics::describe::mean;
use flotor_study::log::TrialEvent;
use flotor_study::sitting::Verdict;
use flotor_study::trial::{Phase, Presented, Response};
use serde::Serialize;

/// Results of one subject's check trials.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SubjectChecks {
    /// Label of the subject: `sub-01`.
    pub subject: String,
    /// Number of catch trials: pairs of equal stimuli.
    pub catch_trials: usize,
    /// Number of catch trials in which a stimulus was named.
    pub false_alarms: usize,
    /// Number of pairs with an obvious difference.
    pub obvious_pairs: usize,
    /// Number of obvious pairs answered with the smaller stimulus or "I don't know".
    pub missed_obvious: usize,
    /// Number of trials that were presented again to check the answer, and have an earlier answer.
    pub repeat_checks: usize,
    /// Fraction of repeated pairs with the same answer as before; `None` without repeated pairs.
    pub agreement: Option<f64>,
    /// Standard deviation of a single rating, from the differences of repeated ratings (Dahlberg's formula), as a fraction of
    /// the subject's mean rating; `None` without repeated ratings.
    pub retest_deviation: Option<f64>,
}

impl SubjectChecks {
    /// Evaluates the checks in a subject's data so far.
    #[must_use]
    pub fn of(record: &SubjectRecord) -> Self {
        let of_phase = |phase| {
            let here = record.trials.iter().enumerate();
            here.filter(move |(_, event)| event.trial.phase == phase && event.verdict != Verdict::Repeated)
        };
        let catch: Vec<_> = of_phase(Phase::Catch).collect();
        let obvious: Vec<_> = of_phase(Phase::Obvious).collect();
        let twice: Vec<(Response, Response)> = of_phase(Phase::RepeatCheck)
            .filter_map(|(place, event)| Some((first_time(record, place, event)?, event.response)))
            .collect();
        let squares = twice.iter().filter_map(|pair| match pair {
            (Response::Rating(first), Response::Rating(second)) => Some((first - second) * (first - second)),
            _ => None,
        });
        let squares: Vec<f64> = squares.collect();
        let ratings: Vec<f64> = record.counted().filter_map(|event| event.response.rating()).collect();
        let is_pair = squares.is_empty() && !twice.is_empty();
        let same = twice.iter().filter(|(first, second)| first == second).count() as f64;
        Self {
            subject: record.subject.to_string(),
            catch_trials: catch.len(),
            false_alarms: catch.iter().filter(|(_, event)| event.response.named().is_some()).count(),
            obvious_pairs: obvious.len(),
            missed_obvious: obvious.iter().filter(|(_, event)| !names_the_larger(event)).count(),
            repeat_checks: twice.len(),
            agreement: is_pair.then(|| same / twice.len() as f64),
            retest_deviation: (!squares.is_empty()).then(|| (0.5 * mean(&squares)).sqrt() / mean(&ratings)),
        }
    }

    /// Returns the fraction of catch trials with a false alarm; `None` without catch trials.
    #[must_use]
    pub fn false_alarm_share(&self) -> Option<f64> {
        (self.catch_trials > 0).then(|| self.false_alarms as f64 / self.catch_trials as f64)
    }

    /// Returns the fraction of obvious pairs missed; `None` without obvious pairs.
    #[must_use]
    pub fn missed_obvious_share(&self) -> Option<f64> {
        (self.obvious_pairs > 0).then(|| self.missed_obvious as f64 / self.obvious_pairs as f64)
    }

    /// Formats the results as one line; empty without checks.
    #[must_use]
    pub fn to_text(&self) -> String {
        let catch = (self.catch_trials > 0).then(|| {
            let (alarms, trials) = (self.false_alarms, self.catch_trials);
            format!("{alarms} of {trials} catch trials named one of two equal stimuli")
        });
        let obvious = (self.obvious_pairs > 0).then(|| {
            let (missed, pairs) = (self.missed_obvious, self.obvious_pairs);
            format!("{missed} of {pairs} obvious pairs missed")
        });
        let agreement = self.agreement.map(|share| {
            let trials = self.repeat_checks;
            format!("{:.0} % of {trials} repeated pairs with the same answer", share * 100.0)
        });
        let deviation = self.retest_deviation.map(|share| {
            let trials = self.repeat_checks;
            format!("{trials} repeated ratings: deviation {:.1} % of the mean rating", share * 100.0)
        });
        [catch, obvious, agreement, deviation].into_iter().flatten().collect::<Vec<_>>().join("; ")
    }
}

fn names_the_larger(event: &TrialEvent) -> bool {
    let named = event.response.named();
    matches!(event.trial.presented, Presented::Pair(pair) if Some(pair.larger_at) == named)
}

/// Returns the earlier answer to a repeated trial: the last counted answer to the same stimuli in the same track, replication
/// and modality.
fn first_time(record: &SubjectRecord, place: usize, check: &TrialEvent) -> Option<Response> {
    let same = |event: &&TrialEvent| {
        let (one, other) = (&event.trial, &check.trial);
        one.phase == Phase::Main
            && event.verdict != Verdict::Repeated
            && (one.track, one.replication, one.modality) == (other.track, other.replication, other.modality)
            && one.presented == other.presented
    };
    record.trials.iter().take(place).rev().find(same).map(|event| event.response)
}
