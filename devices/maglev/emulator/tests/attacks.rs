//! Strangers at the ports of the emulator: they cost little, and a host is served all the same.

#[path = "../../../../tests/src/attacks.rs"]
mod strangers;

use flotor_maglev::ml_api::{Function, Request};
use flotor_maglev::protocol::stream::coded;
use flotor_maglev::protocol::{self, RequestFrame};
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::Duration;
use strangers::Listening;

/// Sends a request; whether anything is answered in time.
fn answers(at: SocketAddr, request: &[u8]) -> bool {
    let asked = TcpStream::connect(at).and_then(|mut stream| {
        stream.set_read_timeout(Some(Duration::from_secs(1)))?;
        stream.write_all(request)?;
        stream.read(&mut [0; 16])
    });
    asked.is_ok_and(|length| length > 0)
}

fn withstands(protocol: &str, request: &[u8]) {
    let arguments = ["--listen", "127.0.0.1:0", "--protocol", protocol];
    let emulator =
        Listening::start(env!("CARGO_BIN_EXE_flotor-maglev-emulator"), &arguments, "listening tcp ");
    emulator.withstand(request, |at| answers(at, request));
}

#[test]
fn strangers_at_the_port_of_the_own_protocol() {
    let request = protocol::Request::Describe { page: 0 };
    let frame = RequestFrame { sequence: 1, acknowledged: 0, time_us: 0, session: 0, request };
    let (bytes, length) = coded(&frame.encode());
    withstands("flotor", &bytes[..length]);
}

#[test]
fn strangers_at_the_port_of_the_ml_api() {
    withstands("ml-api", Request::Plain(Function::GetVersion).encode().bytes());
}
