//! Threads for plugin calls, each call with a name and a time limit.

use super::call::{Call, CallError, Unresponsive, end_limit};
use super::process::{Notice, abandon, notify};
use flotor_core::lock;
use flotor_servo::last_stop::{enter_call, exit_call, prepare_for_calls};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TryRecvError, sync_channel};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Delay before a [`Notice::Waiting`]; half of the time limit if that is shorter.
const NOTIFY_AFTER: Duration = Duration::from_secs(5);
/// Poll interval while waiting for a call.
const POLL_INTERVAL: Duration = Duration::from_millis(20);
/// Memory reserved for the end of a run, bytes: for last messages, summary, and index of the recording.
const RESERVE_BYTES: usize = 1 << 20;
/// Size of one reserved block, bytes: small enough that the allocator takes it from the heap and returns it there when freed.
const BLOCK_BYTES: usize = 1 << 16;

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
    /// Marks the start of a plugin call.
    pub(crate) fn enter(&self, who: &str, call: Call) {
        enter_call(who, call);
        *lock(&self.now) = Some(Now { who: who.to_owned(), call, since: Instant::now(), is_reported: false });
    }

    /// Marks the end of the plugin call.
    pub(crate) fn exit(&self) {
        *lock(&self.now) = None;
        exit_call();
    }

    /// Sends one notice about a slow call; once the call exceeds `limit`, marks its thread as abandoned and returns an error.
    pub(crate) fn check(&self, limit: Duration) -> Result<(), Unresponsive> {
        let mut now = lock(&self.now);
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

type Job = Box<dyn FnOnce() + Send>;

/// Thread for plugin calls, started by the first call. A call that does not return occupies the thread, and the next call starts a
/// new thread. The thread ends when the handle is dropped, after the calls in progress have returned.
#[derive(Default)]
pub(crate) struct CallThread {
    jobs: Option<SyncSender<Job>>,
}

impl CallThread {
    /// Starts the thread, with the stack for crash handlers.
    ///
    /// # Errors
    /// If the system cannot start a thread.
    fn start() -> std::io::Result<SyncSender<Job>> {
        let (jobs, waiting) = sync_channel::<Job>(1);
        let thread = std::thread::Builder::new().name("flotor-calls".to_owned());
        thread.spawn(move || {
            prepare_for_calls();
            waiting.into_iter().for_each(|job| job());
        })?;
        Ok(jobs)
    }

    /// Starts `body` on this thread without waiting; `body` makes plugin calls and records each in the progress.
    ///
    /// # Errors
    /// If the system cannot start a thread.
    pub(crate) fn begin<T: Send + 'static>(
        &mut self,
        limit: Duration,
        body: impl FnOnce(&Progress) -> T + Send + 'static,
    ) -> std::io::Result<PendingCall<T>> {
        let jobs = self.jobs.take().map_or_else(Self::start, Ok)?;
        let progress = Progress::default();
        let (sender, result) = sync_channel(1);
        let inside = progress.clone();
        let job = move || {
            let value = catch_unwind(AssertUnwindSafe(|| body(&inside)));
            inside.exit();
            // Without a receiver the value is dropped here.
            let _ = sender.send(value);
        };
        // Cannot fail: the thread receives as long as this sender exists.
        let _ = jobs.send(Box::new(job));
        self.jobs = Some(jobs);
        Ok(PendingCall { result, progress, limit })
    }

    /// Runs `body`, which makes plugin calls, on this thread and returns its result. Waits up to `limit` for each call, and only
    /// while `is_wanted` returns true.
    ///
    /// # Errors
    /// If a call exceeds `limit`, if `is_wanted` returns false, or if the system cannot start a thread.
    pub(crate) fn run_while<T: Send + 'static>(
        &mut self,
        limit: Duration,
        is_wanted: impl Fn() -> bool,
        body: impl FnOnce(&Progress) -> T + Send + 'static,
    ) -> Result<T, CallError> {
        let call = self.begin(limit, body).map_err(|_| CallError::NoThread)?;
        call.wait_while(is_wanted).inspect_err(|_| self.jobs = None)
    }

    /// Runs `body` as [`Self::run_while`] does, with the limit of calls at the end of a run.
    pub(crate) fn run_to_end<T: Send + 'static>(
        &mut self,
        body: impl FnOnce(&Progress) -> T + Send + 'static,
    ) -> Result<T, CallError> {
        self.run_while(end_limit(), || true, body)
    }
}

/// Plugin calls in progress on a [`CallThread`].
pub(crate) struct PendingCall<T> {
    result: Receiver<std::thread::Result<T>>,
    progress: Progress,
    limit: Duration,
}

impl<T> PendingCall<T> {
    /// Waits up to `time` for the result; returns the result, or an error if a call has exceeded its limit; `None` if neither.
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

    /// Waits for the result while `is_wanted` returns true, up to the limit for each call.
    fn wait_while(self, is_wanted: impl Fn() -> bool) -> Result<T, CallError> {
        while is_wanted() {
            if let Some(result) = self.poll(POLL_INTERVAL) {
                return Ok(result?);
            }
        }
        if matches!(self.result.try_recv(), Err(TryRecvError::Empty)) {
            abandon();
        }
        Err(CallError::Stopped)
    }
}

/// Thread and memory for the end of a run, reserved before anything is energised: if the run exhausts a resource limit, the system
/// grants neither at the end. The default reserves nothing.
#[derive(Default)]
pub(crate) struct EndReserve {
    thread: CallThread,
    memory: Vec<Box<[u8]>>,
}

impl EndReserve {
    /// Starts the thread and reserves the memory. Not real-time.
    ///
    /// # Errors
    /// If the system cannot start a thread.
    pub(crate) fn take() -> std::io::Result<Self> {
        // Written, so that the system maps each page.
        let block = || vec![1; BLOCK_BYTES].into_boxed_slice();
        let memory = std::iter::repeat_with(block).take(RESERVE_BYTES / BLOCK_BYTES).collect();
        Ok(Self { thread: CallThread { jobs: Some(CallThread::start()?) }, memory })
    }

    /// Frees the reserved memory and returns the thread for the calls at the end of the run.
    pub(crate) fn begin(self) -> CallThread {
        drop(self.memory);
        self.thread
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calls::is_abandoned;

    const SHORT: Duration = Duration::from_millis(50);

    #[test]
    fn a_result_comes_back_and_each_call_has_the_whole_limit() {
        let made = CallThread::default().run_while(
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
        let made = CallThread::default().run_while(
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
        let made = CallThread::default().run_while(
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
        let call = CallThread::default().begin(Duration::from_secs(600), move |progress| {
            progress.enter("jelly", Call::Create);
            held.recv()
        });
        assert!(call.expect("a thread").wait_while(|| false).is_err_and(|error| error == CallError::Stopped));
        drop(release);
    }

    #[test]
    fn all_calls_that_return_share_one_thread_and_one_that_hangs_keeps_it() {
        let limit = Duration::from_millis(50);
        let mut calls = EndReserve::take().expect("a thread").begin();
        let thread =
            |calls: &mut CallThread| calls.run_while(limit, || true, |_| std::thread::current().id());
        let first = thread(&mut calls).expect("it returns");
        assert_eq!(thread(&mut calls), Ok(first));
        let (release, held) = sync_channel::<()>(0);
        let hung = calls.run_while(
            limit,
            || true,
            move |progress| {
                progress.enter("jelly", Call::Close);
                held.recv()
            },
        );
        assert!(matches!(hung, Err(CallError::Unresponsive(_))), "{hung:?}");
        let next = thread(&mut calls).expect("it returns");
        assert_ne!(next, first);
        drop(release);
    }
}
