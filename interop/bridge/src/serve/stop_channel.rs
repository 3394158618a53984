//! Bridge's end of a stop channel ([`crate::stop_channel`]).

use super::emergency::{Emergency, who};
use crate::keys::Name;
use crate::stop_channel::{Content, MOST_BYTES, Nonce, StopChannel, StopMessage};
use flotor_live::Directory;
use std::io;
use std::net::UdpSocket;
use std::sync::{Arc, Weak};
use std::time::Duration;

/// Timeout of a receive, and so the poll interval for the end of the bridge.
const LOOK: Duration = Duration::from_millis(200);

/// Guard of the open ports: their threads end when it is dropped.
pub(super) struct Open(Arc<()>);

/// Opens a UDP port at each address, with a thread of its own. Presses share no thread with the Zenoh session, in which a reply
/// may wait for a member.
///
/// # Errors
/// The first error: a port that cannot be bound, no further thread, or no random numbers.
pub(super) fn open(stop: &StopChannel, name: &Name, directory: &Directory) -> io::Result<Open> {
    let open = Open(Arc::default());
    let emergency = Arc::new(Emergency::start(directory)?);
    for address in &stop.addresses {
        let port = Port {
            socket: Arc::new(UdpSocket::bind(address)?),
            stop: stop.clone(),
            name: name.to_string(),
            emergency: Arc::clone(&emergency),
            open: Arc::downgrade(&open.0),
            challenge: Nonce::new()?,
        };
        port.socket.set_read_timeout(Some(LOOK))?;
        std::thread::Builder::new().name("flotor-stop".to_owned()).spawn(move || port.attend())?;
    }
    Ok(open)
}

struct Port {
    socket: Arc<UdpSocket>,
    stop: StopChannel,
    name: String,
    emergency: Arc<Emergency>,
    open: Weak<()>,
    /// Challenge that the next press must repeat.
    challenge: Nonce,
}

impl Port {
    fn attend(mut self) {
        let mut datagram = [0; MOST_BYTES];
        while self.open.strong_count() > 0 {
            let Ok((length, from)) = self.socket.recv_from(&mut datagram) else { continue };
            let message = datagram.get(..length).and_then(|bytes| StopMessage::open(bytes, &self.stop.keys));
            let Some(message) = message.filter(|message| message.bridge == self.name) else { continue };
            if self.stop.is_expired() {
                continue;
            }
            match message.content {
                Content::Hello => {
                    let answer = StopMessage { content: Content::Challenge(self.challenge), ..message };
                    if let Some(bytes) = answer.sealed(&self.stop.keys) {
                        let _ = self.socket.send_to(&bytes, from);
                    }
                }
                Content::Press(challenge) if challenge == self.challenge => {
                    // Renew the challenge first; without random numbers the press could be replayed, which does no harm.
                    if let Ok(next) = Nonce::new() {
                        self.challenge = next;
                    }
                    let (socket, keys) = (Arc::clone(&self.socket), self.stop.keys.clone());
                    let who = who(&message.member, &self.name);
                    let answer = move |refused| {
                        if let Some(bytes) = message.answer(refused).sealed(&keys) {
                            let _ = socket.send_to(&bytes, from);
                        }
                    };
                    self.emergency.press(&who, Box::new(answer));
                }
                Content::Press(_) | Content::Challenge(_) | Content::Answer(_) => {}
            }
        }
    }
}
