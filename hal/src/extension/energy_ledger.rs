//! Extension `flotor.energy-ledger/1`: balance of the mechanical energy of a device with a known plant.

use crate::abi::instance::fill;
use crate::abi::interface::table;
use crate::abi::layout::layout;
use crate::abi::{DeviceAdapter, Instance};
use crate::{ActiveDevice, Device};

/// Balance of the mechanical energy of a device with a known plant (a simulation), J since activation. 56 bytes.
///
/// Every term is integrated separately, none is the difference of others, so that this balance is a check:
/// `stored_j - initial_j = actuators_j + feedforward_j + hand_j - dissipated_j`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct EnergyLedger {
    /// Kinetic and potential energy now, J.
    pub stored_j: f64,
    /// Kinetic and potential energy at activation, J.
    pub initial_j: f64,
    /// Work done on the handle by the actuators for the commanded wrench, J.
    pub actuators_j: f64,
    /// Work done on the handle by the actuators for gravity compensation, J.
    pub feedforward_j: f64,
    /// Work done on the handle by the hand, J.
    pub hand_j: f64,
    /// Energy turned into heat by damping, J.
    pub dissipated_j: f64,
    /// Largest mechanical energy so far (kinetic, plus potential above its lowest point), J: the scale of the residual.
    pub peak_j: f64,
}

impl EnergyLedger {
    /// Returns the residual of the balance, J: the stored minus the explained energy, 0 except for integration errors.
    #[must_use]
    pub fn residual_j(&self) -> f64 {
        let explained = self.actuators_j + self.feedforward_j + self.hand_j - self.dissipated_j;
        self.stored_j - self.initial_j - explained
    }
}

/// Active device with a known plant.
///
/// ```
/// # use flotor_hal::*;
/// # struct Crank { samples: u64, ledger: EnergyLedger }
/// # impl Device for Crank {
/// #     const INFO: DeviceInfo = DeviceInfo::new("crank", "Crank", "A handle that turns");
/// #     type Active = Crank;
/// #     type Stop = NothingToStop;
/// #     fn open(_: &Settings<'_>) -> Result<Self, Refusal> {
/// #         Ok(Crank { samples: 0, ledger: EnergyLedger::default() })
/// #     }
/// #     fn capabilities(&self) -> Capabilities { Capabilities::UNDRIVEN }
/// #     fn stopper(&self) -> NothingToStop { NothingToStop }
/// #     fn activate(self, _: &LoopConfig) -> Result<Crank, (Self, Refusal)> { Ok(self) }
/// # }
/// # impl ActiveDevice for Crank {
/// #     type Opened = Crank;
/// #     fn read(&mut self, _: &Tick, _: &mut DeviceState) -> Cycle { Cycle::Fresh }
/// #     fn write(&mut self, _: &Tick, _: &Wrench) -> Cycle { Cycle::Fresh }
/// #     fn deactivate(self) -> Crank { self }
/// # }
/// /// For a simulated plant, which knows its energy: `export_device!(Crank, energy_ledger)`.
/// impl EnergyLedgerDevice for Crank {
///     fn energy_ledger(&self) -> EnergyLedger {
///         self.ledger
///     }
/// }
/// # let crank = Crank { samples: 0, ledger: EnergyLedger::default() };
/// assert_eq!(crank.energy_ledger().residual_j(), 0.0);
/// ```
pub trait EnergyLedgerDevice: ActiveDevice {
    /// Returns the energy balance since activation. Real-time: bounded, no allocation.
    fn energy_ledger(&self) -> EnergyLedger;
}

/// Function table `flotor.energy-ledger/1`: see [`EnergyLedgerDevice`].
#[repr(C)]
#[derive(Clone, Copy)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct EnergyLedgerTable {
    /// Size of this table in the plugin's build, bytes.
    pub size: u32,
    /// Reserved, 0.
    pub reserved: u32,
    /// Writes the energy balance since activation; returns a [`crate::abi::CallStatus`] code. Real-time.
    pub ledger: Option<unsafe extern "C" fn(instance: Instance, out: *mut EnergyLedger) -> u32>,
}

layout! {
    EnergyLedger { stored_j, initial_j, actuators_j, feedforward_j, hand_j, dissipated_j, peak_j }
    EnergyLedgerTable { size, reserved, ledger }
}
unsafe extern "C" fn ledger<D: Device<Active: EnergyLedgerDevice>>(
    instance: Instance,
    out: *mut EnergyLedger,
) -> u32 {
    // SAFETY: the contract of every table call.
    unsafe { fill::<DeviceAdapter<D>, _>(instance, out, |phase| Ok(phase.active()?.energy_ledger())) }
}

table!(EnergyLedgerTable: "flotor.energy-ledger/1", D: [Device<Active: EnergyLedgerDevice>] {
    reserved: 0,
    ledger: Some(ledger::<D>),
});
