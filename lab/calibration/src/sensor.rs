//! Force sensor of a calibration: device plugin that only measures, read synchronously.

use super::CalibrationError;
use flotor_hal::{Cycle, DeviceState, LoopConfig, Refusal, Tick};
use flotor_loader::{ActiveDevice, Plugin, Setting};
use std::time::{Duration, Instant};

/// Default plugin of a force sensor on a serial port.
pub const SERIAL_SENSOR: &str = "force-sensor";

/// Poll interval for a reading.
const LOOK_AGAIN: Duration = Duration::from_millis(1);
/// Timeout of a reading; longer than the sensor timeout of a plugin.
const PATIENCE: Duration = Duration::from_secs(60);

/// Open force sensor.
pub struct ForceSensor {
    device: ActiveDevice,
    opened: Instant,
    tick: Tick,
}

impl ForceSensor {
    /// Opens and activates the force sensor of a plugin at the serial port `port`, with further settings. Not real-time.
    ///
    /// # Errors
    /// [`CalibrationError`] if the plugin has no parameter `port`, or rejects the settings, opening or activation.
    pub fn open(plugin: &Plugin, port: &str, mut settings: Vec<Setting>) -> Result<Self, CalibrationError> {
        let setting = Setting::parse(plugin.parameters(), "port", port);
        settings.push(
            setting
                .map_err(|error| CalibrationError::SensorRefused(Refusal::parameter(error.to_string())))?,
        );
        let config =
            LoopConfig { period_ns: u64::try_from(LOOK_AGAIN.as_nanos()).unwrap_or(u64::MAX), seed: 0 };
        let device = plugin.open_device(&settings)?.activate(&config);
        let device = device.map_err(|(_, refusal)| CalibrationError::SensorRefused(refusal))?;
        Ok(Self { device, opened: Instant::now(), tick: Tick::default() })
    }

    /// Returns a reading that began after this call, N. Not real-time.
    ///
    /// # Errors
    /// [`CalibrationError::Sensor`] if the sensor faults, a reading is not finite, or no reading arrives within a minute.
    pub fn read_n(&mut self) -> Result<f64, CalibrationError> {
        // The first reading may have begun before this call: discard it.
        self.next_n()?;
        self.next_n()
    }

    fn next_n(&mut self) -> Result<f64, CalibrationError> {
        let (mut state, started) = (DeviceState::HOME, Instant::now());
        while started.elapsed() < PATIENCE {
            let time_ns = u64::try_from(self.opened.elapsed().as_nanos()).unwrap_or(u64::MAX);
            let index = self.tick.index + 1;
            self.tick = Tick { index, time_ns, dt_ns: time_ns - self.tick.time_ns };
            match self.device.read(&self.tick, &mut state) {
                Cycle::Fresh if state.delivered.is_finite() => return Ok(state.delivered.force().z),
                Cycle::Fresh => return Err(CalibrationError::Sensor(flotor_hal::Fault::Protocol)),
                Cycle::Stale => std::thread::sleep(LOOK_AGAIN),
                Cycle::Fault(fault) => return Err(CalibrationError::Sensor(fault)),
            }
        }
        Err(CalibrationError::Sensor(flotor_hal::Fault::Timeout))
    }
}
