//! Recorded trajectories: the motion of a real hand as the intended motion of the simulated hand.
//!
//! Two kinds of file are supported. A recording of a run (`.mcap`) contains the pose of the handle at every tick. Any other
//! file is a table of comma-separated values with a header:
//!
//! ```text
//! time_s,x_m,y_m,z_m                      or      time_s,x_m,y_m,z_m,rx_rad,ry_rad,rz_rad
//! ```
//!
//! in the device frame, rotation as a rotation vector. Times increase from row to row and count from the first row; between two
//! rows, the intended pose is interpolated linearly. Before the first and after the last row the pose is constant.

mod mcap_file;
mod table;

use super::{Aim, Pose};
use crate::units::nanoseconds;
use flotor_hal::glam::{DQuat, DVec3};
use flotor_hal::{TextProblem, read_text};
use std::fmt;
use std::path::Path;
use std::sync::Arc;

/// Largest number of samples: hours of a run.
const MAX_SAMPLES: usize = 1 << 24;
/// Largest plausible coordinate of a handle, m: ten times the range of the device.
const FARTHEST_M: f64 = 0.12;

/// Intended poses of the hand over time, read from a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording(Arc<[Sample]>);

/// Recorded pose of the handle.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Sample {
    /// Time since the first sample, ns.
    time_ns: u64,
    pose: Pose,
}

/// Reason why a file is rejected as a trajectory. Prints file, place, and the expected content.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordingError {
    /// Path of the file.
    pub file: String,
    /// Place in the file (a line, a message) and problem.
    pub problem: String,
}

impl fmt::Display for RecordingError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.file, self.problem)
    }
}

impl std::error::Error for RecordingError {}

impl Recording {
    /// Reads a file. Not real-time.
    ///
    /// # Errors
    /// [`RecordingError`] if the file is unreadable or contains no trajectory.
    pub fn load(path: &Path) -> Result<Self, RecordingError> {
        let wrong = |problem: String| RecordingError { file: path.display().to_string(), problem };
        let unreadable =
            |error| wrong(format!("the file cannot be read: {error}; check the path and its permissions"));
        let is_recording = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("mcap"));
        let samples = if is_recording {
            mcap_file::read(flotor_hal::open_file(path).map_err(unreadable)?)
        } else {
            let read = read_text(path, "the table").and_then(|text| table::read(&text));
            read.map_err(|TextProblem { line, problem }| match line {
                0 => problem,
                line => format!("line {line}: {problem}"),
            })
        };
        samples.and_then(Self::new).map_err(wrong)
    }

    /// Creates a recording from samples in order of time; an error without any sample.
    fn new(samples: Vec<Sample>) -> Result<Self, String> {
        if samples.is_empty() {
            return Err("the file has no pose; record again, or write at least one row".to_owned());
        }
        Ok(Self(samples.into()))
    }

    /// Returns the time of the last sample, ns since the first. Real-time: bounded, no allocation.
    #[must_use]
    pub fn end_ns(&self) -> u64 {
        self.0.last().map_or(0, |sample| sample.time_ns)
    }

    /// Returns the aim at a time since the start of the run. Real-time: bounded, no allocation.
    pub(super) fn aim(&self, time_ns: u64) -> Aim {
        let passed = self.0.partition_point(|sample| sample.time_ns <= time_ns);
        let (before, after) = (self.0.get(passed.saturating_sub(1)), self.0.get(passed));
        Aim::at(match (before, after) {
            (Some(before), Some(after)) => before.toward(after, time_ns),
            (Some(only), None) | (None, Some(only)) => only.pose,
            (None, None) => Pose::HOME,
        })
    }
}

impl Sample {
    /// Creates a sample `time_s` (s) after the first; an error for an implausible time or pose.
    fn new(time_s: f64, position_m: DVec3, orientation: DQuat) -> Result<Self, String> {
        let pose = Pose { position_m, orientation };
        // Written so that NaN is rejected.
        if !(0.0..=1.0e6).contains(&time_s) {
            return Err(format!(
                "time {time_s} s is outside 0 to 1000000 s after the first pose; give ascending times in seconds"
            ));
        }
        pose.check().map_err(|error| error.to_string())?;
        let inside = position_m.abs().max_element() <= FARTHEST_M;
        let far = || {
            format!(
                "{position_m} m is farther than {FARTHEST_M} m from home along an axis; give positions in metres, not millimetres"
            )
        };
        inside.then_some(Self { time_ns: nanoseconds(time_s), pose }).ok_or_else(far)
    }

    /// Appends the sample; an error unless it is later than the last.
    fn append_to(self, samples: &mut Vec<Self>) -> Result<(), String> {
        match samples.last() {
            Some(last) if self.time_ns <= last.time_ns => Err(format!(
                "the time {} s after the first pose is not above {} s, the time of the pose before; give ascending \
                     times, and the poses of one device only",
                self.time_ns as f64 * 1.0e-9,
                last.time_ns as f64 * 1.0e-9
            )),
            _ if samples.len() >= MAX_SAMPLES => {
                Err(format!("the file has more than {MAX_SAMPLES} poses; use a shorter recording"))
            }
            _ => {
                samples.push(self);
                Ok(())
            }
        }
    }

    /// Interpolates between this sample and a later one.
    fn toward(&self, later: &Self, time_ns: u64) -> Pose {
        let whole_ns = (later.time_ns - self.time_ns) as f64;
        let share = (time_ns.saturating_sub(self.time_ns) as f64 / whole_ns).min(1.0);
        Pose {
            position_m: self.pose.position_m + (later.pose.position_m - self.pose.position_m) * share,
            orientation: self.pose.orientation.lerp(later.pose.orientation, share),
        }
    }
}

#[cfg(test)]
mod tests;
