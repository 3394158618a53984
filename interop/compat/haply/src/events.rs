//! Events of the service as JSON, and the queues of the clients of the events channel.

use crate::device::inverse_id;
use serde_json::{Value, json};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Mutex, PoisonError};

/// Limit on the events queued for a slow client; further events are lost for that client.
const MOST_WAITING: usize = 256;

/// Severity of an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Level {
    Info,
    Warning,
}

/// Queues of the clients of the events channel.
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

    /// Adds a client; returns its queue of the events from now on.
    pub(crate) fn listen(&self) -> Receiver<String> {
        let (sender, receiver) = sync_channel(MOST_WAITING);
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(sender);
        receiver
    }
}

/// Encodes the data of an event of a device.
pub(crate) fn device_data(number: usize) -> Value {
    json!({ "device_family": "inverse", "device_id": inverse_id(number) })
}

/// Encodes an event.
pub(crate) fn event(name: &str, category: &str, level: Level, data: Value, message: &str) -> String {
    let level = if level == Level::Info { "info" } else { "warning" };
    json!({ "name": name, "category": category, "level": level, "data": data, "message": message })
        .to_string()
}
