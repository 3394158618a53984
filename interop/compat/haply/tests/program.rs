//! The program as `flotor emulate` starts it. With a test of its own cargo builds it beside the tests of `tests/tests/system/services.rs`.

#[path = "../../../../tests/src/attacks.rs"]
mod strangers;

use std::process::Command;
use strangers::Listening;

#[test]
fn the_program_names_its_ports() {
    let program = env!("CARGO_BIN_EXE_flotor-haply-service-emulator");
    let output = Command::new(program).arg("--help").output().expect("it starts");
    let help = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success() && help.contains("10001") && help.contains("10020"), "{help}");
}

/// Starts the service; `--events` or the simulation channel is the target.
fn start(options: &[&str], before: &str) -> Listening {
    let program = env!("CARGO_BIN_EXE_flotor-haply-service-emulator");
    let arguments = [&["--listen", "127.0.0.1:0", "--events", "127.0.0.1:0"], options].concat();
    Listening::start(program, &arguments, before)
}

const REQUEST: &[u8] = b"GET / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 0\r\n\r\n";
const SOCKET: &[u8] = b"GET / HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\
    Sec-WebSocket-Key: dGhlIHNhbXBsZQ==\r\n\r\n";

#[test]
fn strangers_at_the_simulation_channel_cost_little_and_a_client_is_served_all_the_same() {
    start(&[], "listening ws://").target.withstand(REQUEST, |place| place.answers(REQUEST));
}

#[test]
fn strangers_at_the_events_channel_cost_little_and_a_client_is_served_all_the_same() {
    start(&[], " events ws://").target.withstand(SOCKET, |place| place.answers(SOCKET));
}

#[test]
fn another_user_is_served_with_consent_only() {
    let [alone, with_others] = [&[][..], &["--allow-users"]].map(|options| start(options, "listening ws://"));
    if let Some(length) = alone.target.answers_to_stranger(REQUEST) {
        assert_eq!(length, 0);
        assert_eq!(with_others.target.answers_to_stranger(REQUEST), Some(1));
    }
}
