//! Codec: every frame is decoded as encoded, and all other bytes are rejected. (Fuzzing: `tests/fuzz.rs`.)

use super::codec::FRAME_BYTES;
use super::description::{AxesPage, Description, LimitsPage, PAGES, RangesPage, serial_bytes};
use super::frame::{Answer, AnswerFrame, Condition, Mode, Request, RequestFrame, Status};
use super::intake::Intake;
use super::rejection::Rejection;
use super::stream::{CODED_BYTES, Received, StreamDecoder, coded};
use proptest::prelude::*;

const COMMAND: RequestFrame = RequestFrame {
    sequence: 7,
    acknowledged: 6,
    time_us: 123,
    session: 0xfeed,
    request: Request::Command { wrench: [1.0, -2.0, 3.0, 0.1, 0.2, -0.3], valid_us: 5000 },
};

fn request() -> impl Strategy<Value = Request> {
    prop_oneof![
        any::<u16>().prop_map(|page| Request::Describe { page }),
        any::<(u32, u32)>().prop_map(|(period_us, watchdog_us)| Request::Arm { period_us, watchdog_us }),
        Just(Request::TakeOff),
        (prop::array::uniform6(-1.0e3_f32..1.0e3), any::<u16>())
            .prop_map(|(wrench, valid_us)| Request::Command { wrench, valid_us }),
        Just(Request::Land),
        Just(Request::Disarm),
    ]
}

fn description() -> impl Strategy<Value = Description> {
    let three = || prop::array::uniform3(0.0_f32..1.0e3);
    (any::<(u8, u8, u32, u32)>(), three(), three(), three(), three(), three(), "[!-~]{0,16}").prop_map(
        |((sensed, actuated, latency_us, longest_watchdog_us), a, b, c, d, [e, f, g], serial)| Description {
            axes: AxesPage {
                sensed,
                actuated,
                resolution_m: e,
                rate_hz: [f, g],
                latency_us,
                serial: serial_bytes(&serial),
            },
            ranges: RangesPage {
                range_m: a,
                range_rad: b,
                max_stiffness_n_per_m: e,
                force_slew_n_per_s: f,
                torque_slew_nm_per_s: g,
            },
            limits: LimitsPage { max_force_n: c, max_torque_nm: d, longest_watchdog_us },
        },
    )
}

fn status() -> impl Strategy<Value = Status> {
    let three = || prop::array::uniform3(-1.0_f32..1.0);
    (three(), three(), any::<[i16; 3]>(), any::<[i16; 3]>(), 0..6_usize).prop_map(|(p, r, v, w, mode)| {
        Status {
            mode: [Mode::Disarmed, Mode::Armed, Mode::Levitating, Mode::Holding, Mode::Landing, Mode::Fault]
                [mode],
            condition: Condition::WATCHDOG.with(Condition::BOUNDARY),
            position_m: p,
            rotation_xyz: r,
            velocity_steps: v,
            spin_steps: w,
        }
    })
}

proptest! {
    #[test]
    fn every_request_comes_back(envelope in any::<(u32, u32, u32, u32)>(), request in request()) {
        let (sequence, acknowledged, time_us, session) = envelope;
        let frame = RequestFrame { sequence, acknowledged, time_us, session, request };
        prop_assert_eq!(RequestFrame::decode(&frame.encode()), Ok(frame));
        prop_assert_eq!(AnswerFrame::decode(&frame.encode()), Err(Rejection::Magic));
    }

    #[test]
    fn every_answer_comes_back(envelope in any::<(u32, u32, u32, u32)>(), status in status(), description in description()) {
        let (sequence, acknowledged, time_us, session) = envelope;
        let frame = |answer| AnswerFrame { sequence, acknowledged, time_us, session, answer };
        let told = frame(Answer::Status(status));
        prop_assert_eq!(AnswerFrame::decode(&told.encode()), Ok(told));
        let mut pages = Vec::new();
        for number in 0..PAGES {
            let told = frame(Answer::Description(description.page(number).unwrap()));
            let heard = AnswerFrame::decode(&told.encode()).unwrap();
            prop_assert_eq!(heard, told);
            if let Answer::Description(page) = heard.answer { pages.push(page) }
        }
        prop_assert_eq!(Description::from_pages(pages.try_into().unwrap()), Some(description));
    }

    /// CRC-32 finds every burst of up to 32 bits, and so every single damaged byte.
    #[test]
    fn a_damaged_byte_is_found(at in 0..FRAME_BYTES, damage in 1..=255_u8) {
        let mut bytes = COMMAND.encode();
        bytes[at] ^= damage;
        prop_assert_eq!(RequestFrame::decode(&bytes), Err(Rejection::Checksum));
    }

    #[test]
    fn another_length_is_refused(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        prop_assume!(bytes.len() != FRAME_BYTES);
        prop_assert_eq!(RequestFrame::decode(&bytes), Err(Rejection::Length));
    }

    #[test]
    fn frames_come_out_of_a_stream_whole(garbage in prop::collection::vec(any::<u8>(), 0..150)) {
        let mut decoder = StreamDecoder::default();
        garbage.iter().for_each(|byte| { decoder.push(*byte); });
        // The zero that ends whatever was before, then two frames.
        decoder.push(0);
        for _ in 0..2 {
            let (bytes, length) = coded(&COMMAND.encode());
            let received: Vec<Received> = bytes[..length].iter().filter_map(|byte| decoder.push(*byte)).collect();
            prop_assert_eq!(received, vec![Received::Packet(COMMAND.encode())]);
        }
    }
}

#[test]
fn numbers_that_are_none_are_refused() {
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for axis in 0..6 {
            let mut wrench = [1.0; 6];
            wrench[axis] = bad;
            let frame = RequestFrame { request: Request::Command { wrench, valid_us: 1 }, ..COMMAND };
            assert_eq!(RequestFrame::decode(&frame.encode()), Err(Rejection::NotFinite));
        }
    }
}

#[test]
fn the_layout_is_the_written_one() {
    // The table of docs/src/devices/maglev-protocol.md, read back from bytes.
    let bytes = COMMAND.encode();
    assert_eq!(&bytes[..4], b"ML\x01\x01");
    assert_eq!(bytes[4..20], [7, 0, 0, 0, 6, 0, 0, 0, 123, 0, 0, 0, 0, 0, 0x88, 0x13]);
    assert_eq!(bytes[20..24], 1.0_f32.to_le_bytes());
    assert_eq!(bytes[40..44], (-0.3_f32).to_le_bytes());
    assert_eq!(bytes[44..56], [0; 12]);
    assert_eq!(bytes[56..60], [0xed, 0xfe, 0, 0]);
    // Check value of CRC-32/ISO-HDLC: "123456789" gives cbf43926.
    assert_eq!(crc32fast::hash(b"123456789"), 0xcbf4_3926);
    assert_eq!(CODED_BYTES, FRAME_BYTES + 2);
}

#[test]
fn each_sequence_number_is_taken_once_and_never_backwards() {
    let mut intake = Intake::default();
    let taken: Vec<bool> = [5, 6, 6, 5, 9, 7, u32::MAX - 1].map(|sequence| intake.accept(sequence)).to_vec();
    assert_eq!(taken, [true, true, false, false, true, false, false]);
    assert_eq!(
        (intake.rejections().of(Rejection::Duplicate), intake.rejections().of(Rejection::Old)),
        (1, 3)
    );
    // Wrapping is going up.
    let mut intake = Intake::default();
    assert!(intake.accept(u32::MAX) && intake.accept(0) && intake.accept(1) && !intake.accept(u32::MAX));
}

#[test]
fn too_long_a_packet_is_one_malformed_packet() {
    let mut decoder = StreamDecoder::default();
    let received: Vec<Received> =
        std::iter::repeat_n(1, 500).chain([0, 0, 0]).filter_map(|byte| decoder.push(byte)).collect();
    assert_eq!(received, [Received::Malformed]);
}
