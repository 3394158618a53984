//! Your name: a handle that goes up and down by itself. Put your hardware where the comments say so.
//!
//! A device is opened (it answers questions), then active (`read` and `write`, a thousand times a second), then
//! opened again. Metres, newtons, z up; the wrench is what the hand is to feel.

use flotor_hal::{
    ActiveDevice, Axes, Capabilities, Cycle, DQuat, DVec3, Device, DeviceInfo, DeviceState, LoopConfig,
    Parameter, Pose, Refusal, SafeStop, Settings, Tick, Twist, Wrench, math,
};
use std::f64::consts::TAU;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Frequency of the motion, Hz.
const FREQUENCY_HZ: f64 = 1.0;

/// The device, open: known, not energised.
struct YourName {
    amplitude_m: f64,
    stopped: Arc<AtomicBool>,
}

impl Device for YourName {
    const INFO: DeviceInfo = DeviceInfo::new(
        "your-name", // in scenes
        "Your name", // on screens
        "A handle that goes up and down by itself",
    );
    const PARAMETERS: &'static [Parameter] =
        &[Parameter::real("amplitude_mm", "mm", 0.0, 10.0, 5.0, "Half the way from lowest to highest point")];
    type Active = ActiveYourName;
    type Stop = Stop;

    // Look for the hardware here. If it is missing, busy or forbidden, return a `Refusal::resource` that says what to
    // do.
    fn open(settings: &Settings<'_>) -> Result<Self, Refusal> {
        let amplitude_m = settings.number_or_default("amplitude_mm") * 1.0e-3;
        Ok(Self { amplitude_m, stopped: Arc::default() })
    }

    // The host enforces these numbers. A device that gives no force says `actuated: Axes::NONE`.
    fn capabilities(&self) -> Capabilities {
        Capabilities {
            sensed: Axes::ALL,
            actuated: Axes::ALL,
            range_m: [0.012; 3],
            range_rad: [0.1; 3],
            resolution_m: 0.0,
            max_force_n: [10.0; 3],
            max_torque_nm: [0.5; 3],
            max_force_slew_n_per_s: 20.0e3,
            max_torque_slew_nm_per_s: 1.0e3,
            max_stiffness_n_per_m: 1.0e4,
            rate_hz: [100.0, 10_000.0],
            latency_s: 0.0,
        }
    }

    fn stopper(&self) -> Stop {
        Stop(Arc::clone(&self.stopped))
    }

    // Energise it here; it starts at zero wrench.
    fn activate(self, _config: &LoopConfig) -> Result<ActiveYourName, (Self, Refusal)> {
        self.stopped.store(false, Ordering::Release);
        Ok(ActiveYourName { device: self, commanded: Wrench::ZERO })
    }
}

/// The device, energised.
struct ActiveYourName {
    device: YourName,
    commanded: Wrench,
}

impl ActiveDevice for ActiveYourName {
    type Opened = YourName;

    // The newest sample, without waiting: no allocation, no lock. Nothing new is `Cycle::Stale`.
    fn read(&mut self, tick: &Tick, state: &mut DeviceState) -> Cycle {
        let (sin, cos) = math::sin_cos(TAU * FREQUENCY_HZ * tick.time_ns as f64 * 1.0e-9);
        let speed_m_per_s = self.device.amplitude_m * TAU * FREQUENCY_HZ * cos;
        state.pose = Pose::new(DVec3::Z * self.device.amplitude_m * sin, DQuat::IDENTITY);
        state.twist = Twist::new(DVec3::Z * speed_m_per_s, DVec3::ZERO);
        state.delivered = self.commanded;
        state.sampled_ns = tick.time_ns;
        Cycle::Fresh
    }

    // The wrench from now on, without waiting; none once somebody has stopped the device.
    fn write(&mut self, _tick: &Tick, wrench: &Wrench) -> Cycle {
        let stopped = self.device.stopped.load(Ordering::Acquire);
        self.commanded = if stopped { Wrench::ZERO } else { *wrench };
        Cycle::Fresh
    }

    // Zero wrench, then opened again.
    fn deactivate(self) -> YourName {
        self.device
    }
}

/// Removes the force: from any thread, at any time, without the device's cooperation.
struct Stop(Arc<AtomicBool>);

impl SafeStop for Stop {
    fn safe_stop(&self) {
        self.0.store(true, Ordering::Release);
    }
}

flotor_hal::export_device!(YourName);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn after_a_quarter_of_a_turn_it_is_at_the_top_and_stopped_it_gives_no_force() {
        let opened = YourName { amplitude_m: 0.005, stopped: Arc::default() };
        let stop = opened.stopper();
        let Ok(mut active) = opened.activate(&LoopConfig { period_ns: 1_000_000, seed: 0 }) else {
            panic!("it always activates");
        };
        let (tick, mut state) =
            (Tick { index: 250, time_ns: 250_000_000, dt_ns: 1_000_000 }, DeviceState::HOME);
        assert_eq!(active.write(&tick, &Wrench::from_force(DVec3::Z)), Cycle::Fresh);
        assert_eq!(active.read(&tick, &mut state), Cycle::Fresh);
        assert_eq!((state.pose.position(), state.delivered.force()), (DVec3::Z * 0.005, DVec3::Z));
        stop.safe_stop();
        assert_eq!(active.write(&tick, &Wrench::from_force(DVec3::Z)), Cycle::Fresh);
        assert_eq!(active.read(&tick, &mut state), Cycle::Fresh);
        assert_eq!(state.delivered, Wrench::ZERO);
    }
}
