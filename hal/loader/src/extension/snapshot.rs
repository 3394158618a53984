//! Host side of `flotor.snapshot/1`: saves and restores the state of a model or of an active device.

use crate::guarded::GuardedInstance;
use crate::{ActiveDevice, Model};
use flotor_hal::Memory;
use flotor_hal::abi::CallStatus;
use flotor_hal::extension::snapshot::SnapshotTable;

/// State of a loaded model or device, to save or restore.
pub struct InstanceState<'a> {
    calls: &'a mut GuardedInstance,
    /// `None` for a model without a state.
    table: Option<&'static SnapshotTable>,
}

impl InstanceState<'_> {
    /// Returns the number of bytes of the state; `None` if the plugin failed. Real-time: bounded, no allocation.
    #[must_use]
    pub fn count(&mut self) -> Option<u64> {
        let Some(table) = self.table else { return Some(0) };
        self.calls.query(table.count, 0)
    }

    /// Saves the state to `bytes`, which has the length of [`Self::count`]. Real-time: bounded, no allocation.
    pub fn save(&mut self, bytes: &mut [u8]) -> CallStatus {
        let (at, count) = (bytes.as_mut_ptr(), bytes.len() as u64);
        let Some(table) = self.table else { return empty(count) };
        let Some(save) = table.save else { return CallStatus::Unsupported };
        // SAFETY: a live instance used by this thread only (`&mut`), `count` bytes that are valid for the call.
        CallStatus::from_code(self.calls.call(|instance| unsafe { save(instance, at, count) }))
    }

    /// Saves the state to new memory; `None` if the plugin failed. Not real-time.
    #[must_use]
    pub fn to_bytes(&mut self) -> Option<Vec<u8>> {
        let mut bytes = vec![0; usize::try_from(self.count()?).ok()?];
        (self.save(&mut bytes) == CallStatus::Ok).then_some(bytes)
    }

    /// Restores a saved state; after a failure the state is undefined. Real-time: bounded, no allocation.
    pub fn restore(&mut self, bytes: &[u8]) -> CallStatus {
        let (at, count) = (bytes.as_ptr(), bytes.len() as u64);
        let Some(table) = self.table else { return empty(count) };
        let Some(restore) = table.restore else { return CallStatus::Unsupported };
        // SAFETY: as in `save`.
        CallStatus::from_code(self.calls.call(|instance| unsafe { restore(instance, at, count) }))
    }
}

/// Returns the status of a call with `count` bytes on a model without a state.
const fn empty(count: u64) -> CallStatus {
    if count == 0 { CallStatus::Ok } else { CallStatus::OutOfRange }
}

impl Model {
    /// Returns the state of the model: empty without a history. `None` for a path-dependent model without the extension.
    #[must_use]
    pub fn state(&mut self) -> Option<InstanceState<'_>> {
        let table = self.extensions.snapshot;
        let has_state = table.is_some() || self.memory() == Memory::Stateless;
        has_state.then_some(InstanceState { calls: &mut self.calls, table })
    }
}

impl ActiveDevice {
    /// Returns the state of the device; `None` without the extension.
    #[must_use]
    pub fn state(&mut self) -> Option<InstanceState<'_>> {
        let table = self.extensions()?.snapshot?;
        Some(InstanceState { calls: &mut self.calls, table: Some(table) })
    }
}
