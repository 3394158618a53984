//! The event log of a sitting: one line of JSON per event, on disk before the next trial begins.
//!
//! ```text
//! {"chain":"<64 hexadecimal digits>","event":{"begin":{...}}}
//! {"chain":"...","event":{"trial":{...}}}
//! {"chain":"...","event":{"trial":{...}},"time":"2026-11-25T18:34:09.123Z"}    with a person
//! ```
//!
//! `chain` is the SHA-256 of the chain of the line before and of all that follows it on its own line, so a changed, missing or
//! exchanged line breaks the chain from there on: a guard against accidents. Whoever means to forge a log can compute the chain
//! anew. A last line without its end is what a killed process leaves: the
//! event it would have told never happened.

mod incident;
mod reader;
mod writer;

pub use incident::Incident;
pub use reader::{LogError, LogProblem, SittingLog, TrialRecord};
pub use writer::LogWriter;

use crate::exclusion::ExclusionRules;
use crate::protocol::{Protocol, SubjectNumber};
use crate::sitting::Verdict;
use crate::time_of_day::TimeOfDay;
use crate::trial::{Exploration, Response, Trial};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use sha2::{Digest, Sha256};

/// Revision of the format: 2 has times of day and incidents, 3 has answers that were taken back, 4 has the contents of files and the
/// time of day that was set, 5 has sittings that broke off without a reason.
pub const FORMAT: u32 = 5;

/// What a line says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Event {
    /// The first line: everything needed to do it again.
    Begin(Box<Begin>),
    /// A trial was presented and answered.
    Trial(Box<TrialEvent>),
    /// The answer to the last trial was taken back; the trial is open again, and what followed from the answer is void.
    Withdrawn {
        /// The trial.
        trial: u32,
    },
    /// The sitting was taken up again.
    Resume {
        /// Trials found and replayed.
        trials: u32,
        /// Version of the program.
        version: String,
    },
    /// Something the experimenter wants to be known.
    Note {
        /// In their words.
        text: String,
    },
    /// Something interrupted or disturbed the sitting.
    Incident(Incident),
    /// Everything was presented.
    End {
        /// Presentations in all.
        trials: u32,
    },
}

/// The first line of a log.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Begin {
    /// Revision of the format.
    pub format: u32,
    /// Version of the program.
    pub version: String,
    /// Who sits.
    pub subject: SubjectNumber,
    /// Seed of order, presentation and simulated answers.
    pub seed: u64,
    /// The study file that was followed, if there was one.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub plan: Option<Plan>,
    /// The experiment.
    pub protocol: Protocol,
    /// What is known of the person; nothing is requested.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub person: Option<Person>,
    /// Who answers, with everything that decides how, as JSON.
    pub observer: serde_json::Value,
    /// What presents the stimuli, with everything that decides how, as JSON.
    pub apparatus: serde_json::Value,
    /// Files that decide what is presented, by their content; a log of an earlier revision has none.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub inputs: Vec<InputFile>,
}

/// Origin of the answers of a sitting.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ObserverKind {
    /// A person.
    Human,
    /// A program with known thresholds.
    Simulated,
}

impl ObserverKind {
    /// Returns the word of the tables.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Human => "human",
            Self::Simulated => "simulated",
        }
    }

    /// Returns the restriction that every result of such answers must carry; none for people.
    #[must_use]
    pub fn restriction(self) -> Option<&'static str> {
        match self {
            Self::Human => None,
            Self::Simulated => Some("simulated observers, nobody was tested"),
        }
    }
}

/// A file that decides what a sitting presents.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct InputFile {
    /// Its use: `measured.curve`, `spring` for the file of a plugin.
    pub used_as: String,
    /// Its name, without its folder.
    pub name: String,
    /// Hash of its content, as text.
    pub hash: String,
}

impl Begin {
    /// What makes this a sitting of another study than an earlier one, as text; the subject and the version may differ.
    #[must_use]
    pub fn differs(&self, earlier: &Self) -> Option<String> {
        let own = |what: String, is_same: bool| (!is_same).then_some(what);
        let what = Plan::differs(self.plan.as_ref(), earlier.plan.as_ref())
            .or_else(|| {
                own(another("protocol", &earlier.protocol, &self.protocol), self.protocol == earlier.protocol)
            })
            .or_else(|| own(format!("--seed {}, not {}", earlier.seed, self.seed), self.seed == earlier.seed))
            .or_else(|| {
                own(another("observer", &earlier.observer, &self.observer), self.observer == earlier.observer)
            })
            .or_else(|| {
                own(
                    another("apparatus", &earlier.apparatus, &self.apparatus),
                    self.apparatus == earlier.apparatus,
                )
            });
        what.map(|what| format!("begun with {what}"))
    }

    /// The first file with another content than the file of the same use in an earlier sitting, and that file.
    #[must_use]
    pub fn changed_input<'b>(&'b self, earlier: &'b Self) -> Option<(&'b InputFile, &'b InputFile)> {
        self.inputs.iter().find_map(|now| {
            let of_same_use = |then: &&InputFile| then.used_as == now.used_as && then.hash != now.hash;
            earlier.inputs.iter().find(of_same_use).map(|then| (now, then))
        })
    }

    /// Returns true for the sitting of a person, where times of day mean something.
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

    /// Rate of the servo, Hz, where a scene was presented.
    #[must_use]
    pub fn rate_hz(&self) -> Option<f64> {
        let scene = self.apparatus.get("scene").filter(|scene| scene.is_object()).unwrap_or(&self.apparatus);
        scene.get("rate_hz")?.as_f64()
    }

    /// What does not count, as the study file said.
    #[must_use]
    pub fn exclusion(&self) -> ExclusionRules {
        self.plan.as_ref().map(|plan| plan.exclusion.clone()).unwrap_or_default()
    }

    /// Digest of the configuration: equal for sittings that differ in the subject only.
    #[must_use]
    pub fn config_hash(&self) -> String {
        let text = serde_json::to_string(&(self.seed, &self.protocol, &self.observer, &self.apparatus));
        let digest = Sha256::digest(text.unwrap_or_default().as_bytes());
        hexadecimal(&digest).chars().take(16).collect()
    }
}

/// A study file: what was decided before there were data.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// Its name.
    pub file: String,
    /// SHA-256 of its text.
    pub sha256: String,
    /// Its text, so that a change can be shown.
    #[serde(skip_serializing_if = "String::is_empty", default)]
    pub text: String,
    /// What does not count.
    #[serde(skip_serializing_if = "ExclusionRules::are_none", default)]
    pub exclusion: ExclusionRules,
}

impl Plan {
    /// How the file that is followed now differs from the earlier one, in words; an equal digest is an equal text, whatever its name.
    /// The number of subjects and the folder of the data may change: neither is a part of what a sitting presents.
    fn differs(now: Option<&Self>, earlier: Option<&Self>) -> Option<String> {
        match (earlier, now) {
            (None, None) => None,
            (Some(earlier), None) => Some(format!("the study file {}, and there is none now", earlier.file)),
            (None, Some(now)) => Some(format!("no study file, and there is {} now", now.file)),
            (Some(earlier), Some(now)) if earlier.sha256 == now.sha256 => None,
            (Some(earlier), Some(now)) => {
                let [before, after] = [earlier, now].map(|plan| without_size_and_folder(&plan.text));
                let is_same = !before.is_empty() && before == after;
                (!is_same).then(|| format!("another version of {}{}", now.file, changed(&before, &after)))
            }
        }
    }
}

/// Returns the text of a study file without the content of the lines that set the number of subjects or the folder of the data; all
/// lines keep their numbers.
fn without_size_and_folder(text: &str) -> String {
    let sets = |line: &str, key: &str| {
        line.trim_start().strip_prefix(key).is_some_and(|rest| rest.trim_start().starts_with('='))
    };
    let lines = text.split_inclusive('\n');
    lines
        .map(|line| if ["subjects", "out"].iter().any(|key| sets(line, key)) { "\n" } else { line })
        .collect()
}

/// The lines that changed from one version of a text to the next; nothing of an early log, which has the digest alone.
fn changed(before: &str, after: &str) -> String {
    if before.is_empty() {
        return String::new();
    }
    let without_blanks = |text: &str| text.split_whitespace().collect::<String>();
    if without_blanks(before) == without_blanks(after) {
        let lines = before.split('\n').zip(after.split('\n'));
        let same = lines.take_while(|(one, other)| one == other).count();
        return format!(": line {} on, in blanks or line ends only", same + 1);
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
    format!(": line {} on had {}, and has {} now", same + 1, middle(&before), middle(&after))
}

/// What is another part of a sitting, with the first place where the two differ.
fn another(what: &str, earlier: &impl Serialize, now: &impl Serialize) -> String {
    let [earlier, now] =
        [serde_json::to_value(earlier), serde_json::to_value(now)].map(Result::unwrap_or_default);
    match difference(&earlier, &now, String::new()) {
        Some(place) => format!("another {what}: {place}"),
        None => format!("another {what}"),
    }
}

/// The first place where two values differ, with both.
fn difference(earlier: &Value, now: &Value, place: String) -> Option<String> {
    /// Longer values are not shown.
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

/// What BIDS has columns for, as far as somebody has said it.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Person {
    /// Age, years.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub age: Option<u16>,
    /// Sex, in a word.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub sex: Option<String>,
    /// The hand that is preferred: left, right or ambidextrous.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub handedness: Option<String>,
}

/// A trial with what came of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrialEvent {
    /// What was presented.
    pub trial: Trial,
    /// The answer.
    pub response: Response,
    /// What it was worth.
    pub verdict: Verdict,
    /// What happened meanwhile.
    pub exploration: Exploration,
}

/// The chain before the first line.
const CHAIN_START: &str = "flotor-study-log";

/// The chain of a line.
fn chain(before: &str, event: &str) -> String {
    let mut digest = Sha256::new();
    digest.update(before.as_bytes());
    digest.update(event.as_bytes());
    hexadecimal(&digest.finalize())
}

/// SHA-256 of a text, as the log names what was shown.
#[must_use]
pub fn digest(text: &str) -> String {
    hexadecimal(&Sha256::digest(text.as_bytes()))
}

fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// A line as it is written, without its end.
fn line(chain: &str, event: &str) -> String {
    format!("{{\"chain\":\"{chain}\",\"event\":{event}}}")
}

/// What is chained of an event with a time.
fn stamped(event: &str, time: TimeOfDay) -> String {
    format!("{event},\"time\":\"{time}\"")
}

/// Event and time of what is chained; an event ends with a brace.
fn unstamped(chained: &str) -> (&str, Option<&str>) {
    let time = chained.strip_suffix('"').and_then(|rest| rest.rsplit_once(",\"time\":\""));
    time.map_or((chained, None), |(event, time)| (event, Some(time)))
}

/// Chain of a line, and what is chained of it.
fn parts(line: &str) -> Option<(&str, &str)> {
    let rest = line.strip_prefix("{\"chain\":\"")?;
    let (chain, rest) = rest.split_once("\",\"event\":")?;
    Some((chain, rest.strip_suffix('}')?))
}

#[cfg(test)]
mod tests;
