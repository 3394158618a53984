//! Host side of `flotor.energy-ledger/1`: energy balance of a simulated plant.

use crate::ActiveDevice;
use flotor_hal::EnergyLedger;

impl ActiveDevice {
    /// Returns the energy balance of the plant; `None` without the extension, or if the plugin failed. Real-time:
    /// bounded, no allocation.
    #[must_use]
    pub fn energy_ledger(&mut self) -> Option<EnergyLedger> {
        let ask = self.extensions()?.energy_ledger?.ledger;
        self.calls.query(ask, EnergyLedger::default())
    }
}
