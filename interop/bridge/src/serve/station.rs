//! Publishers of a bridge.

use crate::keys::Name;
use crate::link::{LinkError, WaitNow};
use crate::status::Status;
use flotor_core::Change;
use flotor_core::trace::TickRecord;
use flotor_live::End;
use flotor_record::TickMessages;
use serde::Serialize;
use std::sync::Mutex;
use zenoh::Session;
use zenoh::pubsub::Publisher;
use zenoh::qos::CongestionControl;

/// Publishers of a bridge, by key.
pub(super) struct Station {
    pose: Publisher<'static>,
    tick: Publisher<'static>,
    change: Publisher<'static>,
    end: Publisher<'static>,
    status: Publisher<'static>,
    messages: Mutex<TickMessages>,
}

impl Station {
    pub(super) fn declare(session: &Session, name: &Name) -> Result<Self, LinkError> {
        // A slow subscriber delays the bridge, not the host, which drops and counts ticks. Zenoh disconnects a subscriber that
        // receives nothing for a while.
        let publisher = |key: &str| {
            session.declare_publisher(name.key(key)).congestion_control(CongestionControl::Block).wait_now()
        };
        Ok(Self {
            pose: publisher("tf")?,
            tick: publisher("tick")?,
            change: publisher("change")?,
            end: publisher("end")?,
            status: publisher("status")?,
            messages: Mutex::default(),
        })
    }

    /// Returns true if there are subscribers to ticks or poses.
    pub(super) fn is_wanted(&self) -> Result<bool, LinkError> {
        Ok(self.tick.matching_status().wait_now()?.matching()
            || self.pose.matching_status().wait_now()?.matching())
    }

    /// Publishes the pose and the tick. `number` counts all due ticks, so that a gap in the numbers shows a loss.
    pub(super) fn tick(&self, record: &TickRecord, number: u64) -> Result<(), LinkError> {
        let (pose, tick) = {
            let mut messages = flotor_core::lock(&self.messages);
            messages.encode(record)
        };
        self.pose.put(pose).wait_now()?;
        self.tick.put(tick).attachment(number.to_le_bytes()).wait_now()
    }

    /// Publishes a change with its time.
    pub(super) fn change(&self, change: &Change) -> Result<(), LinkError> {
        self.change
            .put(flotor_record::change_to_bytes(change))
            .attachment(change.time_ns.to_le_bytes())
            .wait_now()
    }

    /// Publishes the end of the run with the number of the last tick.
    pub(super) fn end(&self, end: &End, last: u64) -> Result<(), LinkError> {
        self.end.put(json(end)).attachment(last.to_le_bytes()).wait_now()
    }

    /// Publishes the status of the bridge.
    pub(super) fn status(&self, status: &Status) -> Result<(), LinkError> {
        self.status.put(json(status)).wait_now()
    }
}

/// Encodes a value as JSON; the types used here cannot fail.
pub(super) fn json(value: &impl Serialize) -> Vec<u8> {
    serde_json::to_vec(value).unwrap_or_default()
}
