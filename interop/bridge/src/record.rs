//! Recording of a remote run.

use crate::link::LinkError;
use crate::remote::{Remote, RemoteEvent};
use flotor_record::{Note, RecordError, Recorder, Severity};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Timeout for the next event, and so the poll interval of the stop flag.
const LOOK_PERIOD: Duration = Duration::from_millis(100);

/// Error of a recording.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecordingError {
    /// Error of the network.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// Error of the file.
    #[error(transparent)]
    Record(#[from] RecordError),
}

/// Result of a recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Recorded {
    /// Number of ticks in the file.
    pub ticks: u64,
    /// Number of ticks lost on the network or in the queue. The recording contains a note at each gap.
    pub lost: u64,
    /// Cause of the end.
    pub end: RecordingEnd,
}

/// Cause of the end of a recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RecordingEnd {
    /// The run ended, with this message.
    Over(String),
    /// The recorder was stopped.
    Stopped,
    /// The bridge disappeared without an end message.
    Cut,
}

/// Waits for a remote run and records it to `file` until the run ends, the bridge disappears, or `stop` is set. Creates no file
/// if stopped before there is a run. Not real-time.
///
/// # Errors
/// [`RecordingError`] of the network or of the file.
pub fn record(remote: &Remote, file: &Path, stop: &AtomicBool) -> Result<Recorded, RecordingError> {
    let mut recorded = Recorded { ticks: 0, lost: 0, end: RecordingEnd::Stopped };
    let Some((_, run)) = remote.wait_for_run(stop)? else { return Ok(recorded) };
    let mut recorder = Recorder::create(file, &run)?;
    while !stop.load(Ordering::Relaxed) {
        match remote.next(LOOK_PERIOD) {
            None => {}
            Some(RemoteEvent::Tick(record)) => {
                let lost = remote.lost();
                if lost > recorded.lost {
                    let text = format!("the network lost {} ticks", lost - recorded.lost);
                    let source = "flotor bridge".to_owned();
                    recorder.note(&Note {
                        time_ns: record.time_ns,
                        severity: Severity::Warning,
                        source,
                        text,
                    })?;
                    recorded.lost = lost;
                }
                recorder.record(&record)?;
                recorded.ticks += 1;
            }
            Some(RemoteEvent::Change(change)) => recorder.change(&change)?,
            Some(RemoteEvent::End(end)) => {
                recorded.end = RecordingEnd::Over(end.words);
                break;
            }
            Some(RemoteEvent::Gone) => {
                recorded.end = RecordingEnd::Cut;
                break;
            }
        }
    }
    recorder.finish()?;
    Ok(recorded)
}
