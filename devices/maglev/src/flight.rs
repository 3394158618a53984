//! Take-off and landing: homing and weighing of the handle before the scene becomes active, and lowering it afterwards.
//!
//! A spring and a damper about a target hold the handle (the gains of the device's client program, made stable for period
//! and delay). During take-off the target moves home along a minimum-jerk curve (Flash and Hogan 1985), so that the force
//! starts at zero; during landing stiffness and feedforward fade. The spring force at rest is the weight (D5: the literature gives
//! three masses for one flotor); the device applies it as a feedforward from then on.
//!
//! Not real-time: runs before and after the loop.

use crate::boundary::Wall;
use crate::host_link::HostLink;
use crate::protocol::{Condition, Mode, Request, Status};
use crate::transport::LinkLost;
use flotor_hal::{DVec3, SampledLoop, Wrench};
use std::time::{Duration, Instant};

/// Stiffness and damping about home along each axis, N/m and N·s/m, and about each axis, N·m/rad and N·m·s/rad (client
/// program of the University of Utah: x and y softer than z).
const LINEAR: [Wall; 3] = [gain(2400.0, 15.0), gain(2400.0, 15.0), gain(10_000.0, 15.0)];
const ANGULAR: [Wall; 3] = [gain(50.0, 0.15), gain(50.0, 0.15), gain(10.0, 0.15)];

const fn gain(stiffness: f64, damping: f64) -> Wall {
    Wall { limit: 0.0, stiffness, damping }
}

/// Fraction of the take-off time reserved for settling at home; weighing takes the second half of that fraction.
const SETTLING: f64 = 0.5;
/// Reply timeout.
const PATIENCE: Duration = Duration::from_secs(2);
/// Validity of a command, in periods.
const VALID_PERIODS: u32 = 3;

/// Cause of a failed homing or landing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum Aborted {
    /// The link broke.
    #[error("the link to the controller was lost; check the cable and the power of the controller")]
    Lost,
    /// No reply within the timeout.
    #[error(
        "the controller does not reply; check the power of the controller and the load of this \
         machine"
    )]
    Silent,
    /// The controller left the mode [`Mode::Levitating`].
    #[error(
        "the controller ended the levitation (faults: {0}); free the handle, and end other programs that use the controller"
    )]
    Faulted(Condition),
}

/// Position controller of the handle for take-off and landing.
pub(crate) struct Holder {
    pub(crate) period_us: u32,
    pub(crate) delay_s: f64,
    /// True: wait for the reply to each command (emulator on a virtual clock).
    pub(crate) lockstep: bool,
}

impl Holder {
    /// Moves the handle home within `duration` and weighs it; returns the last status and the weight in N (0 if `duration`
    /// is too short for weighing).
    pub(crate) fn take_off(
        &self,
        link: &mut HostLink,
        first: Status,
        duration: Duration,
    ) -> Result<(Status, f64), Aborted> {
        let start_m = DVec3::from_array(first.position_m.map(f64::from));
        let (mut weighed_n, mut ticks) = (0.0, 0_u32);
        let last = self.hold(
            link,
            first,
            duration,
            |progress| {
                let way = (progress / (1.0 - SETTLING)).min(1.0);
                let left = 1.0 - way * way * way * (10.0 - 15.0 * way + 6.0 * way * way);
                Target { position_m: start_m * left, strength: 1.0, carried_n: 0.0 }
            },
            |progress, command| {
                if progress >= 1.0 - 0.5 * SETTLING {
                    weighed_n += command.force().z;
                    ticks += 1;
                }
            },
        )?;
        Ok((last, if ticks == 0 { 0.0 } else { weighed_n / f64::from(ticks) }))
    }

    /// Lowers the handle within `duration`, starting from the pose in `first` and the feedforward `weight_n`.
    pub(crate) fn land(
        &self,
        link: &mut HostLink,
        first: Status,
        duration: Duration,
        weight_n: f64,
    ) -> Result<(), Aborted> {
        let start_m = DVec3::from_array(first.position_m.map(f64::from));
        let target = |progress: f64| {
            let strength = 1.0 - progress;
            Target { position_m: start_m, strength, carried_n: weight_n * strength }
        };
        self.hold(link, first, duration, target, |_, _| {}).map(|_| ())
    }

    /// Runs the position controller for `duration`; `target` and `seen` get the progress, 0 to 1.
    fn hold(
        &self,
        link: &mut HostLink,
        mut status: Status,
        duration: Duration,
        target: impl Fn(f64) -> Target,
        mut seen: impl FnMut(f64, &Wrench),
    ) -> Result<Status, Aborted> {
        let period = Duration::from_micros(u64::from(self.period_us).max(1));
        let ticks = duration.as_micros() / period.as_micros();
        let started = Instant::now();
        let mut received_at = started;
        for tick in 0..u32::try_from(ticks).unwrap_or(u32::MAX) {
            if status.mode != Mode::Levitating {
                return Err(Aborted::Faulted(status.condition.faults()));
            }
            let progress = f64::from(tick) / ticks as f64;
            let command = self.command(&target(progress), &status);
            seen(progress, &command);
            link.send(request(&command, self.period_us), tick.wrapping_mul(self.period_us)).map_err(lost)?;
            let newest = if self.lockstep {
                link.wait_for(link.sequence, PATIENCE).map_err(lost)?
            } else {
                std::thread::sleep((started + period * (tick + 1)).saturating_duration_since(Instant::now()));
                link.take().map_err(lost)?
            };
            if let Some(newest) = newest {
                (status, received_at) = (newest.status, Instant::now());
            } else if received_at.elapsed() > PATIENCE {
                return Err(Aborted::Silent);
            }
        }
        Ok(status)
    }

    fn command(&self, target: &Target, status: &Status) -> Wrench {
        let sampled = SampledLoop { period_s: f64::from(self.period_us) * 1.0e-6, latency_s: self.delay_s };
        let axes = |gains: [Wall; 3], off: DVec3, speed: DVec3| {
            let [x, y, z] = gains.map(|gain| gain.stabilised(&sampled, gain.damping));
            let stiffness = DVec3::new(x.stiffness, y.stiffness, z.stiffness) * target.strength;
            let damping = DVec3::new(x.damping, y.damping, z.damping);
            -(off * stiffness) - speed * damping
        };
        let wide = |steps: [i16; 3], step: f64| DVec3::from_array(steps.map(f64::from)) * step;
        let off_m = DVec3::from_array(status.position_m.map(f64::from)) - target.position_m;
        // Twice the vector part is the rotation vector, for small rotations.
        let off_rad = DVec3::from_array(status.rotation_xyz.map(f64::from)) * 2.0;
        let force = axes(LINEAR, off_m, wide(status.velocity_steps, Status::VELOCITY_STEP_M_PER_S));
        let torque = axes(ANGULAR, off_rad, wide(status.spin_steps, Status::SPIN_STEP_RAD_PER_S));
        Wrench::new(force + DVec3::Z * target.carried_n, torque)
    }
}

/// Target position of the handle, with stiffness and feedforward.
struct Target {
    position_m: DVec3,
    /// Fraction of the stiffness, 0 to 1; damping is not scaled.
    strength: f64,
    carried_n: f64,
}

fn request(command: &Wrench, period_us: u32) -> Request {
    let (force, torque) = (command.force(), command.torque());
    #[allow(clippy::cast_possible_truncation)] // the wire format is f32
    let wrench = [force.x, force.y, force.z, torque.x, torque.y, torque.z].map(|value| value as f32);
    Request::Command { wrench, valid_us: u16::try_from(VALID_PERIODS * period_us).unwrap_or(u16::MAX) }
}

fn lost(_: LinkLost) -> Aborted {
    Aborted::Lost
}
