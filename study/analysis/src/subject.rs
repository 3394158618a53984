//! Report on the data quality of one subject, also during a sitting: tracks, psychometric functions, and indications of answers
//! that do not depend on the stimuli.

use crate::large::wrong_at_large;
use crate::text::p_text;
use crate::{SubjectChecks, SubjectRecord, conditions};
use flotor_core::quantile;
use flotor_statistics::distribution::binomial_at_least;
use flotor_study::estimate::{Prior, Psychometric, psychometric};
use flotor_study::kinematics::StimulusKinematics;
use flotor_study::log::Incident;
use flotor_study::protocol::Protocol;
use flotor_study::sitting::TrackResult;
use flotor_study::trial::{Modality, Presented, Response};
use serde::Serialize;

/// Exploration time below which a presentation is suspicious, s.
const SHORT_S: f64 = 0.5;
/// Significance level of each kind of test, over all conditions of a subject: worse than chance, misfit of the psychometric
/// function, and preference for a place in the pair.
const LEVEL: f64 = 0.05;

/// Psychometric function of one subject in one condition.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SubjectCondition {
    /// Modality of the condition.
    pub modality: Modality,
    /// Base, in the unit of the stimulus.
    pub base: f64,
    /// Psychometric function with threshold and lapse rate.
    pub function: Psychometric,
}

/// Data quality of one subject.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SubjectQuality {
    /// Label of the subject: `sub-01`.
    pub subject: String,
    /// Number of counted answers.
    pub answers: usize,
    /// Results of completed tracks.
    pub tracks: Vec<TrackResult>,
    /// Psychometric functions of a difference experiment; empty for ratings.
    pub conditions: Vec<SubjectCondition>,
    /// Quartiles of the time from the end of a presentation to the answer, s; `None` if not measured.
    pub response_time_s: Option<[f64; 3]>,
    /// Fraction of "I don't know" among the answers; `None` for ratings or without answers.
    pub dont_know: Option<f64>,
    /// Fraction of "the first" among the answers that name a stimulus; `None` for ratings or without such answers.
    pub first: Option<f64>,
    /// Results of the check trials.
    pub checks: SubjectChecks,
    /// Suspicious findings, one short text each.
    pub flags: Vec<String>,
}

impl SubjectCondition {
    fn name(&self) -> String {
        format!("{} base {}", self.modality.word(), self.base)
    }

    /// Returns the suspicious findings of this condition: worse than chance, or misfit. `level` is the significance level,
    /// corrected for the number of conditions.
    fn suspicions(&self, level: f64) -> Vec<String> {
        let Psychometric { named, wrong, p_chance, fit, .. } = self.function;
        let chance = (p_chance < level).then(|| {
            let p = p_text(p_chance);
            format!("{}: worse than chance: {wrong} of {named} wrong, binomial {p}", self.name())
        });
        let misfit = (fit.p < level).then(|| {
            let p = p_text(fit.p);
            format!("{}: no psychometric function fits: chi-square {:.1}, {p}", self.name(), fit.chi_square)
        });
        chance.into_iter().chain(misfit).collect()
    }
}

impl SubjectQuality {
    /// Evaluates a subject's data so far; `incidents` are the interruptions and disturbances in the log.
    #[must_use]
    pub fn of(protocol: &Protocol, record: &SubjectRecord, incidents: &[Incident]) -> Self {
        let counted: Vec<_> = record.counted().collect();
        let mut times: Vec<f64> =
            counted.iter().filter_map(|event| event.exploration.response_time_s).collect();
        let quartiles = [0.25, 0.5, 0.75].map(|share| quantile(&mut times, share));
        let named = |response: Response| counted.iter().filter(|event| event.response == response).count();
        let [first, second, unsure] = [Response::First, Response::Second, Response::DontKnow].map(named);
        let is_jnd = matches!(protocol, Protocol::Jnd(_));
        let share = |part: usize, whole: usize| (is_jnd && whole > 0).then(|| part as f64 / whole as f64);
        let mut quality = Self {
            subject: record.subject.to_string(),
            answers: counted.len(),
            tracks: record.tracks.clone(),
            response_time_s: (!times.is_empty()).then_some(quartiles),
            dont_know: share(unsure, first + second + unsure),
            first: share(first, first + second),
            checks: SubjectChecks::of(record),
            flags: Vec::new(),
            conditions: functions(protocol, record),
        };
        quality.flags = quality.suspicions(record, [first, second], incidents);
        quality
    }

    fn suspicions(&self, record: &SubjectRecord, named: [usize; 2], incidents: &[Incident]) -> Vec<String> {
        let mut flags = Vec::new();
        let any = |has: fn(&StimulusKinematics) -> bool| {
            record.counted().filter(|event| event.exploration.kinematics.iter().any(has)).count()
        };
        let mut say = |count: usize, what: &str| {
            if count > 0 {
                flags.push(format!("{count} {what}"));
            }
        };
        say(any(|one| one.duration_s < SHORT_S), "answers after less than half a second with a stimulus");
        say(any(|one| one.cycles == 0), "answers without a whole movement down and up");
        say(wrong_at_large(record).wrong, "wrong answers to differences of 40 % and more");
        say(
            without_difference(record),
            "answers to equal stimuli, judged by the place of the larger stimulus (--floor)",
        );
        let stuck = self.tracks.iter().filter(|track| track.threshold.is_none()).count();
        say(stuck, "tracks that did not reach a threshold");
        let open = self.tracks.iter().filter(|track| track.not_bounded.is_some()).count();
        say(open, "tracks whose answers do not bound the threshold");
        say(incidents.len(), "interruptions and disturbances in the log");
        // Bonferroni correction: each kind of test flags at most 5 % of the subjects whose answers are in order.
        let level = LEVEL / self.conditions.len().max(1) as f64;
        flags.extend(self.conditions.iter().flat_map(|condition| condition.suspicions(level)));
        if let Some(first) = self.first
            && is_preference(named)
        {
            flags.push(format!("a preference: {:.0} % of the answers named the first", first * 100.0));
        }
        let checks = &self.checks;
        let above_half = |share: Option<f64>| share.is_some_and(|share| share > 0.5);
        let findings = [
            (above_half(self.dont_know), "more than half of the answers are \"I don't know\""),
            (
                above_half(checks.false_alarm_share()),
                "more than half of the catch trials named one of two equal stimuli",
            ),
            (above_half(checks.missed_obvious_share()), "more than half of the obvious pairs were missed"),
            (
                checks.agreement.is_some_and(|share| share < 0.5),
                "fewer than half of the repeated pairs had the same answer",
            ),
            (
                above_half(checks.retest_deviation),
                "a rating and its repetition deviate by more than half of the mean rating",
            ),
        ];
        flags.extend(findings.into_iter().filter(|(is_found, _)| *is_found).map(|(_, text)| text.to_owned()));
        flags
    }

    /// Formats the findings as a text page.
    #[must_use]
    pub fn to_text(&self) -> String {
        let percent = |share: f64| format!("{:.1} %", share * 100.0);
        let mut lines = vec![format!("{}: {} answers that count", self.subject, self.answers)];
        for track in &self.tracks {
            let TrackResult { track, replication, modality, base, threshold, not_bounded, trials } = track;
            let found = threshold.map_or("none".to_owned(), percent);
            let found = not_bounded.map_or(found.clone(), |open| format!("{found} ({})", open.text()));
            lines.push(format!(
                "  track {track:<3} replication {replication}  {:<3} base {base:<8} threshold {found:<9} {trials} trials",
                modality.word(),
            ));
        }
        for SubjectCondition { modality, base, function } in &self.conditions {
            let interval = match function.threshold_interval.map(|end| end.map(percent)) {
                [Some(low), Some(high)] => format!("95 %: {low} to {high}"),
                [Some(low), None] => format!("95 %: above {low}"),
                [None, Some(high)] => format!("95 %: below {high}"),
                [None, None] => "no interval".to_owned(),
            };
            let open = function.not_bounded.map_or(String::new(), |open| format!(", {}", open.text()));
            lines.push(format!(
                "  {:<3} base {base:<8} {} answers: threshold {} ({interval}{open}), lapse {} (at most {}), fit {}",
                modality.word(),
                function.answers,
                percent(function.threshold),
                percent(function.lapse),
                percent(function.lapse_most),
                p_text(function.fit.p),
            ));
        }
        if let Some([low, middle, high]) = self.response_time_s {
            lines.push(format!("  answers after {middle:.2} s (quartiles {low:.2} to {high:.2} s)"));
        }
        if let (Some(unsure), Some(first)) = (self.dont_know, self.first) {
            let (unsure, first) = (percent(unsure), percent(first));
            lines.push(format!("  \"I don't know\" {unsure}; {first} of the other answers named the first"));
        }
        let checks = self.checks.to_text();
        lines.extend((!checks.is_empty()).then(|| format!("  checks: {checks}")));
        lines.extend(self.flags.iter().map(|flag| format!("  ! {flag}")));
        lines.join("\n")
    }
}

/// Returns true if the numbers of answers that named the first and the second stimulus differ significantly: two-sided binomial
/// test at [`LEVEL`], for which six equal answers suffice.
fn is_preference([first, second]: [usize; 2]) -> bool {
    2.0 * binomial_at_least(first.max(second), first + second, 0.5) < LEVEL
}

/// Counts answers that name a stimulus of a pair of equal stimuli. Such an answer is correct or wrong by chance and affects the
/// track; equal pairs occur in a track with a floor of 0.
fn without_difference(record: &SubjectRecord) -> usize {
    let is_judged = |event: &&flotor_study::log::TrialEvent| {
        event.response.named().is_some()
            && matches!(event.trial.presented, Presented::Pair(pair) if pair.delta == 0.0)
    };
    record.counted().filter(is_judged).count()
}

fn functions(protocol: &Protocol, record: &SubjectRecord) -> Vec<SubjectCondition> {
    let Protocol::Jnd(jnd) = protocol else { return Vec::new() };
    let of = |(modality, base): (Modality, f64)| {
        let observed = record.observations(modality, base);
        let function = psychometric(&observed, &Prior::default(), jnd.procedure.target())?;
        Some(SubjectCondition { modality, base, function })
    };
    conditions(&jnd.bases).filter_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_subject_who_always_says_the_first_has_a_preference() {
        assert!(is_preference([15, 0]) && is_preference([0, 6]));
        assert!(!is_preference([5, 0]) && !is_preference([12, 12]) && !is_preference([0, 0]));
    }

    /// Of the sequences of answers by a coin, at most one in twenty shows a preference, however short they are.
    #[test]
    fn a_coin_rarely_has_a_preference() {
        for answers in 0..=60_usize {
            // Number of sequences with each count of "the first": a row of Pascal's triangle, exact in `f64`.
            let mut ways = vec![1.0_f64];
            for _ in 0..answers {
                let next =
                    |at: usize| ways.get(at).unwrap_or(&0.0) + at.checked_sub(1).map_or(0.0, |at| ways[at]);
                ways = (0..=ways.len()).map(next).collect();
            }
            let shown = ways.iter().enumerate().filter(|(first, _)| is_preference([*first, answers - first]));
            let share = shown.map(|(_, ways)| ways).sum::<f64>() / ways.iter().sum::<f64>();
            assert!(share <= LEVEL, "{answers} answers: {share}");
        }
    }
}
