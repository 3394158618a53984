//! What depends on the machine's clock: in a program of its own and one test after the other, so that nothing else runs beside it.

mod deaths;
mod end_of_run;
mod jitter;

use std::sync::{Mutex, MutexGuard, PoisonError};

/// Waits until no other test of this program runs.
fn alone() -> MutexGuard<'static, ()> {
    static TURN: Mutex<()> = Mutex::new(());
    TURN.lock().unwrap_or_else(PoisonError::into_inner) // a test that failed has ended, too
}
