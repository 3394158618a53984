//! Hostile clients of the emulator: they use few resources, and a host is still served.

#[path = "../../../../tests/src/attacks.rs"]
mod strangers;

use flotor_falcon::remote::REQUEST;
use std::io::{Read, Write};
use std::time::Duration;
use strangers::{Listening, Place};

/// Purges the buffers of the chip; a host gets packets from then on.
const PURGE: [u8; 4] = [REQUEST, 0, 1, 0];

fn start(options: &[&str]) -> Listening {
    let arguments = [&["--listen", "127.0.0.1:0"], options].concat();
    Listening::start(env!("CARGO_BIN_EXE_flotor-falcon-emulator"), &arguments, "listening tcp:")
}

fn is_served(place: &Place) -> bool {
    let asked = place.connect().and_then(|mut stream| {
        stream.set_read_timeout(Some(Duration::from_secs(1)))?;
        stream.write_all(&PURGE)?;
        stream.read(&mut [0; 16])
    });
    asked.is_ok_and(|length| length > 0)
}

#[test]
fn strangers_at_the_port() {
    start(&[]).target.withstand(&PURGE, is_served);
}

#[test]
fn a_host_that_is_silent_makes_room() {
    start(&[]).target.makes_room(&PURGE, is_served);
}

#[test]
fn another_user_is_served_with_consent_only() {
    let [alone, with_others] = [&[][..], &["--allow-users"]].map(start);
    if let Some(length) = alone.target.answers_to_stranger(&PURGE) {
        assert_eq!(length, 0);
        assert_eq!(with_others.target.answers_to_stranger(&PURGE), Some(1));
    }
}
