//! Simulated flotor under a simulated sensor.

use super::{AVERAGED_TICKS, Mean, PERIOD_NS, Rest, Rig, locked};
use crate::CalibrationError;
use flotor_hal::{Cycle, DeviceState, LoopConfig, Refusal, Tick, VerticalCalibration, math};
use flotor_loader::{ActiveDevice, Plugin, Setting};
use flotor_session::calibration_file::CalibratedDevice;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use std::f64::consts::TAU;

/// Weight of flotor, plates, screws and bolts in the thesis's rig, N (Varadharajan 2007, section 3.4).
pub const RIG_WEIGHT_N: f64 = 8.58;
/// Root mean square noise of the force sensor, N.
pub const SENSOR_NOISE_N: f64 = 0.02;

/// Standard gravity, m/s² (ISO 80000-3).
const GRAVITY_M_PER_S2: f64 = 9.806_65;
/// Settling time of the handle, ticks. The slowest motion of the rig decays to 1/e within 10 ticks.
const SETTLE_TICKS: u64 = 200;
/// Stiffness and damping of the sensor's stand, modelled by the simulated hand.
const STAND_STIFFNESS_N_PER_M: f64 = 20_000.0;
const STAND_DAMPING_NS_PER_M: f64 = 250.0;
/// Difference between two halves of the average that counts as motion, m: twenty times the noise.
const REST_M: f64 = 4.0e-6;
/// Maximum number of adjustments of the sensor's position, and their tolerance, m.
const ADJUSTMENTS: u32 = 3;
const CLOSE_M: f64 = 2.0e-6;

/// Simulated flotor under a simulated sensor. The plugin is driven through the contract alone, like any device.
pub struct SimulatedRig {
    plugin: Plugin,
    calibration: Option<VerticalCalibration>,
    noise: Pcg64Mcg,
    seed: u64,
    /// Number of rests so far; each rest has its own noise.
    rests: u64,
}

impl SimulatedRig {
    /// Creates a rig around the plugin `simulated`.
    #[must_use]
    pub fn new(plugin: Plugin, seed: u64) -> Self {
        Self { plugin, calibration: None, noise: Pcg64Mcg::seed_from_u64(seed), seed, rests: 0 }
    }

    /// Sets the calibration of the device; `None`: uncorrected.
    pub fn calibrate(&mut self, calibration: Option<VerticalCalibration>) {
        self.calibration = calibration;
    }

    /// Returns plugin and serial number of the device.
    ///
    /// # Errors
    /// [`CalibrationError`] if the plugin is not the simulated flotor, or the device cannot be opened.
    pub fn device(&mut self) -> Result<CalibratedDevice, CalibrationError> {
        let serial = self.plugin.open_device(&self.settings(0.0)?)?.serial();
        Ok(CalibratedDevice { plugin: self.plugin.metadata().id.clone(), serial })
    }

    /// Returns the settings of the flotor in the rig, with the sensor at a height. The command alone compensates gravity.
    fn settings(&self, sensor_m: f64) -> Result<Vec<Setting>, CalibrationError> {
        let schema = self.plugin.parameters();
        let settings = [
            Setting::parse(schema, "preset", "full"),
            Setting::parse(schema, "hand", "hold"),
            Setting::number(schema, "mass_kg", RIG_WEIGHT_N / GRAVITY_M_PER_S2),
            Setting::number(schema, "gravity_m_per_s2", GRAVITY_M_PER_S2),
            Setting::number(schema, "feedforward_n", 0.0),
            Setting::number(schema, "hand_mass_kg", 0.0),
            Setting::number(schema, "hand_stiffness_n_per_m", STAND_STIFFNESS_N_PER_M),
            Setting::number(schema, "hand_damping_ns_per_m", STAND_DAMPING_NS_PER_M),
            Setting::number(schema, "hand_depth_mm", -sensor_m * 1.0e3),
            Setting::number(schema, "start_z_mm", sensor_m * 1.0e3),
        ];
        Ok(settings.into_iter().collect::<Result<Vec<_>, _>>()?)
    }

    fn activate(&mut self, sensor_m: f64) -> Result<ActiveDevice, CalibrationError> {
        let mut device = self.plugin.open_device(&self.settings(sensor_m)?)?;
        if let Some(calibration) = &self.calibration {
            device.calibrate_vertical(calibration).map_err(CalibrationError::Refused)?;
        }
        self.rests += 1;
        let config = LoopConfig { period_ns: PERIOD_NS, seed: self.seed.wrapping_add(self.rests) };
        device.activate(&config).map_err(|(_, refusal): (_, Refusal)| CalibrationError::Refused(refusal))
    }

    /// Simulates the handle until it rests under a sensor at `sensor_m`.
    fn settle(&mut self, sensor_m: f64, command_n: &dyn Fn(f64) -> f64) -> Result<Rest, CalibrationError> {
        let mut device = self.activate(sensor_m)?;
        let mut state = DeviceState::HOME;
        let (mut first, mut second, mut delivered_n) = (Mean::default(), Mean::default(), Mean::default());
        for index in 0..SETTLE_TICKS + AVERAGED_TICKS {
            let dt_ns = if index == 0 { 0 } else { PERIOD_NS };
            let tick = Tick { index, time_ns: index * PERIOD_NS, dt_ns };
            if let Cycle::Fault(fault) = device.read(&tick, &mut state) {
                return Err(CalibrationError::Fault(fault));
            }
            let height_m = state.pose.position().z;
            if index >= SETTLE_TICKS {
                let half = if index < SETTLE_TICKS + AVERAGED_TICKS / 2 { &mut first } else { &mut second };
                half.add(height_m);
                delivered_n.add(state.delivered.force().z);
            }
            if let Cycle::Fault(fault) = device.write(&tick, &locked(&state, command_n(height_m))) {
                return Err(CalibrationError::Fault(fault));
            }
        }
        let height_m = 0.5 * (first.value() + second.value());
        let moved_m = (first.value() - second.value()).abs();
        if moved_m > REST_M {
            return Err(CalibrationError::NotAtRest {
                height_mm: height_m * 1.0e3,
                moved_um: moved_m * 1.0e6,
            });
        }
        Ok(Rest { height_m, delivered_n: delivered_n.value() })
    }
}

impl Rig for SimulatedRig {
    fn rest_at(&mut self, target_m: f64, command_n: &dyn Fn(f64) -> f64) -> Result<Rest, CalibrationError> {
        let mut sensor_m = target_m;
        let mut rest = self.settle(sensor_m, command_n)?;
        // The stand yields slightly: move the sensor until the handle is at its target.
        for _ in 0..ADJUSTMENTS {
            let off_m = target_m - rest.height_m;
            if off_m.abs() <= CLOSE_M {
                break;
            }
            sensor_m += off_m;
            rest = self.settle(sensor_m, command_n)?;
        }
        Ok(rest)
    }

    fn read_force_n(&mut self, rest: &Rest) -> Result<f64, CalibrationError> {
        // At rest the sensor carries the delivered force beyond the weight.
        let true_n = rest.delivered_n - RIG_WEIGHT_N;
        // Box-Muller transform (1958); 1 - u is never zero.
        let [u, v] = [(); 2].map(|()| (self.noise.next_u64() >> 11) as f64 / (1_u64 << 53) as f64);
        Ok(true_n + SENSOR_NOISE_N * (-2.0 * math::ln(1.0 - u)).sqrt() * math::cos(TAU * v))
    }
}
