//! A recording of a remote run.

use crate::link::LinkError;
use crate::remote::{Remote, Told};
use flotor_record::{Note, RecordError, Recorder, Severity};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// How long to wait for messages before looking whether to stop.
const LOOK_PERIOD: Duration = Duration::from_millis(100);

/// Why there is no recording.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum KeepError {
    /// The network.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The file.
    #[error(transparent)]
    Record(#[from] RecordError),
}

/// What came of a recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Kept {
    /// Ticks in the file.
    pub ticks: u64,
    /// Ticks that were lost on the way. The recording has a note at each gap.
    pub lost: u64,
    /// How it ends.
    pub end: RecordingEnd,
}

/// How a recording ends.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RecordingEnd {
    /// The run is over; its message.
    Over(String),
    /// Whoever recorded has stopped.
    Stopped,
    /// The bridge went without a word.
    Cut,
}

/// Records one remote run, from now to its end or until told to stop.
///
/// # Errors
/// [`KeepError`].
pub fn keep(remote: &Remote, file: &Path, stop: &AtomicBool) -> Result<Kept, KeepError> {
    let mut kept = Kept { ticks: 0, lost: 0, end: RecordingEnd::Stopped };
    let Some((_, run)) = remote.wait_for_run(stop)? else { return Ok(kept) };
    let mut recorder = Recorder::create(file, &run)?;
    while !stop.load(Ordering::Relaxed) {
        match remote.next(LOOK_PERIOD) {
            None => {}
            Some(Told::Tick(record)) => {
                let lost = remote.lost();
                if lost > kept.lost {
                    let text = format!("{} ticks were lost on the way here", lost - kept.lost);
                    let source = "flotor bridge".to_owned();
                    recorder.note(&Note {
                        time_ns: record.time_ns,
                        severity: Severity::Warning,
                        source,
                        text,
                    })?;
                    kept.lost = lost;
                }
                recorder.record(&record)?;
                kept.ticks += 1;
            }
            Some(Told::Change(change)) => recorder.change(&change)?,
            Some(Told::End(end)) => {
                kept.end = RecordingEnd::Over(end.words);
                break;
            }
            Some(Told::Gone) => {
                kept.end = RecordingEnd::Cut;
                break;
            }
        }
    }
    recorder.finish()?;
    Ok(kept)
}
