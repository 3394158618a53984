//! The plugin call outside the loop that a thread executes: if the process ends there, the message names plugin and call.

use super::line::Line;
use crate::platform::last_stop::install_for_crashes;
use std::cell::Cell;
use std::fmt::{Display, Write};

thread_local! {
    /// What a line says if this thread ends the process; empty while the host's own code runs.
    static CALL: Cell<Line> = const { Cell::new(Line::EMPTY) };
    static HAS_HANDLERS: Cell<bool> = const { Cell::new(false) };
}

/// Installs the handlers of a crash, with a stack for them, in this thread, unless they are. Not real-time.
pub fn prepare_for_calls() {
    if !HAS_HANDLERS.replace(true) {
        install_for_crashes();
    }
}

/// From now on this thread is in a call of a plugin: if it crashes there, or calls `exit`, one line names both, and the process
/// ends with code 3. Not real-time.
pub fn enter_call(who: &str, call: impl Display) {
    prepare_for_calls();
    let mut line = Line::EMPTY;
    // A name that is too long is cut, and the call with it.
    let _ = write!(line, "`{who}` ended the process in {call}");
    CALL.set(line);
}

/// The call is over. Not real-time.
pub fn leave_call() {
    CALL.set(Line::EMPTY);
}

/// What is to be said of the call in which this thread is, if it is in one. Safe in a signal handler.
pub(super) fn current() -> Option<Line> {
    let line = CALL.try_with(Cell::get).ok()?;
    (!line.text().is_empty()).then_some(line)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thread_knows_its_own_call_until_it_is_over() {
        assert!(current().is_none());
        enter_call("jelly", "`create`");
        assert_eq!(
            current().map(|line| line.text().to_owned()),
            Some("`jelly` ended the process in `create`".to_owned())
        );
        std::thread::spawn(|| assert!(current().is_none())).join().expect("another thread is in no call");
        leave_call();
        assert!(current().is_none());
    }
}
