//! Plugin call of a thread outside the loop: if the process ends in the call, the message names plugin and call.

use super::line::Line;
use crate::platform::last_stop::install_for_crashes;
use std::cell::Cell;
use std::fmt::{Display, Write};

thread_local! {
    /// Message if this thread ends the process; empty while the host's own code runs.
    static CALL: Cell<Line> = const { Cell::new(Line::EMPTY) };
    static HAS_HANDLERS: Cell<bool> = const { Cell::new(false) };
}

/// Installs the crash handlers and their stack for the calling thread; further calls have no effect. Not real-time.
pub fn prepare_for_calls() {
    if !HAS_HANDLERS.replace(true) {
        install_for_crashes();
    }
}

/// Marks the start of a plugin call in this thread: if the plugin crashes or calls `exit`, one line names plugin and call, and the
/// process ends with code 3. Not real-time.
pub fn enter_call(who: &str, call: impl Display) {
    prepare_for_calls();
    let mut line = Line::EMPTY;
    // A name that is too long is truncated, and the call with it.
    let _ = write!(line, "`{who}` ended the process in {call}");
    CALL.set(line);
}

/// Marks the end of the plugin call. Not real-time.
pub fn exit_call() {
    CALL.set(Line::EMPTY);
}

/// Returns the message about the plugin call of this thread; `None` outside a call. Safe in a signal handler.
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
        exit_call();
        assert!(current().is_none());
    }
}
