//! A force sensor without one, on a pseudo terminal: for the simulated rig. It speaks the protocol of the plugin `force-sensor`.

use serialport::{SerialPort, TTYPort};
use std::io::{Read, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// How long one look at the line takes at most.
const LOOK: Duration = Duration::from_millis(20);
/// Longest question that is remembered.
const LONGEST_LINE: usize = 200;

/// Answers on a pseudo terminal with the force it was last told.
pub(super) struct EmulatedSensor {
    port: String,
    /// Bits of the force, N.
    force: Arc<AtomicU64>,
    ending: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl EmulatedSensor {
    /// Starts one. Not real-time.
    ///
    /// # Errors
    /// What the system says: usually that there are no pseudo terminals.
    pub(super) fn start() -> std::io::Result<Self> {
        let (mut ours, theirs) = TTYPort::pair()?;
        ours.set_timeout(LOOK)?;
        let port = theirs.name().ok_or(std::io::ErrorKind::Unsupported)?;
        let (force, ending) = (Arc::new(AtomicU64::new(0)), Arc::new(AtomicBool::new(false)));
        let (told, end) = (Arc::clone(&force), Arc::clone(&ending));
        let thread = std::thread::Builder::new().name("flotor-sensor".to_owned()).spawn(move || {
            // Held open, or the terminal hangs up whenever nobody listens.
            let _theirs = theirs;
            let mut text = Vec::new();
            while !end.load(Ordering::Acquire) {
                let answer = match read_line(&mut ours, &mut text, LOOK) {
                    Ok(None) => continue,
                    // All digits: what is read is what was told.
                    Ok(Some(asked)) if asked == "R" => {
                        format!("F {}\n", f64::from_bits(told.load(Ordering::Acquire)))
                    }
                    Ok(Some(_)) => "E only R is understood\n".to_owned(),
                    Err(_) => return,
                };
                if ours.write_all(answer.as_bytes()).is_err() {
                    return;
                }
            }
        })?;
        Ok(Self { port, force, ending, thread: Some(thread) })
    }

    /// The path a [`ForceSensor`](super::sensor::ForceSensor) is opened by.
    #[must_use]
    pub(super) fn port(&self) -> &str {
        &self.port
    }

    /// What it feels from now on, N.
    pub(super) fn press(&self, force_n: f64) {
        self.force.store(force_n.to_bits(), Ordering::Release);
    }
}

impl Drop for EmulatedSensor {
    fn drop(&mut self) {
        self.ending.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// Reads up to the end of a line; nothing if it does not end in time: what came of it so far stays in `text`.
fn read_line(line: &mut TTYPort, text: &mut Vec<u8>, patience: Duration) -> std::io::Result<Option<String>> {
    let started = Instant::now();
    while started.elapsed() < patience {
        let mut byte = [0];
        match line.read(&mut byte) {
            Ok(0) => return Err(std::io::ErrorKind::UnexpectedEof.into()),
            Ok(_) if byte == *b"\n" => {
                let whole = std::mem::take(text);
                return Ok(Some(String::from_utf8_lossy(&whole).trim_end().to_owned()));
            }
            Ok(_) if text.len() < LONGEST_LINE => text.extend(byte),
            Ok(_) => return Ok(Some(String::from_utf8_lossy(&std::mem::take(text)).into_owned())),
            Err(error)
                if matches!(error.kind(), std::io::ErrorKind::TimedOut | std::io::ErrorKind::Interrupted) => {
            }
            Err(error) => return Err(error),
        }
    }
    Ok(None)
}
