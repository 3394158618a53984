//! Lines of a log: verifies the hash chain and the syntax of the events, of any experiment.

use super::error::{LogError, LogProblem};
use super::{CHAIN_START, chain, parts, unstamped};
use crate::time_of_day::TimeOfDay;
use flotor_hal::read_file;
use serde::de::DeserializeOwned;
use std::path::Path;

/// Maximum size of a log, bytes; enough for hundreds of hours.
const MOST_BYTES: u64 = 256 << 20;

/// End of a log that was read: where a writer continues.
#[derive(Clone, Debug, Default)]
pub(crate) struct LogEnd {
    /// Length of the complete lines, bytes.
    pub(super) complete_bytes: u64,
    /// Length of the file, bytes.
    pub(super) read_bytes: u64,
    /// `chain` of the last complete line.
    pub(super) chain: String,
}

/// Reads a log and checks its chain; passes each event with its time of day to `take`. An incomplete last line is ignored.
///
/// # Errors
/// [`LogError`] with line and reason, also for the reason that `take` returns.
pub(crate) fn read_lines<E: DeserializeOwned>(
    path: &Path,
    mut take: impl FnMut(E, Option<TimeOfDay>) -> Result<(), LogProblem>,
) -> Result<LogEnd, LogError> {
    let bytes =
        read_file(path, MOST_BYTES).map_err(|cause| LogError::file(path, "cannot read the log", cause))?;
    let complete = bytes.iter().rposition(|byte| *byte == b'\n').map_or(0, |end| end + 1);
    let whole = bytes.get(..complete).unwrap_or_default();
    let mut before = CHAIN_START.to_owned();
    for (index, bytes) in whole.split_inclusive(|byte| *byte == b'\n').enumerate() {
        let at = |problem: LogProblem| LogError { path: path.into(), line: index + 1, problem };
        let not_text = || at(LogProblem::Text("the file is not UTF-8".to_owned()));
        let text = std::str::from_utf8(bytes).map_err(|_| not_text())?;
        let text = text.strip_suffix('\n').unwrap_or(text);
        // Windows programs or git may have changed the line ends to CRLF.
        let text = text.strip_suffix('\r').unwrap_or(text);
        let (found, event) = parts(text).ok_or_else(|| {
            at(LogProblem::Text("the line does not consist of `chain` and `event`".to_owned()))
        })?;
        before = chain(&before, event);
        if found != before {
            return Err(at(LogProblem::Chain));
        }
        let not_read = |error: &dyn std::fmt::Display| at(LogProblem::Unknown(error.to_string()));
        let (event, time) = unstamped(event);
        let time: Option<TimeOfDay> = time.map(str::parse).transpose().map_err(|error| not_read(&error))?;
        let event: E = serde_json::from_str(event).map_err(|error| not_read(&error))?;
        take(event, time).map_err(at)?;
    }
    Ok(LogEnd { complete_bytes: complete as u64, read_bytes: bytes.len() as u64, chain: before })
}
