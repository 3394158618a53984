//! Fuzzing of the decoders: any bytes give a frame or a rejection, never a panic. The inputs are valid frames, damaged at random,
//! as packets and on a stream; 1e8 with `FLOTOR_TEST_SIZE=full`. `tests/fuzz` has the same targets for libFuzzer.
#![allow(clippy::cast_possible_truncation)] // random bytes

#[path = "../../../tests/src/random.rs"]
mod random;

use flotor_maglev::protocol::description::{AxesPage, LimitsPage, RangesPage};
use flotor_maglev::protocol::stream::{CODED_BYTES, Received, StreamDecoder, coded};
use flotor_maglev::protocol::{
    Answer, AnswerFrame, Condition, Description, FRAME_BYTES, Intake, Mode, Rejection, Request, RequestFrame,
    Status,
};
use random::Random;

/// Numbers a link or a host gets wrong.
const ODD: [u32; 8] = [0, 1, u32::MAX, 1 << 31, 0x7f80_0000, 0xff80_0000, 0x7fc0_0000, 0x0000_0001];

fn request(random: &mut Random) -> [u8; FRAME_BYTES] {
    let request = match random.below(6) {
        0 => Request::Describe { page: random.below(5) as u16 },
        1 => Request::Arm { period_us: 1000, watchdog_us: random.bits() as u32 },
        2 => Request::TakeOff,
        3 => Request::Land,
        4 => Request::Disarm,
        _ => Request::Command { wrench: [1.0, -2.0, 3.0, 0.1, -0.2, 0.3], valid_us: 3000 },
    };
    let (sequence, session) = (random.bits() as u32, random.bits() as u32);
    RequestFrame { sequence, acknowledged: 1, time_us: 2, session, request }.encode()
}

const DESCRIPTION: Description = Description {
    axes: AxesPage {
        sensed: 0b11_1111,
        actuated: 0b11_1111,
        resolution_m: 2.0e-6,
        rate_hz: [100.0, 1.0e4],
        latency_us: 1000,
        serial: *b"fuzz\0\0\0\0\0\0\0\0\0\0\0\0",
    },
    ranges: RangesPage {
        range_m: [0.012; 3],
        range_rad: [0.12; 3],
        max_stiffness_n_per_m: 25.0e3,
        force_slew_n_per_s: 55.0e3,
        torque_slew_nm_per_s: 6.3e3,
    },
    limits: LimitsPage {
        max_force_n: [55.0, 55.0, 140.0],
        max_torque_nm: [6.3, 6.3, 12.2],
        longest_watchdog_us: 1_000_000,
    },
};

fn answer(random: &mut Random) -> [u8; FRAME_BYTES] {
    let status = Status {
        mode: [Mode::Disarmed, Mode::Levitating, Mode::Fault][random.below(3)],
        condition: Condition::WATCHDOG,
        position_m: [1.0e-3, 0.0, -2.0e-3],
        rotation_xyz: [0.01, -0.02, 0.03],
        velocity_steps: [1, -1, i16::MAX],
        spin_steps: [0, i16::MIN, 7],
    };
    let answer = match random.below(2) {
        0 => Answer::Status(status),
        _ => Answer::Description(DESCRIPTION.page(random.below(3) as u16).expect("there are three")),
    };
    let (sequence, session) = (random.bits() as u32, random.bits() as u32);
    AnswerFrame { sequence, acknowledged: 1, time_us: 2, session, answer }.encode()
}

/// Wounds a frame; its bytes and how many of them are left.
fn wound(random: &mut Random, frame: [u8; FRAME_BYTES], other: &[u8; FRAME_BYTES]) -> ([u8; 96], usize) {
    let (mut bytes, mut length) = ([0; 96], FRAME_BYTES);
    bytes[..FRAME_BYTES].copy_from_slice(&frame);
    for _ in 0..random.below(4) {
        let at = random.below(FRAME_BYTES);
        match random.below(7) {
            0 => bytes[at] ^= 1 << random.below(8),
            1 => bytes[at] = random.bits() as u8,
            2 => bytes[3] = random.bits() as u8,
            3 => {
                let field = 4 * random.below(FRAME_BYTES / 4);
                bytes[field..field + 4].copy_from_slice(&ODD[random.below(ODD.len())].to_le_bytes());
            }
            // Half of another frame.
            4 => bytes[at..FRAME_BYTES].copy_from_slice(&other[at..]),
            5 => length = random.below(bytes.len()),
            _ => bytes[at..].rotate_left(1),
        }
    }
    // A right checksum half of the time, or nothing gets past it.
    if random.below(2) == 0 {
        let checksum = crc32fast::hash(&bytes[..60]).to_le_bytes();
        bytes[60..64].copy_from_slice(&checksum);
    }
    (bytes, length)
}

/// Decodes as both directions; true if one took it. What is refused is counted by its reason.
fn decode(bytes: &[u8], refused: &mut Intake) -> bool {
    let request = RequestFrame::decode(bytes);
    if let Ok(request) = request {
        assert_eq!(RequestFrame::decode(&request.encode()), Ok(request), "said again, it says the same");
        if let Request::Command { wrench, .. } = request.request {
            assert!(wrench.iter().all(|value| value.is_finite()));
        }
    }
    let answer = AnswerFrame::decode(bytes);
    if let Ok(answer) = answer {
        assert_eq!(AnswerFrame::decode(&answer.encode()), Ok(answer), "said again, it says the same");
    }
    for rejection in [request.err(), answer.err()].into_iter().flatten() {
        refused.reject(rejection);
    }
    let length_is_wrong = (request, answer) == (Err(Rejection::Length), Err(Rejection::Length));
    assert_eq!(length_is_wrong, bytes.len() != FRAME_BYTES);
    request.is_ok() || answer.is_ok()
}

#[test]
fn wounded_frames_are_frames_or_reasons() {
    let full = std::env::var("FLOTOR_TEST_SIZE").is_ok_and(|size| size == "full");
    let executions: u64 = if full { 100_000_000 } else { 200_000 };
    let mut random = Random(1);
    let (mut taken, mut packets, mut malformed) = (0_u64, 0_u64, 0_u64);
    let (mut stream, mut refused) = (StreamDecoder::default(), Intake::default());
    for execution in 0..executions {
        let (one, other) = (request(&mut random), answer(&mut random));
        let (bytes, length) = if execution % 2 == 0 {
            wound(&mut random, one, &other)
        } else {
            wound(&mut random, other, &one)
        };
        taken += u64::from(decode(&bytes[..length], &mut refused));
        // The same on a stream: coded, hurt on the way once more, and never twice in the decoder's way.
        let frame: [u8; FRAME_BYTES] = std::array::from_fn(|index| bytes[index]);
        let (mut line, line_length) = coded(&frame);
        if random.below(2) == 0 {
            line[random.below(CODED_BYTES)] = random.bits() as u8;
        }
        for byte in &line[..line_length.min(1 + random.below(2 * CODED_BYTES))] {
            match stream.push(*byte) {
                Some(Received::Packet(packet)) => {
                    packets += 1;
                    decode(&packet, &mut refused);
                }
                Some(Received::Malformed) => malformed += 1,
                None => {}
            }
        }
    }
    println!(
        "{executions} frames: {taken} taken, the rest refused; on a stream {packets} packets, {malformed} malformed"
    );
    let reasons = refused.rejections();
    for (reason, what) in [
        (Rejection::Length, "length"),
        (Rejection::Checksum, "checksum"),
        (Rejection::Magic, "magic"),
        (Rejection::Version, "version"),
        (Rejection::Kind, "kind"),
        (Rejection::NotFinite, "not finite"),
    ] {
        assert!(reasons.of(reason) > 0, "no frame was refused for its {what}");
    }
    // Neither everything nor nothing gets through: the wounds reach behind the checksum.
    assert!(taken > executions / 8 && taken < executions, "{taken} of {executions}");
    assert!(packets > executions / 8 && malformed > executions / 100, "{packets}, {malformed}");
}
