//! Tables of a designed study: one row per trial, one row per questionnaire.

use super::log::{DesignedLog, StepEvent};
use crate::dataset::table::MISSING;
use flotor_study_design::answer::Answer;
use flotor_study_design::course::{Phase, Signal, Step, Trial};
use flotor_study_design::value::Value;

/// Name and description of each column besides those of the factors.
pub(super) const COLUMNS: [(&str, &str); 14] = [
    ("trial", "Count of presentations in the session, from 1"),
    ("phase", "practice or main: only main counts"),
    ("block", "Block of the session, from 1"),
    ("track", "Track of the method, from 1; 0 without tracks"),
    ("repeat", "Number of earlier presentations of this trial in which the handle left its range"),
    ("level", "Level of the stimulus on its scale; 0 without the signal"),
    ("intervals", "Values of the stimulus's setting in the intervals, in order, with spaces between them"),
    ("comparison_at", "first or second: interval of the comparison"),
    ("signal", "present or absent, in a detection"),
    ("answer", "first, second, unsure, present, absent, or a number"),
    ("positive", "1 if the comparison was named or the signal reported, 0 if not, 0.5 for `unsure`"),
    ("confidence", "Confidence in the answer"),
    ("threshold", "Threshold of the track on the scale of the levels, on its last trial"),
    (
        "counts",
        "1 if the trial counts: not practice, and the handle stayed in its range or the trial was not repeated",
    ),
];

/// Column with the origin of the answers.
pub(super) const OBSERVER: (&str, &str) = ("observer", "human, or simulated: no person was tested");

/// Returns the tab-separated table of the trials of sessions of one study: subject and session, factors, trial and answer.
#[must_use]
pub fn trials_tsv(logs: &[DesignedLog]) -> String {
    let Some(first) = logs.first() else { return String::new() };
    let factors = first.begin.design.factors().iter().map(|factor| factor.name.as_str());
    let head: Vec<&str> = ["subject", "session"]
        .into_iter()
        .chain(factors)
        .chain(COLUMNS.iter().map(|(name, _)| *name))
        .chain([OBSERVER.0])
        .collect();
    let rows = logs.iter().flat_map(|log| rows(log).into_iter());
    [head.join("\t")].into_iter().chain(rows).fold(String::new(), |text, line| text + &line + "\n")
}

fn rows(log: &DesignedLog) -> Vec<String> {
    let session = log.begin.session;
    let trials = log.steps.iter().enumerate().filter_map(|(index, event)| match &event.step {
        Step::Trial(trial) => Some((index, event, trial)),
        Step::Form { .. } | Step::Rest { .. } => None,
    });
    let row = |(index, event, trial): (usize, &StepEvent, &Trial)| {
        let levels =
            log.begin.design.factors().iter().map(|factor| {
                trial.condition.get(&factor.name).map_or(MISSING.to_owned(), ToString::to_string)
            });
        // The next trial has this one's number of repeats plus 1 if it presents this one again.
        let is_repeated = log.steps.iter().skip(index + 1).find_map(|later| match &later.step {
            Step::Trial(later) => Some(later.repeat == trial.repeat + 1),
            Step::Form { .. } | Step::Rest { .. } => None,
        });
        let counts = trial.phase == Phase::Main && is_repeated != Some(true);
        let results = log.course().results();
        let result = results.iter().find(|result| result.track == trial.track);
        // A track ends with its last trial; later trials belong to other tracks.
        let is_last = !log
            .steps
            .iter()
            .skip(index + 1)
            .any(|later| matches!(&later.step, Step::Trial(later) if later.track == trial.track));
        let threshold = result.filter(|_| is_last).and_then(|result| result.threshold);
        let threshold = threshold.map_or(MISSING.to_owned(), |threshold| threshold.to_string());
        let cells = [session.subject.to_string(), session.session.to_string()]
            .into_iter()
            .chain(levels)
            .chain(of_trial(trial, event))
            .chain([threshold, u8::from(counts).to_string(), log.begin.observer_kind().word().to_owned()]);
        cells.collect::<Vec<_>>().join("\t")
    };
    trials.map(row).collect()
}

fn of_trial(trial: &Trial, event: &StepEvent) -> [String; 12] {
    let number = |value: Option<f64>| value.map_or(MISSING.to_owned(), |value| value.to_string());
    let phase = match trial.phase {
        Phase::Practice => "practice",
        Phase::Main => "main",
    };
    let signal = match trial.signal {
        Some(Signal::Present) => "present",
        Some(Signal::Absent) => "absent",
        None => MISSING,
    };
    let intervals: Vec<String> = trial.intervals.iter().map(ToString::to_string).collect();
    [
        trial.number.to_string(),
        phase.to_owned(),
        trial.block.to_string(),
        trial.track.to_string(),
        trial.repeat.to_string(),
        number(trial.level),
        if intervals.is_empty() { MISSING.to_owned() } else { intervals.join(" ") },
        trial.comparison_at.map_or(MISSING, |position| position.word()).to_owned(),
        signal.to_owned(),
        answer_text(&event.reply.answer),
        number(positive(trial, &event.reply.answer)),
        number(event.reply.confidence),
    ]
}

fn answer_text(answer: &Answer) -> String {
    match answer {
        Answer::First => "first".to_owned(),
        Answer::Second => "second".to_owned(),
        Answer::Unsure => "unsure".to_owned(),
        Answer::Present => "present".to_owned(),
        Answer::Absent => "absent".to_owned(),
        Answer::Rating(number) | Answer::Magnitude(number) => number.to_string(),
        Answer::Form(_) | Answer::Rested => MISSING.to_owned(),
    }
}

/// Returns 1 if the comparison was named or the signal reported, 0 if not, and 0.5 for "I don't know"; `None` for numbers.
pub(super) fn positive(trial: &Trial, answer: &Answer) -> Option<f64> {
    use flotor_study_design::answer::Position;
    let named = |position: Position| f64::from(u8::from(trial.comparison_at == Some(position)));
    match answer {
        Answer::First => Some(named(Position::First)),
        Answer::Second => Some(named(Position::Second)),
        Answer::Unsure => Some(0.5),
        Answer::Present => Some(1.0),
        Answer::Absent => Some(0.0),
        Answer::Rating(_) | Answer::Magnitude(_) | Answer::Form(_) | Answer::Rested => None,
    }
}

/// Returns the tab-separated table of the questionnaires of sessions of one study: a row for each answered questionnaire, a column for
/// each item of any of them; empty without questionnaires.
#[must_use]
pub fn forms_tsv(logs: &[DesignedLog]) -> String {
    let Some(first) = logs.first() else { return String::new() };
    let forms = first.begin.design.questionnaires();
    let mut keys: Vec<&str> = Vec::new();
    for item in forms.iter().flat_map(|form| &form.items) {
        if !keys.contains(&item.key()) {
            keys.push(item.key());
        }
    }
    if keys.is_empty() {
        return String::new();
    }
    let head = ["subject", "session", "questionnaire", "after_block"].into_iter().chain(keys.iter().copied());
    let mut text = head.collect::<Vec<_>>().join("\t") + "\n";
    for log in logs {
        for event in &log.steps {
            let (Step::Form { questionnaire, block }, Answer::Form(answers)) =
                (&event.step, &event.reply.answer)
            else {
                continue;
            };
            let items = forms.get(*questionnaire).map_or(&[][..], |form| &form.items);
            let answer = |key: &&str| {
                let given = items.iter().zip(answers).find(|(item, _)| item.key() == *key);
                given.map_or(MISSING.to_owned(), |(_, answer)| cell(answer))
            };
            let session = log.begin.session;
            let cells = [
                session.subject.to_string(),
                session.session.to_string(),
                (questionnaire + 1).to_string(),
                block.to_string(),
            ];
            text += &(cells.into_iter().chain(keys.iter().map(answer)).collect::<Vec<_>>().join("\t") + "\n");
        }
    }
    text
}

fn cell(answer: &Value) -> String {
    match answer.to_string() {
        text if text.is_empty() => MISSING.to_owned(),
        text => text,
    }
}
