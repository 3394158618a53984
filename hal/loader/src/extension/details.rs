//! Host side of `flotor.details/1`: diagnostic numbers of the last step.

use crate::Model;
use crate::declaration::static_list;
use flotor_hal::Detail;
use flotor_hal::abi::CallStatus;

impl Model {
    /// Returns the diagnostic numbers of the model; empty for a model without details.
    pub fn details(&self) -> &'static [Detail] {
        let table = self.extensions.details;
        // SAFETY: a table's list is a static array of `detail_count` details of the checked layout.
        table.map_or(&[], |table| unsafe { static_list(table.details, table.detail_count) })
    }

    /// Writes the values of the last step to `values`, which needs an element for each of [`Self::details`]; NaN for a
    /// missing value. Returns [`CallStatus::OutOfRange`] if `values` is too short, and [`CallStatus::Unsupported`]
    /// without the extension. Real-time: bounded by the model, no allocation.
    pub fn read_details(&mut self, values: &mut [f64]) -> CallStatus {
        let Some(read) = self.extensions.details.and_then(|table| table.values) else {
            return CallStatus::Unsupported;
        };
        let capacity = u32::try_from(values.len()).unwrap_or(u32::MAX);
        // SAFETY: a live instance used by this thread only (`&mut`), room for `capacity` numbers.
        CallStatus::from_code(
            self.calls.call(|instance| unsafe { read(instance, values.as_mut_ptr(), capacity) }),
        )
    }
    /// Returns the error estimates of the model: each finite detail named `..._error`, known before the first step. Empty if the
    /// model has none. Not real-time.
    pub fn estimates(&mut self) -> Vec<(Detail, f64)> {
        let details = self.details();
        let mut values = vec![f64::NAN; details.len()];
        if values.is_empty() || self.read_details(&mut values) != CallStatus::Ok {
            return Vec::new();
        }
        let is_estimate =
            |(detail, value): &(Detail, f64)| detail.id().ends_with("_error") && value.is_finite();
        details.iter().copied().zip(values).filter(is_estimate).collect()
    }
}
