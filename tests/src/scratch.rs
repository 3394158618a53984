//! Temporary folder of a test, deleted at the end of the test.

use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// New, empty temporary folder that only this user may write to. Dropping it deletes the folder.
pub struct Scratch(TempDir);

impl Default for Scratch {
    /// Creates the folder.
    ///
    /// # Panics
    /// If the system's folder for temporary files is not writable.
    fn default() -> Self {
        Self(tempfile::tempdir().expect("there is a place for temporary files"))
    }
}

impl Scratch {
    /// Returns the path of the folder.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.0.path()
    }

    /// Writes a file in the folder and returns its path.
    ///
    /// # Panics
    /// If the file cannot be written.
    #[must_use]
    pub fn file(&self, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
        let file = self.path().join(name);
        std::fs::write(&file, content).expect("a scratch folder can be written to");
        file
    }

    /// Writes a scene for a run in real time, with a watchdog timeout of one minute, in the folder and returns its path. A busy
    /// machine does not expire this watchdog; a test of the watchdog itself needs another scene.
    ///
    /// # Panics
    /// If the file cannot be written, or the scene has a table `[limits]`.
    #[must_use]
    pub fn patient_scene(&self, scene: &str) -> PathBuf {
        assert!(!scene.contains("[limits]"), "it has limits: they can say `watchdog_ms` themselves");
        self.file("patient.toml", format!("{scene}\n[limits]\nwatchdog_ms = 60000\n"))
    }

    /// Creates a subfolder and returns its path.
    ///
    /// # Panics
    /// If the subfolder cannot be created.
    #[must_use]
    pub fn folder(&self, name: &str) -> PathBuf {
        let folder = self.path().join(name);
        std::fs::create_dir(&folder).expect("a scratch folder can be written to");
        folder
    }
}
