//! Events channel: a WebSocket that sends each event to all clients and reads nothing.

use crate::connection::{PATIENCE, accept, prepared, rest, upgraded};
use crate::service::{Service, inverse_id};
use crate::session::socket;
use flotor_emulation::port::Port;
use serde_json::{Value, json};
use std::io;
use std::net::{Shutdown, TcpStream};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;
use tungstenite::Message;

/// Limit on the events queued for a slow client; further ones are lost for that client.
const MOST_WAITING: usize = 256;

/// Severity of an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Level {
    Info,
    Warning,
}

/// Clients of the events channel.
#[derive(Default)]
pub(crate) struct Events(Mutex<Vec<SyncSender<String>>>);

impl Events {
    /// Sends an event to all clients. Never waits.
    pub(crate) fn emit(&self, name: &str, category: &str, level: Level, data: Value, message: &str) {
        let text = event(name, category, level, data, message);
        let is_there = |listener: &SyncSender<String>| {
            !matches!(listener.try_send(text.clone()), Err(TrySendError::Disconnected(_)))
        };
        self.0.lock().unwrap_or_else(PoisonError::into_inner).retain(is_there);
    }

    fn listen(&self) -> Receiver<String> {
        let (sender, receiver) = sync_channel(MOST_WAITING);
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(sender);
        receiver
    }
}

fn event(name: &str, category: &str, level: Level, data: Value, message: &str) -> String {
    let level = if level == Level::Info { "info" } else { "warning" };
    json!({ "name": name, "category": category, "level": level, "data": data, "message": message })
        .to_string()
}

/// Serves the events channel.
///
/// # Errors
/// If the accepting thread cannot be created.
pub(crate) fn serve(service: &'static Service, port: Port) -> io::Result<()> {
    accept(port, "flotor-events", move |stream| send_events(service, stream))
}

fn send_events(service: &Service, mut stream: TcpStream) -> io::Result<()> {
    let deadline = Instant::now() + PATIENCE;
    let Some(head) = prepared(&mut stream, &service.access, deadline)? else { return Ok(()) };
    if !upgraded(&mut stream, &head)? {
        return Ok(());
    }
    let (reading, closing) = (stream.try_clone()?, stream.try_clone()?);
    let events = service.events.listen();
    // Notices a closed connection at once; messages are ignored.
    let mut reader = socket(reading, rest(head));
    let thread = std::thread::Builder::new().name("flotor-listener".to_owned());
    thread.spawn(move || {
        while reader.read().is_ok() {}
        let _ = closing.shutdown(Shutdown::Both);
    })?;
    let mut writer = socket(stream, Vec::new());
    for number in 0..service.host.stations().len() {
        let data = json!({ "device_family": "inverse", "device_id": inverse_id(number) });
        let text = event("device-connected", "device", Level::Info, data, "");
        writer.send(Message::text(text)).map_err(io::Error::other)?;
    }
    while let Ok(text) = events.recv() {
        writer.send(Message::text(text)).map_err(io::Error::other)?;
    }
    Ok(())
}
