//! Second recording, shown over the displayed run for comparison.

use crate::History;
use flotor_hal::Pose;
use flotor_record::ReadError;
use std::path::Path;

/// Recording whose traces and handles are shown over the displayed run. Times count from the start of each run, and devices are
/// matched by their order in the scenes.
#[derive(Clone, Debug)]
pub struct Compared {
    name: String,
    histories: Vec<History>,
}

impl Compared {
    /// Reads a recording.
    ///
    /// # Errors
    /// [`ReadError`] if no part of the file is usable.
    pub fn read(file: &Path) -> Result<Self, ReadError> {
        let name = file.file_name().unwrap_or(file.as_os_str()).to_string_lossy().into_owned();
        Ok(Self { name, histories: History::read(file)? })
    }

    /// Returns the samples of a device, counted from 0 in the order of the scene; `None` if the recording has fewer devices.
    #[must_use]
    pub fn history(&self, device: usize) -> Option<&History> {
        self.histories.get(device)
    }

    /// Returns the pose of each handle in its device frame at a time, s; `None` before the first sample and in a gap. After the end
    /// of the recording, the last pose is valid.
    #[must_use]
    pub fn handles(&self, now_s: f64) -> Vec<Option<Pose>> {
        let pose = |history: &History| history.seen_at(now_s).map(|sample| sample.pose);
        self.histories.iter().map(pose).collect()
    }

    /// Returns file name, tick rate and end time of the recording as one line of text.
    #[must_use]
    pub fn text(&self) -> String {
        let (rate_hz, [_, last_s]) =
            self.histories.first().map_or((0.0, [0.0; 2]), |first| (first.run().rate_hz, first.span_s()));
        format!(
            "Dashed: {}, {rate_hz} Hz, {last_s:.3} s; both times from the start of the run; Escape: close",
            self.name
        )
    }
}
