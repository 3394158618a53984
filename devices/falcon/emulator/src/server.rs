//! TCP server of the emulated device, for a plugin in another process (`flotor_falcon::remote`).

use crate::in_process::InProcess;
use flotor_emulation::clients::Tenure;
use flotor_falcon::remote::{REQUEST, WRITE};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use std::io::{self, ErrorKind, Read, Write};
use std::net::TcpStream;
use std::time::Duration;

/// Poll interval for due packets while the host is silent. Uses `poll`, as a socket's read timeout is rounded up to the
/// kernel tick of several milliseconds.
const LOOK: Timespec = Timespec { tv_sec: 0, tv_nsec: 250_000 };
/// Timeout of the write of a packet to the host.
const WRITE_TIMEOUT: Duration = Duration::from_millis(200);

/// Serves a host until the host disconnects, the device leaves its bus, or a time limit of `tenure` is exceeded.
///
/// # Errors
/// Errors of the connection; `TimedOut` if a time limit is exceeded, `InvalidData` for an unknown message.
pub fn serve(mut stream: TcpStream, device: &InProcess, mut tenure: Tenure<'_>) -> io::Result<()> {
    stream.set_nodelay(true)?;
    stream.set_write_timeout(Some(WRITE_TIMEOUT))?;
    let (mut received, mut chunk) = (Vec::new(), [0; 1024]);
    loop {
        if tenure.is_over() {
            return Err(ErrorKind::TimedOut.into());
        }
        if poll(&mut [PollFd::new(&stream, PollFlags::IN)], Some(&LOOK))? > 0 {
            match stream.read(&mut chunk)? {
                0 => return Ok(()),
                length => received.extend_from_slice(chunk.get(..length).unwrap_or_default()),
            }
        }
        while let Some(length) = execute(&received, device)? {
            received.drain(..length);
            tenure.message();
        }
        if !received.is_empty() {
            tenure.part();
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

/// Executes the first message in a buffer; returns its length, `None` while the message is incomplete.
fn execute(received: &[u8], device: &InProcess) -> io::Result<Option<usize>> {
    let now = device.now();
    match received {
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
