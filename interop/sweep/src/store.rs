//! Store of finished tasks on disk: one file per task, named by its key, written atomically.

use crate::design::Cell;
use crate::task::Task;
use serde::{Deserialize, Serialize};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Folder of finished tasks. May be shared between threads, processes and machines with access to the folder.
#[derive(Clone, Debug)]
pub struct Store {
    folder: PathBuf,
}

/// Error of a store.
#[derive(Debug, thiserror::Error)]
#[error("{}: {action}: {cause}; check the path, free space and permissions", path.display())]
pub struct StoreError {
    /// Affected file or folder.
    pub path: PathBuf,
    /// Failed action.
    pub action: &'static str,
    /// Error of the system.
    pub cause: std::io::Error,
}

#[derive(Serialize, Deserialize)]
struct Finished {
    key: String,
    rows: Vec<Vec<Cell>>,
}

impl Store {
    /// Opens a store, creating its folder if necessary.
    ///
    /// # Errors
    /// If the folder cannot be created.
    pub fn open(folder: &Path) -> Result<Self, StoreError> {
        let folder = folder.join("tasks");
        std::fs::create_dir_all(&folder).map_err(|cause| StoreError {
            path: folder.clone(),
            action: "cannot create the folder",
            cause,
        })?;
        Ok(Self { folder })
    }

    /// Returns true if the task is finished: its file exists, is complete and has the task's key.
    #[must_use]
    pub fn holds(&self, task: &Task) -> bool {
        self.rows(task).is_some()
    }

    /// Returns the rows of a finished task; `None` if unfinished or if its file is damaged, so that the task is executed again.
    #[must_use]
    pub fn rows(&self, task: &Task) -> Option<Vec<Vec<Cell>>> {
        let bytes = std::fs::read(self.file(task)).ok()?;
        let finished: Finished = serde_json::from_slice(&bytes).ok()?;
        (finished.key == task.key && finished.rows.len() as u64 == task.count).then_some(finished.rows)
    }

    /// Stores the rows of a task atomically: written to a temporary file, synchronised, renamed.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn finish(&self, task: &Task, rows: Vec<Vec<Cell>>) -> Result<(), StoreError> {
        let path = self.file(task);
        let failed =
            |cause| StoreError { path: path.clone(), action: "cannot write the finished task", cause };
        let json = serde_json::to_vec(&Finished { key: task.key.clone(), rows });
        let json = json.map_err(|error| failed(error.into()))?;
        let mut file = tempfile::NamedTempFile::new_in(&self.folder).map_err(failed)?;
        file.write_all(&json).and_then(|()| file.as_file().sync_data()).map_err(failed)?;
        file.persist(&path).map_err(|error| failed(error.error))?;
        Ok(())
    }

    fn file(&self, task: &Task) -> PathBuf {
        self.folder.join(format!("{}.json", task.key))
    }
}
