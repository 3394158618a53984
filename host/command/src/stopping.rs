//! Requests of a user to end a run: Ctrl-C for an orderly end; the space bar or `kill -USR1` for an emergency stop.
//!
//! If an orderly end takes too long, the user repeats the signal: the second signal is an emergency stop, the third ends the
//! process. The process also ends if it is still running 5 s after the second signal, or if a plugin call in the loop has lasted
//! 1.5 s after a request. With [`stop_run_on_signals`], the first signal ends the process if no device has been energised yet.
//!
//! A dedicated thread waits for requests. On Linux these are signals, blocked in every other thread, so that a plugin that installs
//! handlers or blocks signals cannot intercept them. On Windows they are events of the console, and Ctrl-Break is an emergency
//! stop.

use super::{CommandError, note, print_error_line};
use crate::platform::{INTERRUPTED, KeyTerminal, Request, Requests, is_orphaned, outlive_requests};
use flotor_servo::last_stop::{calls, exit_process, stop_all, was_armed};
use flotor_servo::{EmergencySource, StopSwitch, Stuck, THREAD_ADVICE, enter_guard_priority};
use std::io::{self, Read, stdin};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::{Duration, Instant};

/// Interval within which signals count as one request: `timeout` signals its child and then the child's group, and a closing
/// terminal signals the shell, which signals its jobs. A user cannot repeat a signal faster.
const ONE_REQUEST: Duration = Duration::from_millis(100);

/// Grace period of a run after an emergency stop, before the process is ended by force.
const LAST_PATIENCE: Duration = Duration::from_secs(5);
/// Timeout of a plugin call in the loop after a request to end, and poll interval for the call. Longer than the one second after
/// which a run itself reports the call.
const CALL_PATIENCE: Duration = Duration::from_millis(1500);
const LOOK: Duration = Duration::from_millis(100);
/// Poll interval of the stop switch while no signal has been received.
const UNASKED_LOOK: Duration = Duration::from_millis(400);
/// Time limit for stopping the devices before the process is ended.
const STOP_PATIENCE: Duration = Duration::from_millis(50);

/// Effect of the first signal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum First {
    /// Orderly end.
    InOrder,
    /// Orderly end, once a run has energised a device; before, the process ends.
    InOrderOnceEnergised,
}

/// Starts the thread that handles signals, and returns the stop switch of that thread: the first signal that requests an end (such
/// as Ctrl-C) leads to an orderly end, the second to an emergency stop, the third ends the process; `SIGUSR1` (on Windows,
/// Ctrl-Break) leads to an emergency stop. Call this function before other threads start.
///
/// # Errors
/// If the system cannot block the signals or start a thread.
pub fn stop_on_signals() -> Result<StopSwitch, CommandError> {
    take_signals(First::InOrder)
}

/// Starts the signal thread and returns its stop switch, as [`stop_on_signals`] does, but for a process that has not yet prepared
/// its run: until a device has been energised, the first signal ends the process, even while a plugin's code runs. Call this
/// function before other threads start.
///
/// # Errors
/// If the system cannot block the signals or start a thread.
pub fn stop_run_on_signals() -> Result<StopSwitch, CommandError> {
    take_signals(First::InOrderOnceEnergised)
}

/// Blocks all requests to end for this process, which ends by itself; prints a note if the system does not permit this.
pub fn outlive_signals() {
    if let Err(error) = outlive_requests() {
        note(format_args!("cannot block signals: {error}"));
    }
}

fn take_signals(first: First) -> Result<StopSwitch, CommandError> {
    let stop = StopSwitch::default();
    let attended = || {
        let (requests, exit, stop) = (Requests::listen(&stop)?, Exit::prepare()?, stop.clone());
        let thread = std::thread::Builder::new().name("flotor-signals".to_owned());
        thread.spawn(move || attend(&requests, first, &stop, &exit))
    };
    attended().map_err(|cause: io::Error| {
        CommandError::Failed(format!(
            "cannot install the signal handlers that stop a run: {cause}; {THREAD_ADVICE}"
        ))
    })?;
    Ok(stop)
}

/// Handles signals as long as the process runs.
fn attend(requests: &Requests, first: First, stop: &StopSwitch, exit: &Exit) {
    // Above the priority of a loop that occupies its core.
    enter_guard_priority();
    let (mut insistence, mut hang) = (Insistence::default(), Hang::default());
    loop {
        // A thread that does not block a signal may have received it: then only the switch shows the request.
        let is_asked = || insistence.last.is_some() || stop.is_stop_requested();
        let patience = if is_asked() { LOOK } else { UNASKED_LOOK };
        let Some(request) = requests.next(patience) else {
            let now = Instant::now();
            if is_asked()
                && let Some((who, at)) = hang.look(calls(), now)
            {
                let call = at.place.call();
                print_error_line(format_args!(
                    "error: `{who}` did not return from {call} in tick {} after the request to stop",
                    at.tick
                ));
                exit.take();
            }
            // The end of the supervisor is a request to end.
            if insistence.is_out_of_patience(now)
                || is_orphaned() && !insistence.is_younger_than_patience(now)
            {
                exit.take();
            }
            continue;
        };
        if request == Request::Emergency {
            stop.press(EmergencySource::Signal);
            continue;
        }
        match insistence.answer(Instant::now()) {
            Answer::InOrder if first == First::InOrderOnceEnergised && !was_armed() => exit.take(),
            Answer::InOrder => stop.stop(),
            Answer::AtOnce => stop.press(EmergencySource::Signal),
            Answer::Leave => exit.take(),
        }
    }
}

/// Forced end of a process: a thread that stops the devices, started early because starting a thread may fail later.
struct Exit {
    stop: SyncSender<()>,
    stopped: Receiver<()>,
}

impl Exit {
    fn prepare() -> io::Result<Self> {
        let (stop, asked) = sync_channel(1);
        let (done, stopped) = sync_channel(1);
        let thread = std::thread::Builder::new().name("flotor-exit".to_owned());
        thread.spawn(move || {
            if asked.recv().is_ok() {
                stop_all();
                let _ = done.send(());
            }
        })?;
        Ok(Self { stop, stopped })
    }

    /// Stops the devices, waiting at most 50 ms, and ends the process without its exit handlers, which may hang.
    fn take(&self) -> ! {
        let _ = self.stop.try_send(());
        let _ = self.stopped.recv_timeout(STOP_PATIENCE);
        exit_process(INTERRUPTED)
    }
}

/// Reaction to a signal that requests an end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Answer {
    InOrder,
    AtOnce,
    Leave,
}

/// Last reaction to a request to end, and its time.
#[derive(Default)]
struct Insistence {
    last: Option<(Instant, Answer)>,
}

impl Insistence {
    /// Returns true if the grace period after an emergency stop is over.
    fn is_out_of_patience(&self, now: Instant) -> bool {
        self.last.is_some_and(|(since, answer)| {
            answer == Answer::AtOnce && now.duration_since(since) >= LAST_PATIENCE
        })
    }

    /// Returns true if the last request to end is more recent than the grace period.
    fn is_younger_than_patience(&self, now: Instant) -> bool {
        self.last.is_some_and(|(since, _)| now.duration_since(since) < LAST_PATIENCE)
    }

    fn answer(&mut self, now: Instant) -> Answer {
        let answer = match self.last {
            Some((since, answer)) if now.duration_since(since) < ONE_REQUEST => return answer,
            None => Answer::InOrder,
            Some((_, Answer::InOrder)) => Answer::AtOnce,
            Some((_, Answer::AtOnce | Answer::Leave)) => Answer::Leave,
        };
        self.last = Some((now, answer));
        answer
    }
}

/// Detector of plugin calls that do not return: the calls of the loops at the last poll, and the time since which one of them has lasted.
#[derive(Default)]
struct Hang {
    seen: Vec<(String, Stuck)>,
    since: Option<Instant>,
}

impl Hang {
    /// Returns a call that has lasted for the timeout, with the name of the plugin; `None` if there is none.
    fn look(&mut self, calls: Vec<(String, Stuck)>, now: Instant) -> Option<(String, Stuck)> {
        let lasting = calls.iter().find(|call| self.seen.contains(call)).cloned();
        let since = *self.since.get_or_insert(now);
        self.seen = calls;
        match lasting {
            Some(call) if now.duration_since(since) >= CALL_PATIENCE => Some(call),
            Some(_) => None,
            None => {
                self.since = Some(now);
                None
            }
        }
    }
}

/// Keyboard control of a run; dropping it restores the mode of the terminal.
pub struct Keys {
    _terminal: KeyTerminal,
}

impl Keys {
    /// Starts a thread that reads keys: space triggers the emergency stop, `q` requests an orderly end. `None` without a terminal
    /// (a pipe), in the background, or if the system cannot start a thread.
    pub fn listen(stop: &StopSwitch) -> Option<Self> {
        let terminal = KeyTerminal::take()?;
        let stop = stop.clone();
        // The thread ends with the process: its read cannot be interrupted.
        let thread = std::thread::Builder::new().name("flotor-keys".to_owned());
        let listening = thread.spawn(move || {
            for key in stdin().lock().bytes().map_while(Result::ok) {
                match request_of(key) {
                    Some(Request::Emergency) => stop.press(EmergencySource::Key),
                    Some(Request::End) => stop.stop(),
                    None => {}
                }
            }
        });
        let keys = Self { _terminal: terminal }; // restores the terminal when dropped, if there is no thread
        listening.ok().map(|_| keys)
    }
}

/// Returns the request of a key; the space bar, the largest key, is the emergency stop.
fn request_of(key: u8) -> Option<Request> {
    match key {
        b' ' => Some(Request::Emergency),
        b'q' => Some(Request::End),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_servo::Place;

    #[test]
    fn a_repeated_request_is_more_urgent() {
        let (mut insistence, start) = (Insistence::default(), Instant::now());
        let mut after_ms = |ms| insistence.answer(start + Duration::from_millis(ms));
        assert_eq!([0, 1, 99].map(&mut after_ms), [Answer::InOrder; 3], "one request, however many signals");
        assert_eq!([100, 199].map(&mut after_ms), [Answer::AtOnce; 2]);
        assert_eq!([200, 300, 301].map(&mut after_ms), [Answer::Leave; 3]);
        let (mut insistence, later) = (Insistence::default(), start + LAST_PATIENCE);
        assert_eq!(insistence.answer(start - LAST_PATIENCE), Answer::InOrder);
        assert!(!insistence.is_out_of_patience(later), "an orderly end may take its time");
        assert_eq!(insistence.answer(start), Answer::AtOnce);
        assert!(!insistence.is_out_of_patience(start) && insistence.is_out_of_patience(later));
    }

    #[test]
    fn a_call_that_lasts_is_found_and_those_that_return_are_not() {
        let (mut hang, start) = (Hang::default(), Instant::now());
        let at = |tick| ("jelly".to_owned(), Stuck { tick, place: Place::Model(0) });
        let mut look = |ms, calls: &[u64]| {
            hang.look(calls.iter().map(|tick| at(*tick)).collect(), start + Duration::from_millis(ms))
        };
        assert_eq!(look(0, &[1]), None);
        assert_eq!(look(2000, &[2]), None, "another tick");
        assert_eq!(look(4000, &[]), None, "the host's own code");
        assert_eq!([look(6000, &[3]), look(6100, &[3]), look(7499, &[3])], [None, None, None]);
        assert_eq!(look(7500, &[3]), Some(at(3)));
    }

    #[test]
    fn the_space_bar_is_the_emergency_stop() {
        assert_eq!(request_of(b' '), Some(Request::Emergency));
        assert_eq!(request_of(b'q'), Some(Request::End));
        assert_eq!(request_of(b'x'), None);
    }
}
