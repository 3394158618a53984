//! Locks of threads other than the loop.

use std::sync::{Mutex, MutexGuard, PoisonError};

/// Locks a mutex, and ignores that an owner panicked: only for data that each owner keeps valid at every step. Not
/// real-time.
pub fn lock<T: ?Sized>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
