//! Parser of scripts: checks every number and reports errors with file, line and key.

use super::{Grip, Leg, Movement, Place, Script};
use crate::units::{MM, nanoseconds};
use flotor_hal::glam::DVec3;
use flotor_hal::{TextProblem, read_text};
use serde::de::Error;
use serde::{Deserialize, Deserializer};
use std::fmt::{self, Display};
use std::ops::Range;
use std::path::Path;

/// Size limit of a script file, bytes: a person writes a few hundred.
const MAX_BYTES: u64 = 1 << 20;
/// Limit of movements in a script, repetitions included.
const MAX_LEGS: usize = 10_000;
/// Longest movement, s.
const LONGEST_S: f64 = 3600.0;
/// Shortest movement, s; anything shorter is an impact.
const SHORTEST_S: f64 = 0.01;
/// Largest distance of a place along each axis, mm: a relaxed hand must aim deep into the object it presses.
const FARTHEST_MM: f64 = 100.0;
/// Largest rotation about each axis, degrees.
const MOST_TURNED_DEG: f64 = 45.0;
/// Largest intended force along each axis, N.
const STRONGEST_N: f64 = 100.0;
/// Largest number of force pulses in a row.
const MOST_PULSES: u32 = 100;
/// Smallest frequency, Hz.
const SLOWEST_HZ: f64 = 0.05;
/// Largest frequency, Hz: twice the limit of a hand (about 10 Hz).
const FASTEST_HZ: f64 = 20.0;

/// Error in a script. Prints file, line, key, and the expected content.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ScriptError {
    /// Path of the file, or name of a built-in script.
    pub file: String,
    /// Line, from 1; 0 for the file as a whole.
    pub line: usize,
    /// Key and problem.
    pub problem: String,
}

impl fmt::Display for ScriptError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line {
            0 => write!(f, "{}: {}", self.file, self.problem),
            line => write!(f, "{}:{line}: {}", self.file, self.problem),
        }
    }
}

impl std::error::Error for ScriptError {}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ScriptText {
    #[serde(default, rename = "title")]
    _title: String,
    grip: Option<Grip>,
    #[serde(default)]
    repeat: Repeat,
    step: Vec<StepText>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
enum StepText {
    Move(MoveText),
    Hold(HoldText),
    Oscillate(OscillateText),
    Push(PushText),
    Release(ReleaseText),
}

#[derive(Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
struct MoveText {
    to_mm: Option<Lengths>,
    to_deg: Option<Angles>,
    duration_s: Duration,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
struct HoldText {
    duration_s: Duration,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
struct OscillateText {
    amplitude_mm: Option<Lengths>,
    amplitude_deg: Option<Angles>,
    frequency_hz: Frequency,
    duration_s: Duration,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
struct PushText {
    force_n: Forces,
    frequency_hz: Frequency,
    pulses: Pulses,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
struct ReleaseText {}

/// Defines types whose values are checked when they are read.
macro_rules! checked {
    ($($(#[$doc:meta])* $name:ident($inner:ty) from $text:ty: |$value:ident| $check:expr;)+) => {
        $(
            $(#[$doc])*
            #[derive(Clone, Copy)]
            struct $name($inner);

            impl<'de> Deserialize<'de> for $name {
                fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                    let $value = <$text>::deserialize(deserializer)?;
                    $check.map(Self).map_err(D::Error::custom)
                }
            }
        )+
    };
}

checked! {
    /// Number of repetitions of the sequence.
    Repeat(usize) from i64: |times| whole(times, MAX_LEGS);
    /// Number of pulses.
    Pulses(u32) from i64: |count| whole(count, MOST_PULSES);
    /// Duration, s.
    Duration(f64) from f64: |seconds| within(seconds, SHORTEST_S, LONGEST_S, "s");
    /// Frequency, Hz.
    Frequency(f64) from f64: |hertz| within(hertz, SLOWEST_HZ, FASTEST_HZ, "Hz");
    /// Lengths along x, y, z, m; mm in the text.
    Lengths(DVec3) from [f64; 3]: |millimetres| three(millimetres, FARTHEST_MM, "mm").map(|all| all * MM);
    /// Rotation vector, rad; degrees in the text.
    Angles(DVec3) from [f64; 3]: |degrees| {
        three(degrees, MOST_TURNED_DEG, "degrees").map(|all| all.map(f64::to_radians))
    };
    /// Forces along x, y, z in N.
    Forces(DVec3) from [f64; 3]: |newtons| three(newtons, STRONGEST_N, "N");
}

impl Default for Repeat {
    fn default() -> Self {
        Self(1)
    }
}

/// Checks a count of 1 to `most`.
fn whole<T: TryFrom<i64> + PartialOrd + From<u8> + Display>(count: i64, most: T) -> Result<T, String> {
    let usable = T::try_from(count).ok().filter(|count| *count >= T::from(1) && *count <= most);
    usable.ok_or_else(|| format!("{count} is outside 1 to {most}"))
}

fn within(number: f64, least: f64, most: f64, unit: &str) -> Result<f64, String> {
    // Written so that NaN is rejected too.
    if number >= least && number <= most {
        Ok(number)
    } else {
        Err(format!("{number} is outside {least} to {most} {unit}"))
    }
}

fn three(numbers: [f64; 3], most: f64, unit: &str) -> Result<DVec3, String> {
    numbers.iter().try_for_each(|number| within(*number, -most, most, unit).map(|_| ()))?;
    Ok(DVec3::from_array(numbers))
}

/// Reads a script file.
pub(super) fn read_file(path: &Path) -> Result<Script, ScriptError> {
    let file = path.display().to_string();
    let wrong = |problem: String| ScriptError { file: file.clone(), line: 0, problem };
    let names = Script::NAMES.join(", ");
    let size = std::fs::metadata(path).map_err(|error| {
        wrong(format!("the script cannot be read: {error}; a script is a TOML file or one of {names}"))
    })?;
    if !size.is_file() {
        return Err(wrong("the path is not a regular file; name a TOML file".to_owned()));
    }
    if size.len() > MAX_BYTES {
        let bytes = size.len();
        return Err(wrong(format!(
            "the file has {bytes} bytes; name a TOML file of at most {MAX_BYTES} bytes"
        )));
    }
    let text = read_text(path, "the script").map_err(|TextProblem { line, problem }| ScriptError {
        line,
        problem,
        file: file.clone(),
    })?;
    read(&file, &text)
}

/// Parses a script.
pub(super) fn read(file: &str, text: &str) -> Result<Script, ScriptError> {
    let script: ScriptText = toml::from_str(text).map_err(|error| {
        let message = error.message().lines().next().unwrap_or("not valid TOML");
        complaint(file, text, error.span(), message)
    })?;
    let whole = |problem: String| ScriptError { file: file.to_owned(), line: 0, problem };
    let count = script.step.len().saturating_mul(script.repeat.0);
    if script.step.is_empty() {
        return Err(whole("`step` is empty; write at least one [[step]]".to_owned()));
    }
    if count > MAX_LEGS {
        return Err(whole(format!(
            "the script has {count} movements, `repeat` included; write at most {MAX_LEGS}"
        )));
    }
    let releases = script.step.iter().position(|step| matches!(step, StepText::Release(_)));
    if let Some(index) = releases
        && (index + 1 < script.step.len() || script.repeat.0 > 1)
    {
        return Err(whole(format!(
            "[[step]] {} is `release`, which opens the hand permanently: make `release` the last step, without `repeat`",
            index + 1
        )));
    }
    Ok(laid_out(&script, count))
}

/// Lays out the movements in sequence.
fn laid_out(script: &ScriptText, count: usize) -> Script {
    let (mut from, mut start_ns) = (Place::HOME, 0);
    let mut legs = Vec::with_capacity(count);
    let mut release_ns = None;
    for step in script.step.iter().cycle().take(count) {
        let Some((movement, duration)) = movement(step, &from) else {
            release_ns = Some(start_ns);
            break;
        };
        let leg = Leg { start_ns, duration_ns: nanoseconds(duration.0), from, movement };
        (from, start_ns) = (leg.end(), leg.start_ns + leg.duration_ns);
        legs.push(leg);
    }
    Script { grip: script.grip, legs: legs.into(), release_ns }
}

/// Returns the movement of a step from a place, with its duration; `None` for a release.
fn movement(step: &StepText, from: &Place) -> Option<(Movement, Duration)> {
    let zero = DVec3::ZERO;
    Some(match step {
        StepText::Move(MoveText { to_mm, to_deg, duration_s }) => {
            let to = Place {
                position_m: to_mm.map_or(from.position_m, |to| to.0),
                rotation_rad: to_deg.map_or(from.rotation_rad, |to| to.0),
            };
            (Movement::Move { to }, *duration_s)
        }
        StepText::Hold(HoldText { duration_s }) => (Movement::Hold, *duration_s),
        StepText::Oscillate(OscillateText { amplitude_mm, amplitude_deg, frequency_hz, duration_s }) => {
            let amplitude = Place {
                position_m: amplitude_mm.map_or(zero, |amplitude| amplitude.0),
                rotation_rad: amplitude_deg.map_or(zero, |amplitude| amplitude.0),
            };
            (Movement::Oscillate { amplitude, frequency_hz: frequency_hz.0 }, *duration_s)
        }
        StepText::Push(PushText { force_n, frequency_hz, pulses }) => {
            // Whole pulses, so that the force ends at zero.
            let duration = Duration(f64::from(pulses.0) / frequency_hz.0);
            (Movement::Push { force_n: force_n.0, frequency_hz: frequency_hz.0 }, duration)
        }
        StepText::Release(ReleaseText {}) => return None,
    })
}

/// Builds an error for a position in the text, with line number and the key before that position.
fn complaint(file: &str, text: &str, span: Option<Range<usize>>, message: &str) -> ScriptError {
    let before = text.get(..span.map_or(0, |span| span.start)).unwrap_or(text);
    let line = before.matches('\n').count() + 1;
    let key = before.rsplit('\n').next().and_then(key_of_the_value);
    let key = key.filter(|key| !message.contains(&format!("`{key}`")));
    let problem = key.map_or_else(|| message.to_owned(), |key| format!("`{key}`: {message}"));
    ScriptError { file: file.to_owned(), line, problem }
}

/// Returns the key before a value, given the line up to the value: `step = { duration_s = ` has `duration_s`.
fn key_of_the_value(line: &str) -> Option<&str> {
    let (before, after) = line.rsplit_once('=')?;
    // After the equals sign a list may begin, but no other key.
    let is_value = after.chars().all(|c| !c.is_alphabetic());
    let key = before.trim_end().rsplit(|c: char| !(c.is_alphanumeric() || c == '_')).next()?;
    (is_value && !key.is_empty()).then_some(key)
}
