//! Emergency stop over the sockets of the other runs, which confirm the stop, in addition to the latch.
//!
//! One thread sends the request to all runs and does not block on any. Not real-time.

use crate::frame::{Frames, Kind, frame};
use crate::message::{Answer, Ask, Request};
use crate::platform::{Stream, connect_now};
use crate::{DirectoryError, FoundRun, Latch};
use std::io::{ErrorKind, Write};
use std::time::{Duration, Instant};

/// Poll interval of the runs that have not confirmed.
const LOOK_PERIOD: Duration = Duration::from_millis(2);

impl Latch {
    /// Sends an emergency stop to each run of the folder, and waits until all runs have confirmed or ended, or until the deadline
    /// `until`; returns the process ids of the runs that have not confirmed.
    ///
    /// # Errors
    /// If the runs cannot be listed.
    pub fn stop_runs(&self, until: Instant) -> Result<Vec<u32>, DirectoryError> {
        self.free_descriptors();
        let unconfirmed = self.unconfirmed(until);
        self.reserve_descriptors();
        unconfirmed
    }

    fn unconfirmed(&self, until: Instant) -> Result<Vec<u32>, DirectoryError> {
        let runs = self.directory.try_runs()?;
        let mut open: Vec<Stopping> =
            runs.into_iter().map(|run| Stopping { run, connection: None }).collect();
        loop {
            open.retain_mut(|stopping| !stopping.is_done());
            if open.is_empty() || Instant::now() >= until {
                return Ok(open.into_iter().map(|stopping| stopping.run.process).collect());
            }
            std::thread::sleep(LOOK_PERIOD);
        }
    }
}

/// Run that has not confirmed the stop yet.
struct Stopping {
    run: FoundRun,
    connection: Option<(Stream, Frames)>,
}

impl Stopping {
    /// Returns true if the run has confirmed, or is over.
    fn is_done(&mut self) -> bool {
        let (stream, frames) = match &mut self.connection {
            Some(connection) => connection,
            none => match ask(&self.run) {
                Ok(stream) => none.insert((stream, Frames::default())),
                Err(kind) => return matches!(kind, ErrorKind::ConnectionRefused | ErrorKind::NotFound),
            },
        };
        loop {
            match frames.fill(stream) {
                Ok(length) if length > 0 => {}
                Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                Err(error) if error.kind() == ErrorKind::WouldBlock => return false,
                // The run is over, or this client was evicted in favour of another: the next connection attempt shows which.
                _ => {
                    self.connection = None;
                    return false;
                }
            }
            while let Ok(Some((kind, payload))) = frames.take() {
                let has_stopped = match kind {
                    Kind::Answer => {
                        serde_json::from_slice::<Answer>(payload).is_ok_and(|a| a.refused.is_none())
                    }
                    Kind::End => true,
                    _ => false,
                };
                if has_stopped {
                    return true;
                }
            }
        }
    }
}

/// Connects to a run and sends the stop request.
fn ask(run: &FoundRun) -> Result<Stream, ErrorKind> {
    let mut stream = connect_now(&run.path).map_err(|error| error.kind())?;
    let request = Request { number: 0, ask: Ask::MachineStop };
    let request = serde_json::to_vec(&request).map_err(|_| ErrorKind::InvalidData)?;
    stream.write_all(&frame(Kind::Request, &request)).map_err(|error| error.kind())?;
    Ok(stream)
}
