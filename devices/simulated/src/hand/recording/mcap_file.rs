//! Reader of recordings of runs: MCAP files with poses in Foxglove's schema.

use super::Sample;
use flotor_hal::glam::{DQuat, DVec3};
use flotor_mcap::{ChannelInfo, Damage, Ending, MessageReader, OpenError};
use prost::Message;
use std::io::{Read, Seek};

/// Schema of a pose in a recording.
const POSE_SCHEMA: &str = "foxglove.FrameTransform";

/// Remedy for another kind of file.
const HOW_TO_MAKE_ONE: &str = "make a recording with `flotor run --record FILE.mcap`";

/// Problem and remedy of a recording without its end.
const TRUNCATED: &str = "the file is truncated: the end of the run is missing; record again, or make a copy of the readable \
part with `mcap recover` and name the copy";

/// Decoded fields of `foxglove.FrameTransform` (<https://docs.foxglove.dev/docs/sdk/schemas/frame-transform>).
#[derive(Clone, PartialEq, Message)]
struct FrameTransform {
    #[prost(message, optional, tag = "4")]
    translation: Option<Vector3>,
    #[prost(message, optional, tag = "5")]
    rotation: Option<Quaternion>,
}

/// x, y and z.
#[derive(Clone, Copy, PartialEq, Message)]
struct Vector3(
    #[prost(double, tag = "1")] f64,
    #[prost(double, tag = "2")] f64,
    #[prost(double, tag = "3")] f64,
);

/// x, y, z and w.
#[derive(Clone, Copy, PartialEq, Message)]
struct Quaternion(
    #[prost(double, tag = "1")] f64,
    #[prost(double, tag = "2")] f64,
    #[prost(double, tag = "3")] f64,
    #[prost(double, tag = "4")] f64,
);

/// Topic of the ticks of a run.
const TICK_TOPIC: &str = "/flotor/tick";
/// Encoding of the messages.
const ENCODING: &str = "protobuf";

/// Channel of interest.
#[derive(Clone, Copy)]
enum Topic {
    Pose,
    /// Ticks; only their sequence numbers are used: a gap there is a gap in the trajectory.
    Tick,
}

/// Reads the poses of a recording; an error if a single tick is missing.
pub(super) fn read(file: impl Read + Seek) -> Result<Vec<Sample>, String> {
    let mut messages = MessageReader::open(file, topic_of).map_err(|error| match error {
        OpenError::Io(cause) => format!("the file cannot be read: {cause}; record again"),
        _ => format!("the file is not an MCAP file; {HOW_TO_MAKE_ONE}"),
    })?;
    if messages.ending() == Ending::CutOff {
        return Err(TRUNCATED.to_owned());
    }
    let mut samples = Vec::new();
    let mut start_ns = None;
    let mut tick = 0_u32;
    let damaged = |cause: String, samples: &[Sample]| {
        let good_ns = samples.last().map_or(0, |sample| sample.time_ns);
        format!(
            "the file is damaged {:.3} s after the first pose: {cause}; record again",
            good_ns as f64 * 1.0e-9
        )
    };
    while let Some(message) = messages.next_message().map_err(|damage| match damage {
        Damage::Compressed(_) => damage.to_string(),
        damage => damaged(damage.to_string(), &samples),
    })? {
        match message.topic {
            Topic::Pose => {
                let (position_m, orientation) =
                    pose(&message.data).map_err(|problem| damaged(problem, &samples))?;
                let since_start_ns = message.time_ns.saturating_sub(*start_ns.get_or_insert(message.time_ns));
                let sample = Sample::new(since_start_ns as f64 * 1.0e-9, position_m, orientation);
                let place = |problem| {
                    format!("{:.6} s after the first pose: {problem}", since_start_ns as f64 * 1.0e-9)
                };
                sample.and_then(|sample| sample.append_to(&mut samples)).map_err(place)?;
            }
            Topic::Tick => {
                if message.sequence != tick {
                    let cause = "the tick numbers do not continue (ticks are missing, or another recording is appended)";
                    return Err(damaged(cause.to_owned(), &samples));
                }
                tick = tick.wrapping_add(1);
            }
        }
    }
    Ok(samples)
}

fn topic_of(channel: ChannelInfo<'_>) -> Option<Topic> {
    match channel {
        ChannelInfo { encoding: ENCODING, schema: POSE_SCHEMA, .. } => Some(Topic::Pose),
        ChannelInfo { encoding: ENCODING, topic: TICK_TOPIC, .. } => Some(Topic::Tick),
        _ => None,
    }
}

fn pose(message: &[u8]) -> Result<(DVec3, DQuat), String> {
    let transform =
        FrameTransform::decode(message).map_err(|error| format!("a pose cannot be decoded: {error}"))?;
    let (Some(at), Some(turn)) = (transform.translation, transform.rotation) else {
        return Err("a pose lacks its translation or its rotation".to_owned());
    };
    Ok((DVec3::new(at.0, at.1, at.2), DQuat::from_xyzw(turn.0, turn.1, turn.2, turn.3)))
}
