//! Taking off and landing: before the scene becomes active the handle is caught, brought home, and weighed; after
//! it, it is let down.
//!
//! A spring and a damper about a target hold the handle (the gains of the device's client program, made stable for
//! period and delay). On the way up the target moves home along a minimum-jerk curve (Flash and Hogan 1985), so that the
//! first force is none; on the way down the gains fade. What the spring carries at rest is the weight, whatever it is
//! made of (D5: three numbers are published for one flotor), and the device carries it from then on.
//!
//! Not real-time: a procedure of its own, before and after the loop.

use crate::boundary::Wall;
use crate::host_link::HostLink;
use crate::protocol::{Condition, Mode, Request, Status};
use crate::transport::LinkLost;
use flotor_hal::{DVec3, SampledLoop, Wrench};
use std::time::{Duration, Instant};

/// Stiffness and damping about home along each axis, N/m and N·s/m, and about each, N·m/rad and N·m·s/rad (client
/// program of the University of Utah: x and y softer than z).
const LINEAR: [Wall; 3] = [gain(2400.0, 15.0), gain(2400.0, 15.0), gain(10_000.0, 15.0)];
const ANGULAR: [Wall; 3] = [gain(50.0, 0.15), gain(50.0, 0.15), gain(10.0, 0.15)];

const fn gain(stiffness: f64, damping: f64) -> Wall {
    Wall { limit: 0.0, stiffness, damping }
}

/// Share of the time in the air that is for coming to rest at home; the last half of that is weighed.
const SETTLING: f64 = 0.5;
/// How long an answer may take.
const PATIENCE: Duration = Duration::from_secs(2);
/// Periods a command is valid for.
const VALID_PERIODS: u32 = 3;

/// Why homing failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Aborted {
    /// The link broke.
    Lost,
    /// Nothing was heard in time.
    Silent,
    /// The controller does not obey any more.
    Faulted(Condition),
}

impl std::fmt::Display for Aborted {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Lost => f.write_str("the link to the controller broke"),
            Self::Silent => f.write_str("the controller fell silent"),
            Self::Faulted(condition) => write!(f, "the controller faulted ({condition})"),
        }
    }
}

/// How the handle is held.
pub(crate) struct Holder {
    pub(crate) period_us: u32,
    pub(crate) delay_s: f64,
    /// Each command waits for its answer: an emulator on a virtual clock.
    pub(crate) lockstep: bool,
}

impl Holder {
    /// Brings the handle home within `duration` and weighs it; the last status, and the weight in N (0 if the time is
    /// too short to tell).
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

    /// Lets the handle down within `duration`, from where it is carried with `weight_n`.
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

    /// Holds for a time; `target` and `seen` get how much of it is over.
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
        let mut heard_at = started;
        for tick in 0..u32::try_from(ticks).unwrap_or(u32::MAX) {
            if status.mode != Mode::Levitating {
                return Err(Aborted::Faulted(status.condition.faults()));
            }
            let progress = f64::from(tick) / ticks as f64;
            let command = self.command(&target(progress), &status);
            seen(progress, &command);
            link.send(request(&command, self.period_us), tick.wrapping_mul(self.period_us)).map_err(lost)?;
            let heard = if self.lockstep {
                link.wait_for(link.sequence(), PATIENCE).map_err(lost)?
            } else {
                std::thread::sleep((started + period * (tick + 1)).saturating_duration_since(Instant::now()));
                link.take().map_err(lost)?
            };
            if let Some(heard) = heard {
                (status, heard_at) = (heard.status, Instant::now());
            } else if heard_at.elapsed() > PATIENCE {
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
        // Twice the vector part: the rotation, for the small ones there are.
        let off_rad = DVec3::from_array(status.rotation_xyz.map(f64::from)) * 2.0;
        let force = axes(LINEAR, off_m, wide(status.velocity_steps, Status::VELOCITY_STEP_M_PER_S));
        let torque = axes(ANGULAR, off_rad, wide(status.spin_steps, Status::SPIN_STEP_RAD_PER_S));
        Wrench::new(force + DVec3::Z * target.carried_n, torque)
    }
}

/// Where the handle should be, and how strongly.
struct Target {
    position_m: DVec3,
    /// Share of the stiffness, 0 to 1; damping stays.
    strength: f64,
    carried_n: f64,
}

fn request(command: &Wrench, period_us: u32) -> Request {
    let (force, torque) = (command.force(), command.torque());
    #[allow(clippy::cast_possible_truncation)] // f32 is what the wire has
    let wrench = [force.x, force.y, force.z, torque.x, torque.y, torque.z].map(|value| value as f32);
    Request::Command { wrench, valid_us: u16::try_from(VALID_PERIODS * period_us).unwrap_or(u16::MAX) }
}

fn lost(_: LinkLost) -> Aborted {
    Aborted::Lost
}
