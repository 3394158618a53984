//! Channels of the service: the simulation channel with HTTP, and the events channel, a WebSocket that sends each event to all
//! clients and ignores their messages.

use crate::connection::{PATIENCE, answer, prepared, read_body, upgraded};
use crate::events::{Level, device_data, event};
use crate::http;
use crate::service::Service;
use crate::session::{self, socket};
use std::io;
use std::net::{Shutdown, TcpStream};
use std::time::Instant;
use tungstenite::Message;

/// Serves a client of the simulation channel until the connection ends, or answers one HTTP request.
///
/// # Errors
/// Error of the connection.
pub(crate) fn answer_client(service: &Service, mut stream: TcpStream) -> io::Result<()> {
    let deadline = Instant::now() + PATIENCE;
    let Some(mut head) = prepared(&mut stream, &service.access, deadline)? else { return Ok(()) };
    match upgraded(&mut stream, &head)? {
        true => session::serve(service, session::socket(stream, head.rest)),
        false => {
            read_body(&mut stream, &mut head, deadline)?;
            answer(&mut stream, &http::answer(service, &head.request))?;
        }
    }
    Ok(())
}

/// Sends a `device-connected` event for each device, and then all events, to a client of the events channel until the connection
/// ends.
///
/// # Errors
/// Error of the connection.
pub(crate) fn send_events(service: &Service, mut stream: TcpStream) -> io::Result<()> {
    let deadline = Instant::now() + PATIENCE;
    let Some(head) = prepared(&mut stream, &service.access, deadline)? else { return Ok(()) };
    if !upgraded(&mut stream, &head)? {
        return Ok(());
    }
    let (reading, closing) = (stream.try_clone()?, stream.try_clone()?);
    let events = service.events.listen();
    // Notices a closed connection at once; messages are ignored.
    let mut reader = socket(reading, head.rest);
    let thread = std::thread::Builder::new().name("flotor-listener".to_owned());
    thread.spawn(move || {
        while reader.read().is_ok() {}
        let _ = closing.shutdown(Shutdown::Both);
    })?;
    let mut writer = socket(stream, Vec::new());
    for number in 0..service.host.stations().len() {
        let text = event("device-connected", "device", Level::Info, device_data(number), "");
        writer.send(Message::text(text)).map_err(io::Error::other)?;
    }
    while let Ok(text) = events.recv() {
        writer.send(Message::text(text)).map_err(io::Error::other)?;
    }
    Ok(())
}
