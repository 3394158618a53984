//! Application of the exclusion rules to complete sittings.

use crate::large::wrong_at_large;
use crate::{Estimator, SubjectChecks, SubjectRecord, conditions};
use flotor_study::exclusion::{EMPTY_CONDITION, Exclusion, ExclusionRules, Scope};
use flotor_study::log::TrialEvent;
use flotor_study::protocol::{Protocol, SubjectNumber};
use flotor_study::trial::{Modality, Response, Trial};
use serde::Serialize;
use std::collections::BTreeSet;

/// Result of applying the exclusion rules.
#[derive(Clone, Debug, Default)]
pub struct Applied {
    /// Records of the subjects that are not excluded, without their excluded trials and tracks.
    pub kept: Vec<SubjectRecord>,
    /// Excluded trials, tracks and sittings with rule and value.
    pub excluded: Vec<Exclusion>,
    /// Rules that could not be applied.
    pub not_applied: Vec<NotApplied>,
}

/// Rule that could not be applied to some subjects.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NotApplied {
    /// Name of the rule in the study file.
    pub rule: &'static str,
    /// Reason: the information that the rule needs and the data lack.
    pub why: &'static str,
    /// Subjects concerned.
    pub subjects: Vec<SubjectNumber>,
}

impl std::fmt::Display for NotApplied {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let subjects: Vec<String> = self.subjects.iter().map(SubjectNumber::to_string).collect();
        write!(f, "{}: {} ({})", self.rule, self.why, subjects.join(", "))
    }
}

/// Applies the rules to the complete sittings of `subjects`. A sitting with a condition that has no result left is excluded as
/// a whole. `rate_hz` is the servo rate, Hz; `None` without a scene.
#[must_use]
pub fn apply(
    rules: &ExclusionRules,
    protocol: &Protocol,
    subjects: Vec<SubjectRecord>,
    estimator: Estimator,
    rate_hz: Option<f64>,
) -> Applied {
    let mut applied = Applied::default();
    for record in subjects {
        let before = applied.excluded.len();
        let trials = excluded_trials(rules, &record, estimator, &mut applied);
        exclude_sitting(rules, &record, &trials, rate_hz, &mut applied);
        let new = applied.excluded.split_off(before);
        let is_out = |exclusion: &&Exclusion| exclusion.scope == Scope::Sitting;
        if let Some(whole) = new.iter().find(is_out) {
            applied.excluded.push(whole.clone());
            continue;
        }
        let kept = without(&record, &new);
        applied.excluded.extend(new);
        match emptied(protocol, estimator, &kept) {
            // A condition would be empty: exclude the whole sitting.
            Some(found) => applied.excluded.push(Exclusion {
                subject: record.subject,
                scope: Scope::Sitting,
                rule: EMPTY_CONDITION,
                found,
            }),
            None => applied.kept.push(kept),
        }
    }
    applied
}

/// Applies the trial rules and returns the numbers of the excluded trials.
fn excluded_trials(
    rules: &ExclusionRules,
    record: &SubjectRecord,
    estimator: Estimator,
    applied: &mut Applied,
) -> BTreeSet<u32> {
    let mut numbers = BTreeSet::new();
    for event in record.counted() {
        let Some((rule, found)) = outside_rule(rules, record.subject, event, applied) else { continue };
        let Trial { number, track, .. } = event.trial;
        numbers.insert(number);
        let (scope, found) = match estimator {
            Estimator::Procedure if track > 0 => (Scope::Track(track), format!("trial {number}: {found}")),
            _ => (Scope::Trial(number), found),
        };
        let is_known = |known: &Exclusion| known.subject == record.subject && known.scope == scope;
        if !applied.excluded.iter().any(is_known) {
            applied.excluded.push(Exclusion { subject: record.subject, scope, rule, found });
        }
    }
    numbers
}

fn outside_rule(
    rules: &ExclusionRules,
    subject: SubjectNumber,
    event: &TrialEvent,
    applied: &mut Applied,
) -> Option<(&'static str, String)> {
    let exploration = &event.exploration;
    if let Some([shortest, longest]) = rules.response_time_s {
        match exploration.response_time_s {
            Some(time_s) if !(shortest..=longest).contains(&time_s) => {
                return Some(("response_time_s", format!("{time_s:.2} s")));
            }
            Some(_) => {}
            None => applied.cannot("response_time_s", "not measured for simulated observers", subject),
        }
    }
    let least_mm = rules.least_movement_mm?;
    if exploration.kinematics.is_empty() {
        applied.cannot("least_movement_mm", "no movement was stored", subject);
    }
    // A repeated presentation adds further entries for each stimulus: sum their path lengths.
    let (felt, stimuli) = (&exploration.kinematics, event.trial.presented.values().len().max(1));
    let way_mm = |stimulus: usize| {
        let here = felt.iter().skip(stimulus).step_by(stimuli);
        here.map(|one| 1.0e3 * one.mean_speed_m_per_s * one.duration_s).sum::<f64>()
    };
    let ways_mm = (0..stimuli.min(felt.len())).map(way_mm);
    let least = ways_mm.fold(f64::INFINITY, f64::min);
    (least < least_mm).then(|| ("least_movement_mm", format!("{least:.1} mm")))
}

fn exclude_sitting(
    rules: &ExclusionRules,
    record: &SubjectRecord,
    trials: &BTreeSet<u32>,
    rate_hz: Option<f64>,
    applied: &mut Applied,
) {
    let checks = SubjectChecks::of(record);
    let counted: Vec<&TrialEvent> = record.counted().collect();
    let share = |part: usize| (!counted.is_empty()).then(|| part as f64 / counted.len() as f64);
    let unsure = counted.iter().filter(|event| event.response == Response::DontKnow).count();
    let missed = missed_share(&counted, rate_hz);
    if rules.most_missed_ticks.is_some() && missed.is_none() {
        applied.cannot("most_missed_ticks", "no movement was stored", record.subject);
    }
    let above =
        |most: Option<f64>, found: Option<f64>| Some((most?, found?)).filter(|(most, found)| found > most);
    let below = |least: Option<f64>, found: Option<f64>| {
        Some((least?, found?)).filter(|(least, found)| found < least)
    };
    let found = [
        ("most_false_alarms", above(rules.most_false_alarms, checks.false_alarm_share())),
        ("most_missed_obvious", above(rules.most_missed_obvious, checks.missed_obvious_share())),
        ("most_wrong_at_large", above(rules.most_wrong_at_large, wrong_at_large(record).share())),
        ("least_agreement", below(rules.least_agreement, checks.agreement)),
        ("most_retest_deviation", above(rules.most_retest_deviation, checks.retest_deviation)),
        ("most_dont_know", above(rules.most_dont_know, share(unsure))),
        ("most_missed_ticks", above(rules.most_missed_ticks, missed)),
        ("most_excluded_trials", above(rules.most_excluded_trials, share(trials.len()))),
    ];
    let first = found.into_iter().find_map(|(rule, outside)| Some((rule, outside?.1)));
    applied.excluded.extend(first.map(|(rule, value)| Exclusion {
        subject: record.subject,
        scope: Scope::Sitting,
        rule,
        found: format!("{value:.3}"),
    }));
}

impl Applied {
    fn cannot(&mut self, rule: &'static str, why: &'static str, subject: SubjectNumber) {
        match self.not_applied.iter_mut().find(|known| (known.rule, known.why) == (rule, why)) {
            Some(known) if known.subjects.contains(&subject) => {}
            Some(known) => known.subjects.push(subject),
            None => self.not_applied.push(NotApplied { rule, why, subjects: vec![subject] }),
        }
    }

    /// Returns the warnings of the rules that have excluded data and depend on the stimulus as well as on the subject.
    pub fn warnings(&self) -> impl Iterator<Item = &'static str> {
        let mut rules: Vec<&str> = self.excluded.iter().map(|exclusion| exclusion.rule).collect();
        rules.sort_unstable();
        rules.dedup();
        rules.into_iter().filter_map(ExclusionRules::warning)
    }

    /// Formats a table of the exclusions, the rules without exclusions, the rules that could not be applied, and the warnings.
    #[must_use]
    pub fn to_text(&self, rules: &ExclusionRules) -> String {
        let mut lines = vec![
            "  Excluded                      by rule of the study file                     found".to_owned(),
        ];
        for Exclusion { subject, scope, rule, found } in &self.excluded {
            lines.push(format!("  {:<30}{:<46}{found}", format!("{subject} {scope}"), rules.text_of(rule)));
        }
        for rule in rules.names() {
            let unknown = self.not_applied.iter().find(|one| one.rule == rule);
            let took = self.excluded.iter().any(|exclusion| exclusion.rule == rule);
            match unknown {
                Some(why) => lines.push(format!("  not applied                   {why}")),
                None if !took => {
                    lines.push(format!("  nothing                       {}", rules.text_of(&rule)))
                }
                None => {}
            }
        }
        lines.extend(self.warnings().map(|warning| format!("  note                          {warning}")));
        lines.join("\n")
    }
}

/// Returns the number of missed ticks as a fraction of the ticks while stimuli were felt; `None` without stored movements or a
/// servo rate.
fn missed_share(counted: &[&TrialEvent], rate_hz: Option<f64>) -> Option<f64> {
    let felt = counted.iter().filter(|event| !event.exploration.kinematics.is_empty());
    let time_s =
        |event: &&&TrialEvent| event.exploration.kinematics.iter().map(|one| one.duration_s).sum::<f64>();
    let ticks = felt.clone().map(|event| time_s(&event)).sum::<f64>() * rate_hz?;
    let missed: u64 = felt.map(|event| event.exploration.missed_ticks).sum();
    (ticks > 0.0).then(|| missed as f64 / ticks)
}

fn without(record: &SubjectRecord, excluded: &[Exclusion]) -> SubjectRecord {
    let mut kept = record.clone();
    kept.trials
        .retain(|event| !excluded.iter().any(|exclusion| exclusion.covers(record.subject, &event.trial)));
    kept.tracks
        .retain(|track| !excluded.iter().any(|exclusion| exclusion.scope == Scope::Track(track.track)));
    kept
}

/// Returns a text about the first condition without a result, because rules have excluded all of its data or no track reached a
/// threshold; `None` if every condition has a result.
fn emptied(protocol: &Protocol, estimator: Estimator, kept: &SubjectRecord) -> Option<String> {
    // A track without a threshold has answers, but no result.
    let by_tracks = matches!((protocol, estimator), (Protocol::Jnd(_), Estimator::Procedure));
    let has_result = |(modality, at): (Modality, f64)| {
        if by_tracks {
            let mut tracks = kept.tracks.iter().filter(|track| track.threshold.is_some());
            tracks.any(|track| track.modality == modality && track.base == at)
        } else {
            let mut trials = kept.counted().map(|event| &event.trial);
            trials.any(|trial| trial.modality == modality && trial.presented.level() == at)
        }
    };
    let (modality, at) = conditions(protocol.levels()).find(|condition| !has_result(*condition))?;
    let what = if by_tracks { "track with a threshold" } else { "answer" };
    Some(format!("{} at {at}: no {what}", modality.word()))
}

#[cfg(test)]
mod tests;
