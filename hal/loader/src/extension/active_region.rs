//! Host side of `flotor.active-region/1`: the region in which an instance may act.

use crate::Model;
use flotor_hal::extension::active_region::ActiveRegion;

impl Model {
    /// Returns the active region of the instance with the current parameters; without the extension, everywhere.
    /// Real-time: bounded, no allocation.
    pub fn active_region(&mut self) -> ActiveRegion {
        let ask = self.extensions.active_region.and_then(|table| table.region);
        self.calls.query(ask, ActiveRegion::EVERYWHERE).unwrap_or(ActiveRegion::EVERYWHERE)
    }
}
