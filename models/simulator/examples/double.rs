//! Test double of a simulator: a floor at z = 0, and the faults of simulators.
//!
//! `double KIND [TICK]`: from pose number TICK on it hangs, ends, sends NaN or 1e308, goes back in time, floods, is slow, or claims a floor
//! above the hand.

use flotor_hal::{Contact, DVec3, Input, Pose};
use flotor_simulator::messages::{PoseMessage, SetMessage};
use flotor_simulator::program::Connection;
use std::io;
use std::thread::sleep;
use std::time::Duration;

fn floor(pose: &PoseMessage, floor_m: f64) -> SetMessage {
    let input = Input { pose: pose.pose, ..Input::at_rest(Pose::HOME) };
    let gap_m = pose.pose.position().z - floor_m;
    let contact = Contact::of_handle(&input, DVec3::Z, gap_m, 500.0).with_damping(2.0);
    SetMessage { valid_s: 0.05, contacts: vec![contact], ..SetMessage::at(pose) }
}

fn main() -> io::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let kind = arguments.next().unwrap_or_default();
    let from: u64 = arguments.next().and_then(|text| text.parse().ok()).unwrap_or(u64::MAX);
    let mut connection = Connection::of_standard_input()?;
    while let Some(pose) = connection.receive()? {
        let right = floor(&pose, 0.0);
        let is_wrong = pose.number >= from;
        let sent = match kind.as_str() {
            "hang" if is_wrong => loop {
                sleep(Duration::from_secs(1));
            },
            "end" if is_wrong => std::process::exit(3),
            "nan" if is_wrong => {
                let mut set = right;
                set.contacts.iter_mut().for_each(|contact| contact.gap_m = f64::NAN);
                connection.send(&set)
            }
            "huge" if is_wrong => {
                let mut set = right;
                set.contacts.iter_mut().for_each(|contact| contact.stiffness_n_per_m = 1.0e308);
                connection.send(&set)
            }
            "back" if is_wrong => connection.send(&SetMessage { number: pose.number - 2, ..right }),
            "ahead" if is_wrong => connection.send(&SetMessage { number: pose.number + 1, ..right }),
            "short" if is_wrong => connection.send_bytes(&right.to_bytes()[..60]),
            "above" if is_wrong => connection.send(&floor(&pose, 0.05)),
            "flood" => (0..40).try_for_each(|_| connection.send(&right)),
            "slow" if is_wrong && !pose.number.is_multiple_of(2500) => Ok(()),
            _ => connection.send(&right),
        };
        match sent {
            Err(error) if error.kind() == io::ErrorKind::BrokenPipe => return Ok(()),
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
            sent => sent?,
        }
    }
    Ok(())
}
