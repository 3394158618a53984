//! Everything a servo is made of, its devices open and not yet energised.

use super::RunError;
use super::prepare::Opened;
use flotor_hal::abi::loader::Stopper;
use flotor_hal::{DVec3, LoopConfig};
use flotor_servo::{Envelope, Exchange, Forces, Heartbeat, ParameterQueue, RunConfig, Servo, Station};

/// What becomes a [`Servo`] right before its first tick: a device that is energised and not spoken to lets go, some after
/// a few milliseconds.
pub(super) struct Standby {
    devices: Vec<(Opened, Envelope)>,
    forces: Forces,
    parameters: ParameterQueue,
    exchange: Exchange,
    config: LoopConfig,
    run: RunConfig,
    heart: Heartbeat,
}

impl Standby {
    /// Not real-time.
    pub(super) fn new(
        devices: Vec<(Opened, Envelope)>,
        forces: Forces,
        parameters: ParameterQueue,
        exchange: Exchange,
        config: LoopConfig,
        run: RunConfig,
    ) -> Self {
        Self { devices, forces, parameters, exchange, config, run, heart: Heartbeat::default() }
    }

    /// What the servo's watchdog will listen to.
    pub(super) fn heart(&self) -> Heartbeat {
        self.heart.clone()
    }

    /// The most that may reach a hand at any device: force along each axis (N), torque about each (N·m).
    pub(super) fn most(&self) -> [DVec3; 2] {
        let most = self.devices.iter().map(|(_, envelope)| envelope.most());
        most.fold([DVec3::ZERO; 2], |[force_n, torque_nm], [f, t]| [force_n.max(f), torque_nm.max(t)])
    }

    /// Stops any of the devices, from wherever.
    pub(super) fn stoppers(&self) -> Vec<Stopper> {
        self.devices.iter().map(|(opened, _)| opened.device.stopper()).collect()
    }

    /// Energises the devices, in order. Not real-time; may block.
    ///
    /// # Errors
    /// [`RunError::Plugin`] if one says no; then none stays energised.
    pub(super) fn activate(self) -> Result<Servo, RunError> {
        let stoppers = self.stoppers();
        let Self { devices, forces, parameters, exchange, config, run, heart } = self;
        let station = |(opened, envelope): (Opened, Envelope)| {
            let sensed = opened.capabilities.sensed;
            Ok(Station::new(opened.activate(&config)?, envelope, sensed, config.period_ns))
        };
        let stations = devices.into_iter().map(station).collect::<Result<Vec<_>, RunError>>();
        let stations = stations.inspect_err(|_| stoppers.iter().for_each(Stopper::safe_stop))?;
        Ok(Servo::new(stations, forces, parameters, exchange, run, heart))
    }
}
