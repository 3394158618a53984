//! Plugin calls at the end of a run. Their thread and memory are reserved before anything is energised: a limit of the machine,
//! reached during the run, would refuse both at its end.

use super::{CallError, CallThread, Progress};
use std::time::Duration;

/// Memory reserved for the end of a run, bytes: last messages, summary, index of the recording.
const RESERVE_BYTES: usize = 1 << 20;
/// Size of one block, bytes: small enough to come from the heap, to which a freed block returns.
const BLOCK_BYTES: usize = 1 << 16;

/// Thread and memory for the end of a run; the default reserves nothing.
#[derive(Default)]
pub(crate) struct EndReserve {
    thread: Option<CallThread>,
    memory: Vec<Box<[u8]>>,
}

impl EndReserve {
    /// Starts the thread and reserves the memory. Not real-time.
    ///
    /// # Errors
    /// If the system cannot start a thread.
    pub(crate) fn take() -> std::io::Result<Self> {
        // Written to, so that the system allocates each page.
        let block = || vec![1; BLOCK_BYTES].into_boxed_slice();
        let memory = std::iter::repeat_with(block).take(RESERVE_BYTES / BLOCK_BYTES).collect();
        Ok(Self { thread: Some(CallThread::start()?), memory })
    }

    /// Frees the memory and returns the thread for the calls.
    pub(crate) fn begin(self) -> EndCalls {
        drop(self.memory);
        EndCalls { thread: self.thread }
    }
}

/// Executor of the calls at the end of a run: one thread, as long as each call returns.
#[derive(Default)]
pub(crate) struct EndCalls {
    thread: Option<CallThread>,
}

impl EndCalls {
    /// Executes plugin calls, `body`, each for no longer than `limit`. A call that does not return occupies the thread, and the
    /// next one needs a new thread.
    ///
    /// # Errors
    /// The call that did not return, or no new thread.
    pub(crate) fn attended<T: Send + 'static>(
        &mut self,
        limit: Duration,
        body: impl FnOnce(&Progress) -> T + Send + 'static,
    ) -> Result<T, CallError> {
        let thread = self.thread.take().map_or_else(CallThread::start, Ok);
        let thread = thread.map_err(|_| CallError::NoThread)?;
        let result = thread.attend(limit, body).wait_while(|| true);
        let value = result.map_err(|unresponsive| unresponsive.map_or(CallError::Stopped, Into::into))?;
        self.thread = Some(thread);
        Ok(value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calls::Call;
    use std::sync::mpsc::sync_channel;

    #[test]
    fn all_calls_that_return_share_one_thread_and_one_that_hangs_keeps_it() {
        let limit = Duration::from_millis(50);
        let mut calls = EndReserve::take().expect("a thread").begin();
        let thread = |calls: &mut EndCalls| calls.attended(limit, |_| std::thread::current().id());
        let first = thread(&mut calls).expect("it returns");
        assert_eq!(thread(&mut calls), Ok(first));
        let (release, held) = sync_channel::<()>(0);
        let hung = calls.attended(limit, move |progress| {
            progress.enter("jelly", Call::Close);
            held.recv()
        });
        assert!(matches!(hung, Err(CallError::Unresponsive(_))), "{hung:?}");
        let next = thread(&mut calls).expect("it returns");
        assert_ne!(next, first);
        drop(release);
    }
}
