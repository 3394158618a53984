//! Connections: one thread each, with a state shared with the servo loop.
//!
//! A connection is a control connection until its client requests a token; from then on it carries events. A control
//! connection replies at once, except to procedures; it never waits for another connection, because a client's event
//! handler may be inside a call. Of the ticks only the newest is queued; other events are queued in order.
//!
//! Rejected connections are reset: clients do not detect an orderly close and would wait for ever.

mod callback;
mod connection;
mod control;
mod hub;
mod state;

pub use hub::{Hub, TickWait};
pub use state::Log;

use flotor_emulation::port::Port;
use std::io;
use std::net::TcpStream;
use std::sync::Arc;
use std::time::Duration;

/// Maximum number of connections; further connections are reset.
const CONNECTIONS: usize = 60;
/// Pause after a failed accept: the process may have no descriptor left.
const PAUSE: Duration = Duration::from_millis(10);
/// Write timeout: the longest time for a client to read a reply.
const WRITE_PATIENCE: Duration = Duration::from_secs(2);

/// Starts to accept connections of a port, in a thread of its own until the process ends.
///
/// # Errors
/// Errors of the system when starting the thread.
pub fn serve(port: Port, hub: Arc<Hub>) -> io::Result<()> {
    let accept = move || {
        // Its references count the connections.
        let served = Arc::new(());
        loop {
            let Ok(stream) = port.accept().and_then(prepared) else {
                std::thread::sleep(PAUSE);
                continue;
            };
            if Arc::strong_count(&served) > CONNECTIONS {
                continue;
            }
            let (hub, place) = (Arc::clone(&hub), Arc::clone(&served));
            let thread = std::thread::Builder::new().name("ml-api-client".to_owned());
            // A connection without a thread is dropped, and with it its place.
            let _ = thread.spawn(move || {
                let _place = place;
                control::serve(stream, &hub);
            });
        }
    };
    std::thread::Builder::new().name("ml-api".to_owned()).spawn(accept)?;
    Ok(())
}

/// Configures a connection to send small frames at once, and to reset when it is dropped or the process dies.
fn prepared(stream: TcpStream) -> io::Result<TcpStream> {
    stream.set_nodelay(true)?;
    stream.set_write_timeout(Some(WRITE_PATIENCE))?;
    rustix::net::sockopt::set_socket_linger(&stream, Some(Duration::ZERO))?;
    Ok(stream)
}
