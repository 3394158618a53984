//! The device for a plugin in another process, over TCP (`flotor_falcon::remote`).

use crate::in_process::InProcess;
use flotor_falcon::remote::{REQUEST, WRITE};
use std::io::{self, ErrorKind, Read, Write};
use std::net::TcpStream;
use std::time::Duration;

/// How long is waited for the host before a look whether a packet is due.
const LOOK: Duration = Duration::from_micros(500);

/// Serves a host until it is gone, or the device is.
///
/// # Errors
/// What the system says of the connection.
pub fn serve(mut stream: TcpStream, device: &InProcess) -> io::Result<()> {
    stream.set_nodelay(true)?;
    stream.set_read_timeout(Some(LOOK))?;
    let (mut heard, mut chunk) = (Vec::new(), [0; 1024]);
    loop {
        match stream.read(&mut chunk) {
            Ok(0) => return Ok(()),
            Ok(length) => heard.extend_from_slice(chunk.get(..length).unwrap_or_default()),
            Err(error) if [ErrorKind::WouldBlock, ErrorKind::TimedOut].contains(&error.kind()) => {}
            Err(error) => return Err(error),
        }
        while let Some(length) = obey(&heard, device)? {
            heard.drain(..length);
        }
        let now = device.now();
        let mut machine = device.machine();
        if machine.is_gone() {
            return Ok(());
        }
        let mut packets = Vec::new();
        while let Some(packet) = machine.packet(now) {
            packets.extend(u8::try_from(packet.len()));
            packets.extend(packet);
        }
        drop(machine);
        stream.write_all(&packets)?;
    }
}

/// Carries out the first message of some bytes; its length, if it is whole.
fn obey(heard: &[u8], device: &InProcess) -> io::Result<Option<usize>> {
    let now = device.now();
    match heard {
        [REQUEST, number, low, high, ..] => {
            let _ = device.machine().request(*number, u16::from_le_bytes([*low, *high]));
            Ok(Some(4))
        }
        [WRITE, length, rest @ ..] => {
            let Some(bytes) = rest.get(..usize::from(*length)) else { return Ok(None) };
            device.machine().output(bytes, now);
            Ok(Some(2 + bytes.len()))
        }
        [REQUEST | WRITE, ..] | [] => Ok(None),
        _ => Err(ErrorKind::InvalidData.into()),
    }
}
