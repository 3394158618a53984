use flotor_hal::{
    ActiveDevice, Axes, Capabilities, Cycle, DQuat, DVec3, Device, DeviceInfo, DeviceState, LoopConfig,
    Parameter, Pose, Refusal, SafeStop, Settings, Tick, Twist, Wrench,
};
use std::f64::consts::TAU;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Turns of the crank per second.
const FREQUENCY_HZ: f64 = 1.0;

/// Handle on a crank that turns once a second.
struct Crank {
    amplitude_m: f64,
    stopped: Arc<AtomicBool>,
}

/// Energised crank, turning.
struct TurningCrank {
    crank: Crank,
    commanded: Wrench,
}

/// Safe stop that removes the force, from any thread.
struct Clutch(Arc<AtomicBool>);

impl Device for Crank {
    const INFO: DeviceInfo = DeviceInfo::new("crank", "Crank", "A handle that goes up and down by itself");
    const PARAMETERS: &'static [Parameter] =
        &[Parameter::real("amplitude_mm", "mm", 0.0, 10.0, 5.0, "Half the way from lowest to highest point")];
    type Active = TurningCrank;
    type Stop = Clutch;

    fn open(settings: &Settings<'_>) -> Result<Self, Refusal> {
        // Look for the hardware here. If it is missing, busy or forbidden, return a `Refusal::resource` whose text names
        // the remedy.
        let amplitude_m = settings.number_or_default("amplitude_mm") * 1.0e-3;
        Ok(Crank { amplitude_m, stopped: Arc::new(AtomicBool::new(false)) })
    }

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

    fn stopper(&self) -> Clutch {
        Clutch(Arc::clone(&self.stopped))
    }

    fn activate(self, _config: &LoopConfig) -> Result<TurningCrank, (Self, Refusal)> {
        self.stopped.store(false, Ordering::Release);
        Ok(TurningCrank { crank: self, commanded: Wrench::ZERO })
    }
}

impl ActiveDevice for TurningCrank {
    type Opened = Crank;

    fn read(&mut self, tick: &Tick, state: &mut DeviceState) -> Cycle {
        // Scheduled time, not the wall clock: equal runs give equal numbers.
        let phase = TAU * FREQUENCY_HZ * tick.time_ns as f64 * 1.0e-9;
        let (sin, cos) = phase.sin_cos();
        let speed_m_per_s = self.crank.amplitude_m * TAU * FREQUENCY_HZ * cos;
        state.pose = Pose::new(DVec3::Z * self.crank.amplitude_m * sin, DQuat::IDENTITY);
        state.twist = Twist::new(DVec3::Z * speed_m_per_s, DVec3::ZERO);
        state.delivered =
            if self.crank.stopped.load(Ordering::Acquire) { Wrench::ZERO } else { self.commanded };
        state.sampled_ns = tick.time_ns;
        Cycle::Fresh
    }

    fn write(&mut self, _tick: &Tick, wrench: &Wrench) -> Cycle {
        self.commanded = *wrench;
        Cycle::Fresh
    }

    fn deactivate(self) -> Crank {
        self.crank
    }
}

impl SafeStop for Clutch {
    fn safe_stop(&self) {
        self.0.store(true, Ordering::Release);
    }
}

flotor_hal::export_device!(Crank);

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_hal::abi::loader::Plugin;

    /// Goes through a crank's life as a host does.
    #[test]
    fn a_stopped_crank_gives_no_force() -> Result<(), Box<dyn std::error::Error>> {
        let plugin = Plugin::in_process(&FLOTOR_ENTRY)?;
        let opened = plugin.open_device(&[])?;
        let stopper = opened.stopper();
        let config = LoopConfig { period_ns: 1_000_000, seed: 0 };
        let mut crank = opened.activate(&config).map_err(|(_, refusal)| refusal)?;

        let quarter_turn = Tick { index: 250, time_ns: 250_000_000, dt_ns: 1_000_000 };
        let mut state = DeviceState::HOME;
        assert_eq!(crank.write(&quarter_turn, &Wrench::from_force(DVec3::Z)), Cycle::Fresh);
        assert_eq!(crank.read(&quarter_turn, &mut state), Cycle::Fresh);
        assert_eq!(state.pose.position(), DVec3::Z * 0.005);
        assert_eq!(state.delivered.force(), DVec3::Z);

        std::thread::spawn(move || stopper.safe_stop()).join().expect("safe_stop does not panic");
        assert_eq!(crank.read(&quarter_turn, &mut state), Cycle::Fresh);
        assert_eq!(state.delivered, Wrench::ZERO);

        let opened_again = crank.deactivate().ok_or("deactivation failed")?;
        assert!(opened_again.activate(&config).is_ok());
        Ok(())
    }
}
