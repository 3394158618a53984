//! Everything a servo is made of, its devices open and not yet energised.

use crate::{Envelope, Forces, Heartbeat, LastStop, LoopSwaps, ParameterQueue, RunConfig, Servo, Station};
use flotor_core::demand::ObserverDemand;
use flotor_core::limits::Bound;
use flotor_hal::abi::loader::{OpenedDevice, Stopper};
use flotor_hal::{Capabilities, LoopConfig, Refusal};

/// A device that is opened, not energised, and what guards it.
pub struct Guarded {
    /// The device.
    pub device: OpenedDevice,
    /// What it has said it can do: what its samples are checked against.
    pub capabilities: Capabilities,
    /// What nothing gets past on its way there.
    pub envelope: Envelope,
}

/// What becomes a [`Servo`] right before its first tick: an energised device without commands removes its force, some
/// after a few milliseconds.
pub struct Standby {
    devices: Vec<Guarded>,
    forces: Forces,
    observers: ObserverDemand,
    parameters: ParameterQueue,
    swaps: LoopSwaps,
    config: LoopConfig,
    run: RunConfig,
    heart: Heartbeat,
}

impl Standby {
    /// Not real-time.
    pub fn new(
        devices: Vec<Guarded>,
        forces: Forces,
        parameters: ParameterQueue,
        swaps: LoopSwaps,
        config: LoopConfig,
        run: RunConfig,
    ) -> Self {
        let (observers, heart) = (ObserverDemand::default(), Heartbeat::default());
        Self { devices, forces, observers, parameters, swaps, config, run, heart }
    }

    /// What the servo's watchdog will listen to.
    pub fn heart(&self) -> Heartbeat {
        self.heart.clone()
    }

    /// Returns the place where observers ask for outputs of the models.
    pub fn observers(&self) -> ObserverDemand {
        self.observers.clone()
    }

    /// The most that may reach a hand at any device: force (N), torque (N·m), each with the longest there is as its norm.
    pub fn most(&self) -> [Bound; 2] {
        let most = self.devices.iter().map(|guarded| guarded.envelope.most());
        let larger = |a: Bound, b: Bound| {
            let axes = std::array::from_fn(|axis| a.axes()[axis].max(b.axes()[axis]));
            Bound::box_of(axes).and(Bound::ball(a.longest().max(b.longest())))
        };
        most.fold([Bound::ball(0.0); 2], |[force_n, torque_nm], [f, t]| {
            [larger(force_n, f), larger(torque_nm, t)]
        })
    }

    /// Puts other envelopes before the devices, in order; a device without another keeps its own. Not real-time.
    pub fn guard_with(&mut self, envelopes: Vec<Envelope>) {
        for (guarded, envelope) in self.devices.iter_mut().zip(envelopes) {
            guarded.envelope = envelope;
        }
    }

    /// Stops any of the devices, from wherever.
    pub fn stoppers(&self) -> Vec<Stopper> {
        self.devices.iter().map(|guarded| guarded.device.stopper()).collect()
    }

    /// Energises the devices, in order, on the thread that will loop. `names` are those of the devices, then of the models,
    /// for whom it may concern if the process dies; `enters` hears of the number of each device before. Not real-time; may
    /// block.
    ///
    /// # Errors
    /// The number of the device that says no, and why; then none stays energised.
    pub fn activate(self, names: Vec<String>, enters: impl Fn(usize)) -> Result<Servo, (usize, Refusal)> {
        let stoppers = self.stoppers();
        let last_stop = LastStop::arm(stoppers.clone(), names, self.heart());
        let Self { devices, forces, observers, parameters, swaps, config, run, heart } = self;
        let station = |(number, guarded): (usize, Guarded)| {
            let Guarded { mut device, capabilities, envelope } = guarded;
            enters(number);
            // The loader refuses what is not what was told when the envelope was made.
            device.capabilities().map_err(|refusal| (number, refusal))?;
            let device = device.activate(&config).map_err(|(_, refusal)| (number, refusal))?;
            Ok(Station::new(device, envelope, &capabilities, config.period_ns))
        };
        let stations =
            devices.into_iter().enumerate().map(station).collect::<Result<Vec<_>, (usize, Refusal)>>();
        let stations = stations.inspect_err(|_| stoppers.iter().for_each(Stopper::safe_stop))?;
        Ok(Servo::new(stations, forces, observers, parameters, swaps, run, heart).guarded_by(last_stop))
    }
}
