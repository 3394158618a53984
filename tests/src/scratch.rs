//! A folder of a test's own, gone when the test is.

use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// A new, empty folder only this user may write to.
pub struct Scratch(TempDir);

impl Default for Scratch {
    /// # Panics
    /// If the system has no place for temporary files.
    fn default() -> Self {
        Self(tempfile::tempdir().expect("there is a place for temporary files"))
    }
}

impl Scratch {
    /// The folder.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.0.path()
    }

    /// Writes a file into the folder.
    ///
    /// # Panics
    /// If it cannot be written.
    #[must_use]
    pub fn file(&self, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
        let file = self.path().join(name);
        std::fs::write(&file, content).expect("a scratch folder can be written to");
        file
    }

    /// Writes a scene for a run in real time into the folder: with a watchdog that bears a machine on which nothing moves for a
    /// while. To be used where the test is not about that.
    ///
    /// # Panics
    /// If it cannot be written, or has limits of its own.
    #[must_use]
    pub fn patient_scene(&self, scene: &str) -> PathBuf {
        assert!(!scene.contains("[limits]"), "it has limits: they can say `watchdog_ms` themselves");
        self.file("patient.toml", format!("{scene}\n[limits]\nwatchdog_ms = 60000\n"))
    }

    /// Makes a folder in the folder.
    ///
    /// # Panics
    /// If it cannot be made.
    #[must_use]
    pub fn folder(&self, name: &str) -> PathBuf {
        let folder = self.path().join(name);
        std::fs::create_dir(&folder).expect("a scratch folder can be written to");
        folder
    }
}
