//! Plugin calls outside the loop, each with a name and a time limit.
//!
//! A thread cannot be ended from outside while plugin code runs in it. Such a call therefore has a thread of its own; the caller waits no
//! longer than a limit, then abandons the thread and names the plugin. In the loop the watchdog does the same. Not real-time.

pub(crate) use end::{EndCalls, EndReserve};

mod end;

use crate::platform::MachineState;
use flotor_servo::last_stop::{enter_call, exit_call, prepare_for_calls};
use flotor_servo::{StopSwitch, THREAD_ADVICE};
use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TryRecvError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, Instant};

/// Environment variable with the time limit of a call before a run, in seconds.
pub const LIMIT_VARIABLE: &str = "FLOTOR_CALL_LIMIT_S";

/// Environment variable with the processor time limit of a step without a clock (virtual clock, `validate`, `stress`), in seconds.
pub const STEP_LIMIT_VARIABLE: &str = "FLOTOR_STEP_LIMIT_S";

/// Delay before a "still waiting" notice, at most half of the limit.
const NOTIFY_AFTER: Duration = Duration::from_secs(5);
/// Default time limit of a call before a run, or for a replacement during one: large models compute tables.
const DEFAULT_LIMIT: Duration = Duration::from_secs(60);
/// Time limit of a call after a run: the device is stopped, and nothing depends on the call.
const END_LIMIT: Duration = Duration::from_secs(5);
/// Poll interval while waiting for a call.
const POLL_INTERVAL: Duration = Duration::from_millis(20);

/// Plugin call outside the loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Call {
    /// Loading the file, which runs its initialisers.
    Load,
    /// Creating a model.
    Create,
    /// Preparing a model for the loop.
    Prepare,
    /// Opening a device and reading its capabilities.
    Open,
    /// Energising a device.
    Activate,
    /// Stopping a device at the end of a run.
    SafeStop,
    /// Ending the energy balance of a device and de-energising it.
    Deactivate,
    /// Reading the message about a failed call.
    LastMessage,
    /// Freeing a model.
    Destroy,
    /// Closing a device.
    Close,
}

impl fmt::Display for Call {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Load => "its initialisers",
            Self::Create => "`create`",
            Self::Prepare => "`prepare`",
            Self::Open => "`open`",
            Self::Activate => "`activate`",
            Self::SafeStop => "`safe_stop`",
            Self::Deactivate => "`deactivate`",
            Self::LastMessage => "`last_message`",
            Self::Destroy => "`destroy`",
            Self::Close => "`close`",
        })
    }
}

/// Call that did not return in time: its thread is abandoned, and the process should end soon.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{who}` did not return from {call} within {} s, the time limit; check the plugin, or raise the limit with `{LIMIT_VARIABLE}`",
    limit.as_secs_f64()
)]
pub struct Unresponsive {
    /// Name in the scene, or path of the file.
    pub who: String,
    /// Call that did not return.
    pub call: Call,
    /// Time limit of the call.
    pub limit: Duration,
}

/// Notice for the user.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Notice {
    /// A call takes long.
    Waiting {
        /// Name in the scene, or path of the file.
        who: String,
        /// Call in progress.
        call: Call,
        /// Time limit of the call.
        limit: Duration,
    },
    /// A plugin changed the state of the process.
    Changed {
        /// Name in the scene.
        who: String,
        /// Changed parts, restored by the host.
        restored: Vec<&'static str>,
        /// Changed environment variables, which stay: other threads may read them at any time.
        variables: Vec<String>,
    },
    /// The watchdog process has ended, and the run continues.
    Unguarded,
}

impl fmt::Display for Notice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Waiting { who, call, limit } => {
                write!(f, "waiting for `{who}` to return from {call}, for up to {} s", limit.as_secs_f64())
            }
            Self::Changed { who, restored, variables } => {
                write!(f, "`{who}` changed ")?;
                if !restored.is_empty() {
                    write!(f, "{} of the host; restored by the host", restored.join(", "))?;
                }
                if !variables.is_empty() {
                    let joined = if restored.is_empty() { "" } else { "; it also changed " };
                    write!(
                        f,
                        "{joined}environment variables of the host ({}), which the host does not restore",
                        variables.join(", ")
                    )?;
                }
                Ok(())
            }
            Self::Unguarded => f.write_str(
                "the watchdog process has ended, so no process stops the devices if this program is killed",
            ),
        }
    }
}

static ON_NOTICE: OnceLock<fn(&Notice)> = OnceLock::new();
static STOP: OnceLock<StopSwitch> = OnceLock::new();
static ABANDONED: AtomicBool = AtomicBool::new(false);

/// Sets the callback for notices: calls that take 5 s or more, changes of the process by plugins, and the end of a watchdog
/// process. Only the first callback counts.
pub fn on_notice(notify: fn(&Notice)) {
    let _ = ON_NOTICE.set(notify);
}

/// Sets the switch that stops waiting for a call before a run, when nothing is energised. Only the first switch counts.
pub fn stop_waits_with(stop: &StopSwitch) {
    let _ = STOP.set(stop.clone());
}

/// Returns true unless a stop was requested.
pub(crate) fn is_to_begin() -> bool {
    STOP.get().is_none_or(|stop| !stop.is_stop_requested() && stop.emergency().is_none())
}

pub(crate) fn notify(notice: &Notice) {
    if let Some(notify) = ON_NOTICE.get() {
        notify(notice);
    }
}

/// Runs plugin code, `make`, and restores the state of the process afterwards.
pub(crate) fn keeping_machine<T>(who: &str, make: impl FnOnce() -> T) -> T {
    let (before, variables) = (MachineState::now(), environment());
    let made = make();
    let (restored, variables) = (before.restore(), changed_variables(&variables, &environment()));
    if !(restored.is_empty() && variables.is_empty()) {
        notify(&Notice::Changed { who: who.to_owned(), restored, variables });
    }
    made
}

/// Returns the environment variables by name.
fn environment() -> BTreeMap<OsString, OsString> {
    std::env::vars_os().collect()
}

/// Returns the names of variables that were added, changed or removed.
fn changed_variables(
    before: &BTreeMap<OsString, OsString>,
    after: &BTreeMap<OsString, OsString>,
) -> Vec<String> {
    let names: BTreeSet<&OsString> = before.keys().chain(after.keys()).collect();
    let changed = names.into_iter().filter(|name| before.get(*name) != after.get(*name));
    changed.map(|name| name.display().to_string()).collect()
}

/// Returns true if a call did not return and its thread still runs: exit handlers of the process may wait for that thread.
#[must_use]
pub fn is_abandoned() -> bool {
    ABANDONED.load(Ordering::Relaxed)
}

/// Records that a thread with plugin code is abandoned.
pub(crate) fn abandon() {
    ABANDONED.store(true, Ordering::Relaxed);
}

/// Returns the time limit of a call before a run.
pub(crate) fn limit() -> Duration {
    limit_of(LIMIT_VARIABLE).unwrap_or(DEFAULT_LIMIT)
}

/// Reads a time limit from the environment.
pub(crate) fn limit_of(variable: &str) -> Option<Duration> {
    let seconds = std::env::var(variable).ok()?.parse::<f64>().ok().filter(|seconds| *seconds > 0.0)?;
    Duration::try_from_secs_f64(seconds).ok()
}

/// Returns the time limit of a call after a run: at most the one before a run.
pub(crate) fn end_limit() -> Duration {
    END_LIMIT.min(limit())
}

/// Progress of a call thread. Clones share their state.
#[derive(Clone, Default)]
pub(crate) struct Progress {
    now: Arc<Mutex<Option<Now>>>,
}

/// Running call.
struct Now {
    who: String,
    call: Call,
    since: Instant,
    is_reported: bool,
}

impl Progress {
    fn lock(&self) -> MutexGuard<'_, Option<Now>> {
        self.now.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Marks the start of a plugin call.
    pub(crate) fn enter(&self, who: &str, call: Call) {
        enter_call(who, call);
        *self.lock() = Some(Now { who: who.to_owned(), call, since: Instant::now(), is_reported: false });
    }

    /// Marks the end of the plugin call.
    pub(crate) fn exit(&self) {
        *self.lock() = None;
        exit_call();
    }

    /// Sends a notice about a call that takes long; returns an error for a call beyond the limit.
    pub(crate) fn check(&self, limit: Duration) -> Result<(), Unresponsive> {
        let mut now = self.lock();
        let Some(Now { who, call, since, is_reported }) = &mut *now else { return Ok(()) };
        let waited = since.elapsed();
        if waited >= limit {
            abandon();
            return Err(Unresponsive { who: who.clone(), call: *call, limit });
        }
        if waited >= NOTIFY_AFTER.min(limit / 2) && !*is_reported {
            *is_reported = true;
            notify(&Notice::Waiting { who: who.clone(), call: *call, limit });
        }
        Ok(())
    }
}

/// Plugin calls on a helper thread, with a time limit.
pub(crate) struct Attended<T> {
    result: Receiver<std::thread::Result<T>>,
    progress: Progress,
    limit: Duration,
}

impl<T: Send + 'static> Attended<T> {
    /// Starts a thread for the calls; `body` records each in the progress.
    ///
    /// # Errors
    /// If the system cannot start a thread.
    pub(crate) fn start(
        limit: Duration,
        body: impl FnOnce(&Progress) -> T + Send + 'static,
    ) -> std::io::Result<Self> {
        Ok(CallThread::start()?.attend(limit, body))
    }

    /// Waits up to `time` for the result; returns the result, or the call beyond its limit.
    pub(crate) fn poll(&self, time: Duration) -> Option<Result<T, Unresponsive>> {
        match self.result.recv_timeout(time) {
            Ok(Ok(value)) => Some(Ok(value)),
            // Only host code panics here.
            Ok(Err(panic)) => std::panic::resume_unwind(panic),
            Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => {
                self.progress.check(self.limit).err().map(Err)
            }
        }
    }

    /// Waits for the result while `is_wanted`, no longer than the limit for each call.
    ///
    /// # Errors
    /// Call that did not return; `None` if the result is not wanted any more.
    pub(crate) fn wait_while(self, is_wanted: impl Fn() -> bool) -> Result<T, Option<Unresponsive>> {
        while is_wanted() {
            if let Some(result) = self.poll(POLL_INTERVAL) {
                return result.map_err(Some);
            }
        }
        if matches!(self.result.try_recv(), Err(TryRecvError::Empty)) {
            abandon();
        }
        Err(None)
    }
}

type Job = Box<dyn FnOnce() + Send>;

/// Helper thread for plugin calls. It ends when the handle is dropped, after the calls that have begun.
pub(super) struct CallThread {
    jobs: SyncSender<Job>,
}

impl CallThread {
    /// Starts the thread, with the stack for crash handlers.
    ///
    /// # Errors
    /// If the system cannot start a thread.
    pub(super) fn start() -> std::io::Result<Self> {
        let (jobs, waiting) = sync_channel::<Job>(1);
        let thread = std::thread::Builder::new().name("flotor-calls".to_owned());
        thread.spawn(move || {
            prepare_for_calls();
            waiting.into_iter().for_each(|job| job());
        })?;
        Ok(Self { jobs })
    }

    /// Queues calls on this thread; `body` records each in the progress.
    pub(super) fn attend<T: Send + 'static>(
        &self,
        limit: Duration,
        body: impl FnOnce(&Progress) -> T + Send + 'static,
    ) -> Attended<T> {
        let progress = Progress::default();
        let (sender, result) = sync_channel(1);
        let inside = progress.clone();
        let job = move || {
            let value = catch_unwind(AssertUnwindSafe(|| body(&inside)));
            inside.exit();
            // Without a receiver the value is dropped here.
            let _ = sender.send(value);
        };
        // The thread ends after this sender only.
        let _ = self.jobs.send(Box::new(job));
        Attended { result, progress, limit }
    }
}

/// Runs plugin calls, `body`, on a helper thread, each for no longer than `limit`, and only while the result is wanted.
///
/// # Errors
/// Call that did not return, stop request, or no thread.
pub(crate) fn attended_while<T: Send + 'static>(
    limit: Duration,
    is_wanted: impl Fn() -> bool,
    body: impl FnOnce(&Progress) -> T + Send + 'static,
) -> Result<T, CallError> {
    let calls = Attended::start(limit, body).map_err(|_| CallError::NoThread)?;
    calls.wait_while(is_wanted).map_err(|unresponsive| unresponsive.map_or(CallError::Stopped, Into::into))
}

/// Reason why a call has no result.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CallError {
    /// The call did not return in time.
    #[error(transparent)]
    Unresponsive(#[from] Unresponsive),
    /// The system has no thread for the call.
    #[error("cannot start a thread for the calls of a plugin; {THREAD_ADVICE}")]
    NoThread,
    /// The run was stopped or over before the call returned.
    #[error("the run was stopped before `create`, `open` or another call returned; start the run again")]
    Stopped,
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHORT: Duration = Duration::from_millis(50);

    #[test]
    fn a_result_comes_back_and_each_call_has_the_whole_limit() {
        let made = attended_while(
            Duration::from_secs(600),
            || true,
            |progress| {
                progress.enter("jelly", Call::Create);
                progress.enter("jelly", Call::Prepare);
                7
            },
        );
        assert_eq!(made, Ok(7));
    }

    #[test]
    fn who_does_not_return_is_named_and_left_behind() {
        let (release, held) = sync_channel::<()>(0);
        let made = attended_while(
            SHORT,
            || true,
            move |progress| {
                progress.enter("jelly", Call::Create);
                progress.enter("rubber", Call::Prepare);
                held.recv()
            },
        );
        let told = Unresponsive { who: "rubber".to_owned(), call: Call::Prepare, limit: SHORT };
        assert_eq!(made.map(|_| ()), Err(CallError::Unresponsive(told)));
        assert!(is_abandoned());
        drop(release);
    }

    #[test]
    fn the_hosts_own_code_has_no_limit() {
        let made = attended_while(
            SHORT,
            || true,
            |progress| {
                progress.enter("jelly", Call::Create);
                progress.exit();
                std::thread::sleep(4 * SHORT);
            },
        );
        assert_eq!(made, Ok(()));
    }

    #[test]
    fn a_result_that_nobody_wants_is_not_waited_for() {
        let (release, held) = sync_channel::<()>(0);
        let calls = Attended::start(Duration::from_secs(600), move |progress| {
            progress.enter("jelly", Call::Create);
            held.recv()
        });
        assert!(calls.expect("a thread").wait_while(|| false).is_err_and(|error| error.is_none()));
        drop(release);
    }
}
