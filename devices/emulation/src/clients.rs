//! Queue of the clients of a port that serves one client at a time.

use crate::port::Port;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use std::io;
use std::net::TcpStream;
use std::time::{Duration, Instant};

/// Timeout for the first bytes of a client.
pub const FIRST_MESSAGE: Duration = Duration::from_secs(5);
/// Timeout from the first bytes of a message to its last: a host writes a message at once, and a slower client delays the others.
const REST_OF_MESSAGE: Duration = Duration::from_millis(200);
/// Silence after which the served client is disconnected if another client waits. Before its first tick a host may be silent for
/// longer, while its models are prepared.
const LONGEST_SILENCE: Duration = Duration::from_secs(5);
/// Limit on clients that have sent nothing yet; a further client replaces the oldest.
const MOST_SILENT: usize = 32;
/// Interval at which silent clients are checked.
const CHECK: Timespec = Timespec { tv_sec: 1, tv_nsec: 0 };
const NOW: Timespec = Timespec { tv_sec: 0, tv_nsec: 0 };

/// Clients of a port, served one at a time in the order in which their first messages arrive. Clients that have sent
/// nothing do not block the others.
pub struct Clients {
    port: Port,
    silent: Vec<(TcpStream, Instant)>,
}

impl Clients {
    /// Creates the queue of a port, without clients.
    ///
    /// # Errors
    /// If the port cannot be set to non-blocking.
    pub fn of(port: Port) -> io::Result<Self> {
        port.listener.set_nonblocking(true)?;
        Ok(Self { port, silent: Vec::new() })
    }

    /// Waits for the next client that has sent data and returns its connection. A client that sends nothing is
    /// disconnected after [`FIRST_MESSAGE`], or earlier if too many such clients are connected.
    ///
    /// # Errors
    /// Errors of `poll` and of the socket.
    pub fn wait_for_one(&mut self) -> io::Result<TcpStream> {
        loop {
            if let Some(place) = self.look(&CHECK)? {
                let (stream, _) = self.silent.remove(place);
                stream.set_nonblocking(false)?;
                return Ok(stream);
            }
        }
    }

    /// Returns true if another client has sent data and waits for service. Does not block.
    fn is_one_waiting(&mut self) -> bool {
        // As many events at most as there may be silent clients.
        (0..MOST_SILENT).any(|_| self.look(&NOW).is_ok_and(|place| place.is_some()))
    }

    /// Handles at most one event within a timeout: accepts a client, removes a client that has left, or returns the index of a
    /// client that has sent something.
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
        all.push(PollFd::new(&self.port.listener, PollFlags::IN));
        match poll(&mut all, Some(timeout)) {
            Ok(_) | Err(rustix::io::Errno::INTR) => {}
            Err(error) => return Err(error.into()),
        }
        let is_ready = |descriptor: &PollFd<'_>| !descriptor.revents().is_empty();
        let is_new = all.pop().is_some_and(|listener| is_ready(&listener));
        Ok(Ready { client: all.iter().position(is_ready), is_new })
    }
}

/// Readable descriptors after a poll.
struct Ready {
    /// Index of a silent client that has sent something or has left.
    client: Option<usize>,
    /// True if a client connects.
    is_new: bool,
}

/// Time limits of the served client. A client that keeps sending complete messages is a host and is not disconnected,
/// even if others wait: a hostile program of the same user could end the emulator anyway.
pub struct Tenure<'c> {
    others: &'c mut Clients,
    /// Time of the last whole message.
    message: Instant,
    /// Arrival of the first bytes of an incomplete message.
    part: Option<Instant>,
}

impl<'c> Tenure<'c> {
    /// Starts the time limits of a client whose first message is not complete yet.
    pub fn begin(others: &'c mut Clients) -> Self {
        let now = Instant::now();
        Self { others, message: now, part: Some(now) }
    }

    /// Records a complete message, which restarts the time limits.
    pub fn message(&mut self) {
        (self.message, self.part) = (Instant::now(), None);
    }

    /// Records bytes of an incomplete message, whose other bytes are due within 200 ms of the first.
    pub fn part(&mut self) {
        self.part.get_or_insert_with(Instant::now);
    }

    /// Returns true if the client must be disconnected: a message has been incomplete for more than 200 ms, or the client has been
    /// silent for more than 5 s and another client waits. Does not block.
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
