//! Scheduler: one thread for all devices, which calls the program once a tick, higher priority first.

use crate::device::Devices;
use flotor_compat::{guarded, quietly};
use std::cell::Cell;
use std::ffi::{c_int, c_uint, c_ulong, c_ushort, c_void};
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Callback of the program: returns 0 to end, else to be called again. It may end its thread, as an interpreter does at shutdown.
pub(crate) type Callback = unsafe extern "C-unwind" fn(*mut c_void) -> c_uint;

/// Limit on the number of callbacks.
const MOST: usize = 64;

unsafe extern "C" {
    /// Declared as in the C library, for a body that the end of its thread may unwind.
    fn pthread_create(
        thread: *mut c_ulong,
        attributes: *const c_void,
        body: extern "C-unwind" fn(*mut c_void) -> *mut c_void,
        data: *mut c_void,
    ) -> c_int;
    fn pthread_join(thread: c_ulong, result: *mut *mut c_void) -> c_int;
}

/// Thread of the system, without frames of the standard library, which would catch the unwinding at a thread's end, and abort.
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

/// Timeout for a running call while unscheduling.
const LONGEST_CALL: Duration = Duration::from_secs(1);
/// Pause without a tick to wait for.
const NO_TICK: Duration = Duration::from_millis(1);

/// Scheduled callback.
#[derive(Clone, Copy)]
struct Entry {
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
    thread: Option<Thread>,
}

static LIST: Mutex<List> = Mutex::new(List { entries: Vec::new(), next: 1, thread: None });
/// Signals a change of the list.
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

impl Entry {
    /// Calls the callback; returns whether to call it again.
    fn call(&self) -> bool {
        // SAFETY: whoever scheduled it guarantees that it may be called with these data until it is taken out.
        unsafe { (self.callback)(self.data.0) != 0 }
    }
}

/// Runs the scheduler. During a callback, this frame contains nothing to drop, and nothing catches an unwinding: the program may
/// end the thread.
extern "C-unwind" fn run(_data: *mut c_void) -> *mut c_void {
    IS_SCHEDULER.with(|here| here.set(true));
    while Scheduler::is_running() {
        let calls = guarded([None; MOST], Scheduler::next_calls);
        for entry in calls.iter().flatten() {
            if !guarded(false, || Scheduler::enter(entry)) {
                continue;
            }
            let goes_on = entry.call();
            guarded((), || Scheduler::finish(entry, goes_on));
        }
    }
    std::ptr::null_mut()
}

/// The scheduler of the process.
pub(crate) struct Scheduler;

impl Scheduler {
    /// Returns whether the calling thread is the scheduler's.
    pub(crate) fn is_here() -> bool {
        IS_SCHEDULER.try_with(Cell::get).unwrap_or(false)
    }

    pub(crate) fn is_running() -> bool {
        IS_RUNNING.load(Ordering::Acquire)
    }

    /// Returns the number of ticks so far.
    pub(crate) fn tick() -> u64 {
        TICK.load(Ordering::Acquire)
    }

    pub(crate) fn rate_hz() -> u32 {
        RATE_HZ.load(Ordering::Relaxed)
    }

    /// Sets the rate; returns false for an unsupported rate.
    pub(crate) fn set_rate(rate_hz: c_ulong) -> bool {
        let rate_hz = u32::try_from(rate_hz).ok().filter(|rate_hz| [500, 1000].contains(rate_hz));
        rate_hz.inspect(|rate_hz| RATE_HZ.store(*rate_hz, Ordering::Relaxed)).is_some()
    }

    /// Starts the scheduler unless it runs; returns whether it runs.
    pub(crate) fn start() -> bool {
        let mut list = list();
        if Self::is_running() {
            return true;
        }
        // A scheduler stopped by its own callback is about to end.
        if let Some(thread) = list.thread.take() {
            drop(list);
            thread.join();
            list = self::list();
        }
        IS_RUNNING.store(true, Ordering::Release);
        list.thread = quietly(|| Thread::start(run));
        let is_started = list.thread.is_some();
        IS_RUNNING.store(is_started, Ordering::Release);
        drop(list);
        Devices::follow_scheduler();
        is_started
    }

    /// Stops the scheduler: no force, and no callback is called after the return.
    pub(crate) fn stop() {
        IS_RUNNING.store(false, Ordering::Release);
        Devices::follow_scheduler();
        CHANGED.notify_all();
        if Self::is_here() {
            return;
        }
        let thread = list().thread.take();
        if let Some(thread) = thread {
            thread.join();
        }
    }

    /// Waits for a tick and returns the callbacks to call, in order; none without a tick.
    fn next_calls() -> [Option<Entry>; MOST] {
        let mut calls = [None; MOST];
        if !Self::wait_for_tick() {
            return calls;
        }
        TICK.fetch_add(1, Ordering::AcqRel);
        *TICK_BEGAN.lock().unwrap_or_else(PoisonError::into_inner) = Some(Instant::now());
        calls.iter_mut().zip(&list().entries).for_each(|(call, entry)| *call = Some(*entry));
        calls
    }

    /// Returns whether a callback is still scheduled, and marks it as running.
    fn enter(entry: &Entry) -> bool {
        let list = list();
        let is_in = Self::is_running() && list.is_in(entry.handle);
        if is_in {
            UNDER_WAY.store(entry.handle, Ordering::Release);
        }
        is_in
    }

    /// Clears the mark of a running callback, and unschedules one that has ended.
    fn finish(entry: &Entry, goes_on: bool) {
        UNDER_WAY.store(0, Ordering::Release);
        if !goes_on {
            Self::take_out(entry.handle);
        }
    }

    /// Waits for the next tick at the program's rate; returns whether there are callbacks.
    fn wait_for_tick() -> bool {
        let is_idle = list().entries.is_empty();
        let Some((host, station)) = Devices::any() else {
            std::thread::sleep(NO_TICK);
            return !is_idle;
        };
        // In lockstep the callbacks advance time: without any, time stands still.
        if is_idle && host.pace() == flotor_compat::Pace::Lockstep {
            let list = list();
            let wait = |list: &mut List| list.entries.is_empty() && Self::is_running();
            let _ = CHANGED.wait_timeout_while(list, Duration::from_millis(100), wait);
            return false;
        }
        let period_ns = 1_000_000_000 / u64::from(Self::rate_hz());
        let ticks = (period_ns / host.period_ns().max(1)).max(1);
        for _ in 0..ticks {
            if !host.wait(station) {
                std::thread::sleep(NO_TICK); // the device is lost: the program gets the error in its frame
                break;
            }
        }
        !is_idle
    }

    /// Schedules a callback if there is room; on the scheduler's own thread also calls it at once.
    ///
    /// # Safety
    /// `callback` may be called with `data` from any thread until it is taken out.
    pub(crate) unsafe fn asynchronous(
        callback: Callback,
        data: *mut c_void,
        priority: c_ushort,
    ) -> Option<c_ulong> {
        let mut list = list();
        if list.entries.len() >= MOST {
            return None;
        }
        let handle = list.next;
        list.next += 1;
        let entry = Entry { handle, priority, callback, data: Data(data) };
        if Self::is_here() {
            drop(list);
            if !entry.call() {
                return Some(handle);
            }
            list = self::list();
        }
        list.put(entry);
        drop(list);
        CHANGED.notify_all();
        Some(handle)
    }

    /// Calls a callback until it has ended, on the scheduler's thread if that is running and another one.
    ///
    /// # Safety
    /// `callback` may be called with `data` from any thread until this returns.
    pub(crate) unsafe fn synchronous(callback: Callback, data: *mut c_void, priority: c_ushort) {
        if Self::is_here() || !Self::is_running() {
            let entry = Entry { handle: 0, priority, callback, data: Data(data) };
            while entry.call() {
                if let Some((host, station)) = Devices::any() {
                    host.wait(station);
                } else {
                    std::thread::sleep(NO_TICK);
                }
            }
            return;
        }
        // SAFETY: by the contract of this function; it returns only when the callback is taken out.
        let Some(handle) = (unsafe { Self::asynchronous(callback, data, priority) }) else {
            return crate::error::raise(crate::error::Code::SchedulerFull, crate::NO_DEVICE);
        };
        Self::wait_until_out(handle);
        // A scheduler that stopped meanwhile calls no callback any more.
        Self::unschedule(handle);
    }

    fn wait_until_out(handle: u64) {
        let is_in = |list: &mut List| list.is_in(handle) && Self::is_running();
        let mut list = list();
        while is_in(&mut list) {
            let waited = CHANGED.wait_timeout(list, Duration::from_millis(100));
            (list, _) = waited.unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Unschedules a callback, and waits for a running call on another thread; returns whether it was scheduled.
    pub(crate) fn unschedule(handle: c_ulong) -> bool {
        let was_in = Self::take_out(handle);
        let since = Instant::now();
        while UNDER_WAY.load(Ordering::Acquire) == handle
            && !Self::is_here()
            && since.elapsed() < LONGEST_CALL
        {
            std::thread::sleep(Duration::from_micros(50));
        }
        was_in
    }

    /// Removes all callbacks unless the scheduler runs: the last device is closed, and the program may have freed their data.
    pub(crate) fn clear() {
        if !Self::is_running() {
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

    /// Returns whether a callback is still scheduled; with `waits`, waits for its end first.
    pub(crate) fn is_scheduled(handle: c_ulong, waits: bool) -> bool {
        if waits && !Self::is_here() {
            Self::wait_until_out(handle);
        }
        list().is_in(handle)
    }

    /// Returns the time since the tick began, s.
    pub(crate) fn since_tick_s() -> f64 {
        let began = *TICK_BEGAN.lock().unwrap_or_else(PoisonError::into_inner);
        began.map_or(0.0, |began| began.elapsed().as_secs_f64())
    }
}

impl List {
    fn put(&mut self, entry: Entry) {
        let place = self.entries.iter().position(|there| there.priority < entry.priority);
        self.entries.insert(place.unwrap_or(self.entries.len()), entry);
    }

    fn is_in(&self, handle: u64) -> bool {
        self.entries.iter().any(|entry| entry.handle == handle)
    }
}
