//! Callbacks of the program by priority, and the state of the scheduler that calls them.

use crate::error::Code;
use std::cell::Cell;
use std::ffi::{c_uint, c_ulong, c_ushort, c_void};
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Callback of the program: returns 0 to end, another value to be called again. May end its thread, like an interpreter at
/// shutdown.
pub(crate) type Callback = unsafe extern "C-unwind" fn(*mut c_void) -> c_uint;

/// Limit on the number of callbacks.
pub(crate) const MOST: usize = 64;
/// Timeout for a running call while unscheduling.
const LONGEST_CALL: Duration = Duration::from_secs(1);
/// Interval at which a wait checks whether the scheduler still runs.
const LOOK: Duration = Duration::from_millis(100);

/// Callback with its data.
#[derive(Clone, Copy)]
pub(crate) struct Entry {
    handle: u64,
    priority: c_ushort,
    callback: Callback,
    data: Data,
}

/// Data pointer of the program, passed to the callback.
#[derive(Clone, Copy)]
struct Data(*mut c_void);

// SAFETY: the program schedules it for another thread: what it points at is its own affair.
unsafe impl Send for Data {}

struct List {
    /// Callbacks by priority, then in the order of scheduling.
    entries: Vec<Entry>,
    next: u64,
}

static LIST: Mutex<List> = Mutex::new(List { entries: Vec::new(), next: 1 });
/// Signals a change of the list, and a start or stop of the scheduler.
static CHANGED: Condvar = Condvar::new();
static IS_RUNNING: AtomicBool = AtomicBool::new(false);
static RATE_HZ: AtomicU32 = AtomicU32::new(1000);
static TICK: AtomicU64 = AtomicU64::new(0);
/// Handle of the running callback; 0: none.
static UNDER_WAY: AtomicU64 = AtomicU64::new(0);
static TICK_BEGAN: Mutex<Option<Instant>> = Mutex::new(None);

thread_local! {
    static IS_SCHEDULER: Cell<bool> = const { Cell::new(false) };
}

fn list() -> MutexGuard<'static, List> {
    LIST.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Returns true if the calling thread is the thread of the scheduler.
pub(crate) fn is_here() -> bool {
    IS_SCHEDULER.try_with(Cell::get).unwrap_or(false)
}

/// Marks the calling thread as the thread of the scheduler.
pub(crate) fn mark_here() {
    IS_SCHEDULER.with(|here| here.set(true));
}

/// Returns true if the scheduler runs.
pub(crate) fn is_running() -> bool {
    IS_RUNNING.load(Ordering::Acquire)
}

/// Sets whether the scheduler runs, and wakes the waiting threads.
pub(crate) fn set_running(is_running: bool) {
    IS_RUNNING.store(is_running, Ordering::Release);
    CHANGED.notify_all();
}

/// Returns the number of ticks so far.
pub(crate) fn tick() -> u64 {
    TICK.load(Ordering::Acquire)
}

/// Returns the rate of the scheduler, Hz.
pub(crate) fn rate_hz() -> u32 {
    RATE_HZ.load(Ordering::Relaxed)
}

/// Sets the rate, Hz; returns false unless it is 500 or 1000.
pub(crate) fn set_rate(rate_hz: c_ulong) -> bool {
    let rate_hz = u32::try_from(rate_hz).ok().filter(|rate_hz| [500, 1000].contains(rate_hz));
    rate_hz.inspect(|rate_hz| RATE_HZ.store(*rate_hz, Ordering::Relaxed)).is_some()
}

/// Begins a tick; returns the callbacks to call, in order.
pub(crate) fn begin_tick() -> [Option<Entry>; MOST] {
    TICK.fetch_add(1, Ordering::AcqRel);
    *TICK_BEGAN.lock().unwrap_or_else(PoisonError::into_inner) = Some(Instant::now());
    let mut calls = [None; MOST];
    calls.iter_mut().zip(&list().entries).for_each(|(call, entry)| *call = Some(*entry));
    calls
}

/// Returns the time since the tick began, s; 0 before the first tick.
pub(crate) fn since_tick_s() -> f64 {
    let began = *TICK_BEGAN.lock().unwrap_or_else(PoisonError::into_inner);
    began.map_or(0.0, |began| began.elapsed().as_secs_f64())
}

impl Entry {
    /// Creates an entry outside the list.
    ///
    /// # Safety
    /// `callback` may be called with `data` from any thread as long as the entry is used.
    pub(crate) unsafe fn new(callback: Callback, data: *mut c_void, priority: c_ushort) -> Self {
        Self { handle: 0, priority, callback, data: Data(data) }
    }

    /// Calls the callback; returns true if the callback requests a further call.
    pub(crate) fn call(&self) -> bool {
        // SAFETY: by the contract of `new`.
        unsafe { (self.callback)(self.data.0) != 0 }
    }

    /// Returns true if the callback is still scheduled, and marks it as running.
    pub(crate) fn enter(&self) -> bool {
        let list = list();
        let is_in = is_running() && list.is_in(self.handle);
        if is_in {
            UNDER_WAY.store(self.handle, Ordering::Release);
        }
        is_in
    }

    /// Clears the mark of the running callback; unschedules the callback unless `goes_on`.
    pub(crate) fn finish(&self, goes_on: bool) {
        UNDER_WAY.store(0, Ordering::Release);
        if !goes_on {
            take_out(self.handle);
        }
    }

    /// Schedules the callback and returns its handle. On the scheduler's own thread, calls the callback first, and does not
    /// schedule the callback if the call returns 0.
    ///
    /// # Errors
    /// [`Code::SchedulerFull`] without room.
    pub(crate) fn schedule(mut self) -> Result<c_ulong, Code> {
        let mut list = list();
        if list.entries.len() >= MOST {
            return Err(Code::SchedulerFull);
        }
        self.handle = list.next;
        list.next += 1;
        if is_here() {
            drop(list);
            if !self.call() {
                return Ok(self.handle);
            }
            list = self::list();
        }
        let place = list.entries.iter().position(|there| there.priority < self.priority);
        let place = place.unwrap_or(list.entries.len());
        list.entries.insert(place, self);
        drop(list);
        CHANGED.notify_all();
        Ok(self.handle)
    }
}

impl List {
    fn is_in(&self, handle: u64) -> bool {
        self.entries.iter().any(|entry| entry.handle == handle)
    }
}

/// Returns true if no callback is scheduled.
pub(crate) fn is_empty() -> bool {
    list().entries.is_empty()
}

/// Waits until a callback is scheduled or the scheduler stops, at most 100 ms.
pub(crate) fn wait_for_callback() {
    let wait = |list: &mut List| list.entries.is_empty() && is_running();
    let _ = CHANGED.wait_timeout_while(list(), LOOK, wait);
}

/// Waits until a callback is no longer scheduled, or the scheduler stops.
pub(crate) fn wait_until_out(handle: u64) {
    let mut list = list();
    while list.is_in(handle) && is_running() {
        (list, _) = CHANGED.wait_timeout(list, LOOK).unwrap_or_else(PoisonError::into_inner);
    }
}

/// Unschedules a callback, and waits at most 1 s for a running call on another thread; returns true if the callback was scheduled.
pub(crate) fn unschedule(handle: c_ulong) -> bool {
    let was_in = take_out(handle);
    let since = Instant::now();
    while UNDER_WAY.load(Ordering::Acquire) == handle && !is_here() && since.elapsed() < LONGEST_CALL {
        std::thread::sleep(Duration::from_micros(50));
    }
    was_in
}

/// Removes all callbacks unless the scheduler runs: the last device is closed, and the program may have freed their data.
pub(crate) fn clear() {
    if !is_running() {
        list().entries.clear();
        CHANGED.notify_all();
    }
}

fn take_out(handle: u64) -> bool {
    let mut list = list();
    let before = list.entries.len();
    list.entries.retain(|entry| entry.handle != handle);
    let was_in = list.entries.len() < before;
    drop(list);
    CHANGED.notify_all();
    was_in
}

/// Returns true if a callback is still scheduled; with `waits`, waits for its end first.
pub(crate) fn is_scheduled(handle: c_ulong, waits: bool) -> bool {
    if waits && !is_here() {
        wait_until_out(handle);
    }
    list().is_in(handle)
}
