//! Device of almost no cost: its handle follows a script and ignores commands.
//!
//! A bench on this device times the loop and not a simulated plant. The device is linked in, behind the same function
//! table as a device from a file.

use flotor_hal::abi::{Entry, device_entry};
use flotor_hal::{
    ActiveDevice, Axes, Capabilities, Cycle, DVec3, Device, DeviceInfo, DeviceState, LoopConfig,
    NothingToStop, Pose, Refusal, Settings, Tick, Twist, Wrench, math,
};
use std::f64::consts::TAU;

/// Plugin id of the device in a scene.
pub const SCRIPTED: &str = "scripted";

/// Entry of the device as a linked-in plugin.
pub static SCRIPTED_ENTRY: Entry = device_entry::<Scripted>();

/// Repetition rate of the script, Hz.
const SCRIPT_HZ: f64 = 1.0;
/// Amplitudes of x and y and of z about its mean, m, and that mean: as the path of the benches, within the range of the
/// thesis's spring.
const AMPLITUDE_M: DVec3 = DVec3::new(1.5e-3, 1.2e-3, 3.0e-3);
const MEAN_Z_M: f64 = -4.0e-3;
/// Amplitudes of the tilts and of the yaw, rad.
const AMPLITUDE_RAD: DVec3 = DVec3::new(0.030, 0.025, 0.035);

/// Opened device.
struct Scripted;

/// Active device: phase of the script, and phase per period.
struct Following {
    at: Phase,
    step: Phase,
}

/// Phase of the script as cosine and sine. A rotation costs four multiplications, a sine of the time ten times as much.
#[derive(Clone, Copy)]
struct Phase {
    cos: f64,
    sin: f64,
}

impl Phase {
    fn of(angle_rad: f64) -> Self {
        let (sin, cos) = math::sin_cos(angle_rad);
        Self { cos, sin }
    }

    #[inline]
    fn turned(self, by: Self) -> Self {
        Self { cos: self.cos * by.cos - self.sin * by.sin, sin: self.sin * by.cos + self.cos * by.sin }
    }

    /// Returns pose and twist of the handle.
    #[inline]
    fn state(self) -> (Pose, Twist) {
        let Self { cos, sin } = self;
        let twice = self.turned(self);
        // Per period of the script: x, the first tilt, z and the yaw once, y and the second tilt twice.
        let (wave, slope) = (DVec3::new(sin, twice.sin, cos), DVec3::new(cos, 2.0 * twice.cos, -sin));
        let rate = TAU * SCRIPT_HZ;
        let half = AMPLITUDE_RAD * wave * 0.5;
        let w = (1.0 - half.length_squared()).sqrt();
        let orientation_xyzw = [half.x, half.y, half.z, w];
        let position_m = (AMPLITUDE_M * wave + DVec3::Z * MEAN_Z_M).to_array();
        // Angular velocity to first order in the tilts, which are small.
        let twist = Twist::new(AMPLITUDE_M * slope * rate, AMPLITUDE_RAD * slope * rate);
        (Pose { position_m, orientation_xyzw }, twist)
    }
}

impl Device for Scripted {
    const INFO: DeviceInfo =
        DeviceInfo::new(SCRIPTED, "Scripted device", "A handle that follows a script").simulated();
    type Active = Following;
    type Stop = NothingToStop;

    fn open(_: &Settings<'_>) -> Result<Self, Refusal> {
        Ok(Self)
    }

    /// Returns range and limits of the thesis's machine.
    fn capabilities(&self) -> Capabilities {
        let slew = 1.0e9; // no limit
        let ranges = Capabilities::driving(Axes::ALL).with_range(0.012, 0.12);
        Capabilities {
            max_force_n: [55.0, 55.0, 140.0],
            max_torque_nm: [6.3, 6.3, 12.2],
            ..ranges.with_slew(slew, slew).with_stiffness(25.0e3)
        }
    }

    fn stopper(&self) -> NothingToStop {
        NothingToStop
    }

    fn activate(self, config: &LoopConfig) -> Result<Following, (Self, Refusal)> {
        let period_s = config.period_ns as f64 * 1.0e-9;
        Ok(Following { at: Phase::of(0.0), step: Phase::of(TAU * SCRIPT_HZ * period_s) })
    }
}

impl ActiveDevice for Following {
    type Opened = Scripted;

    #[inline]
    fn read(&mut self, tick: &Tick, state: &mut DeviceState) -> Cycle {
        (state.pose, state.twist) = self.at.state();
        state.sampled_ns = tick.time_ns;
        self.at = self.at.turned(self.step);
        Cycle::Fresh
    }

    #[inline]
    fn write(&mut self, _: &Tick, _: &Wrench) -> Cycle {
        Cycle::Fresh
    }

    fn deactivate(self) -> Scripted {
        Scripted
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_script_is_smooth_and_its_velocity_is_its_slope() {
        let config = LoopConfig { period_ns: 1_000_000, seed: 0 };
        let Ok(mut device) = Scripted.activate(&config) else { panic!("it needs nothing") };
        let mut next = || {
            let mut state = DeviceState::HOME;
            assert_eq!(device.read(&Tick::default(), &mut state), Cycle::Fresh);
            state
        };
        let mut before = next();
        for _ in 0..3000 {
            let now = next();
            assert!((now.pose.orientation().length() - 1.0).abs() < 1.0e-12);
            let moved = now.pose.position() - before.pose.position();
            let mean = (now.twist.linear() + before.twist.linear()) * 0.5e-3;
            // Trapezoid: half a derivative more, cubed in the step.
            assert!((moved - mean).length() < 1.0e-9, "{moved} and {mean}");
            before = now;
        }
    }
}
