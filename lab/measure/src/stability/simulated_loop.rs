//! Closed loop of a virtual spring and a loaded device, with a test of stability.
//!
//! The device is the plugin `simulated`, opened as in any scene. Its centre of mass is at the origin, so that a push along z
//! remains a translation and the plant is the linear plant of [`theory`](super::theory). The spring is implemented here: it samples
//! the height, computes its force, delays it in a delay line and writes it.
//!
//! **Stable** means that the envelope of the height shrinks. The measure is the mean square over two successive
//! windows, weighted by a Hann window: for an oscillation `e^(s t) sin(w t)` their ratio is `e^(2 s W)` but for a
//! ripple that falls with the cube of the number of periods in a window `W`. The loop starts from a displacement so
//! small that no limit of force or range is reached; a real device would reach them, and buzz at that amplitude instead
//! of diverging.

use super::search::largest_stable;
use super::theory::Plant;
use flotor_hal::{Cycle, DVec3, DeviceState, Fault, LoopConfig, Refusal, Tick, Wrench, math};
use flotor_loader::{ActiveDevice, LoadError, OpenedDevice, Plugin, Setting, SettingError};
use std::collections::VecDeque;
use std::f64::consts::TAU;

/// Grip of the hand on the device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Grip {
    /// No grip: the worst case for stability
    #[default]
    Open,
    /// Relaxed hand at a constant position
    Relaxed,
    /// Firm hand at a constant position
    Firm,
}

/// Failure of a measurement of a loop.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LoopError {
    /// The plugin cannot be loaded, or rejects a call.
    #[error(transparent)]
    Plugin(#[from] LoadError),
    /// The plugin lacks a parameter of the simulated flotor.
    #[error("the plugin `simulated` is not that of this version (`flotor plugins` shows its file): {0}")]
    Setting(#[from] SettingError),
    /// The device rejects activation.
    #[error("the device cannot be activated: {0}")]
    Refused(Refusal),
    /// The device faulted for a reason outside the loop.
    #[error("the device faulted: {}", .0.advice())]
    Fault(Fault),
}

/// Configuration of a loop without its stiffness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoopSetup {
    /// Time between two samples, ns.
    pub period_ns: u64,
    /// Delay of a force before it is written, whole periods.
    pub delay_ticks: u32,
    /// Viscous damping of the device, N s/m.
    pub plant_damping_ns_per_m: f64,
    /// Virtual damping by backward difference, N s/m.
    pub virtual_damping_ns_per_m: f64,
    /// Step of the position sensor, m; 0 for an ideal sensor.
    pub quantum_m: f64,
    /// Grip of the hand on the device.
    pub grip: Grip,
}

/// Relative tolerance of the search for the limit.
const TOLERANCE: f64 = 1.0e-4;
/// Time for the fast modes to decay, s.
const SETTLE_S: f64 = 4.0;
/// Length of each of the two consecutive windows whose mean squares are compared, s.
const WINDOW_S: f64 = 8.0;
/// Initial displacement with an ideal sensor, m: at 1e6 N/m a millinewton.
const IDEAL_START_M: f64 = 1.0e-9;
/// Initial displacement with a quantised sensor, in its steps: above the limit cycles of a quantised loop, and small
/// enough that a stiff spring stays within the limits of the coils (10 µm, 60 kN/m: 12 N).
const QUANTISED_START_STEPS: f64 = 20.0;
/// Amplitude of limit cycles, in steps of the sensor, below which a loop counts as stable.
const LIMIT_CYCLE_STEPS: f64 = 10.0;
/// Growth over the initial displacement that ends a simulation early: the overshoot of a release is smaller.
const GROWN: f64 = 5.0;
/// Mean square, relative to the initial displacement squared, below which a motion has vanished.
const VANISHED: f64 = 1.0e-12;

impl LoopSetup {
    /// Returns the largest stiffness at which the loop around `plugin` is stable, N/m: 0 if no stiffness is stable, and the [end of
    /// the search](super::is_search_end) if it is stable up to there. Not real-time.
    ///
    /// # Errors
    /// [`LoopError`] if the plugin is not a simulated flotor or rejects a call.
    pub fn limit_n_per_m(&self, plugin: &Plugin) -> Result<f64, LoopError> {
        largest_stable(TOLERANCE, |stiffness_n_per_m| {
            let device = self.open(plugin)?;
            let config = LoopConfig { period_ns: self.period_ns, seed: 0 };
            let device = device.activate(&config).map_err(|(_, refusal)| LoopError::Refused(refusal))?;
            self.is_stable(device, stiffness_n_per_m)
        })
    }

    /// Returns mass, damping and stiffness of device and hand together, from the plugin's current parameters. Not
    /// real-time.
    ///
    /// # Errors
    /// [`LoopError`] if the plugin is not a simulated flotor or rejects a call.
    pub fn plant(&self, plugin: &Plugin) -> Result<Plant, LoopError> {
        let mut device = self.open(plugin)?;
        let mut value = |id: &str| {
            let index = plugin.parameters().iter().position(|parameter| parameter.id() == id);
            index.map_or(f64::NAN, |index| device.parameter(index))
        };
        let mut plant = Plant {
            mass_kg: value("mass_kg"),
            damping_ns_per_m: value("damping_ns_per_m"),
            stiffness_n_per_m: 0.0,
        };
        if self.grip != Grip::Open {
            plant.mass_kg += value("hand_mass_kg");
            plant.damping_ns_per_m += value("hand_damping_ns_per_m");
            plant.stiffness_n_per_m += value("hand_stiffness_n_per_m");
        }
        Ok(plant)
    }

    fn open(&self, plugin: &Plugin) -> Result<OpenedDevice, LoopError> {
        let schema = plugin.parameters();
        let (hand, grip) = match self.grip {
            Grip::Open => ("open", "firm"),
            Grip::Relaxed => ("hold", "relaxed"),
            Grip::Firm => ("hold", "firm"),
        };
        let settings = [
            Setting::parse(schema, "preset", "plain"),
            Setting::parse(schema, "hand", hand),
            Setting::parse(schema, "hand_grip", grip),
            Setting::number(schema, "hand_depth_mm", 0.0),
            Setting::number(schema, "com_z_mm", 0.0),
            Setting::number(schema, "damping_ns_per_m", self.plant_damping_ns_per_m),
            Setting::number(schema, "start_z_mm", self.start_m() * 1.0e3),
        ];
        let settings = settings.into_iter().collect::<Result<Vec<_>, _>>()?;
        Ok(plugin.open_device(&settings)?)
    }

    fn start_m(&self) -> f64 {
        if self.quantum_m > 0.0 { QUANTISED_START_STEPS * self.quantum_m } else { IDEAL_START_M }
    }

    /// Runs the loop from a small displacement and tests whether its envelope shrinks.
    fn is_stable(&self, mut device: ActiveDevice, stiffness_n_per_m: f64) -> Result<bool, LoopError> {
        let start_m = self.start_m();
        let period_s = seconds(self.period_ns);
        let mut spring = Spring::new(self, stiffness_n_per_m);
        let (settle, length) = (ticks(SETTLE_S / period_s), ticks(WINDOW_S / period_s));
        let (mut first, mut second) = (Window::new(length), Window::new(length));
        let mut state = DeviceState::HOME;
        for index in 0..settle + 2 * length {
            let dt_ns = if index == 0 { 0 } else { self.period_ns };
            let tick = Tick { index, time_ns: index * self.period_ns, dt_ns };
            match device.read(&tick, &mut state) {
                Cycle::Fresh => {}
                Cycle::Fault(Fault::SensorOutOfRange) => return Ok(false),
                Cycle::Fault(fault) => return Err(LoopError::Fault(fault)),
                Cycle::Stale => return Err(LoopError::Fault(Fault::Timeout)),
            }
            let height_m = state.pose.position().z;
            if height_m.abs() > GROWN * start_m || height_m.is_nan() {
                return Ok(false);
            }
            if index >= settle + length {
                second.add(height_m);
            } else if index >= settle {
                first.add(height_m);
                if index + 1 == settle + length && first.mean_square() < VANISHED * start_m * start_m {
                    return Ok(true);
                }
            }
            let force = DVec3::Z * spring.force_n(height_m);
            if let Cycle::Fault(fault) = device.write(&tick, &Wrench::from_force(force)) {
                return Err(LoopError::Fault(fault));
            }
        }
        let quiet_m = LIMIT_CYCLE_STEPS * self.quantum_m;
        Ok(second.mean_square() < first.mean_square() || second.mean_square() < quiet_m * quiet_m)
    }
}

/// Rendered spring and damper, with sensor and delay line.
struct Spring {
    stiffness_n_per_m: f64,
    damping_n_per_m: f64,
    quantum_m: f64,
    previous_m: Option<f64>,
    waiting_n: VecDeque<f64>,
}

impl Spring {
    fn new(setup: &LoopSetup, stiffness_n_per_m: f64) -> Self {
        Self {
            stiffness_n_per_m,
            damping_n_per_m: setup.virtual_damping_ns_per_m / seconds(setup.period_ns),
            quantum_m: setup.quantum_m,
            previous_m: None,
            waiting_n: std::iter::repeat_n(0.0, setup.delay_ticks as usize).collect(),
        }
    }

    /// Returns the force to write now, N, after a sample at `height_m`.
    fn force_n(&mut self, height_m: f64) -> f64 {
        let sensed_m = match self.quantum_m {
            quantum_m if quantum_m > 0.0 => (height_m / quantum_m).round() * quantum_m,
            _ => height_m,
        };
        let moved_m = sensed_m - self.previous_m.replace(sensed_m).unwrap_or(sensed_m);
        self.waiting_n.push_back(-self.stiffness_n_per_m * sensed_m - self.damping_n_per_m * moved_m);
        self.waiting_n.pop_front().unwrap_or_default()
    }
}

/// Mean square of a range of samples, weighted by a Hann window.
struct Window {
    step: f64,
    phase: f64,
    weight: f64,
    sum: f64,
}

impl Window {
    fn new(length: u64) -> Self {
        Self { step: TAU / length as f64, phase: 0.0, weight: 0.0, sum: 0.0 }
    }

    fn add(&mut self, sample: f64) {
        let weight = 1.0 - math::cos(self.phase);
        self.phase += self.step;
        self.weight += weight;
        self.sum += weight * sample * sample;
    }

    fn mean_square(&self) -> f64 {
        if self.weight > 0.0 { self.sum / self.weight } else { 0.0 }
    }
}

fn seconds(time_ns: u64) -> f64 {
    time_ns as f64 * 1.0e-9
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // seconds over at least 0.1 ms
fn ticks(count: f64) -> u64 {
    count.round() as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ratio_of_two_windows_is_the_growth_between_them() {
        let (rate_per_s, omega_per_s, period_s) = (-0.01, 41.0, 1.0e-3);
        let length = ticks(WINDOW_S / period_s);
        let sample = |index: u64| {
            let t = index as f64 * period_s;
            (rate_per_s * t).exp() * (omega_per_s * t).sin()
        };
        let window = |from: u64| {
            let mut window = Window::new(length);
            (from..from + length).for_each(|index| window.add(sample(index)));
            window.mean_square()
        };
        let measured = math::ln(window(length) / window(0)) / (2.0 * WINDOW_S);
        // Ripple of a Hann window over n = 52 periods: about 1 / (8 n^3) of the mean square, so 1e-6 / 16 s.
        assert!((measured - rate_per_s).abs() < 1.0e-6, "{measured}");
    }

    #[test]
    fn a_delay_line_hands_out_what_went_in_that_many_ticks_ago() {
        let setup = LoopSetup {
            period_ns: 1_000_000,
            delay_ticks: 2,
            plant_damping_ns_per_m: 0.5,
            virtual_damping_ns_per_m: 2.0,
            quantum_m: 0.0,
            grip: Grip::Open,
        };
        let mut spring = Spring::new(&setup, 1000.0);
        let forces: Vec<f64> = [1.0e-3, 2.0e-3, 2.0e-3, 0.0].map(|x| spring.force_n(x)).to_vec();
        // K x = 1 N, then 2 N plus B * 1 mm / 1 ms = 2 N.
        assert_eq!(forces, [0.0, 0.0, -1.0, -4.0]);
    }

    #[test]
    fn a_quantised_sensor_answers_in_whole_steps() {
        let setup = LoopSetup {
            period_ns: 1_000_000,
            delay_ticks: 0,
            plant_damping_ns_per_m: 0.5,
            virtual_damping_ns_per_m: 0.0,
            quantum_m: 10.0e-6,
            grip: Grip::Open,
        };
        assert_eq!(Spring::new(&setup, 1.0e5).force_n(14.9e-6), -1.0);
        assert_eq!(Spring::new(&setup, 1.0e5).force_n(4.9e-6), 0.0);
    }
}
