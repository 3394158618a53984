//! Ticks and changes as the messages of a recording, for transports other than a file.

use crate::schema::{Change as ChangeMessage, FrameTransform, Missing, Tick};
use flotor_core::Change;
use flotor_core::trace::TickRecord;
use prost::Message;

/// Error of bytes that are not a complete message of a recording.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("not a valid message {message}: {reason}")]
pub struct InvalidMessage {
    message: &'static str,
    reason: String,
}

/// Encoder for the two messages of a tick. Reuses the frame names, which are equal for all ticks.
#[derive(Debug)]
pub struct TickMessages {
    pose: FrameTransform,
}

impl Default for TickMessages {
    fn default() -> Self {
        Self { pose: FrameTransform::of_handle() }
    }
}

impl TickMessages {
    /// Encodes a record as a `foxglove.FrameTransform` and a `flotor.Tick`, which together contain the whole record,
    /// bit by bit. Not real-time.
    pub fn encode(&mut self, record: &TickRecord) -> (Vec<u8>, Vec<u8>) {
        self.pose.set(record);
        (self.pose.encode_to_vec(), Tick::new(record).encode_to_vec())
    }
}

/// Decodes the record of a tick from its two messages. Not real-time.
///
/// # Errors
/// [`InvalidMessage`] if a message cannot be decoded or is incomplete, or the messages belong to two different ticks.
pub fn tick_from_messages(pose: &[u8], tick: &[u8]) -> Result<TickRecord, InvalidMessage> {
    let wrong = |message: &'static str| move |reason: String| InvalidMessage { message, reason };
    let lacks = |Missing(part)| format!("the message has no `{part}`");
    let of_pose = wrong("foxglove.FrameTransform");
    let of_tick = wrong("flotor.Tick");
    let transform = FrameTransform::decode(pose).map_err(|cause| of_pose(cause.to_string()))?;
    let tick = Tick::decode(tick).map_err(|cause| of_tick(cause.to_string()))?;
    let record = tick.record(transform.pose().map_err(|part| of_pose(lacks(part)))?);
    let record = record.map_err(|part| of_tick(lacks(part)))?;
    if !transform.is_of(&record) {
        return Err(of_pose("the time of the pose differs from the time of the tick".to_owned()));
    }
    Ok(record)
}

/// Encodes a change as the protobuf message `flotor.Change`, which contains no time. Not real-time.
#[must_use]
pub fn change_to_bytes(change: &Change) -> Vec<u8> {
    ChangeMessage::new(change).encode_to_vec()
}

/// Decodes a change from a protobuf message `flotor.Change`, given its time, ns. Not real-time.
///
/// # Errors
/// [`InvalidMessage`] if the message cannot be decoded or is incomplete.
pub fn change_from_bytes(bytes: &[u8], time_ns: u64) -> Result<Change, InvalidMessage> {
    let wrong = |reason: String| InvalidMessage { message: "flotor.Change", reason };
    let message = ChangeMessage::decode(bytes).map_err(|cause| wrong(cause.to_string()))?;
    message.change(time_ns).map_err(|Missing(part)| wrong(format!("the message has no `{part}`")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_core::trace::RECORD_WORDS;
    use flotor_sync::Words;

    /// A record in which every word is another number.
    fn record(seed: u64) -> TickRecord {
        TickRecord::from_words(&std::array::from_fn(|i| match i {
            0..=2 => seed + i as u64,
            42 => seed % 3, // the kind of a grip, or none
            i => (seed as f64 * 0.1 - i as f64).to_bits() & 0xffff_ffff_ffff,
        }))
    }

    #[test]
    fn a_tick_survives_to_the_bit() {
        let mut messages = TickMessages::default();
        for seed in 0..100 {
            let record = record(seed);
            let (pose, tick) = messages.encode(&record);
            let back = tick_from_messages(&pose, &tick).unwrap();
            assert_eq!(back.to_words(), record.to_words());
        }
        assert_eq!(RECORD_WORDS, 45);
    }

    #[test]
    fn halves_of_two_ticks_are_no_tick() {
        let mut messages = TickMessages::default();
        let (pose, tick) = messages.encode(&record(1));
        let (other, _) = messages.encode(&record(2));
        assert!(tick_from_messages(&other, &tick).is_err());
        assert!(tick_from_messages(&[], &tick).is_err(), "no pose at all");
        assert!(tick_from_messages(&pose, &[]).is_err(), "no tick at all");
        for cut in 0..tick.len() {
            let _ = tick_from_messages(&pose, &tick[..cut]); // an error or a record, no panic
        }
    }
}
