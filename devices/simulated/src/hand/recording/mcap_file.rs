//! Recordings of runs: MCAP files with poses in Foxglove's schema.

use super::Sample;
use flotor_hal::glam::{DQuat, DVec3};
use prost::Message;

/// Schema of a pose in a recording.
const POSE_SCHEMA: &str = "foxglove.FrameTransform";

/// Remedy for a file that is something else.
const HOW_TO_MAKE_ONE: &str = "`flotor run --record FILE.mcap` makes one";

/// What of `foxglove.FrameTransform` is read (<https://docs.foxglove.dev/docs/sdk/schemas/frame-transform>).
#[derive(Clone, PartialEq, Message)]
struct FrameTransform {
    #[prost(message, optional, tag = "4")]
    translation: Option<Vector3>,
    #[prost(message, optional, tag = "5")]
    rotation: Option<Quaternion>,
}

#[derive(Clone, Copy, PartialEq, Message)]
struct Vector3 {
    #[prost(double, tag = "1")]
    x: f64,
    #[prost(double, tag = "2")]
    y: f64,
    #[prost(double, tag = "3")]
    z: f64,
}

#[derive(Clone, Copy, PartialEq, Message)]
struct Quaternion {
    #[prost(double, tag = "1")]
    x: f64,
    #[prost(double, tag = "2")]
    y: f64,
    #[prost(double, tag = "3")]
    z: f64,
    #[prost(double, tag = "4")]
    w: f64,
}

/// Reads the poses of a recording.
pub(super) fn read(bytes: &[u8]) -> Result<Vec<Sample>, String> {
    if !bytes.starts_with(mcap::MAGIC) {
        return Err(format!("is no MCAP file; {HOW_TO_MAKE_ONE}"));
    }
    let options = mcap::read::Options::IgnoreEndMagic; // a killed recorder leaves none
    let messages = mcap::MessageStream::new_with_options(bytes, options.into())
        .map_err(|error| format!("is no MCAP file ({error}); {HOW_TO_MAKE_ONE}"))?;
    let mut samples = Vec::new();
    let mut start_ns = None;
    for message in messages {
        let Ok(message) = message else { break }; // cut off: what came before is good
        if message.channel.schema.as_ref().is_none_or(|schema| schema.name != POSE_SCHEMA) {
            continue;
        }
        let pose =
            FrameTransform::decode(&*message.data).map_err(|error| format!("a pose is damaged: {error}"))?;
        let (Some(at), Some(turn)) = (pose.translation, pose.rotation) else { continue };
        let since_start_ns = message.log_time.saturating_sub(*start_ns.get_or_insert(message.log_time));
        let orientation = DQuat::from_xyzw(turn.x, turn.y, turn.z, turn.w);
        let sample = Sample::new(since_start_ns as f64 * 1.0e-9, DVec3::new(at.x, at.y, at.z), orientation);
        let time = |problem| format!("{since_start_ns} ns after the first pose: {problem}");
        sample.and_then(|sample| sample.append_to(&mut samples)).map_err(time)?;
    }
    Ok(samples)
}
