//! A TCP port of an emulator: who may reach it, and which of those that connect is served.

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use std::io;
use std::net::{SocketAddr, TcpListener, TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant};

/// Time in which a client sends its first message.
pub const FIRST_MESSAGE: Duration = Duration::from_secs(5);
/// Time from the first bytes of a message to its last where one client is served at a time: a host writes it at once, and whoever
/// does not keeps the others waiting.
pub const REST_OF_MESSAGE: Duration = Duration::from_millis(200);
/// Clients that have sent nothing yet at most; a further one takes the place of the oldest.
const MOST_SILENT: usize = 32;
/// Interval at which silent clients are checked.
const CHECK: Timespec = Timespec { tv_sec: 1, tv_nsec: 0 };

/// Machines whose programs may connect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reach {
    /// This one, on which every user may.
    ThisMachine,
    /// All that reach the address.
    AnyMachine,
}

impl Reach {
    /// Returns the reach that the option `--allow-remote` gives.
    #[must_use]
    pub fn of(allow_remote: bool) -> Self {
        if allow_remote { Self::AnyMachine } else { Self::ThisMachine }
    }
}

/// Binds a port.
///
/// # Errors
/// The system's error, or one of kind `InvalidInput` for an address beyond this machine without consent; both with the remedy.
pub fn listen(at: &str, reach: Reach) -> io::Result<TcpListener> {
    let unusable = |error: io::Error| {
        let problem = format!("cannot listen at {at}: {error}; --listen 127.0.0.1:0 takes any free port");
        io::Error::new(error.kind(), problem)
    };
    let addresses: Vec<SocketAddr> = at.to_socket_addrs().map_err(unusable)?.collect();
    if reach == Reach::ThisMachine && addresses.iter().any(|address| !address.ip().is_loopback()) {
        let problem = format!(
            "{at} can be reached from other machines, and whoever reaches it commands the device; listen at 127.0.0.1, or add \
             --allow-remote"
        );
        return Err(io::Error::new(io::ErrorKind::InvalidInput, problem));
    }
    TcpListener::bind(&addresses[..]).map_err(unusable)
}

/// Clients of a port that serves one at a time: the first that sends something. Silent ones keep nobody out.
pub struct Clients {
    listener: TcpListener,
    silent: Vec<(TcpStream, Instant)>,
}

impl Clients {
    /// The clients of a port.
    ///
    /// # Errors
    /// What the system says.
    pub fn of(listener: TcpListener) -> io::Result<Self> {
        listener.set_nonblocking(true)?;
        Ok(Self { listener, silent: Vec::new() })
    }

    /// Waits for the next client that sends something. Those that connected earlier and are silent stay for
    /// [`FIRST_MESSAGE`].
    ///
    /// # Errors
    /// What the system says.
    pub fn wait_for_one(&mut self) -> io::Result<TcpStream> {
        loop {
            self.silent.retain(|(_, since)| since.elapsed() < FIRST_MESSAGE);
            let ready = self.wait()?;
            if let Some(place) = ready.client {
                let (stream, _) = self.silent.remove(place);
                if stream.peek(&mut [0]).is_ok_and(|length| length > 0) {
                    stream.set_nonblocking(false)?;
                    return Ok(stream);
                }
            } else if ready.is_new
                && let Ok((stream, _)) = self.listener.accept()
            {
                stream.set_nonblocking(true)?;
                if self.silent.len() >= MOST_SILENT {
                    self.silent.remove(0);
                }
                self.silent.push((stream, Instant::now()));
            }
        }
    }

    fn wait(&self) -> io::Result<Ready> {
        let streams = self.silent.iter().map(|(stream, _)| PollFd::new(stream, PollFlags::IN));
        let mut all: Vec<PollFd<'_>> = streams.collect();
        all.push(PollFd::new(&self.listener, PollFlags::IN));
        match poll(&mut all, Some(&CHECK)) {
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    #[test]
    fn an_address_that_is_taken_is_named_with_the_remedy() {
        let holder = listen("127.0.0.1:0", Reach::ThisMachine).unwrap();
        let at = holder.local_addr().unwrap().to_string();
        let error = listen(&at, Reach::ThisMachine).unwrap_err().to_string();
        assert!(error.contains(&at) && error.contains("127.0.0.1:0"), "{error}");
    }

    #[test]
    fn other_machines_reach_a_port_with_consent_only() {
        for at in ["0.0.0.0:0", "[::]:0"] {
            assert!(
                listen(at, Reach::ThisMachine).unwrap_err().to_string().contains("--allow-remote"),
                "{at}"
            );
        }
        assert!(listen("0.0.0.0:0", Reach::AnyMachine).is_ok());
        assert!(listen("localhost:0", Reach::ThisMachine).is_ok());
    }

    #[test]
    fn silent_clients_and_those_that_leave_keep_nobody_out() {
        let listener = listen("127.0.0.1:0", Reach::ThisMachine).unwrap();
        let at = listener.local_addr().unwrap();
        let mut clients = Clients::of(listener).unwrap();
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
