//! WebSocket to the service: whole text messages in both directions, in buffers of fixed size.
//!
//! Frames are encoded with tungstenite (RFC 6455), but read here: tungstenite's reader would buffer an oversized
//! message up to the size limit before rejecting the message; this reader rejects an oversized message by its header.

use crate::session_error::SessionError;
use std::io::{self, Cursor, ErrorKind, Read, Write};
use std::net::{Shutdown, TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant};
use tungstenite::handshake::client::generate_key;
use tungstenite::handshake::derive_accept_key;
use tungstenite::protocol::frame::FrameHeader;
use tungstenite::protocol::frame::coding::{Control, Data, OpCode};

/// Limit on a message of the service, bytes: a state of one device has about a kilobyte, an inventory a few per device.
pub const LONGEST_BYTES: usize = 256 << 10;
/// Buffer size of a message to the service, bytes: the longest configures a session.
const SENT_BYTES: usize = 2048;
/// Limit on the reply to the upgrade request, bytes.
const LONGEST_HEAD: usize = 8 << 10;
/// Limit on a control frame, bytes (RFC 6455, section 5.5).
const LONGEST_CONTROL: usize = 125;

/// WebSocket client connection; the last received message stays in the buffer until the next call of
/// [`Socket::receive`].
#[derive(Debug)]
pub struct Socket {
    stream: TcpStream,
    patience: Duration,
    /// Receive buffer; the received bytes are `start..end`.
    buffer: Box<[u8]>,
    start: usize,
    end: usize,
    sent: Vec<u8>,
    /// Mask of the next frame.
    mask: u32,
}

impl Socket {
    /// Connects and performs the WebSocket upgrade; `patience` is the timeout of the connection and of each read and
    /// write. Not real-time.
    ///
    /// # Errors
    /// Error text: unknown host name, error of the operating system, or a server that rejects the WebSocket upgrade.
    pub fn connect(address: &str, patience: Duration) -> Result<Self, String> {
        let lookup = address.to_socket_addrs().map_err(|error| error.to_string())?;
        let mut failed = "unknown host name".to_owned();
        for candidate in lookup {
            match TcpStream::connect_timeout(&candidate, patience) {
                Ok(stream) => return Self::on(stream, address, patience).map_err(|error| error.to_string()),
                Err(error) => failed = error.to_string(),
            }
        }
        Err(failed)
    }

    fn on(stream: TcpStream, address: &str, patience: Duration) -> io::Result<Self> {
        stream.set_nodelay(true)?;
        stream.set_read_timeout(Some(patience))?;
        stream.set_write_timeout(Some(patience))?;
        let key = generate_key();
        // Masks protect old proxies: for a service on this machine any mask will do, a new one per frame.
        let mask = key.bytes().fold(0x9e37_79b9, |mask: u32, byte| mask.rotate_left(5) ^ u32::from(byte));
        let buffer = vec![0; LONGEST_BYTES + LONGEST_CONTROL].into_boxed_slice();
        let sent = Vec::with_capacity(SENT_BYTES);
        let mut socket = Self { stream, patience, buffer, start: 0, end: 0, sent, mask };
        socket.upgrade(address, &key)?;
        Ok(socket)
    }

    fn upgrade(&mut self, host: &str, key: &str) -> io::Result<()> {
        let no_service =
            || io::Error::new(ErrorKind::InvalidData, "the server at this address is not a WebSocket server");
        write!(
            self.stream,
            "GET / HTTP/1.1\r\nHost: {host}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n\
             Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: {key}\r\n\r\n"
        )?;
        let head = loop {
            let arrived = self.buffer.get(..self.end).unwrap_or_default();
            if let Some(end) = arrived.windows(4).position(|window| window == b"\r\n\r\n") {
                self.start = end + 4;
                break String::from_utf8_lossy(arrived.get(..end).unwrap_or_default()).into_owned();
            }
            if self.end >= LONGEST_HEAD {
                return Err(no_service());
            }
            let room = self.buffer.get_mut(self.end..).unwrap_or_default();
            match self.stream.read(room)? {
                0 => return Err(no_service()),
                length => self.end += length,
            }
        };
        let mut lines = head.split("\r\n");
        let is_agreed = lines.next().is_some_and(|status| status.split(' ').nth(1) == Some("101"));
        let accepted = derive_accept_key(key.as_bytes());
        let proves_it = |line: &str| {
            line.split_once(':').is_some_and(|(name, value)| {
                name.trim().eq_ignore_ascii_case("sec-websocket-accept") && value.trim() == accepted
            })
        };
        if is_agreed && lines.any(proves_it) { Ok(()) } else { Err(no_service()) }
    }

    /// Sends a text message. Real-time except for the system call: bounded, no allocation.
    ///
    /// # Errors
    /// If the connection is closed, or the write times out.
    pub fn send(&mut self, text: &[u8]) -> Result<(), SessionError> {
        self.send_frame(OpCode::Data(Data::Text), text)
    }

    fn send_frame(&mut self, opcode: OpCode, payload: &[u8]) -> Result<(), SessionError> {
        // Xorshift (Marsaglia 2003): another mask for each frame.
        self.mask ^= self.mask << 13;
        self.mask ^= self.mask >> 17;
        self.mask ^= self.mask << 5;
        let mask = self.mask.to_le_bytes();
        let header = FrameHeader { opcode, mask: Some(mask), ..FrameHeader::default() };
        self.sent.clear();
        header.format(payload.len() as u64, &mut self.sent).map_err(|_| SessionError::Gone)?;
        self.sent.extend(payload.iter().zip(mask.iter().cycle()).map(|(byte, mask)| byte ^ mask));
        self.stream.write_all(&self.sent).map_err(|_| SessionError::Gone)
    }

    /// Waits for the next text or binary message, which stays in the buffer until the next call. Answers pings. Real-time except
    /// for the wait: bounded, no allocation.
    ///
    /// # Errors
    /// A [`SessionError`]: the connection is closed, no message arrived until the timeout, or a message is oversized,
    /// malformed or fragmented.
    pub fn receive(&mut self) -> Result<&[u8], SessionError> {
        let until = Instant::now() + self.patience;
        loop {
            let (opcode, from, to) = self.next_frame(until)?;
            self.start = to;
            match opcode {
                OpCode::Data(Data::Text | Data::Binary) => {
                    return Ok(self.buffer.get(from..to).unwrap_or_default());
                }
                OpCode::Control(Control::Close) => return Err(SessionError::Gone),
                OpCode::Control(Control::Ping) => {
                    let mut echoed = [0; LONGEST_CONTROL];
                    let payload = self.buffer.get(from..to).unwrap_or_default();
                    let length = payload.len().min(LONGEST_CONTROL);
                    echoed.iter_mut().zip(payload).for_each(|(place, byte)| *place = *byte);
                    self.send_frame(
                        OpCode::Control(Control::Pong),
                        echoed.get(..length).unwrap_or_default(),
                    )?;
                }
                OpCode::Control(_) => {}
                OpCode::Data(_) => return Err(SessionError::NoFrame),
            }
        }
    }

    /// Waits for the next frame; returns its opcode and the start and end of its payload in the buffer.
    fn next_frame(&mut self, until: Instant) -> Result<(OpCode, usize, usize), SessionError> {
        loop {
            let arrived = self.buffer.get(self.start..self.end).unwrap_or_default();
            let mut cursor = Cursor::new(arrived);
            if let Some((header, length)) =
                FrameHeader::parse(&mut cursor).map_err(|_| SessionError::NoFrame)?
            {
                let is_control = matches!(header.opcode, OpCode::Control(_));
                let longest = if is_control { LONGEST_CONTROL } else { LONGEST_BYTES };
                let length = match usize::try_from(length) {
                    Ok(length) if length <= longest => length,
                    _ => return Err(SessionError::TooLong(length)),
                };
                let is_plain = header.is_final && !(header.rsv1 || header.rsv2 || header.rsv3);
                if !is_plain || header.mask.is_some() {
                    return Err(SessionError::NoFrame);
                }
                let from = self.start + usize::try_from(cursor.position()).unwrap_or(0);
                if from + length <= self.end {
                    return Ok((header.opcode, from, from + length));
                }
            }
            self.fill(until)?;
        }
    }

    /// Waits for more bytes in the receive buffer.
    fn fill(&mut self, until: Instant) -> Result<(), SessionError> {
        // Move the partial frame to the front, to have room for the longest frame.
        self.buffer.copy_within(self.start..self.end, 0);
        (self.start, self.end) = (0, self.end - self.start);
        let late = if self.end == 0 { SessionError::Silent } else { SessionError::Unfinished };
        let room = self.buffer.get_mut(self.end..).unwrap_or_default();
        match self.stream.read(room) {
            Ok(0) => Err(SessionError::Gone),
            Ok(_) if Instant::now() > until => Err(late),
            Ok(length) => {
                self.end += length;
                Ok(())
            }
            Err(error) => match error.kind() {
                ErrorKind::Interrupted if Instant::now() < until => Ok(()),
                ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted => Err(late),
                _ => Err(SessionError::Gone),
            },
        }
    }

    /// Sets the timeout of a reply, and of each read and write. Not real-time.
    ///
    /// # Errors
    /// Errors of the system.
    pub fn set_patience(&mut self, patience: Duration) -> io::Result<()> {
        self.patience = patience;
        self.stream.set_read_timeout(Some(patience))?;
        self.stream.set_write_timeout(Some(patience))
    }

    /// Closes the connection in both directions.
    pub fn close(&self) {
        let _ = self.stream.shutdown(Shutdown::Both);
    }
}
