//! Finds the call of a model that does not return: every call says where it is while it lasts, and one thread looks.
//!
//! Nothing can end such a call but the end of its process. So the thread that finds one reports the pose, and whoever
//! measures runs in a process of its own.

use flotor_hal::Pose;
use std::collections::BTreeMap;
use std::io;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::thread;
use std::time::Duration;

/// How often a watch looks while its patience lasts. Looks are counted, not time: a thread that had to wait for a processor
/// has been waited for by this one.
const LOOKS: u32 = 10;

/// Where the calls of one thread are.
#[derive(Default)]
struct Place(Mutex<Doing>);

#[derive(Clone, Copy, Default)]
struct Doing {
    /// Calls that have begun.
    calls: u64,
    /// The pose of the one that lasts.
    at: Option<Pose>,
}

/// The threads that have made calls.
static THREADS: Mutex<Vec<Weak<Place>>> = Mutex::new(Vec::new());

thread_local! {
    static OWN: Arc<Place> = {
        let own = Arc::new(Place::default());
        locked(&THREADS).push(Arc::downgrade(&own));
        own
    };
}

/// What is locked here is whole after each statement.
fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// While it lives, this thread is in a call.
pub struct Calling(());

/// This thread calls a model at a pose, until the result is dropped. Takes some tens of nanoseconds.
#[must_use]
pub fn calling(pose: Pose) -> Calling {
    OWN.with(|own| {
        let mut doing = locked(&own.0);
        *doing = Doing { calls: doing.calls + 1, at: Some(pose) };
    });
    Calling(())
}

impl Drop for Calling {
    fn drop(&mut self) {
        OWN.with(|own| locked(&own.0).at = None);
    }
}

/// Watches all threads of this process, until one is in the same call for longer than `patience`: then it reports the
/// pose, once, from a thread of its own.
///
/// # Errors
/// The system's, if there can be no thread.
pub fn start(patience: Duration, on_stuck: impl FnOnce(Pose) + Send + 'static) -> io::Result<()> {
    thread::Builder::new().spawn(move || {
        let mut seen = BTreeMap::new();
        loop {
            thread::sleep(patience / LOOKS);
            if let Some(pose) = stuck(&mut seen) {
                return on_stuck(pose);
            }
        }
    })?;
    Ok(())
}

/// The pose of a call that has been seen [`LOOKS`] times. `seen`: by thread, in which call, and how often.
fn stuck(seen: &mut BTreeMap<usize, (u64, u32)>) -> Option<Pose> {
    let threads: Vec<Arc<Place>> = {
        let mut all = locked(&THREADS);
        all.retain(|thread| thread.strong_count() > 0);
        all.iter().filter_map(Weak::upgrade).collect()
    };
    for thread in threads {
        let id = Arc::as_ptr(&thread).addr();
        let Doing { calls, at } = *locked(&thread.0);
        match (at, seen.get_mut(&id)) {
            (None, _) => drop(seen.remove(&id)),
            (Some(pose), Some((same, looks))) if *same == calls => {
                *looks += 1;
                if *looks > LOOKS {
                    return Some(pose);
                }
            }
            (Some(_), _) => drop(seen.insert(id, (calls, 1))),
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_hal::DVec3;
    use std::sync::mpsc;
    use std::time::Instant;

    #[test]
    fn the_call_that_does_not_return_is_named_and_no_other() {
        let far = Pose { position_m: DVec3::new(1.0, 2.0, 3.0).to_array(), ..Pose::HOME };
        let (tell, told) = mpsc::channel();
        let patience = Duration::from_millis(100);
        start(patience, move |pose| tell.send(pose).expect("the test waits")).expect("a thread");
        let (end, ended) = mpsc::channel::<()>();
        // One that makes many short calls for longer than the patience lasts, then one long call.
        let worker = thread::spawn(move || {
            let begin = Instant::now();
            while begin.elapsed() < 3 * patience {
                let _call = calling(Pose::HOME);
            }
            let _call = calling(far);
            ended.recv().ok();
        });
        assert_eq!(told.recv().expect("it is found"), far);
        end.send(()).expect("the worker waits");
        worker.join().expect("the worker ends");
    }
}
