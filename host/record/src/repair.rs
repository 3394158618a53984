//! Repair of a truncated recording: copies its complete chunks to a new file with an end, which every reader of MCAP accepts.

use crate::reader::{Damage, ReadError, Recording};
use crate::schema::Topic;
use crate::writer::{RecordError, Recorder};
use std::path::{Path, PathBuf};

/// Error of repairing a recording.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RepairError {
    /// The recording cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The repaired recording cannot be written.
    #[error(transparent)]
    Write(#[from] RecordError),
    /// The recording is complete: there is nothing to repair.
    #[error("`{}` is complete: there is nothing to repair", .0.display())]
    Complete(PathBuf),
}

/// Result of a repair: extent of the new file, and damage of the old.
#[derive(Debug)]
pub struct Repaired {
    /// Ticks in the new file, counted once for each device.
    pub ticks: u64,
    /// Recorded time of the last tick, ns.
    pub end_ns: u64,
    /// Planned duration of the run, s.
    pub planned_s: f64,
    /// Damage in the middle of the file, if the file is not only truncated: messages after the damage are lost.
    pub damage: Option<Damage>,
}

/// Copies the complete chunks of a truncated or damaged recording to a new file, message by message and bit for bit, and
/// closes it with index and end. The new file is marked as repaired: its [`Recording::ending`] is
/// [`Ending::CutOff`](crate::Ending::CutOff). The old file is not changed. Not real-time.
///
/// # Errors
/// If the recording cannot be read, the new file cannot be written, or the recording is complete; for a complete
/// recording the new file is removed again.
pub fn repair(from: &Path, to: &Path) -> Result<Repaired, RepairError> {
    let mut recording = Recording::open(from)?;
    let is_truncated = !recording.has_end();
    let mut recorder = Recorder::create_repaired(to, recording.run())?;
    let mut repaired = Repaired { ticks: 0, end_ns: 0, planned_s: recording.run().duration_s, damage: None };
    loop {
        match recording.next_message() {
            Ok(Some(message)) => {
                if message.topic == Topic::Tick {
                    (repaired.ticks, repaired.end_ns) = (repaired.ticks + 1, message.time_ns);
                }
                recorder.copy(&message)?;
            }
            Ok(None) => break,
            Err(damage) => {
                repaired.damage = Some(damage);
                break;
            }
        }
    }
    if !is_truncated && repaired.damage.is_none() {
        recorder.discard();
        return Err(RepairError::Complete(from.into()));
    }
    recorder.finish()?;
    Ok(repaired)
}
