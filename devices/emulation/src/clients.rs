//! Clients of a port that serves one at a time.

use crate::port::Port;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use std::io;
use std::net::TcpStream;
use std::time::{Duration, Instant};

/// Time in which a client sends its first message.
pub const FIRST_MESSAGE: Duration = Duration::from_secs(5);
/// Time from the first bytes of a message to its last: a host writes it at once, and a slower client delays the others.
const REST_OF_MESSAGE: Duration = Duration::from_millis(200);
/// Silence after which the client that is served is disconnected if another waits. Before its first tick a host may be silent for
/// longer, where its models take their time.
const LONGEST_SILENCE: Duration = Duration::from_secs(5);
/// Clients that have sent nothing yet at most; a further one takes the place of the oldest.
const MOST_SILENT: usize = 32;
/// Interval at which silent clients are checked.
const CHECK: Timespec = Timespec { tv_sec: 1, tv_nsec: 0 };
const NOW: Timespec = Timespec { tv_sec: 0, tv_nsec: 0 };

/// Clients of a port that serves one at a time: the first that sends something. Silent ones keep nobody out.
pub struct Clients {
    port: Port,
    silent: Vec<(TcpStream, Instant)>,
}

impl Clients {
    /// The clients of a port.
    ///
    /// # Errors
    /// The system's error.
    pub fn of(port: Port) -> io::Result<Self> {
        port.listener().set_nonblocking(true)?;
        Ok(Self { port, silent: Vec::new() })
    }

    /// Waits for the next client that sends something. Silent clients stay connected for [`FIRST_MESSAGE`].
    ///
    /// # Errors
    /// The system's error.
    pub fn wait_for_one(&mut self) -> io::Result<TcpStream> {
        loop {
            if let Some(place) = self.look(&CHECK)? {
                let (stream, _) = self.silent.remove(place);
                stream.set_nonblocking(false)?;
                return Ok(stream);
            }
        }
    }

    /// Returns whether a client has sent something and waits. Does not wait.
    fn is_one_waiting(&mut self) -> bool {
        // As many events at most as there may be silent clients.
        (0..MOST_SILENT).any(|_| self.look(&NOW).is_ok_and(|place| place.is_some()))
    }

    /// Handles one event in a time: accepts a client, removes one that has left, or returns the place of one that has sent something.
    fn look(&mut self, timeout: &Timespec) -> io::Result<Option<usize>> {
        self.silent.retain(|(_, since)| since.elapsed() < FIRST_MESSAGE);
        let ready = self.wait(timeout)?;
        if let Some(place) = ready.client {
            let has_sent = |stream: &TcpStream| stream.peek(&mut [0]).is_ok_and(|length| length > 0);
            if self.silent.get(place).is_some_and(|(stream, _)| has_sent(stream)) {
                return Ok(Some(place));
            }
            self.silent.remove(place);
        } else if ready.is_new
            && let Ok(stream) = self.port.accept()
        {
            stream.set_nonblocking(true)?;
            if self.silent.len() >= MOST_SILENT {
                self.silent.remove(0);
            }
            self.silent.push((stream, Instant::now()));
        }
        Ok(None)
    }

    fn wait(&self, timeout: &Timespec) -> io::Result<Ready> {
        let streams = self.silent.iter().map(|(stream, _)| PollFd::new(stream, PollFlags::IN));
        let mut all: Vec<PollFd<'_>> = streams.collect();
        all.push(PollFd::new(self.port.listener(), PollFlags::IN));
        match poll(&mut all, Some(timeout)) {
            Ok(_) | Err(rustix::io::Errno::INTR) => {}
            Err(error) => return Err(error.into()),
        }
        let is_ready = |descriptor: &PollFd<'_>| !descriptor.revents().is_empty();
        let is_new = all.pop().is_some_and(|listener| is_ready(&listener));
        Ok(Ready { client: all.iter().position(is_ready), is_new })
    }
}

/// Descriptors that can be read.
struct Ready {
    /// The place of a client that has sent something or has left.
    client: Option<usize>,
    /// Whether a client connects.
    is_new: bool,
}

/// The time for which a client is served while others wait. One that sends whole messages is a host, and keeps its turn: a program
/// of the same user could end the emulator as well.
pub struct Tenure<'c> {
    others: &'c mut Clients,
    /// The last whole message.
    message: Instant,
    /// The first bytes of a message that is not whole yet.
    part: Option<Instant>,
}

impl<'c> Tenure<'c> {
    /// Begins the service to a client, whose first message is due.
    pub fn begin(others: &'c mut Clients) -> Self {
        let now = Instant::now();
        Self { others, message: now, part: Some(now) }
    }

    /// Counts a whole message.
    pub fn message(&mut self) {
        (self.message, self.part) = (Instant::now(), None);
    }

    /// Counts bytes of a message that is not whole.
    pub fn part(&mut self) {
        self.part.get_or_insert_with(Instant::now);
    }

    /// Returns whether the client is to be disconnected: a message of it did not come whole in time, or it has been silent for long and
    /// another one waits.
    pub fn is_over(&mut self) -> bool {
        self.part.is_some_and(|since| since.elapsed() > REST_OF_MESSAGE)
            || self.message.elapsed() > LONGEST_SILENCE && self.others.is_one_waiting()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::port::Reach;
    use std::io::Write;

    #[test]
    fn silent_clients_and_those_that_leave_keep_nobody_out() {
        let port = Port::bind("127.0.0.1:0", Reach::ThisUser).unwrap();
        let at = port.address().unwrap();
        let mut clients = Clients::of(port).unwrap();
        let silent: Vec<TcpStream> = (0..2 * MOST_SILENT).map(|_| TcpStream::connect(at).unwrap()).collect();
        (0..10).for_each(|_| drop(TcpStream::connect(at).unwrap()));
        let mut talking = TcpStream::connect(at).unwrap();
        talking.write_all(b"x").unwrap();
        let served = clients.wait_for_one().unwrap();
        assert_eq!(served.peer_addr().unwrap(), talking.local_addr().unwrap());
        assert!(clients.silent.len() <= MOST_SILENT);
        drop(silent);
    }
}
