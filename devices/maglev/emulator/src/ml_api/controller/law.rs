//! The law: what the gains make of where the flotor is, what a command does to that, and the boundary sphere.

use super::gains::{AxisError, force};
use super::machine::{Command, Controller, Flight, ForceCommand, vector, wrench};
use flotor_hal::{DVec3, Wrench};
use flotor_maglev::ml_api::{Axis, AxisMode, GainSet, Pid};

impl Controller {
    /// The wrench that is wanted of the coils now.
    pub(super) fn wanted(&self) -> Wrench {
        if !self.faults.is_empty() {
            return Wrench::ZERO;
        }
        let held = || wrench(&Axis::ALL.map(|axis| self.held(axis)));
        match (self.flight, self.command) {
            (Flight::Landed, _) => Wrench::ZERO,
            (Flight::TakingOff | Flight::Landing, _) => held(),
            (Flight::Flying, Command::Forces(forces)) => {
                let forces = wrench(&forces.map(f64::from)) + self.boundary();
                match self.config.force_command {
                    ForceCommand::Adds => forces + held(),
                    ForceCommand::Replaces => forces,
                }
            }
            (Flight::Flying, Command::Currents(currents_a)) => {
                self.coils.wrench(&currents_a) + self.boundary()
            }
            (Flight::Flying, _) => held() + self.boundary(),
        }
    }

    /// The wrench the coils give now: what is wanted, within the current limits.
    pub(super) fn applied(&self) -> Wrench {
        self.coils.driven(&self.wanted()).1
    }

    /// What the gains give on an axis.
    fn held(&self, axis: Axis) -> f64 {
        let index = axis as usize;
        let (at, speed) = (self.at[index], self.speed[index]);
        let wanted_speed = match self.command {
            Command::Velocity(speeds) => f64::from(speeds[index]),
            _ => 0.0,
        };
        let error = |to: f64, wanted_speed: f64| AxisError {
            off: to - at,
            speed_off: wanted_speed - speed,
            integral: self.integral[index],
        };
        if self.flight == Flight::Landing {
            let (gains, left) = &self.landing;
            let pid = gains[index];
            let damping = f64::from(pid.d) * -speed;
            return (force(Pid { d: 0.0, ..pid }, error(self.desired[index], 0.0))) * left + damping;
        }
        let normal = self.gains.of(GainSet::Normal, axis);
        if self.flight == Flight::TakingOff {
            return force(normal, error(self.desired[index], 0.0));
        }
        self.trim[index]
            + match self.modes[index] {
                AxisMode::Locked => {
                    force(self.gains.of(GainSet::Locked, axis), error(self.locked_at[index], 0.0))
                }
                AxisMode::Constrained if self.side(axis) != 0 => {
                    let [least, most] = self.ranges[index].map(f64::from);
                    let nearest = if at < least { least } else { most };
                    force(self.gains.of(GainSet::Constrained, axis), error(nearest, 0.0))
                }
                _ => force(normal, error(self.target(axis), wanted_speed)),
            }
    }

    /// Where an axis should be: the desired position, within the range of a constrained axis.
    pub(super) fn target(&self, axis: Axis) -> f64 {
        let (desired, [least, most]) = (self.desired[axis as usize], self.ranges[axis as usize]);
        match self.modes[axis as usize] {
            AxisMode::Constrained => desired.max(f64::from(least)).min(f64::from(most)),
            _ => desired,
        }
    }

    /// What pushes back beyond the sphere: a spring along the way home, a damper against going out.
    fn boundary(&self) -> Wrench {
        let (position, velocity) = (vector(&self.at, 0), vector(&self.speed, 0));
        let distance = position.length();
        let depth = distance - f64::from(self.boundary_radius_m);
        if depth <= 0.0 || distance == 0.0 {
            return Wrench::ZERO;
        }
        let outward = position / distance;
        let gain = |gain: fn(&Pid) -> f32| {
            let [x, y, z, ..] = self.gains.set(GainSet::Boundary);
            DVec3::new(gain(x).into(), gain(y).into(), gain(z).into())
        };
        let speed = velocity.dot(outward).max(0.0);
        let (spring, damper) = (gain(|pid| pid.p), gain(|pid| pid.d));
        Wrench::from_force(-(outward * depth) * spring - (outward * speed) * damper + gain(|pid| pid.ff))
    }

    /// -1 below the range of a constrained axis, 1 above it.
    pub(super) fn side(&self, axis: Axis) -> i8 {
        let ([least, most], at) = (self.ranges[axis as usize], self.at[axis as usize]);
        match self.modes[axis as usize] {
            AxisMode::Constrained if at < f64::from(least) => -1,
            AxisMode::Constrained if at > f64::from(most) => 1,
            _ => 0,
        }
    }
}
