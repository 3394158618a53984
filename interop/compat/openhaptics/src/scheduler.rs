//! Scheduler: one thread for all devices, which calls the program's callbacks once per tick, higher priority first.

use crate::callbacks::{self, Callback, Entry, MOST, is_here, is_running, set_running};
use crate::device::Devices;
use crate::error::{NO_DEVICE, raise};
use flotor_compat::{Pace, guarded, quietly};
use std::ffi::{c_int, c_ulong, c_ushort, c_void};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

unsafe extern "C" {
    /// Starts a thread. Declared here with a start routine that may unwind, because `pthread_exit` in a callback unwinds the stack.
    fn pthread_create(
        thread: *mut c_ulong,
        attributes: *const c_void,
        body: extern "C-unwind" fn(*mut c_void) -> *mut c_void,
        data: *mut c_void,
    ) -> c_int;
    fn pthread_join(thread: c_ulong, result: *mut *mut c_void) -> c_int;
}

/// System thread without stack frames of the standard library, which would catch the unwinding at a thread's end, and abort.
struct Thread(c_ulong);

impl Thread {
    fn start(body: extern "C-unwind" fn(*mut c_void) -> *mut c_void) -> Option<Self> {
        let mut thread = 0;
        // SAFETY: a place for the number of the thread, no attributes, and a body that takes nothing.
        let code = unsafe { pthread_create(&raw mut thread, std::ptr::null(), body, std::ptr::null_mut()) };
        (code == 0).then_some(Self(thread))
    }

    fn join(self) {
        // SAFETY: a thread that was started and that nobody else waits for; its result is not wanted.
        unsafe { pthread_join(self.0, std::ptr::null_mut()) };
    }
}

/// Pause without a tick to wait for.
const NO_TICK: Duration = Duration::from_millis(1);

static THREAD: Mutex<Option<Thread>> = Mutex::new(None);

fn thread() -> MutexGuard<'static, Option<Thread>> {
    THREAD.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Runs the scheduler. During a callback, this frame contains nothing to drop, and nothing catches an unwinding: the program may
/// end the thread.
extern "C-unwind" fn run(_data: *mut c_void) -> *mut c_void {
    callbacks::mark_here();
    while is_running() {
        let calls = guarded([None; MOST], next_calls);
        for entry in calls.iter().flatten() {
            if !guarded(false, || entry.enter()) {
                continue;
            }
            let goes_on = entry.call();
            guarded((), || entry.finish(goes_on));
        }
    }
    std::ptr::null_mut()
}

/// Starts the scheduler unless it runs, and enables the force of the devices; returns true if the scheduler runs.
pub(crate) fn start() -> bool {
    let mut started = thread();
    if is_running() {
        return true;
    }
    // A scheduler stopped by its own callback is about to end.
    if let Some(ending) = started.take() {
        drop(started);
        ending.join();
        started = thread();
    }
    set_running(true);
    *started = quietly(|| Thread::start(run));
    let is_started = started.is_some();
    set_running(is_started);
    drop(started);
    Devices::follow_scheduler();
    is_started
}

/// Stops the scheduler and disables force. Called from another thread, waits for the end of the scheduler's thread: no callback
/// is called after the return.
pub(crate) fn stop() {
    set_running(false);
    Devices::follow_scheduler();
    if is_here() {
        return;
    }
    let ending = thread().take();
    if let Some(ending) = ending {
        ending.join();
    }
}

/// Waits for a tick and returns the callbacks to call, in order; none without a tick.
fn next_calls() -> [Option<Entry>; MOST] {
    if wait_for_tick() { callbacks::begin_tick() } else { [None; MOST] }
}

/// Waits for the next tick at the program's rate; returns true if there are callbacks to call.
fn wait_for_tick() -> bool {
    let is_idle = callbacks::is_empty();
    let Some((host, station)) = Devices::any() else {
        std::thread::sleep(NO_TICK);
        return !is_idle;
    };
    // In lockstep the callbacks advance time: without any, time stands still.
    if is_idle && host.pace() == Pace::Lockstep {
        callbacks::wait_for_callback();
        return false;
    }
    let period_ns = 1_000_000_000 / u64::from(callbacks::rate_hz());
    let ticks = (period_ns / host.period_ns().max(1)).max(1);
    for _ in 0..ticks {
        if !host.wait(station) {
            std::thread::sleep(NO_TICK); // the device is lost: the program gets the error in its frame
            break;
        }
    }
    !is_idle
}

/// Calls a callback until it returns 0: on the scheduler's thread if the scheduler runs, otherwise on the calling thread.
///
/// # Safety
/// `callback` may be called with `data` from any thread until this returns.
pub(crate) unsafe fn synchronous(callback: Callback, data: *mut c_void, priority: c_ushort) {
    // SAFETY: by the contract of this function; it returns only when the callback is taken out.
    let entry = unsafe { Entry::new(callback, data, priority) };
    if is_here() || !is_running() {
        while entry.call() {
            if let Some((host, station)) = Devices::any() {
                host.wait(station);
            } else {
                std::thread::sleep(NO_TICK);
            }
        }
        return;
    }
    match entry.schedule() {
        Ok(handle) => {
            callbacks::wait_until_out(handle);
            // A scheduler that stopped meanwhile calls no callback any more.
            callbacks::unschedule(handle);
        }
        Err(code) => raise(code, NO_DEVICE),
    }
}
