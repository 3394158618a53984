//! Scripted service for tests: a callback returns each reply, and all messages are recorded. Not real-time.
//!
//! `flotor emulate haply-service` is a correct service; this service simulates faulty services.

use std::io::{self, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use tungstenite::handshake::derive_accept_key;

mod texts;

pub(crate) use texts::{ARM, GRIP, OTHER_ARM, configured, state};

/// Reply to a message.
#[derive(Clone, Debug)]
pub(crate) enum Said {
    /// A text message.
    Text(String),
    /// Raw bytes, for malformed frames.
    Raw(Vec<u8>),
    /// No reply; the connection stays open.
    Nothing,
    /// No reply; the connection is closed.
    Close,
}

/// Scripted service on a port of this machine, for one client after another.
#[derive(Debug)]
pub(crate) struct StandIn {
    /// Address, `host:port`.
    pub address: String,
    received: Arc<Mutex<Vec<String>>>,
    ended: Arc<AtomicUsize>,
}

impl StandIn {
    /// Starts a service. `answer` is called with the number of the message in its connection and the message; number 0
    /// (empty message) requests the first message of the service.
    ///
    /// # Errors
    /// If there is no port, or no thread.
    pub(crate) fn start(answer: impl FnMut(usize, &str) -> Said + Send + 'static) -> io::Result<Self> {
        let listener = TcpListener::bind("127.0.0.1:0")?;
        let address = listener.local_addr()?.to_string();
        let received = Arc::new(Mutex::new(Vec::new()));
        let ended = Arc::new(AtomicUsize::new(0));
        let (mut answer, receiving, ending) = (answer, Arc::clone(&received), Arc::clone(&ended));
        std::thread::Builder::new().name("stand-in".to_owned()).spawn(move || {
            while let Ok((stream, _)) = listener.accept() {
                // A client that disconnects is no failure.
                let _ = serve(stream, &mut answer, &receiving);
                ending.fetch_add(1, Ordering::Release);
            }
        })?;
        Ok(Self { address, received, ended })
    }

    /// Returns the number of closed connections.
    #[must_use]
    pub(crate) fn ended(&self) -> usize {
        self.ended.load(Ordering::Acquire)
    }

    /// Returns all received messages of all connections.
    #[must_use]
    pub(crate) fn received(&self) -> Vec<String> {
        self.received.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// Encodes a text as an unfragmented frame of a server.
#[must_use]
pub(crate) fn frame(text: &str) -> Vec<u8> {
    let mut frame = vec![0x81];
    match u16::try_from(text.len()) {
        Ok(short @ 0..126) => frame.extend(short.to_be_bytes().get(1)),
        Ok(long) => {
            frame.push(126);
            frame.extend(long.to_be_bytes());
        }
        Err(_) => {
            frame.push(127);
            frame.extend((text.len() as u64).to_be_bytes());
        }
    }
    frame.extend(text.as_bytes());
    frame
}

fn serve(
    mut stream: TcpStream,
    answer: &mut impl FnMut(usize, &str) -> Said,
    receiving: &Mutex<Vec<String>>,
) -> io::Result<()> {
    stream.set_nodelay(true)?;
    let mut head = Vec::new();
    while !head.ends_with(b"\r\n\r\n") {
        let mut byte = [0];
        stream.read_exact(&mut byte)?;
        head.extend(byte);
    }
    let head = String::from_utf8_lossy(&head).into_owned();
    let key = head.lines().find_map(|line| line.strip_prefix("Sec-WebSocket-Key: ")).unwrap_or_default();
    let accept = derive_accept_key(key.as_bytes());
    write!(
        stream,
        "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Accept: {accept}\r\n\r\n"
    )?;
    let mut text = String::new();
    for number in 0.. {
        if number > 0 {
            text = receive(&mut stream)?;
            receiving.lock().unwrap_or_else(PoisonError::into_inner).push(text.clone());
        }
        match answer(number, &text) {
            Said::Text(text) => stream.write_all(&frame(&text))?,
            Said::Raw(bytes) => stream.write_all(&bytes)?,
            Said::Nothing => {}
            Said::Close => break,
        }
    }
    Ok(())
}

/// Receives the next text of the client.
fn receive(stream: &mut TcpStream) -> io::Result<String> {
    let mut head = [0; 2];
    stream.read_exact(&mut head)?;
    let length = match head[1] & 0x7f {
        126 => {
            let mut long = [0; 2];
            stream.read_exact(&mut long)?;
            usize::from(u16::from_be_bytes(long))
        }
        short => usize::from(short),
    };
    let mut mask = [0; 4];
    stream.read_exact(&mut mask)?;
    let mut payload = vec![0; length];
    stream.read_exact(&mut payload)?;
    payload.iter_mut().zip(mask.iter().cycle()).for_each(|(byte, mask)| *byte ^= mask);
    Ok(String::from_utf8_lossy(&payload).into_owned())
}
