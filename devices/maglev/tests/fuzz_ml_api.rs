//! Fuzzing of the decoders of the ML API: any bytes give a request, a reply, an event or an error, never a panic. The inputs are
//! valid frames, damaged at random, whole and on a stream; 1e8 of each with `FLOTOR_TEST_SIZE=full`. `tests/fuzz` has the same
//! targets for libFuzzer.
#![allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap)] // random bytes

#[path = "../../../tests/src/random.rs"]
mod random;

use flotor_maglev::ml_api::*;
use random::Random;

impl Random {
    /// A number with all its bits at random, or a small one.
    fn word(&mut self) -> [u8; 4] {
        if self.below(2) == 0 {
            (self.below(9) as u32).to_le_bytes()
        } else {
            (self.bits() as u32).to_le_bytes()
        }
    }
}

/// A frame of this code with some fields, or a wrong length; its bytes and how many there are.
fn frame(random: &mut Random, code: i32) -> ([u8; 128], usize) {
    let mut bytes = [0; 128];
    let length = 8 + 4 * random.below(29);
    for field in bytes.chunks_exact_mut(4).skip(2) {
        field.copy_from_slice(&random.word());
    }
    bytes[..4].copy_from_slice(&(length as u32).to_le_bytes());
    bytes[4..8].copy_from_slice(&code.to_le_bytes());
    match random.below(8) {
        0 => bytes[random.below(8)] = random.bits() as u8,
        1 => return (bytes, random.below(128)),
        _ => {}
    }
    (bytes, length)
}

/// The same to the bit: a NaN is no number that equals itself.
fn is_again(frame: &Frame, again: &Frame) -> bool {
    frame.bytes() == again.bytes()
}

#[test]
fn wounded_frames_of_the_ml_api_are_messages_or_nothing() {
    let full = std::env::var("FLOTOR_TEST_SIZE").is_ok_and(|size| size == "full");
    let executions: u64 = if full { 100_000_000 } else { 200_000 };
    let mut random = Random(1);
    let (mut requests, mut replies, mut events, mut on_a_stream) = (0_u64, 0_u64, 0_u64, 0_u64);
    for _ in 0..executions {
        let id = if random.below(16) == 0 { random.bits() as i32 } else { random.below(80) as i32 };
        let (bytes, length) = frame(&mut random, id);
        let bytes = &bytes[..length];
        match Request::decode(bytes) {
            Ok(request) => {
                requests += 1;
                let said = request.encode();
                let again = Request::decode(said.bytes()).expect("what was said can be read");
                // A wound may have made it another function.
                assert!(is_again(&said, &again.encode()) && said.bytes()[4..8] == bytes[4..8]);
            }
            // What is refused is answered in full.
            Err(unreadable) => {
                let reply = Reply::failed(unreadable.function, unreadable.status);
                assert!(reply.encode().bytes().len() >= 8 && !reply.status.is_ok());
            }
        }
        let function = Function::ALL[random.below(Function::ALL.len())];
        if let Some(reply) = Reply::decode(function, bytes) {
            replies += 1;
            let said = reply.encode();
            let again = Reply::decode(function, said.bytes()).expect("what was said can be read");
            assert!(is_again(&said, &again.encode()), "{reply:?}");
        }
        if let Some(event) = Event::decode(bytes) {
            events += 1;
            let said = event.encode();
            assert!(is_again(&said, &Event::decode(said.bytes()).expect("as before").encode()));
        }
        // As much as a server reads before it gives up: whole frames and nothing else.
        let (mut intake, mut stream) = (Intake::default(), bytes);
        while let ReadResult::Frame(length) = intake.take(&mut stream) {
            assert!((8..=512).contains(&length) && intake.frame().len() == length);
            on_a_stream += 1;
        }
    }
    println!(
        "{executions} frames: {requests} requests, {replies} replies, {events} events; {on_a_stream} whole on a stream"
    );
    // The wounds leave enough whole to reach behind the first field, and not everything.
    for (count, what) in [
        (requests, "requests"),
        (replies, "replies"),
        (events, "events"),
        (on_a_stream, "frames on a stream"),
    ] {
        assert!(count > executions / 100 && count < executions, "{count} {what}");
    }
}
