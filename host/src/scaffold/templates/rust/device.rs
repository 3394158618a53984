//! Your name: a handle that goes up and down by itself. Put your hardware where the comments say so.
//!
//! Metres, newtons, z up; a wrench is the force and torque on the hand.

use flotor_hal::{
    Axes, Capabilities, Cycle, DQuat, DVec3, DeviceInfo, DeviceState, Opened, Parameter, Pose, Refusal,
    Settings, Simple, SimpleDevice, StopFlag, Tick, Twist, Wrench, math,
};
use std::f64::consts::TAU;

/// A handle on a crank that turns once a second.
struct YourName {
    amplitude_m: f64,
    commanded: Wrench,
    stop: StopFlag,
}

impl SimpleDevice for YourName {
    const INFO: DeviceInfo = DeviceInfo::new(
        "your-name", // in scenes
        "Your name", // on screens
        "A handle that goes up and down by itself",
    );
    const PARAMETERS: &'static [Parameter] =
        &[Parameter::real("amplitude_mm", "mm", 0.0, 10.0, 5.0, "Half the distance from lowest to highest")];
    type Stop = StopFlag;

    // Find the hardware here; where it is missing, busy or forbidden, return a `Refusal::resource` with the remedy. The
    // host enforces the capabilities: an input device has `Capabilities::driving(Axes::NONE).sensing(Axes::ALL)`.
    fn open(settings: &Settings<'_>) -> Result<Opened<Self>, Refusal> {
        let amplitude_m = settings.number_or_default("amplitude_mm") * 1.0e-3;
        let stop = StopFlag::default();
        let device = Self { amplitude_m, commanded: Wrench::ZERO, stop: stop.clone() };
        let capabilities = Capabilities::driving(Axes::ALL).with_range(0.012, 0.1).with_limits(10.0, 0.5);
        Ok(Opened { device, capabilities, stop })
    }

    // The newest sample, without waiting: no allocation, no lock. Without a new one return `Cycle::Stale`.
    fn read(&mut self, tick: &Tick, state: &mut DeviceState) -> Cycle {
        // Scheduled time, not the wall clock: the same run gives the same numbers.
        let (sin, cos) = math::sin_cos(TAU * tick.time_ns as f64 * 1.0e-9);
        state.pose = Pose::new(DVec3::Z * self.amplitude_m * sin, DQuat::IDENTITY);
        state.twist = Twist::new(DVec3::Z * self.amplitude_m * TAU * cos, DVec3::ZERO);
        state.delivered = if self.stop.is_set() { Wrench::ZERO } else { self.commanded };
        state.sampled_ns = tick.time_ns;
        Cycle::Fresh
    }

    // The wrench from now on, without waiting; zero from a stop on.
    fn write(&mut self, _tick: &Tick, wrench: &Wrench) -> Cycle {
        self.commanded = *wrench;
        Cycle::Fresh
    }
}

flotor_hal::export_device!(Simple<YourName>);

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_hal::{ActiveDevice as _, Device as _, LoopConfig, SafeStop as _};

    #[test]
    fn after_a_quarter_of_a_turn_it_is_at_the_top_and_stopped_it_gives_no_force() {
        let settings = Settings::defaults(YourName::PARAMETERS);
        let opened = Simple::<YourName>::open(&settings).expect("it needs no hardware");
        let stopper = opened.stopper();
        let config = LoopConfig { period_ns: 1_000_000, seed: 0 };
        let Ok(mut active) = opened.activate(&config) else { panic!("it always activates") };
        let tick = Tick { index: 250, time_ns: 250_000_000, dt_ns: 1_000_000 };
        let mut state = DeviceState::HOME;
        assert_eq!(active.write(&tick, &Wrench::from_force(DVec3::Z)), Cycle::Fresh);
        assert_eq!(active.read(&tick, &mut state), Cycle::Fresh);
        assert_eq!((state.pose.position(), state.delivered.force()), (DVec3::Z * 0.005, DVec3::Z));

        std::thread::spawn(move || stopper.safe_stop()).join().expect("it does not panic");
        assert_eq!(active.read(&tick, &mut state), Cycle::Fresh);
        assert_eq!(state.delivered, Wrench::ZERO);
        assert!(active.deactivate().activate(&config).is_ok());
    }
}
