//! Watchdog for steps that do not return: every call records its inputs while it lasts, and one thread polls.
//!
//! Nothing can end such a call but the end of its process. So the watchdog thread reports it, and each measurement runs
//! in its own process.

use flotor_core::lock;
use flotor_hal::{Input, Pose};
use flotor_session::{Exceeded, LongCall, ThreadClock};
use std::collections::BTreeMap;
use std::fmt;
use std::io;
use std::sync::{Arc, Mutex, Weak};
use std::thread;
use std::time::Duration;

/// Poll interval.
const LOOK: Duration = Duration::from_millis(20);

/// Thread that makes calls, with its present call.
struct Caller {
    clock: ThreadClock,
    doing: Mutex<Doing>,
}

#[derive(Clone, Copy, Default)]
struct Doing {
    /// Number of calls so far.
    calls: u64,
    /// Present call: number of steps, and tick and pose of the first.
    at: Option<(u32, u64, Pose)>,
}

/// Threads that have made calls.
static CALLERS: Mutex<Vec<Weak<Caller>>> = Mutex::new(Vec::new());

thread_local! {
    static OWN: Arc<Caller> = {
        let own = Arc::new(Caller { clock: ThreadClock::of_this_thread(), doing: Mutex::default() });
        lock(&CALLERS).push(Arc::downgrade(&own));
        own
    };
}

/// Guard of a call: while it exists, its thread counts as being in a step.
pub struct CallGuard(());

/// Marks this thread as being in `step` with these inputs, until the returned guard is dropped. Takes some tens of nanoseconds.
#[must_use]
pub fn enter_call(inputs: &[Input]) -> CallGuard {
    let steps = u32::try_from(inputs.len()).unwrap_or(u32::MAX);
    let at = inputs.first().map(|first| (steps, first.tick, first.pose));
    OWN.with(|own| {
        let mut doing = lock(&own.doing);
        *doing = Doing { calls: doing.calls + 1, at };
    });
    CallGuard(())
}

impl Drop for CallGuard {
    fn drop(&mut self) {
        OWN.with(|own| lock(&own.doing).at = None);
    }
}

/// Step that does not return.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StuckStep {
    /// Tick of the input, of a batch the first.
    pub tick: u64,
    /// Pose of the input, of a batch the first.
    pub pose: Pose,
    /// Limit that was exceeded.
    pub limit: Exceeded,
}

impl fmt::Display for StuckStep {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "`step` did not return in tick {}{}", self.tick, self.limit)
    }
}

/// Starts a watchdog thread for all threads of this process. If a step exceeds `limit` of processor time, or ten times `limit`
/// in waiting (a batch: as many times as it has steps), the thread calls `on_stuck` with the step and ends.
///
/// # Errors
/// If no thread can be started.
pub fn start(limit: Duration, on_stuck: impl FnOnce(StuckStep) + Send + 'static) -> io::Result<()> {
    thread::Builder::new().spawn(move || {
        let mut seen = BTreeMap::new();
        loop {
            thread::sleep(LOOK.min(limit));
            if let Some(stuck) = stuck(&mut seen, limit) {
                return on_stuck(stuck);
            }
        }
    })?;
    Ok(())
}

/// Returns a step that has exceeded its limit; `None` if there is none. `seen`: call of each thread at the last poll.
fn stuck(seen: &mut BTreeMap<usize, LongCall<u64>>, limit: Duration) -> Option<StuckStep> {
    let callers: Vec<Arc<Caller>> = {
        let mut all = lock(&CALLERS);
        all.retain(|caller| caller.strong_count() > 0);
        all.iter().filter_map(Weak::upgrade).collect()
    };
    for caller in callers {
        let id = Arc::as_ptr(&caller).addr();
        let Doing { calls, at } = *lock(&caller.doing);
        let Some((steps, tick, pose)) = at else {
            seen.remove(&id);
            continue;
        };
        let call = seen.entry(id).or_insert_with(|| LongCall::new(calls));
        if let Some(limit) = call.check(calls, &caller.clock, limit.saturating_mul(steps), None) {
            return Some(StuckStep { tick, pose, limit });
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::subject::input_of;
    use flotor_hal::DVec3;
    use std::sync::mpsc;
    use std::time::Instant;

    #[test]
    fn the_step_that_does_not_return_is_named_and_no_other() {
        let far = Pose { position_m: DVec3::new(1.0, 2.0, 3.0).to_array(), ..Pose::HOME };
        let (tell, told) = mpsc::channel();
        let limit = Duration::from_millis(20);
        start(limit, move |stuck| tell.send(stuck).expect("the test waits")).expect("a thread");
        let (end, ended) = mpsc::channel::<()>();
        // One that makes many short calls for longer than the limit, then one long call.
        let worker = thread::spawn(move || {
            let begin = Instant::now();
            while begin.elapsed() < 20 * limit {
                let _call = enter_call(&[input_of(1, Pose::HOME)]);
            }
            let _call = enter_call(&[input_of(700, far)]);
            ended.recv().ok();
        });
        let stuck = told.recv().expect("it is found");
        assert_eq!((stuck.tick, stuck.pose, stuck.limit), (700, far, Exceeded::Waiting(10 * limit)));
        assert!(stuck.to_string().starts_with("`step` did not return in tick 700 within 0.2 s"), "{stuck}");
        end.send(()).expect("the worker waits");
        worker.join().expect("the worker ends");
    }
}
