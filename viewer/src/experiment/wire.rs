//! Channels between this window and the experiment that opened it: a line of JSON for each message, on standard input
//! and output. Separate threads read and write, so that neither program waits for the other.

use super::Prompt;
use flotor_study::screen::{WindowMessage, WindowReply};
use std::io::{BufRead, Write, stdin, stdout};
use std::sync::mpsc::channel;
use std::thread::Builder;

/// Connects to the experiment at this program's standard input and output.
///
/// # Errors
/// If a thread cannot be started.
pub fn connect_stdio() -> std::io::Result<Prompt> {
    let (teller, told) = channel();
    let (said, sayer) = channel::<WindowReply>();
    let prompt = Prompt::new(told, said);
    let waker = prompt.waker();
    // Both threads end with the process, or with the experiment.
    Builder::new().name("flotor-told".to_owned()).spawn(move || {
        for line in stdin().lock().lines().map_while(Result::ok) {
            // Skip an unknown message of a newer experiment.
            let Ok(word) = serde_json::from_str::<WindowMessage>(&line) else { continue };
            if teller.send(word).is_err() {
                return;
            }
            waker.wake();
        }
        drop(teller);
        waker.wake(); // the window then shows that the experiment has ended
    })?;
    Builder::new().name("flotor-said".to_owned()).spawn(move || {
        let mut out = stdout();
        for word in sayer {
            let Ok(line) = serde_json::to_string(&word) else { continue };
            if writeln!(out, "{line}").and_then(|()| out.flush()).is_err() {
                return;
            }
        }
    })?;
    Ok(prompt)
}
