//! Observers of a run: [`Observer`] receives every tick, [`Tap`] reads the newest.

use flotor_core::tally::Tally;
use flotor_core::trace::{Events, RECORD_WORDS, TickRecord};
use flotor_core::{Change, ModelOutputs};
use flotor_hal::{Demand, Pose, Twist, Wrench};

/// Observer of all records and changes of a run; on the real clock called outside the loop's thread.
pub trait Observer {
    /// Receives the record of a tick at one device: tick after tick, and within a tick device after device. Not real-time.
    fn observe(&mut self, record: &TickRecord);

    /// Receives a change of a parameter, a weight or a model, before the record of the first tick with the change. Not real-time.
    fn change(&mut self, _change: &Change) {}

    /// Returns true if the observer reads the changes of the run.
    fn reads_changes(&self) -> bool {
        true
    }

    /// Returns the model outputs that the observer reads; the loop computes the others only where the hand feels them. Called
    /// before the run and repeatedly during the run. Not real-time.
    fn demand(&self) -> Demand {
        Demand::FORCE
    }
}

impl Observer for Tally {
    fn observe(&mut self, record: &TickRecord) {
        self.add(record);
    }
}

/// Reader of the newest record of a device, for another thread, without waiting. Version 0, before the first tick, is a device at
/// rest at home.
pub type Tap = flotor_sync::Observer<TickRecord, RECORD_WORDS>;

/// Initial record: device at home.
const AT_HOME: TickRecord = TickRecord {
    tick: 0,
    device: 0,
    time_ns: 0,
    dt_ns: 0,
    pose: Pose::HOME,
    twist: Twist::ZERO,
    model: ModelOutputs::ZERO,
    commanded: Wrench::ZERO,
    delivered: Wrench::ZERO,
    port_energy_j: 0.0,
    grip: None,
    events: Events::NONE,
    buttons: 0,
    lateness_ns: 0,
    compute_ns: 0,
};

/// Publishers of the taps, in the loop's thread, each with its device number.
#[derive(Default)]
pub(super) struct Taps(Vec<(u16, flotor_sync::Publisher<TickRecord, RECORD_WORDS>)>);

impl Taps {
    /// Creates a tap for a device.
    pub(super) fn add(&mut self, device: u16) -> Tap {
        let (end, tap) = flotor_sync::latest(TickRecord { device, ..AT_HOME });
        self.0.push((device, end));
        tap
    }

    /// Publishes a record to the taps of its device. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn publish(&mut self, record: &TickRecord) {
        let taps = self.0.iter_mut().filter(|(device, _)| *device == record.device);
        taps.for_each(|(_, tap)| tap.publish(record));
    }
}
