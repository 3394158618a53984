//! Event log of a sitting: one line of JSON per event, on disk before the next trial begins.
//!
//! ```text
//! {"chain":"<64 hexadecimal digits>","event":{"begin":{...}}}
//! {"chain":"...","event":{"trial":{...}}}
//! {"chain":"...","event":{"trial":{...}},"time":"2026-11-25T18:34:09.123Z"}    with a person
//! ```
//!
//! `chain` is the SHA-256 of the previous line's `chain` followed by the event and the time of the same line, so a changed, missing
//! or exchanged line breaks the chain from that line on. The chain protects against accidents, not against forgery, because anyone
//! can recompute it. An incomplete last line, which a killed process leaves, is ignored.

mod error;
mod incident;
pub(crate) mod lines;
mod reader;
mod writer;

pub use error::{LogError, LogProblem};
pub use incident::Incident;
pub use reader::{SittingLog, TrialRecord};
pub use writer::{LogWriter, LoggedEvent};

use crate::exclusion::ExclusionRules;
use crate::protocol::{Protocol, SubjectNumber};
use crate::sitting::Verdict;
use crate::time_of_day::TimeOfDay;
use crate::trial::{Exploration, Response, Trial};
use flotor_study_design::words;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use sha2::{Digest, Sha256};

/// Revision of the format: 2 adds times of day and incidents, 3 withdrawn answers, 4 hashes of input files and changes of the time
/// of day, 5 sittings that ended without a reason.
pub const FORMAT: u32 = 5;

/// Event of a line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Event {
    /// First line: all inputs needed to repeat the sitting.
    Begin(Box<Begin>),
    /// A trial was presented and answered.
    Trial(Box<TrialEvent>),
    /// The answer to the last trial was withdrawn: the trial is open again, and the state is as before the answer.
    Withdrawn {
        /// Trial number.
        trial: u32,
    },
    /// The sitting was resumed after an interruption.
    Resume {
        /// Number of replayed trials.
        trials: u32,
        /// Version of the program.
        version: String,
    },
    /// Note of the experimenter or the program.
    Note {
        /// Text of the note.
        text: String,
    },
    /// Interruption or disturbance.
    Incident(Incident),
    /// The sitting is complete.
    End {
        /// Total number of presentations.
        trials: u32,
    },
}

/// First line of a log.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Begin {
    /// Revision of the format.
    pub format: u32,
    /// Version of the program.
    pub version: String,
    /// Number of the subject.
    pub subject: SubjectNumber,
    /// Seed of order, presentation and simulated answers.
    pub seed: u64,
    /// Study file in use; `None` without a study file.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub plan: Option<Plan>,
    /// Experiment with its settings.
    pub protocol: Protocol,
    /// Optional data on the person.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub person: Option<Person>,
    /// Observer with all parameters that affect the answers, as JSON; `"human"` for a person.
    pub observer: serde_json::Value,
    /// Apparatus with all settings that affect the stimuli, as JSON.
    pub apparatus: serde_json::Value,
    /// Files that determine the stimuli, with their hashes; empty in logs of earlier revisions.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub inputs: Vec<InputFile>,
}

/// Origin of the answers of a sitting.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ObserverKind {
    /// A person.
    Human,
    /// A simulated observer with known thresholds.
    Simulated,
}

impl ObserverKind {
    /// Returns the restriction to attach to every result; `None` for people.
    #[must_use]
    pub fn restriction(self) -> Option<&'static str> {
        match self {
            Self::Human => None,
            Self::Simulated => Some("simulated observers, no person was tested"),
        }
    }
}

words! { ObserverKind { Human = "human", Simulated = "simulated" } }

/// File that determines the stimuli of a sitting.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct InputFile {
    /// Purpose: plugin and parameter such as `measured.curve`, or the plugin's name such as `spring` for the file of a plugin.
    pub used_as: String,
    /// File name without folder.
    pub name: String,
    /// Hash of the content, as text.
    pub hash: String,
}

impl Begin {
    /// Describes the first difference from an earlier sitting's configuration; `None` if they are equal. Subject, person,
    /// version and input files may differ.
    #[must_use]
    pub fn differs(&self, earlier: &Self) -> Option<String> {
        let what = Plan::differs(self.plan.as_ref(), earlier.plan.as_ref())
            .or_else(|| another("protocol", &earlier.protocol, &self.protocol))
            .or_else(|| {
                (self.seed != earlier.seed).then(|| format!("--seed {}, not {}", earlier.seed, self.seed))
            })
            .or_else(|| another("observer", &earlier.observer, &self.observer))
            .or_else(|| another("apparatus", &earlier.apparatus, &self.apparatus));
        what.map(|what| format!("begun with {what}"))
    }

    /// Returns the first input file whose content differs from the earlier file of the same purpose, and the earlier file;
    /// `None` if there is none.
    #[must_use]
    pub fn changed_input<'b>(&'b self, earlier: &'b Self) -> Option<(&'b InputFile, &'b InputFile)> {
        self.inputs.iter().find_map(|now| {
            let of_same_use = |then: &&InputFile| then.used_as == now.used_as && then.hash != now.hash;
            earlier.inputs.iter().find(of_same_use).map(|then| (now, then))
        })
    }

    /// Returns true for the sitting of a person; its events have times of day.
    #[must_use]
    pub fn is_of_a_person(&self) -> bool {
        self.observer_kind() == ObserverKind::Human
    }

    /// Returns the origin of the answers.
    #[must_use]
    pub fn observer_kind(&self) -> ObserverKind {
        if self.observer == serde_json::json!("human") {
            ObserverKind::Human
        } else {
            ObserverKind::Simulated
        }
    }

    /// Returns the servo rate, Hz; `None` if no scene was presented.
    #[must_use]
    pub fn rate_hz(&self) -> Option<f64> {
        let scene = self.apparatus.get("scene").filter(|scene| scene.is_object()).unwrap_or(&self.apparatus);
        scene.get("rate_hz")?.as_f64()
    }

    /// Returns the exclusion rules of the study file; no rules without a study file.
    #[must_use]
    pub fn exclusion(&self) -> ExclusionRules {
        self.plan.as_ref().map(|plan| plan.exclusion.clone()).unwrap_or_default()
    }

    /// Returns a digest of seed, protocol, observer and apparatus (16 hexadecimal digits of a SHA-256), equal for all subjects
    /// of a study.
    #[must_use]
    pub fn config_hash(&self) -> String {
        let text = serde_json::to_string(&(self.seed, &self.protocol, &self.observer, &self.apparatus));
        let digest = Sha256::digest(text.unwrap_or_default().as_bytes());
        hexadecimal(&digest).chars().take(16).collect()
    }
}

/// Study file, fixed before data collection.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// File name.
    pub file: String,
    /// SHA-256 of the text, hexadecimal.
    pub sha256: String,
    /// Full text, so that a change can be described; empty in early logs.
    #[serde(skip_serializing_if = "String::is_empty", default)]
    pub text: String,
    /// Exclusion rules.
    #[serde(skip_serializing_if = "ExclusionRules::are_none", default)]
    pub exclusion: ExclusionRules,
}

impl Plan {
    /// Describes the difference of the current study file from the earlier one; `None` if they are equal. Only the texts count,
    /// not the file names. The number of subjects and the data folder may differ: neither affects a sitting.
    pub(crate) fn differs(now: Option<&Self>, earlier: Option<&Self>) -> Option<String> {
        match (earlier, now) {
            (None, None) => None,
            (Some(earlier), None) => {
                Some(format!("the study file {}; now there is no study file", earlier.file))
            }
            (None, Some(now)) => Some(format!("no study file; now there is {}", now.file)),
            (Some(earlier), Some(now)) if earlier.sha256 == now.sha256 => None,
            (Some(earlier), Some(now)) => {
                let [before, after] = [earlier, now].map(|plan| without_size_and_folder(&plan.text));
                let is_same = !before.is_empty() && before == after;
                (!is_same).then(|| format!("another version of {}{}", now.file, changed(&before, &after)))
            }
        }
    }
}

/// Empties the lines of a study file that set the number of subjects or the data folder; line numbers do not change.
fn without_size_and_folder(text: &str) -> String {
    let sets = |line: &str, key: &str| {
        line.trim_start().strip_prefix(key).is_some_and(|rest| rest.trim_start().starts_with('='))
    };
    let lines = text.split_inclusive('\n');
    lines
        .map(|line| if ["subjects", "out"].iter().any(|key| sets(line, key)) { "\n" } else { line })
        .collect()
}

/// Describes the changed lines between two versions of a text; empty if `before` is empty, as for an early log that has only
/// the digest.
fn changed(before: &str, after: &str) -> String {
    if before.is_empty() {
        return String::new();
    }
    let without_blanks = |text: &str| text.split_whitespace().collect::<String>();
    if without_blanks(before) == without_blanks(after) {
        let lines = before.split('\n').zip(after.split('\n'));
        let same = lines.take_while(|(one, other)| one == other).count();
        return format!(": from line {} on, only blanks or line ends differ", same + 1);
    }
    let [before, after] = [before, after].map(|text| text.lines().collect::<Vec<_>>());
    let same = before.iter().zip(&after).take_while(|(one, other)| one == other).count();
    let rest = before.len().min(after.len()) - same;
    let backwards = before.iter().rev().zip(after.iter().rev()).take(rest);
    let same_end = backwards.take_while(|(one, other)| one == other).count();
    let middle = |lines: &[&str]| {
        let lines = lines.get(same..lines.len() - same_end).unwrap_or_default().join("; ");
        if lines.is_empty() { "nothing".to_owned() } else { format!("`{lines}`") }
    };
    format!(": from line {} on: {}, now {}", same + 1, middle(&before), middle(&after))
}

/// Describes a changed part of the configuration with its first difference; `None` if the part is equal.
pub(crate) fn another<T: PartialEq + Serialize>(what: &str, earlier: &T, now: &T) -> Option<String> {
    if earlier == now {
        return None;
    }
    let [earlier, now] = [earlier, now].map(|part| serde_json::to_value(part).unwrap_or_default());
    let place = difference(&earlier, &now, String::new());
    Some(place.map_or(format!("another {what}"), |place| format!("another {what}: {place}")))
}

/// Returns the path of the first difference between two JSON values, with both values; `None` if they are equal.
fn difference(earlier: &Value, now: &Value, place: String) -> Option<String> {
    /// Longest value that is shown, characters.
    const MOST: usize = 60;
    match (earlier, now) {
        (Value::Object(one), Value::Object(two)) => {
            one.keys().chain(two.keys().filter(|key| !one.contains_key(*key))).find_map(|key| {
                let place = if place.is_empty() { key.clone() } else { format!("{place}.{key}") };
                difference(one.get(key).unwrap_or(&Value::Null), two.get(key).unwrap_or(&Value::Null), place)
            })
        }
        (earlier, now) if earlier == now => None,
        (earlier, now) => {
            let [earlier, now] = [earlier, now].map(|value| match value.to_string() {
                text if text.chars().count() > MOST => text.chars().take(MOST).chain(['…']).collect(),
                text => text,
            });
            let place = if place.is_empty() { place } else { format!("{place} ") };
            Some(format!("{place}{earlier}, not {now}"))
        }
    }
}

/// Optional data on a person, for the list of participants (BIDS).
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Person {
    /// Age, years.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub age: Option<u16>,
    /// Sex, one word.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub sex: Option<String>,
    /// Preferred hand: left, right or ambidextrous.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub handedness: Option<String>,
}

/// Trial with its answer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrialEvent {
    /// Presented trial.
    pub trial: Trial,
    /// Answer of the subject.
    pub response: Response,
    /// Verdict on the answer.
    pub verdict: Verdict,
    /// Measurements during the presentation.
    pub exploration: Exploration,
}

/// Value of `chain` before the first line.
const CHAIN_START: &str = "flotor-study-log";

/// Returns the `chain` of a line: the SHA-256 of the previous line's chain and of the chained text `event`.
fn chain(before: &str, event: &str) -> String {
    let mut digest = Sha256::new();
    digest.update(before.as_bytes());
    digest.update(event.as_bytes());
    hexadecimal(&digest.finalize())
}

/// Returns the SHA-256 of a text, hexadecimal.
#[must_use]
pub fn digest(text: &str) -> String {
    hexadecimal(&Sha256::digest(text.as_bytes()))
}

fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Formats a line of the log without the line end.
fn line(chain: &str, event: &str) -> String {
    format!("{{\"chain\":\"{chain}\",\"event\":{event}}}")
}

/// Appends the time to an event, giving the chained text.
fn stamped(event: &str, time: TimeOfDay) -> String {
    format!("{event},\"time\":\"{time}\"")
}

/// Splits the chained text into event and time; without a time, the text is the event, which ends with a brace.
fn unstamped(chained: &str) -> (&str, Option<&str>) {
    let time = chained.strip_suffix('"').and_then(|rest| rest.rsplit_once(",\"time\":\""));
    time.map_or((chained, None), |(event, time)| (event, Some(time)))
}

/// Splits a line into `chain` and the chained text; `None` for another syntax.
fn parts(line: &str) -> Option<(&str, &str)> {
    let rest = line.strip_prefix("{\"chain\":\"")?;
    let (chain, rest) = rest.split_once("\",\"event\":")?;
    Some((chain, rest.strip_suffix('}')?))
}

#[cfg(test)]
mod tests;
