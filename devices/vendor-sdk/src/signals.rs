//! Signals belong to the host: a thread that a library starts takes over the mask of the thread that calls it.
#![allow(unsafe_code)] // the mask of a thread; listed in tests/tests/system/architecture.rs

use std::mem::MaybeUninit;

/// Runs `body` with all signals of this thread blocked, so that threads it starts never take one. Not real-time.
pub fn without_signals<T>(body: impl FnOnce() -> T) -> T {
    let mut before = MaybeUninit::<libc::sigset_t>::zeroed();
    // SAFETY: two sets on this stack; the first is filled before it is read, the second is written by the system.
    let is_blocked = unsafe {
        let mut all = MaybeUninit::<libc::sigset_t>::zeroed();
        libc::sigfillset(all.as_mut_ptr());
        libc::pthread_sigmask(libc::SIG_SETMASK, all.as_ptr(), before.as_mut_ptr()) == 0
    };
    let value = body();
    if is_blocked {
        // SAFETY: the set that the system wrote above.
        unsafe { libc::pthread_sigmask(libc::SIG_SETMASK, before.as_ptr(), std::ptr::null_mut()) };
    }
    value
}
