//! Connections: a thread each, and one state that all of them share with the servo loop.
//!
//! A connection is a control connection until its client asks for a token: from then on it carries events. A control
//! connection always answers at once, but for procedures; it never waits for what another connection does, because a
//! client's handler of an event may be inside a call. Of ticks the newest waits, those in between are dropped; other events
//! wait in order.
//!
//! Whoever is thrown out is reset: a client does not notice that a connection was closed in order, and waits for ever.

mod callback;
mod control;
mod hub;
mod state;

pub use hub::{Hub, Log, TickWait};

use flotor_emulation::port::Port;
use std::io;
use std::net::TcpStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

/// Connections at a time; more are reset.
const CONNECTIONS: usize = 60;
/// Pause after a connection could not be accepted: there may be no descriptor left.
const PAUSE: Duration = Duration::from_millis(10);
/// How long a client may take to read a reply.
const WRITE_PATIENCE: Duration = Duration::from_secs(2);

/// A server that accepts connections in a thread of its own.
pub struct Server {
    hub: Arc<Hub>,
}

impl Server {
    /// Accepts connections of a port from now on, as long as the process lives.
    ///
    /// # Errors
    /// The system's error.
    pub fn start(port: Port, hub: Arc<Hub>) -> io::Result<Self> {
        let shared = Arc::clone(&hub);
        let open = Arc::new(AtomicUsize::new(0));
        std::thread::Builder::new().name("ml-api".to_owned()).spawn(move || {
            loop {
                let Ok(stream) = port.accept().and_then(prepared) else {
                    std::thread::sleep(PAUSE);
                    continue;
                };
                if open.load(Ordering::Acquire) >= CONNECTIONS {
                    continue;
                }
                open.fetch_add(1, Ordering::AcqRel);
                let (hub, counter) = (Arc::clone(&shared), Arc::clone(&open));
                let started = std::thread::Builder::new().name("ml-api-client".to_owned()).spawn(move || {
                    control::serve(stream, &hub);
                    counter.fetch_sub(1, Ordering::AcqRel);
                });
                if started.is_err() {
                    open.fetch_sub(1, Ordering::AcqRel);
                }
            }
        })?;
        Ok(Self { hub })
    }

    /// What the connections share.
    #[must_use]
    pub fn hub(&self) -> &Hub {
        &self.hub
    }
}

/// A connection that sends small frames at once, and that is reset when it is dropped or its process dies.
fn prepared(stream: TcpStream) -> io::Result<TcpStream> {
    stream.set_nodelay(true)?;
    stream.set_write_timeout(Some(WRITE_PATIENCE))?;
    rustix::net::sockopt::set_socket_linger(&stream, Some(Duration::ZERO))?;
    Ok(stream)
}
