//! Stops all energised devices before this process ends by a signal, by `exit`, or by the end of the loop's thread.
//!
//! Devices hold their last command, some indefinitely. While a run has energised devices, fatal signals and `exit` are therefore
//! intercepted: every device's `safe_stop` is called, by contract possible from any thread without lock or allocation; one line
//! names the code at fault; the process ends with code 3, or by the signal that requested the end.
//!
//! Ends that cannot be caught (`_exit`, `exec`, SIGKILL, a stack overflow in a thread without an alternate stack) are handled by a
//! separate process: [`crate::watchdog_process`].

mod call;
mod end_report;
mod line;

pub(crate) use crate::platform::last_stop::take_sent;
pub use crate::platform::last_stop::{
    SignalGuard, SignalName, TakenSignals, ignore_no_signal, spawn_unblocked,
};
pub use call::{enter_call, exit_call, prepare_for_calls};
pub use end_report::{ReportedEnd, report_end, report_end_to};

use crate::platform::last_stop as system;
use crate::{Heartbeat, Place, Stuck};
use flotor_core::lock;
use flotor_loader::Stopper;
use line::Line;
use std::fmt::Write;
use std::mem::ManuallyDrop;
use std::sync::atomic::{AtomicBool, AtomicI32, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, TryLockError};

/// Exit code after a last stop, the same as for a failed plugin.
const ENDED: i32 = 3;
/// Maximum number of armed runs in one process; further runs, as of parallel simulations, are not armed.
const MAX_RUNS: usize = 256;
/// Number of polls, and poll interval, ns, of a second thread that has to end the process: it lets the first thread finish.
const LOOKS: u32 = 50;
const LOOK_NS: u64 = 10_000_000;

/// Run with energised devices.
struct Armed {
    stoppers: Box<[Stopper]>,
    /// Names of the devices, then of the models, in the scene's order.
    names: Box<[String]>,
    heartbeat: Heartbeat,
    /// Id of the loop thread.
    thread: AtomicI32,
}

/// Runs of this process. Locked for a few instructions to begin or end a run; a thread that ends the process only tries the lock: a
/// locked run has no energised device yet, or none any more.
static RUNS: [Mutex<Option<Arc<Armed>>>; MAX_RUNS] = [const { Mutex::new(None) }; MAX_RUNS];
/// True once a run was armed.
static WAS_ARMED: AtomicBool = AtomicBool::new(false);
/// Id of the thread that ends this process after a fatal event; 0: none.
static DYING: AtomicI32 = AtomicI32::new(0);
/// Number of the next device to stop, counted through all runs: a stop that crashes is not retried.
static NEXT: AtomicUsize = AtomicUsize::new(0);

/// Cause of the end of a process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Death {
    /// Signal, with the process id of its sender if another process sent the signal.
    Signal { signal: i32, sender: Option<i32> },
    /// Call of `exit`.
    Exit,
    /// End of the loop's thread, as by `pthread_exit`.
    Thread,
}

/// Returns true while a run has energised devices. Waits for no lock, allocates nothing.
#[must_use]
pub fn is_armed() -> bool {
    RUNS.iter().filter_map(glance).any(|run| run.as_ref().is_some_and(|run| !run.is_over()))
}

/// Returns true once a run has had energised devices.
#[must_use]
pub fn was_armed() -> bool {
    WAS_ARMED.load(Ordering::Acquire)
}

/// Stops every device of every run of this process, from any thread. Not real-time.
pub fn stop_all() {
    for run in &RUNS {
        let run = lock(run).clone();
        run.iter().for_each(|run| run.heartbeat.silence());
        run.iter().flat_map(|run| &run.stoppers).for_each(Stopper::safe_stop);
    }
}

/// Returns the name of the running plugin of each loop of this process, with tick and call; loops in host code are left out. Not
/// real-time.
#[must_use]
pub fn calls() -> Vec<(String, Stuck)> {
    let runs = RUNS.iter().filter_map(|run| lock(run).clone()).filter(|run| !run.is_over());
    let calls = runs.map(|run| (run.name(run.heartbeat.now().place).to_owned(), run.heartbeat.now()));
    calls.filter(|(_, at)| at.place.is_a_plugins()).collect()
}

/// Returns the armed runs for a thread that ends the process, without ever freeing them: closing a device allocates, and the
/// allocator may have crashed.
fn runs() -> impl Iterator<Item = ManuallyDrop<Arc<Armed>>> {
    RUNS.iter().filter_map(|run| glance(run)?.clone()).map(ManuallyDrop::new)
}

fn glance(run: &Mutex<Option<Arc<Armed>>>) -> Option<MutexGuard<'_, Option<Arc<Armed>>>> {
    match run.try_lock() {
        Ok(run) => Some(run),
        Err(TryLockError::Poisoned(run)) => Some(run.into_inner()),
        Err(TryLockError::WouldBlock) => None,
    }
}

/// Guard of a run's emergency stop on process death: until the guard is dropped, the devices of the run are stopped before the
/// process ends. Drop the guard after the devices are closed and the models freed.
pub struct LastStop {
    place: usize,
}

/// Guard that stops the devices when a plugin or a panic ends the loop thread. A loop drops the guard before devices and models: if
/// neither the end of the loop nor a panic is the reason, a plugin has called a function like `pthread_exit`, and the process ends.
pub struct Unwound(Arc<Armed>);

impl LastStop {
    /// Arms a run, on the thread that will run the loop: the devices of `stoppers` are stopped when the process dies. `names`:
    /// names of the devices, in the order of `stoppers`, then of the models. `None` if 256 runs are armed already. Not real-time.
    #[must_use]
    pub fn arm(stoppers: Vec<Stopper>, names: Vec<String>, heartbeat: Heartbeat) -> Option<(Unwound, Self)> {
        let thread = AtomicI32::new(system::thread_number());
        let armed = Arc::new(Armed { stoppers: stoppers.into(), names: names.into(), heartbeat, thread });
        system::install();
        for (place, run) in RUNS.iter().enumerate() {
            let mut run = lock(run);
            if run.is_none() {
                *run = Some(Arc::clone(&armed));
                WAS_ARMED.store(true, Ordering::Release);
                return Some((Unwound(armed), Self { place }));
            }
        }
        None
    }

    /// Registers the calling thread as the loop thread of the run. Not real-time.
    pub(crate) fn register_loop_thread(&self) {
        if let Some(run) = RUNS.get(self.place).and_then(|run| lock(run).clone()) {
            run.thread.store(system::thread_number(), Ordering::Release);
            system::install();
        }
    }
}

impl Drop for LastStop {
    fn drop(&mut self) {
        let armed = RUNS.get(self.place).and_then(|run| lock(run).take());
        drop(armed); // outside the lock: it may close a device
    }
}

impl Drop for Unwound {
    fn drop(&mut self) {
        let Self(run) = self;
        if run.is_over() {
            return;
        }
        if std::thread::panicking() {
            run.stoppers.iter().for_each(Stopper::safe_stop);
        } else if run.heartbeat.now().place.is_a_plugins() {
            die(Death::Thread);
        }
    }
}

impl Armed {
    /// Returns true once the loop has ended or the watchdog has stopped the devices: nothing is energised.
    fn is_over(&self) -> bool {
        self.heartbeat.is_done() || self.heartbeat.fired_at().is_some()
    }

    fn name(&self, place: Place) -> &str {
        let Some(plugin) = place.plugin(self.stoppers.len()) else { return "host" };
        self.names.get(plugin.position()).map_or("a plugin", String::as_str)
    }
}

/// Reports the exit code to the supervisor and ends the process at once, without exit handlers. Real-time: never returns.
pub fn exit_process(code: i32) -> ! {
    report_end(ReportedEnd::Code(u8::try_from(code & 0xff).unwrap_or(u8::MAX)));
    system::exit_process(code)
}

/// Stops the devices and ends the process; returns if no run is energised. For a signal handler or `exit`: no lock, no allocation.
pub(crate) fn end_if_armed(death: Death) {
    if is_armed() {
        die(death);
    }
}

/// Ends the process; returns if the calling thread is in no plugin call outside the loop. No lock, no allocation.
pub(crate) fn end_if_in_call(death: Death) {
    if is_in_call() {
        die(death);
    }
}

/// Returns true if the calling thread is in a plugin call outside the loop. No lock, no allocation.
pub(crate) fn is_in_call() -> bool {
    call::current().is_some()
}

/// Returns true once a thread has begun to stop the devices and to end this process.
pub(crate) fn is_dying() -> bool {
    DYING.load(Ordering::Acquire) != 0
}

/// Stops the remaining devices and ends the process, if a device's stop has not returned in time.
pub(crate) fn end_dying() -> ! {
    stop_the_rest();
    system::say(b"error: the process was ended, and a device did not return from `safe_stop`\n");
    exit_process(ENDED)
}

/// Stops all devices, prints the message, and ends the process.
fn die(death: Death) -> ! {
    let own = system::thread_number();
    // On the first thread again: a stop that crashed; continue with the next device.
    if let Err(first) = DYING.compare_exchange(0, own, Ordering::AcqRel, Ordering::Acquire)
        && first != own
    {
        // The first thread stops the devices and ends the process, unless a device's stop does not return.
        for _ in 0..LOOKS {
            crate::sleep_until(crate::monotonic_ns() + LOOK_NS);
        }
    }
    stop_the_rest();
    let mut line = Line::EMPTY;
    describe(&mut line, death, own);
    system::say(line.as_bytes());
    report_end(ReportedEnd::Signal);
    system::end_by(death, ENDED)
}

/// Stops each device of each run whose stop has not begun.
fn stop_the_rest() {
    let (own, mut first) = (system::thread_number(), 0);
    for run in runs() {
        // If the crash is in the loop's own thread, that loop sends no more commands: only other loops have to be silenced.
        if run.thread.load(Ordering::Acquire) != own {
            run.heartbeat.silence();
        }
        for (index, stopper) in run.stoppers.iter().enumerate() {
            let number = first + index;
            if NEXT.compare_exchange(number, number + 1, Ordering::AcqRel, Ordering::Acquire).is_ok() {
                stopper.safe_stop();
            }
        }
        first += run.stoppers.len();
    }
}

/// Describes the end in one line: cause, tick and running code.
fn describe(line: &mut Line, death: Death, own: i32) {
    if let Some(call) = call::current() {
        let _ = write!(line, "error: {}: ", call.text());
        describe_death(line, death);
        if is_armed() {
            let _ = write!(line, "; every device was commanded to stop");
        }
        return;
    }
    let is_own = |run: &ManuallyDrop<Arc<Armed>>| run.thread.load(Ordering::Acquire) == own;
    let own_run = runs().find(|run| is_own(run) && !run.is_over());
    let Some(run) = own_run.or_else(|| runs().find(|run| !run.is_over())) else {
        let _ = write!(line, "error: the process was ended; every device was commanded to stop");
        return;
    };
    let Stuck { tick, place } = run.heartbeat.now();
    let in_loop = is_own(&run);
    let culprit = in_loop && place.is_a_plugins();
    // A line that is too long is truncated.
    let _ = match (culprit, in_loop) {
        (true, _) => write!(line, "error: `{}` ended the process in {}", run.name(place), place.call()),
        (false, true) => write!(line, "error: the process was ended in {}", place.call()),
        (false, false) => {
            let mut name = [0; system::NAME_BYTES];
            let name = system::thread_name(&mut name);
            write!(line, "error: the process was ended in its thread `{name}`")
        }
    };
    let _ = write!(line, ", tick {tick}: ");
    describe_death(line, death);
    if !culprit {
        let _ = write!(line, "; the loop was in {} of `{}`; its plugins:", place.call(), run.name(place));
        for name in &run.names {
            let _ = write!(line, " `{name}`");
        }
    }
    let _ = write!(line, "; every device was commanded to stop");
}

fn describe_death(line: &mut Line, death: Death) {
    let _ = match death {
        Death::Signal { signal, sender } => {
            let told = write!(line, "{}", system::SignalName(signal));
            sender.map_or(told, |sender| write!(line, ", sent by process {sender}"))
        }
        Death::Exit => write!(line, "it called `exit`"),
        Death::Thread => write!(line, "it ended the thread of the loop"),
    };
}
