//! How a person ends a run: Ctrl-C in order; the space bar or `kill -USR1` at once.

use super::style;
use crate::servo::StopSwitch;
use rustix::process::getpgrp;
use rustix::termios::{LocalModes, OptionalActions, Termios, isatty, tcgetattr, tcgetpgrp, tcsetattr};
use signal_hook::consts::{SIGINT, SIGTERM, SIGUSR1, SIGXFSZ};
use signal_hook::flag;
use std::io::{Read, stdin};
use std::sync::Arc;

/// Exit code after a second Ctrl-C, when an orderly end takes too long: 128 + SIGINT, as shells have it.
const INTERRUPTED: i32 = 130;

/// A switch that Ctrl-C and `SIGTERM` use in order (a second one ends the process), and `SIGUSR1` at once.
pub(super) fn stop_on_signals() -> StopSwitch {
    let stop = StopSwitch::default();
    let registered = flag::register_conditional_shutdown(SIGINT, INTERRUPTED, stop.stop_flag())
        .and_then(|_| flag::register(SIGINT, stop.stop_flag()))
        .and_then(|_| flag::register(SIGTERM, stop.stop_flag()))
        .and_then(|_| flag::register(SIGUSR1, stop.emergency_flag()))
        // Else a file that may not grow any further would end the process, not the recording.
        .and_then(|_| flag::register(SIGXFSZ, Arc::default()));
    if let Err(error) = registered {
        eprintln!("{} signals will not end the run in order: {error}", style::warning("note:"));
    }
    stop
}

/// Keys without a line end, while it lives.
pub(super) struct Keys {
    before: Termios,
}

impl Keys {
    /// Listens to the terminal: space is the emergency stop, `q` an orderly end. `None` where there is no terminal
    /// to listen to: in a pipe, in the background.
    pub(super) fn listen(stop: &StopSwitch) -> Option<Self> {
        let terminal = stdin();
        // Changing the terminal from the background would suspend the process.
        if !isatty(&terminal) || tcgetpgrp(&terminal).ok()? != getpgrp() {
            return None;
        }
        let before = tcgetattr(&terminal).ok()?;
        let mut keys = before.clone();
        keys.local_modes.remove(LocalModes::ICANON | LocalModes::ECHO);
        tcsetattr(&terminal, OptionalActions::Now, &keys).ok()?;
        let stop = stop.clone();
        // Ends with the process: nothing can call it back from a read.
        let thread = std::thread::Builder::new().name("flotor-keys".to_owned());
        let listening = thread.spawn(move || {
            for key in stdin().lock().bytes().map_while(Result::ok) {
                match Wish::of(key) {
                    Some(Wish::Emergency) => stop.emergency_by_key(),
                    Some(Wish::Stop) => stop.stop(),
                    None => {}
                }
            }
        });
        let keys = Self { before }; // dropped, and the terminal put right, if there is no thread
        listening.ok().map(|_| keys)
    }
}

impl Drop for Keys {
    fn drop(&mut self) {
        let _ = tcsetattr(stdin(), OptionalActions::Now, &self.before);
    }
}

/// What a key asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Wish {
    Emergency,
    Stop,
}

impl Wish {
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

    #[test]
    fn the_space_bar_is_the_emergency_stop() {
        assert_eq!(Wish::of(b' '), Some(Wish::Emergency));
        assert_eq!(Wish::of(b'q'), Some(Wish::Stop));
        assert_eq!(Wish::of(b'x'), None);
    }
}
