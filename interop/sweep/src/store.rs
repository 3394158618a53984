//! Finished tasks on disk: one file a task, named by its key, whole or absent.

use crate::design::Cell;
use crate::task::Task;
use serde::{Deserialize, Serialize};
use std::io::Write;
use std::path::{Path, PathBuf};

/// A folder of finished tasks. May be shared between threads, processes and machines that see the folder.
#[derive(Clone, Debug)]
pub struct Store {
    folder: PathBuf,
}

/// Why the store cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("{}: {action}: {cause}", path.display())]
pub struct StoreError {
    /// File or folder.
    pub path: PathBuf,
    /// What was attempted.
    pub action: &'static str,
    /// What the system said.
    pub cause: std::io::Error,
}

#[derive(Serialize, Deserialize)]
struct Finished {
    key: String,
    rows: Vec<Vec<Cell>>,
}

impl Store {
    /// Opens a store, making its folder if need be.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn open(folder: &Path) -> Result<Self, StoreError> {
        let folder = folder.join("tasks");
        std::fs::create_dir_all(&folder).map_err(|cause| StoreError {
            path: folder.clone(),
            action: "cannot make the folder",
            cause,
        })?;
        Ok(Self { folder })
    }

    /// True if the task is finished: its file is there, whole and its own.
    #[must_use]
    pub fn holds(&self, task: &Task) -> bool {
        self.rows(task).is_some()
    }

    /// Rows of a finished task; `None` if it is not, or its file is damaged (then it is simply done again).
    #[must_use]
    pub fn rows(&self, task: &Task) -> Option<Vec<Vec<Cell>>> {
        let bytes = std::fs::read(self.file(task)).ok()?;
        let finished: Finished = serde_json::from_slice(&bytes).ok()?;
        (finished.key == task.key && finished.rows.len() as u64 == task.count).then_some(finished.rows)
    }

    /// Puts a task away: written beside, made durable, then renamed, so that a kill leaves all of it or nothing.
    ///
    /// # Errors
    /// [`StoreError`].
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
