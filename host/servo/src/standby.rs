//! Parts of a servo before its start: devices are opened, not yet energised.

use crate::servo::Parts;
use crate::{Envelope, Forces, Heartbeat, LastStop, LoopSwaps, ParameterQueue, RunConfig, Servo, Station};
use flotor_core::demand::ObserverDemand;
use flotor_core::limits::Bound;
use flotor_hal::{Capabilities, LoopConfig, Refusal};
use flotor_loader::{OpenedDevice, Stopper};

/// Opened device, not energised, with its envelope.
pub struct Guarded {
    /// Opened device.
    pub device: OpenedDevice,
    /// Declared capabilities, against which samples are checked.
    pub capabilities: Capabilities,
    /// Envelope for all commands to the device.
    pub envelope: Envelope,
}

/// Servo in standby, which becomes a [`Servo`] right before its first tick: an energised device without commands removes its force,
/// sometimes after a few milliseconds.
pub struct Standby {
    devices: Vec<Guarded>,
    config: LoopConfig,
    parts: Parts,
}

impl Standby {
    /// Creates a standby from its parts, with a new heartbeat and no demand of observers. Not real-time.
    pub fn new(
        devices: Vec<Guarded>,
        forces: Forces,
        parameters: ParameterQueue,
        swaps: LoopSwaps,
        config: LoopConfig,
        run: RunConfig,
    ) -> Self {
        let (observers, heartbeat) = (ObserverDemand::default(), Heartbeat::default());
        let parts = Parts { forces, observers, parameters, swaps, config: run, heartbeat };
        Self { devices, config, parts }
    }

    /// Returns the heartbeat that the servo's watchdog will read.
    pub fn heartbeat(&self) -> Heartbeat {
        self.parts.heartbeat.clone()
    }

    /// Returns the shared demand of observers for model outputs.
    pub fn observers(&self) -> ObserverDemand {
        self.parts.observers.clone()
    }

    /// Returns the largest force (N) and torque (N·m) that may reach a hand at any device, per axis and as a norm.
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

    /// Replaces the envelopes of the devices, in order; a device without a new envelope keeps its own. Not real-time.
    pub fn guard_with(&mut self, envelopes: Vec<Envelope>) {
        for (guarded, envelope) in self.devices.iter_mut().zip(envelopes) {
            guarded.envelope = envelope;
        }
    }

    /// Returns a stopper for each device, usable from any thread.
    pub fn stoppers(&self) -> Vec<Stopper> {
        self.devices.iter().map(|guarded| guarded.device.stopper()).collect()
    }

    /// Arms the last stop, energises the devices, in order, and returns the servo. Call this function on the loop thread. `names`:
    /// names of the devices, then of the models, for the message if the process dies; `enters` is called with each device's number
    /// before that device is energised. Not real-time; may block.
    ///
    /// # Errors
    /// Number and [`Refusal`] of the device that refused; all devices are then stopped.
    pub fn activate(self, names: Vec<String>, enters: impl Fn(usize)) -> Result<Servo, (usize, Refusal)> {
        let stoppers = self.stoppers();
        let last_stop = LastStop::arm(stoppers.clone(), names, self.heartbeat());
        let Self { devices, config, parts } = self;
        let station = |(number, guarded): (usize, Guarded)| {
            let Guarded { mut device, capabilities, envelope } = guarded;
            enters(number);
            // The loader rejects capabilities that differ from those the envelope was made for.
            let _ = device.capabilities().map_err(|refusal| (number, refusal))?;
            let device = device.activate(&config).map_err(|(_, refusal)| (number, refusal))?;
            Ok(Station::new(device, envelope, &capabilities, config.period_ns))
        };
        let stations =
            devices.into_iter().enumerate().map(station).collect::<Result<Vec<_>, (usize, Refusal)>>();
        let stations = stations.inspect_err(|_| stoppers.iter().for_each(Stopper::safe_stop))?;
        Ok(Servo::new(stations, parts, last_stop))
    }
}
