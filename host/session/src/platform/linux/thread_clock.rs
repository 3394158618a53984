//! Processor time and scheduling state of a thread, read by other threads.

use rustix::thread::gettid;
use std::time::Duration;

/// Unit of processor times in `/proc`: `USER_HZ` is 100 on every Linux.
const CLOCK_TICK: Duration = Duration::from_millis(10);

/// Processor use of a thread at one instant.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Used {
    /// Processor time since the start of the thread.
    pub(crate) ran: Duration,
    /// True if the thread runs, would run on a free processor, or waits for a disk.
    pub(crate) wants: bool,
}

/// Reader of the processor use of one thread.
pub struct ThreadClock {
    path: String,
}

impl ThreadClock {
    /// Creates a reader for the calling thread.
    #[must_use]
    pub fn of_this_thread() -> Self {
        Self { path: format!("/proc/self/task/{}/stat", gettid().as_raw_nonzero()) }
    }

    /// Returns the processor use; `None` if the system does not report it. Not real-time.
    pub(crate) fn used(&self) -> Option<Used> {
        let text = std::fs::read_to_string(&self.path).ok()?;
        // Field 3 of proc(5), the state, comes first after the name; fields 14 and 15 are the times.
        let fields: Vec<&str> = text.rsplit(')').next()?.split_whitespace().collect();
        let ticks = |field: usize| fields.get(field - 3)?.parse::<u32>().ok();
        let ran = CLOCK_TICK * ticks(14)?.saturating_add(ticks(15)?);
        Some(Used { ran, wants: matches!(*fields.first()?, "R" | "D") })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thread_that_runs_uses_time_and_one_that_waits_does_not() {
        let own = ThreadClock::of_this_thread();
        let used = || own.used().expect("/proc is there");
        while used().ran < 2 * CLOCK_TICK {
            assert!(used().wants);
        }
        let (clock, waiting) = std::thread::scope(|scope| {
            let (sender, receiver) = std::sync::mpsc::channel();
            let (end, ended) = std::sync::mpsc::channel::<()>();
            scope.spawn(move || {
                sender.send(ThreadClock::of_this_thread()).expect("the test waits");
                ended.recv().ok();
            });
            let clock = receiver.recv().expect("the thread sends it");
            while clock.used().is_some_and(|used| used.wants) {
                std::thread::yield_now();
            }
            let waiting = clock.used().expect("the thread waits");
            drop(end);
            (clock, waiting)
        });
        assert!(!waiting.wants && waiting.ran < used().ran);
        // The system removes an ended thread a moment after its last instruction.
        while clock.used().is_some() {
            std::thread::yield_now();
        }
    }
}
