//! Hostile clients of the emulator: they use few resources, and a host is still served.

#[path = "../../../../tests/src/attacks.rs"]
mod strangers;

use flotor_maglev::ml_api::{Function, Request};
use flotor_maglev::protocol::stream::coded;
use flotor_maglev::protocol::{self, RequestFrame};
use strangers::Listening;

fn start(protocol: &str, options: &[&str]) -> Listening {
    let arguments = [&["--listen", "127.0.0.1:0", "--protocol", protocol], options].concat();
    Listening::start(env!("CARGO_BIN_EXE_flotor-maglev-emulator"), &arguments, "listening tcp ")
}

/// A request of the own protocol.
fn description() -> Vec<u8> {
    let request = protocol::Request::Describe { page: 0 };
    let frame = RequestFrame { sequence: 1, acknowledged: 0, time_us: 0, session: 0, request };
    let (bytes, length) = coded(&frame.encode());
    bytes[..length].to_vec()
}

/// A request of the ML API.
fn version() -> Vec<u8> {
    Request::Plain(Function::GetVersion).encode().bytes().to_vec()
}

#[test]
fn strangers_at_the_port_of_the_own_protocol() {
    let request = description();
    start("flotor", &[]).target.withstand(&request, |place| place.answers(&request));
}

#[test]
fn strangers_at_the_port_of_the_ml_api() {
    let request = version();
    start("ml-api", &[]).target.withstand(&request, |place| place.answers(&request));
}

#[test]
fn a_host_that_is_silent_makes_room() {
    let request = description();
    start("flotor", &[]).target.makes_room(&request, |place| place.answers(&request));
}

#[test]
fn another_user_is_served_with_consent_only() {
    for (protocol, request) in [("flotor", description()), ("ml-api", version())] {
        let [alone, with_others] = [&[][..], &["--allow-users"]].map(|options| start(protocol, options));
        if let Some(length) = alone.target.answers_to_stranger(&request) {
            assert_eq!(length, 0, "{protocol}");
            assert_eq!(with_others.target.answers_to_stranger(&request), Some(1), "{protocol}");
        }
    }
}
