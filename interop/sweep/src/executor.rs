//! Local executor: runs tasks on the cores of this machine.

use crate::store::{Store, StoreError};
use crate::task::{Sweep, Task};
use std::num::NonZeroUsize;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Result of a local execution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Number of tasks that were already in the store.
    pub found: usize,
    /// Number of tasks finished by this execution.
    pub done: usize,
    /// True if `stop` ended the execution early.
    pub stopped: bool,
}

/// Executes every task that is not in the store, on `jobs` threads, until `stop` is set; calls `on_task` for each finished task,
/// first for the tasks already in the store.
///
/// # Errors
/// The first [`StoreError`]; finished tasks stay in the store.
pub fn execute(
    sweep: &Sweep,
    store: &Store,
    jobs: NonZeroUsize,
    stop: &AtomicBool,
    on_task: &(dyn Fn(&Task) + Sync),
) -> Result<Progress, StoreError> {
    let (found, open): (Vec<Task>, Vec<Task>) = sweep.tasks().into_iter().partition(|task| store.holds(task));
    found.iter().for_each(on_task);
    let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let failed = AtomicBool::new(false);
    let work = || -> Result<(), StoreError> {
        while !stop.load(Ordering::Relaxed) && !failed.load(Ordering::Relaxed) {
            let Some(task) = open.get(next.fetch_add(1, Ordering::Relaxed)) else { break };
            let finished = store.finish(task, sweep.answer(task));
            finished.inspect_err(|_| failed.store(true, Ordering::Relaxed))?;
            done.fetch_add(1, Ordering::Relaxed);
            on_task(task);
        }
        Ok(())
    };
    std::thread::scope(|scope| {
        // If threads cannot be created, this thread executes the rest.
        let start = |_| std::thread::Builder::new().spawn_scoped(scope, work).ok();
        let workers: Vec<_> = (1..jobs.get()).filter_map(start).collect();
        let own = std::iter::once(work());
        let others = workers
            .into_iter()
            .map(|worker| worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
        own.chain(others).collect::<Result<Vec<()>, StoreError>>()
    })?;
    let done = done.into_inner();
    Ok(Progress { found: found.len(), done, stopped: done < open.len() })
}
