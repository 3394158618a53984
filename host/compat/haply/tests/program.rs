//! The program as `flotor emulate` starts it. With a test of its own cargo builds it beside the tests of `tests/tests/system/services.rs`.

#[path = "../../../../tests/src/attacks.rs"]
mod strangers;

use std::io::{Read, Write};
use std::net::TcpStream;
use std::process::Command;
use std::time::Duration;
use strangers::Listening;

#[test]
fn the_program_names_its_ports() {
    let program = env!("CARGO_BIN_EXE_flotor-haply-service-emulator");
    let output = Command::new(program).arg("--help").output().expect("it starts");
    let help = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success() && help.contains("10001") && help.contains("10020"), "{help}");
}

#[test]
fn strangers_cost_little_and_a_client_is_served_all_the_same() {
    let request = b"GET / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 0\r\n\r\n";
    let program = env!("CARGO_BIN_EXE_flotor-haply-service-emulator");
    let arguments = ["--listen", "127.0.0.1:0", "--events", "127.0.0.1:0"];
    Listening::start(program, &arguments, "listening ws://").withstand(request, |at| {
        let asked = TcpStream::connect(at).and_then(|mut stream| {
            stream.set_read_timeout(Some(Duration::from_secs(1)))?;
            stream.write_all(request)?;
            stream.read(&mut [0; 16])
        });
        asked.is_ok_and(|length| length > 0)
    });
}
