//! What depends on the machine's clock: in a program of its own, so that nothing runs beside a test but what it allows.

mod board;
mod deaths;
mod emulated;
mod end_of_run;
mod first_moment;
mod force_log;
mod groups;
mod jitter;
mod keyboard;
mod lateness;
mod post;
mod scarcity;
mod signals;
mod stop_reach;
mod strangers;

use std::sync::{PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};

static TURN: RwLock<()> = RwLock::new(());

/// Waits until no other test of this program runs.
fn alone() -> RwLockWriteGuard<'static, ()> {
    TURN.write().unwrap_or_else(PoisonError::into_inner) // a test that failed has ended, too
}

/// Waits until only tests run that wait more than they compute.
fn among_idle_ones() -> RwLockReadGuard<'static, ()> {
    TURN.read().unwrap_or_else(PoisonError::into_inner)
}
