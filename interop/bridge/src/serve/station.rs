//! What a bridge publishes.

use super::WaitNow;
use crate::keys::Name;
use crate::link::LinkError;
use crate::status::Status;
use flotor_core::Change;
use flotor_core::trace::TickRecord;
use flotor_live::{ChangeMessage, End};
use flotor_record::TickMessages;
use serde::Serialize;
use std::sync::Mutex;
use zenoh::Session;
use zenoh::pubsub::Publisher;
use zenoh::qos::CongestionControl;

/// The keys on which a bridge publishes.
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
        // A subscriber that lags holds up the bridge, not the host, which drops and counts. One that takes nothing at all is
        // cut off by Zenoh after a while.
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

    /// Whether anybody subscribes to ticks.
    pub(super) fn is_wanted(&self) -> Result<bool, LinkError> {
        Ok(self.tick.matching_status().wait_now()?.matching()
            || self.pose.matching_status().wait_now()?.matching())
    }

    /// Publishes a tick, with its number among all that were to be: a gap in these is a loss.
    pub(super) fn tick(&self, record: &TickRecord, number: u64) -> Result<(), LinkError> {
        let (pose, tick) = {
            let mut messages = self.messages.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            messages.encode(record)
        };
        self.pose.put(pose).wait_now()?;
        self.tick.put(tick).attachment(number.to_le_bytes()).wait_now()
    }

    /// Publishes a change, with its time.
    pub(super) fn change(&self, change: &ChangeMessage) -> Result<(), LinkError> {
        let change = Change::from(change);
        self.change
            .put(flotor_record::change_to_bytes(&change))
            .attachment(change.time_ns.to_le_bytes())
            .wait_now()
    }

    /// Publishes that the run is over, with the number of its last tick.
    pub(super) fn end(&self, end: &End, last: u64) -> Result<(), LinkError> {
        self.end.put(json(end)).attachment(last.to_le_bytes()).wait_now()
    }

    /// Publishes how the bridge is doing.
    pub(super) fn status(&self, status: &Status) -> Result<(), LinkError> {
        self.status.put(json(status)).wait_now()
    }
}

/// None of our types fails to become JSON.
pub(super) fn json(value: &impl Serialize) -> Vec<u8> {
    serde_json::to_vec(value).unwrap_or_default()
}
