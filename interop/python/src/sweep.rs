//! Python class of a sweep, task by task, for any executor.

use crate::error::refuse;
use flotor_sweep::plan::Plan;
use flotor_sweep::store::Store;
use flotor_sweep::{table, task};
use pyo3::prelude::*;
use std::path::PathBuf;

/// A prepared sweep with its folder of finished tasks.
#[pyclass(frozen, module = "flotor")]
pub(crate) struct Sweep {
    sweep: task::Sweep,
    tasks: Vec<task::Task>,
    store: Store,
    out: PathBuf,
}

#[pymethods]
impl Sweep {
    #[new]
    fn new(plan: PathBuf, out: PathBuf, folders: Vec<PathBuf>) -> PyResult<Self> {
        let sweep = task::Sweep::prepare(Plan::load(&plan).map_err(refuse)?, &folders).map_err(refuse)?;
        let store = Store::open(&out).map_err(refuse)?;
        Ok(Self { tasks: sweep.tasks(), sweep, store, out })
    }

    /// Keys of all tasks, in the order of their rows.
    #[getter]
    fn keys(&self) -> Vec<String> {
        self.tasks.iter().map(|task| task.key.clone()).collect()
    }

    /// Returns the numbers of the unfinished tasks.
    fn open_tasks(&self) -> Vec<usize> {
        let open = self.tasks.iter().enumerate().filter(|(_, task)| !self.store.holds(task));
        open.map(|(number, _)| number).collect()
    }

    /// Executes a task unless it is finished, and stores its rows; without the GIL.
    fn do_task(&self, py: Python<'_>, number: usize) -> PyResult<()> {
        let task = self.tasks.get(number);
        let task = task.ok_or_else(|| {
            refuse(format!(
                "task {number} does not exist; the sweep has {} tasks, numbered from 0",
                self.tasks.len()
            ))
        })?;
        py.detach(|| {
            if self.store.holds(task) {
                return Ok(());
            }
            self.store.finish(task, self.sweep.answer(task))
        })
        .map_err(refuse)
    }

    /// Writes `results.parquet` if all tasks are finished; returns its path.
    fn write_table(&self, py: Python<'_>) -> PyResult<PathBuf> {
        py.detach(|| {
            let path = self.out.join("results.parquet");
            table::write(&path, &self.sweep.columns(), &table::rows(&self.sweep, &self.store)?)?;
            Ok::<_, table::TableError>(path)
        })
        .map_err(refuse)
    }
}
