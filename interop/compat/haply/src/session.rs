//! Client of the simulation channel: one state per message. The reply to a message with a command waits for the next
//! tick, unless the next message has arrived already; a message that only reads is answered at once.

use crate::message::carry_out;
use crate::service::Service;
use crate::state::{Extent, write};
use flotor_compat::{Pace, Turn};
use rustix::net::{RecvFlags, recv};
use std::io::{self, ErrorKind, Read, Write};
use std::net::TcpStream;
use std::time::Duration;
use tungstenite::protocol::{Role, WebSocketConfig};
use tungstenite::{Error, Message, WebSocket};

/// Limit on a message of a client, bytes.
const LONGEST: usize = 1 << 20;
/// Size of the read buffer, bytes.
const ROOM: usize = 16 << 10;

/// Silence after which a session ends in real time, so that silent clients do not use up the connections.
const LONGEST_SILENCE: Duration = Duration::from_secs(20);

/// Connection whose reads can be switched to non-blocking.
pub(crate) struct Link {
    pub(crate) stream: TcpStream,
    /// True while reads do not block.
    is_asking: bool,
}

impl Read for Link {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.is_asking {
            Ok(recv(&self.stream, buffer, RecvFlags::DONTWAIT).map(|(count, _)| count)?)
        } else {
            self.stream.read(buffer)
        }
    }
}

impl Write for Link {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.stream.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.stream.flush()
    }
}

/// Creates the WebSocket of an upgraded connection; `read` contains the bytes received since the upgrade request.
pub(crate) fn socket(stream: TcpStream, read: Vec<u8>) -> WebSocket<Link> {
    let config = WebSocketConfig::default()
        .read_buffer_size(ROOM)
        .write_buffer_size(0)
        .max_message_size(Some(LONGEST))
        .max_frame_size(Some(LONGEST));
    WebSocket::from_partially_read(Link { stream, is_asking: false }, read, Role::Server, Some(config))
}

/// Serves a client until the connection ends or, in real time, the client is silent for 20 s.
pub(crate) fn serve(service: &Service, mut socket: WebSocket<Link>) {
    let session = service.enter();
    if service.host.pace() == Pace::Real {
        let _ = socket.get_ref().stream.set_read_timeout(Some(LONGEST_SILENCE));
    }
    let ended = answer(service, session, &mut socket);
    service.remove(session);
    if let Err(Error::Capacity(_) | Error::Utf8(_) | Error::Protocol(_)) = &ended {
        let _ = socket.close(None);
    }
    let _ = socket.flush();
}

/// Replies to each message of a session; returns the error that ends the connection.
fn answer(service: &Service, session: u64, socket: &mut WebSocket<Link>) -> Result<(), Error> {
    let turn = Turn::default();
    let mut text = String::new();
    write(&mut text, service, session, Extent::All);
    socket.send(Message::text(text.as_str()))?;
    let mut next = None;
    loop {
        let message = match next.take() {
            Some(message) => message,
            None => read(socket)?,
        };
        let carried = match &message {
            Message::Text(message) => carry_out(service, session, message),
            Message::Binary(message) => match std::str::from_utf8(message) {
                Ok(message) => carry_out(service, session, message),
                Err(_) => {
                    service.refuse("", "a message must be text", "binary");
                    Default::default()
                }
            },
            _ => continue,
        };
        match carried.commanded.and_then(|device| service.host.station(device)) {
            None => service.host.note_read(|| ()),
            Some(_) if service.host.pace() == Pace::Lockstep => {
                service.host.advance();
            }
            Some(station) => {
                next = waiting(socket)?;
                if next.is_none() {
                    service.host.wait_in(station, &turn);
                }
            }
        }
        write(&mut text, service, session, if carried.wants_all { Extent::All } else { Extent::State });
        socket.send(Message::text(text.as_str()))?;
    }
}

/// Waits for the next message.
fn read(socket: &mut WebSocket<Link>) -> Result<Message, Error> {
    loop {
        match socket.read() {
            Err(Error::Io(error)) if error.kind() == ErrorKind::Interrupted => {}
            read => return read,
        }
    }
}

/// Returns the next message if it has arrived.
fn waiting(socket: &mut WebSocket<Link>) -> Result<Option<Message>, Error> {
    socket.get_mut().is_asking = true;
    let read = socket.read();
    socket.get_mut().is_asking = false;
    match read {
        Ok(message) => Ok(Some(message)),
        Err(Error::Io(error)) if [ErrorKind::WouldBlock, ErrorKind::Interrupted].contains(&error.kind()) => {
            Ok(None)
        }
        Err(error) => Err(error),
    }
}
