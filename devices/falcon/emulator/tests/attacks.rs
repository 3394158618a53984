//! Strangers at the port of the emulator: they cost little, and a host is served all the same.

#[path = "../../../../tests/src/attacks.rs"]
mod strangers;

use flotor_falcon::remote::REQUEST;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::Duration;
use strangers::Listening;

#[test]
fn strangers_at_the_port() {
    // Purges the buffers of the chip; a host gets packets from then on.
    let request = [REQUEST, 0, 1, 0];
    let emulator = Listening::start(
        env!("CARGO_BIN_EXE_flotor-falcon-emulator"),
        &["--listen", "127.0.0.1:0"],
        "listening tcp:",
    );
    emulator.withstand(&request, |at| {
        let asked = TcpStream::connect(at).and_then(|mut stream| {
            stream.set_read_timeout(Some(Duration::from_secs(1)))?;
            stream.write_all(&request)?;
            stream.read(&mut [0; 16])
        });
        asked.is_ok_and(|length| length > 0)
    });
}
