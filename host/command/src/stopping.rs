//! How a person ends a run: Ctrl-C in order; the space bar or `kill -USR1` at once.
//!
//! If an orderly end takes too long, the user repeats the signal: the second one is an emergency stop, the
//! third ends the process, as does the second one some seconds later. Before anything is energised, the first does.
//!
//! A thread of its own waits for what asks. On Linux these are signals, blocked in every other thread: a plugin that installs
//! handlers or blocks signals takes none of them away. On Windows they are events of the console, and Ctrl-Break ends a run at once.

use super::{CommandError, note, print_error_line};
use crate::platform::{INTERRUPTED, KeyTerminal, Request, Requests, is_orphaned, outlive_requests};
use flotor_servo::last_stop::{calls, leave_process, stop_all, was_armed};
use flotor_servo::{EmergencySource, StopSwitch, Stuck, THREAD_ADVICE, enter_guard_priority};
use std::io::{self, Read, stdin};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::{Duration, Instant};

/// Signals this close together are one request: `timeout` signals its child and then the group the child is in, a
/// terminal that closes tells the shell, which tells its jobs. A person takes longer.
const ONE_REQUEST: Duration = Duration::from_millis(100);

/// How long a run may take to end after an emergency stop: what holds it up then is left behind.
const LAST_PATIENCE: Duration = Duration::from_secs(5);
/// How long a call of the loop may last once an end was requested, and the interval between two looks at it. A run that names the call
/// itself waits for one second.
const CALL_PATIENCE: Duration = Duration::from_millis(1500);
const LOOK: Duration = Duration::from_millis(100);
/// Interval between two looks at the switch as long as no signal was taken here.
const UNASKED_LOOK: Duration = Duration::from_millis(400);
/// How long devices may take to be told to stop when a process is left.
const STOP_PATIENCE: Duration = Duration::from_millis(50);

/// What the first signal means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum First {
    /// End in order.
    InOrder,
    /// The same, once a run has energised something; before, nothing has to be put in order.
    InOrderOnceEnergised,
}

/// Returns a switch that the first signal of `ENDING` uses in order and the second at once (the third ends the
/// process), and `SIGUSR1` at once. Called before there are other threads.
///
/// # Errors
/// No thread for them.
pub fn stop_on_signals() -> Result<StopSwitch, CommandError> {
    take_signals(First::InOrder)
}

/// Returns such a switch for a run that is yet to be prepared: as long as nothing has been energised, the first signal ends the
/// process, whatever code a plugin executes.
///
/// # Errors
/// No thread for them.
pub fn stop_run_on_signals() -> Result<StopSwitch, CommandError> {
    take_signals(First::InOrderOnceEnergised)
}

/// Whatever asks this process to end does not: it ends by itself.
pub fn outlive_signals() {
    if let Err(error) = outlive_requests() {
        note(format_args!("cannot block signals: {error}"));
    }
}

fn take_signals(first: First) -> Result<StopSwitch, CommandError> {
    let stop = StopSwitch::default();
    register(first, &stop).map_err(|cause| {
        CommandError::Failed(format!("cannot take signals, which end a run: {cause}; {THREAD_ADVICE}"))
    })?;
    Ok(stop)
}

fn register(first: First, stop: &StopSwitch) -> io::Result<()> {
    let requests = Requests::listen(stop)?;
    let exit = Exit::prepare()?;
    let stop = stop.clone();
    let thread = std::thread::Builder::new().name("flotor-signals".to_owned());
    thread.spawn(move || attend(&requests, first, &stop, &exit))?;
    Ok(())
}

/// Waits for signals as long as the process lives.
fn attend(requests: &Requests, first: First, stop: &StopSwitch, exit: &Exit) {
    // Above a loop that hogs its core.
    enter_guard_priority();
    let (mut insistence, mut hang) = (Insistence::default(), Hang::default());
    loop {
        // A thread that does not block a signal may have taken it: then only the switch says so.
        let is_asked = || insistence.last.is_some() || stop.is_stop_asked();
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
            // An orphan was asked to end when its supervisor ended.
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

/// The end of a process that hangs: a thread that stops its devices, started early because the system may refuse one later.
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

    /// Stops the devices and ends the process, without what a process does at its end: that may be what hangs, and so may a
    /// device's stop.
    fn take(&self) -> ! {
        let _ = self.stop.try_send(());
        let _ = self.stopped.recv_timeout(STOP_PATIENCE);
        leave_process(INTERRUPTED)
    }
}

/// Answer to a signal that requests an end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Answer {
    InOrder,
    AtOnce,
    Leave,
}

/// How often an end was requested: the last answer and its time.
#[derive(Default)]
struct Insistence {
    last: Option<(Instant, Answer)>,
}

impl Insistence {
    /// The run was to end at once, and that was some time ago.
    fn is_out_of_patience(&self, now: Instant) -> bool {
        self.last.is_some_and(|(since, answer)| {
            answer == Answer::AtOnce && now.duration_since(since) >= LAST_PATIENCE
        })
    }

    /// An end was requested a short time ago.
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

/// Calls that the loops were in at the last look, and the time when they were seen there first.
#[derive(Default)]
struct Hang {
    seen: Vec<(String, Stuck)>,
    since: Option<Instant>,
}

impl Hang {
    /// Returns a call that has lasted too long.
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

/// Keys without a line end, while it lives.
pub struct Keys {
    _terminal: KeyTerminal,
}

impl Keys {
    /// Listens to the terminal: space is the emergency stop, `q` an orderly end. `None` where there is no terminal
    /// to listen to: in a pipe, in the background.
    pub fn listen(stop: &StopSwitch) -> Option<Self> {
        let terminal = KeyTerminal::take()?;
        let stop = stop.clone();
        // Ends with the process: nothing can call it back from a read.
        let thread = std::thread::Builder::new().name("flotor-keys".to_owned());
        let listening = thread.spawn(move || {
            for key in stdin().lock().bytes().map_while(Result::ok) {
                match KeyRequest::of(key) {
                    Some(KeyRequest::Emergency) => stop.press(EmergencySource::Key),
                    Some(KeyRequest::Stop) => stop.stop(),
                    None => {}
                }
            }
        });
        let keys = Self { _terminal: terminal }; // dropped, and the terminal put right, if there is no thread
        listening.ok().map(|_| keys)
    }
}

/// Request of a key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum KeyRequest {
    Emergency,
    Stop,
}

impl KeyRequest {
    /// The largest key is the emergency stop.
    fn of(key: u8) -> Option<Self> {
        match key {
            b' ' => Some(Self::Emergency),
            b'q' => Some(Self::Stop),
            _ => None,
        }
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
        assert_eq!(KeyRequest::of(b' '), Some(KeyRequest::Emergency));
        assert_eq!(KeyRequest::of(b'q'), Some(KeyRequest::Stop));
        assert_eq!(KeyRequest::of(b'x'), None);
    }
}
