//! Calls of plugins outside the loop, each with a name and a time limit.
//!
//! No thread can be ended from outside while a plugin's code runs in it. Such a call therefore has a thread of its own; who
//! needs the result waits no longer than a limit, and then leaves the thread behind and names the plugin. In the
//! loop the watchdog does the same. Not real-time.

pub(crate) use end::{EndCalls, EndReserve};

mod end;

use crate::platform::MachineState;
use flotor_servo::last_stop::{enter_call, leave_call, prepare_for_calls};
use flotor_servo::{StopSwitch, THREAD_ADVICE};
use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TryRecvError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, Instant};

/// Environment variable with the longest time a call may take before a run, in seconds.
pub const LIMIT_VARIABLE: &str = "FLOTOR_CALL_LIMIT_S";

/// Environment variable with the longest processor time of a step without a clock (virtual clock, `validate`, `stress`), in seconds.
pub const STEP_LIMIT_VARIABLE: &str = "FLOTOR_STEP_LIMIT_S";

/// Time after which somebody who waits is told for whom, or half of a shorter limit.
const TELL_AFTER: Duration = Duration::from_secs(5);
/// The longest time a call may take before a run, or for a replacement during one, unless the user says so: large models
/// compute tables.
const DEFAULT_LIMIT: Duration = Duration::from_secs(60);
/// The longest time a call may take after a run: the device is stopped, and nothing depends on it.
const END_LIMIT: Duration = Duration::from_secs(5);
/// How often somebody who waits looks at the time.
const LOOK: Duration = Duration::from_millis(20);

/// A call of a plugin outside the loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Call {
    /// Its file is loaded, which runs its initialisers.
    Load,
    /// A model is made.
    Create,
    /// A model gets ready for the loop.
    Prepare,
    /// A device is opened, and says what it can do.
    Open,
    /// A device is energised.
    Activate,
    /// A device is told to stop at the end of a run.
    SafeStop,
    /// A device ends its energy balance and is de-energised.
    Deactivate,
    /// It says why a call failed.
    LastMessage,
    /// A model is freed.
    Destroy,
    /// A device is closed.
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

/// A call that did not return in time: its thread is left behind, and the process should end soon.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{who}` did not return from {call} within {} s; the host waits no longer (`{LIMIT_VARIABLE}` sets the limit)",
    limit.as_secs_f64()
)]
pub struct Unresponsive {
    /// Name in the scene, or the file.
    pub who: String,
    /// The call.
    pub call: Call,
    /// How long it was waited for.
    pub limit: Duration,
}

/// What a user may want to know at once.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Notice {
    /// A call takes long.
    Waiting {
        /// Name in the scene, or the file.
        who: String,
        /// The call.
        call: Call,
        /// When the wait ends.
        limit: Duration,
    },
    /// It changed what belongs to the process.
    Changed {
        /// Name in the scene.
        who: String,
        /// Parts that it changed and the host has restored.
        restored: Vec<&'static str>,
        /// Environment variables that it changed: other threads may read them at any time, so they stay.
        variables: Vec<String>,
    },
    /// The watchdog process of a run has ended, and the run goes on.
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
                        "{joined}environment variables of the host ({}), which stay",
                        variables.join(", ")
                    )?;
                }
                Ok(())
            }
            Self::Unguarded => f.write_str(
                "the watchdog process is gone; nothing stops the devices if this program is killed",
            ),
        }
    }
}

static TELL: OnceLock<fn(&Notice)> = OnceLock::new();
static STOP: OnceLock<StopSwitch> = OnceLock::new();
static LEFT_BEHIND: AtomicBool = AtomicBool::new(false);

/// Lets a program tell its user whose code is waited for, once a call has taken 5 s, what plugins change of the process, and that
/// a watchdog process is gone.
/// The first one set stays.
pub fn tell_notices(tell: fn(&Notice)) {
    let _ = TELL.set(tell);
}

/// Lets the user stop a process that waits for a call before a run: nothing is energised then. The first one set stays.
pub fn stop_waits_with(stop: &StopSwitch) {
    let _ = STOP.set(stop.clone());
}

/// Nobody has asked for an end.
pub(crate) fn is_to_begin() -> bool {
    STOP.get().is_none_or(|stop| !stop.is_stop_asked() && stop.emergency().is_none())
}

pub(crate) fn tell(notice: &Notice) {
    if let Some(tell) = TELL.get() {
        tell(notice);
    }
}

/// Makes something with the code of a plugin; what belongs to the process is then as it was before.
pub(crate) fn keeping_machine<T>(who: &str, make: impl FnOnce() -> T) -> T {
    let (before, variables) = (MachineState::now(), environment());
    let made = make();
    let (restored, variables) = (before.restore(), changed_variables(&variables, &environment()));
    if !(restored.is_empty() && variables.is_empty()) {
        tell(&Notice::Changed { who: who.to_owned(), restored, variables });
    }
    made
}

/// The variables of the environment, by name.
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

/// True if a call did not return and its thread still runs: what a process does at its end may wait for it.
#[must_use]
pub fn is_left_behind() -> bool {
    LEFT_BEHIND.load(Ordering::Relaxed)
}

/// A thread that runs code of a plugin is left to itself.
pub(crate) fn leave_behind() {
    LEFT_BEHIND.store(true, Ordering::Relaxed);
}

/// Returns the longest time a call may take before a run.
pub(crate) fn limit() -> Duration {
    limit_of(LIMIT_VARIABLE).unwrap_or(DEFAULT_LIMIT)
}

/// Reads a limit from the environment.
pub(crate) fn limit_of(variable: &str) -> Option<Duration> {
    let seconds = std::env::var(variable).ok()?.parse::<f64>().ok().filter(|seconds| *seconds > 0.0)?;
    Duration::try_from_secs_f64(seconds).ok()
}

/// The longest time a call may take after a run: no longer than before one.
pub(crate) fn end_limit() -> Duration {
    END_LIMIT.min(limit())
}

/// What a thread of calls is at. Clones are the same.
#[derive(Clone, Default)]
pub(crate) struct Progress {
    now: Arc<Mutex<Option<Now>>>,
}

/// A call that runs.
struct Now {
    who: String,
    call: Call,
    since: Instant,
    is_told: bool,
}

impl Progress {
    fn lock(&self) -> MutexGuard<'_, Option<Now>> {
        self.now.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whose code runs from now on.
    pub(crate) fn enter(&self, who: &str, call: Call) {
        enter_call(who, call);
        *self.lock() = Some(Now { who: who.to_owned(), call, since: Instant::now(), is_told: false });
    }

    /// The host's own code runs from now on.
    pub(crate) fn leave(&self) {
        *self.lock() = None;
        leave_call();
    }

    /// Tells of a call that takes long; an error for one that takes longer than the limit.
    pub(crate) fn look(&self, limit: Duration) -> Result<(), Unresponsive> {
        let mut now = self.lock();
        let Some(Now { who, call, since, is_told }) = &mut *now else { return Ok(()) };
        let waited = since.elapsed();
        if waited >= limit {
            leave_behind();
            return Err(Unresponsive { who: who.clone(), call: *call, limit });
        }
        if waited >= TELL_AFTER.min(limit / 2) && !*is_told {
            *is_told = true;
            tell(&Notice::Waiting { who: who.clone(), call: *call, limit });
        }
        Ok(())
    }
}

/// Calls of plugins on a thread of their own, and their result.
pub(crate) struct Attended<T> {
    result: Receiver<std::thread::Result<T>>,
    progress: Progress,
    limit: Duration,
}

impl<T: Send + 'static> Attended<T> {
    /// Starts a thread for the calls; `body` notes each in the progress.
    ///
    /// # Errors
    /// The system's, if there can be no thread.
    pub(crate) fn start(
        limit: Duration,
        body: impl FnOnce(&Progress) -> T + Send + 'static,
    ) -> std::io::Result<Self> {
        Ok(CallThread::start()?.attend(limit, body))
    }

    /// Returns the result, if it comes within `time`, or the call that does not return.
    pub(crate) fn look(&self, time: Duration) -> Option<Result<T, Unresponsive>> {
        match self.result.recv_timeout(time) {
            Ok(Ok(value)) => Some(Ok(value)),
            // Only the host's own code panics here.
            Ok(Err(panic)) => std::panic::resume_unwind(panic),
            Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => {
                self.progress.look(self.limit).err().map(Err)
            }
        }
    }

    /// Waits for the result, but no longer than the limit for each call, and only while `is_wanted`.
    ///
    /// # Errors
    /// Which call did not return; `None` if the result is not wanted any more.
    pub(crate) fn wait_while(self, is_wanted: impl Fn() -> bool) -> Result<T, Option<Unresponsive>> {
        while is_wanted() {
            if let Some(result) = self.look(LOOK) {
                return result.map_err(Some);
            }
        }
        if matches!(self.result.try_recv(), Err(TryRecvError::Empty)) {
            leave_behind();
        }
        Err(None)
    }
}

type Job = Box<dyn FnOnce() + Send>;

/// A thread for calls of plugins. It ends when this is dropped, after the calls that it has begun.
pub(super) struct CallThread {
    jobs: SyncSender<Job>,
}

impl CallThread {
    /// Starts the thread, with the stack on which it would end the process.
    ///
    /// # Errors
    /// The system's, if there can be no thread.
    pub(super) fn start() -> std::io::Result<Self> {
        let (jobs, waiting) = sync_channel::<Job>(1);
        let thread = std::thread::Builder::new().name("flotor-calls".to_owned());
        thread.spawn(move || {
            prepare_for_calls();
            waiting.into_iter().for_each(|job| job());
        })?;
        Ok(Self { jobs })
    }

    /// Executes calls on this thread, after those before; `body` notes each in the progress.
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
            inside.leave();
            // Nobody takes the value where nobody waits any more: it is dropped here.
            let _ = sender.send(value);
        };
        // The thread ends after this sender only.
        let _ = self.jobs.send(Box::new(job));
        Attended { result, progress, limit }
    }
}

/// Runs calls of plugins, `body`, on a thread of their own, each for no longer than `limit`, and only while the result is wanted.
///
/// # Errors
/// Which call did not return, or no thread.
pub(crate) fn attended_while<T: Send + 'static>(
    limit: Duration,
    is_wanted: impl Fn() -> bool,
    body: impl FnOnce(&Progress) -> T + Send + 'static,
) -> Result<T, CallError> {
    let calls = Attended::start(limit, body).map_err(|_| CallError::NoThread)?;
    calls.wait_while(is_wanted).map_err(|unresponsive| unresponsive.map_or(CallError::Stopped, Into::into))
}

/// Why there is no result of a call.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CallError {
    /// It did not return.
    #[error(transparent)]
    Unresponsive(#[from] Unresponsive),
    /// The system has no thread for it.
    #[error("cannot start a thread for the calls of a plugin; {THREAD_ADVICE}")]
    NoThread,
    /// The run it was for was stopped or over before.
    #[error("the run was stopped before `create`, `open` or the like returned")]
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
        assert!(is_left_behind());
        drop(release);
    }

    #[test]
    fn the_hosts_own_code_has_no_limit() {
        let made = attended_while(
            SHORT,
            || true,
            |progress| {
                progress.enter("jelly", Call::Create);
                progress.leave();
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
