//! Tidy tables: one row per presentation, one column per variable, `n/a` for missing values.

use crate::blinding::Codes;
use crate::exclusion::Exclusion;
use crate::kinematics::StimulusKinematics;
use crate::log::{Begin, Person, SittingLog, TrialRecord};
use crate::protocol::Protocol;
use crate::sitting::Verdict;
use crate::trial::{Judgement, Presented};
use serde_json::{Map, Value, json};

/// Text for a missing value in BIDS.
pub(crate) const MISSING: &str = "n/a";

/// Name and description of each column.
const COLUMNS: [(&str, &str); 30] = [
    ("trial", "Count of presentations in the sitting, from 1"),
    (
        "phase",
        "practice, main, catch (a pair of equal stimuli), obvious (a pair with an obvious difference) or repeat_check (presented once before): only main counts",
    ),
    ("replication", "Replication, from 1; 0 for practice"),
    ("track", "Track of the adaptive procedure, from 1; 0 without a track"),
    ("repeat", "Number of earlier repetitions of this presentation, because the handle left its range"),
    ("condition", "Code of modality and level, for a blinded analysis"),
    ("modality", "vh: vision and haptics, h: haptics alone"),
    ("base", "Base of a pair, in the unit of the stimulus"),
    ("comparison", "Comparison of a pair, in the unit of the stimulus"),
    ("stimulus", "The stimulus rated, in its unit"),
    ("delta", "Difference of comparison and base as a share of the base"),
    ("comparison_at", "first or second: position of the comparison in the pair"),
    ("response", "first, second, dont_know, rating or seen"),
    ("rating", "Rating, in the subject's own scale"),
    ("judgement", "correct, wrong or unsure"),
    ("is_reversal", "1 if the answer reversed the direction of the track"),
    ("repeated", "1 if the presentation is repeated and its answer does not count"),
    ("threshold", "Threshold of the track as a share of the base, on its last trial"),
    ("response_time", "From the end of the presentation to the answer, s"),
    ("boundary_hit", "1 if the handle left its range"),
    ("duration", "Time the stimuli were explored, s"),
    ("cycles", "Down and up movements"),
    ("mean_speed", "Mean speed along the vertical, m/s"),
    ("mean_acceleration", "Mean magnitude of the acceleration along the vertical, m/s2"),
    ("mean_force", "Mean magnitude of the vertical force on the hand, N"),
    ("peak_force", "Largest force on the hand, N"),
    ("felt_stiffness", "Stiffness of each stimulus at the hand, N/m, in order"),
    ("missed_ticks", "Ticks missed by the servo"),
    (
        "onset",
        "Time from which the first stimulus could be felt, s after the start of the sitting (acq_time in the list of scans)",
    ),
    ("observer", "human, or simulated: no person was tested"),
];

/// Returns the tab-separated table of one sitting.
pub(super) fn trials(log: &SittingLog) -> String {
    let head: Vec<&str> = COLUMNS.iter().map(|(name, _)| *name).collect();
    let codes = Codes::new(&log.begin.protocol, log.begin.seed);
    let rows = log.trials.iter().map(|record| row(record, &codes, log).join("\t"));
    [head.join("\t")].into_iter().chain(rows).fold(String::new(), |text, line| text + &line + "\n")
}

/// Returns all trials of all sittings as one comma-separated table for other programs: subject and first modality, the columns
/// of a sitting's table, movement per stimulus, and the rule that excluded the trial. Spaces separate the items of a list within
/// a cell.
#[must_use]
pub fn trials_csv(logs: &[SittingLog], excluded: &[Exclusion]) -> String {
    let head = COLUMNS.iter().map(|(name, _)| *name);
    let head = ["subject", "first_modality"].into_iter().chain(head).chain(EACH).chain(["excluded"]);
    let mut text = head.collect::<Vec<_>>().join(",") + "\n";
    for log in logs {
        let codes = Codes::new(&log.begin.protocol, log.begin.seed);
        let subject = log.begin.subject;
        let first = log.begin.protocol.first_modality().of(subject).word();
        for record in &log.trials {
            let cells = row(record, &codes, log).into_iter().map(|cell| cell.replace(',', " "));
            let by = excluded.iter().find(|exclusion| exclusion.covers(subject, &record.event.trial));
            let by = by.map_or(MISSING, |exclusion| exclusion.rule).to_owned();
            let cells = [subject.to_string(), first.to_owned()]
                .into_iter()
                .chain(cells)
                .chain(each(record))
                .chain([by]);
            text += &(cells.collect::<Vec<_>>().join(",") + "\n");
        }
    }
    text
}

/// Movement columns with one number per stimulus, in order.
const EACH: [&str; 3] = ["speed_each", "acceleration_each", "force_each"];

fn each(record: &TrialRecord) -> [String; 3] {
    let felt = &record.event.exploration.kinematics;
    let measures: [fn(&StimulusKinematics) -> f64; 3] =
        [|one| one.mean_speed_m_per_s, |one| one.mean_acceleration_m_per_s2, |one| one.mean_force_n];
    measures.map(|measure| {
        let numbers: Vec<String> = felt.iter().map(|one| measure(one).to_string()).collect();
        if numbers.is_empty() { MISSING.to_owned() } else { numbers.join(" ") }
    })
}

fn row(record: &TrialRecord, codes: &Codes, log: &SittingLog) -> Vec<String> {
    let event = &record.event;
    let trial = &event.trial;
    let number = |value: Option<f64>| value.map_or(MISSING.to_owned(), |value| value.to_string());
    let flag = |value: bool| u8::from(value).to_string();
    let word = |value: Option<&str>| value.unwrap_or(MISSING).to_owned();
    let (pair, single) = match trial.presented {
        Presented::Pair(pair) => (Some(pair), None),
        Presented::One { value } => (None, Some(value)),
    };
    let (judgement, reversal) = match event.verdict {
        Verdict::Judged { judgement, reversal } => (Some(judgement), reversal),
        Verdict::Taken | Verdict::Repeated => (None, false),
    };
    let felt = &event.exploration.kinematics;
    let mean = |value: fn(&StimulusKinematics) -> f64| {
        let total: f64 = felt.iter().map(|one| one.duration_s).sum();
        (total > 0.0).then(|| felt.iter().map(|one| value(one) * one.duration_s).sum::<f64>() / total)
    };
    let any = !felt.is_empty();
    let stiffness: Vec<String> = felt.iter().map(|one| number(one.felt_stiffness_n_per_m)).collect();
    vec![
        trial.number.to_string(),
        trial.phase.word().to_owned(),
        trial.replication.to_string(),
        trial.track.to_string(),
        trial.repeat.to_string(),
        codes.condition(trial.modality, &trial.presented),
        trial.modality.word().to_owned(),
        number(pair.map(|pair| pair.base)),
        number(pair.map(|pair| pair.comparison)),
        number(single),
        number(pair.map(|pair| pair.delta)),
        word(pair.map(|pair| pair.comparison_at.word())),
        event.response.word().to_owned(),
        number(event.response.rating()),
        word(judgement.map(Judgement::word)),
        flag(reversal),
        flag(event.verdict == Verdict::Repeated),
        number(record.track.and_then(|track| track.threshold)),
        number(event.exploration.response_time_s),
        flag(event.exploration.boundary_hit),
        number(any.then(|| felt.iter().map(|one| one.duration_s).sum())),
        if any { felt.iter().map(|one| one.cycles).sum::<u32>().to_string() } else { MISSING.to_owned() },
        number(mean(|one| one.mean_speed_m_per_s)),
        number(mean(|one| one.mean_acceleration_m_per_s2)),
        number(mean(|one| one.mean_force_n)),
        number(any.then(|| felt.iter().map(|one| one.peak_force_n).fold(0.0, f64::max))),
        if any { stiffness.join(",") } else { MISSING.to_owned() },
        event.exploration.missed_ticks.to_string(),
        number(event.exploration.onset.zip(log.began).map(|(onset, began)| onset.since_s(began))),
        log.begin.observer_kind().word().to_owned(),
    ]
}

/// Returns the JSON sidecar of the tables, and the keys that the program overwrites.
pub(super) fn columns(protocol: &Protocol) -> (Map<String, Value>, &'static [&'static str]) {
    let mut sidecar = Map::new();
    sidecar.insert("TaskName".to_owned(), json!(protocol.task()));
    sidecar.insert("Stimulus".to_owned(), json!(protocol.stimulus().to_string()));
    sidecar.insert("Protocol".to_owned(), json!(protocol));
    for (name, meaning) in COLUMNS {
        sidecar.insert(name.to_owned(), json!({ "Description": meaning }));
    }
    (sidecar, &["TaskName", "Stimulus", "Protocol"])
}

/// Returns the description of the data set, and the keys that the program overwrites.
pub(super) fn description(begin: &Begin) -> (Map<String, Value>, &'static [&'static str]) {
    let description = json!({
        "Name": format!("Perception study: {}", begin.protocol.task()),
        "BIDSVersion": "1.9.0",
        "DatasetType": "raw",
        "GeneratedBy": [{ "Name": "flotor", "Version": begin.version }],
        "Seed": begin.seed,
        "ConfigHash": begin.config_hash(),
        "Observer": begin.observer,
        "Apparatus": begin.apparatus,
    });
    (members(&description), &["Seed", "ConfigHash", "Observer", "Apparatus"])
}

/// First column of the list of scans.
pub(crate) const SCAN: &str = "filename";

/// Returns the list of scans of a subject: the sitting's table with the start time; `None` if the time is unknown.
pub(super) fn scans(log: &SittingLog) -> Option<String> {
    let (subject, task) = (log.begin.subject, log.begin.protocol.task());
    let began = log.began?;
    Some(format!("filename\tacq_time\nbeh/{subject}_task-{task}_beh.tsv\t{began}\n"))
}

/// First column of the list of participants.
pub(crate) const PARTICIPANT: &str = "participant_id";

/// Header of the list of participants.
pub(super) const PARTICIPANTS_HEAD: &str = "participant_id\tobserver\tfirst_modality\tcomplete\tpresentations\tresumed\tincidents\tage\tsex\thandedness\n";

/// Returns a participant's line in the list of participants.
pub(super) fn participant(log: &SittingLog) -> String {
    let subject = log.begin.subject;
    let observer = log.begin.observer_kind().word();
    let first = log.begin.protocol.first_modality().of(subject).word();
    let complete = u8::from(log.complete);
    let counts = [log.trials.len(), log.resumed as usize, log.incidents.len()].map(|count| count.to_string());
    let person = person_cells(log.begin.person.as_ref()).join("\t");
    format!("{subject}\t{observer}\t{first}\t{complete}\t{}\t{person}\n", counts.join("\t"))
}

/// Returns age, sex and handedness for the list of participants.
pub(crate) fn person_cells(person: Option<&Person>) -> [String; 3] {
    let Person { age, sex, handedness } = person.cloned().unwrap_or_default();
    [age.map(|age| age.to_string()), sex, handedness].map(|known| known.unwrap_or(MISSING.to_owned()))
}

/// Returns the descriptions of the participant columns; the program overwrites none of them.
pub(crate) fn participant_columns() -> (Map<String, Value>, &'static [&'static str]) {
    let columns = json!({
        "observer": { "Description": "human, or simulated: no person was tested" },
        "first_modality": { "Description": "Modality the subject started with: vh (vision and haptics) or h (haptics alone)" },
        "complete": { "Description": "1 if the sitting is complete" },
        "presentations": { "Description": "Presentations, practice and repeats included" },
        "resumed": { "Description": "Number of times the sitting was resumed" },
        "incidents": { "Description": "Interruptions and disturbances in the event log" },
    });
    let columns = members(&columns).into_iter().chain(person_columns()).collect();
    (columns, &[])
}

/// Returns the descriptions of the columns of [`person_cells`].
pub(crate) fn person_columns() -> Map<String, Value> {
    members(&json!({
        "age": { "Description": "Age, if it was given", "Units": "year" },
        "sex": { "Description": "Sex, if it was given" },
        "handedness": { "Description": "Preferred hand, if it was given" },
    }))
}

pub(crate) fn members(object: &Value) -> Map<String, Value> {
    object.as_object().cloned().unwrap_or_default()
}
