//! How a subject did in the trials that check them: catch trials and trials presented once more.

use super::SubjectRecord;
use flotor_statistics::describe::mean;
use flotor_study::log::TrialEvent;
use flotor_study::sitting::Verdict;
use flotor_study::trial::{Phase, Position, Presented, Response};
use serde::Serialize;

/// What came of the checks of one subject.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SubjectChecks {
    /// Who: `sub-01`.
    pub subject: String,
    /// Catch trials: pairs without any difference.
    pub catch_trials: usize,
    /// Of those, answers that named one of the two.
    pub false_alarms: usize,
    /// Pairs with an obvious difference.
    pub obvious_pairs: usize,
    /// Of those, answers that did not name the larger one.
    pub missed_obvious: usize,
    /// Trials presented once more.
    pub repeat_checks: usize,
    /// Share of them with the same answer as the first time; none for ratings.
    pub agreement: Option<f64>,
    /// Deviation of a single rating between the two times, as a share of the subject's mean rating; none for pairs.
    pub retest_deviation: Option<f64>,
}

impl SubjectChecks {
    /// Of a subject's data so far.
    #[must_use]
    pub fn of(record: &SubjectRecord) -> Self {
        let of_phase = |phase| {
            let here = record.trials.iter().enumerate();
            here.filter(move |(_, event)| event.trial.phase == phase && event.verdict != Verdict::Repeated)
        };
        let catch: Vec<_> = of_phase(Phase::Catch).collect();
        let named = |event: &TrialEvent| matches!(event.response, Response::First | Response::Second);
        let obvious: Vec<_> = of_phase(Phase::Obvious).collect();
        let twice: Vec<(Response, Response)> = of_phase(Phase::RepeatCheck)
            .filter_map(|(place, event)| Some((first_time(record, place, event)?, event.response)))
            .collect();
        let squares = twice.iter().filter_map(|pair| match pair {
            (Response::Rating(first), Response::Rating(second)) => Some((first - second) * (first - second)),
            _ => None,
        });
        let squares: Vec<f64> = squares.collect();
        let ratings = record.counted().filter_map(|event| match event.response {
            Response::Rating(rating) => Some(rating),
            _ => None,
        });
        let ratings: Vec<f64> = ratings.collect();
        let is_pair = squares.is_empty() && !twice.is_empty();
        let same = twice.iter().filter(|(first, second)| first == second).count() as f64;
        Self {
            subject: record.subject.to_string(),
            catch_trials: catch.len(),
            false_alarms: catch.iter().filter(|(_, event)| named(event)).count(),
            obvious_pairs: obvious.len(),
            missed_obvious: obvious.iter().filter(|(_, event)| !names_the_larger(event)).count(),
            repeat_checks: twice.len(),
            agreement: is_pair.then(|| same / twice.len() as f64),
            retest_deviation: (!squares.is_empty()).then(|| (0.5 * mean(&squares)).sqrt() / mean(&ratings)),
        }
    }

    /// Share of the catch trials in which one was named.
    #[must_use]
    pub fn false_alarm_share(&self) -> Option<f64> {
        (self.catch_trials > 0).then(|| self.false_alarms as f64 / self.catch_trials as f64)
    }

    /// Share of the obvious pairs whose larger stimulus was not named.
    #[must_use]
    pub fn missed_obvious_share(&self) -> Option<f64> {
        (self.obvious_pairs > 0).then(|| self.missed_obvious as f64 / self.obvious_pairs as f64)
    }

    /// One line for people; empty if there were no checks.
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
            format!("{:.0} % of {trials} repeated pairs had the same answer", share * 100.0)
        });
        let deviation = self.retest_deviation.map(|share| {
            let trials = self.repeat_checks;
            format!("{trials} repeated ratings: deviation {:.1} % of the mean rating", share * 100.0)
        });
        [catch, obvious, agreement, deviation].into_iter().flatten().collect::<Vec<_>>().join("; ")
    }
}

fn names_the_larger(event: &TrialEvent) -> bool {
    let named = match event.response {
        Response::First => Position::First,
        Response::Second => Position::Second,
        Response::DontKnow | Response::Rating(_) | Response::Seen => return false,
    };
    matches!(event.trial.presented, Presented::Pair(pair) if pair.larger_at == named)
}

/// The answer when a trial was presented before: the last time it counted, in the same track or replication.
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
