//! The control law: gains, commands and the boundary sphere.

use super::gains::{AxisError, force};
use super::machine::{Command, Controller, Flight, ForceCommand, vector, wrench};
use flotor_hal::{DVec3, Wrench};
use flotor_maglev::ml_api::{Axis, AxisMode, GainSet, Pid};

impl Controller {
    /// Returns the demanded wrench, before the limits of the coils.
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

    /// Returns the applied wrench: the demanded wrench within the current limits of the coils.
    pub(super) fn applied(&self) -> Wrench {
        self.coils.driven(&self.wanted()).1
    }

    /// Returns force or torque that the gains exert on an axis, N or N·m.
    fn held(&self, axis: Axis) -> f64 {
        let index = axis as usize;
        let error = self.error(axis, self.desired[index], 0.0);
        let normal = self.gains.of(GainSet::Normal, axis);
        match self.flight {
            Flight::Landing => {
                let (gains, left) = &self.landing;
                let pid = gains[index];
                force(Pid { d: 0.0, ..pid }, error) * left + f64::from(pid.d) * error.speed_off
            }
            Flight::TakingOff => force(normal, error),
            Flight::Landed | Flight::Flying => {
                let laws = self.laws(axis).map(|(pid, error)| force(pid, error));
                self.trim[index] + self.integral_n[index] + laws.iter().sum::<f64>()
            }
        }
    }

    fn error(&self, axis: Axis, to: f64, wanted_speed: f64) -> AxisError {
        let index = axis as usize;
        AxisError { off: to - self.at[index], speed_off: wanted_speed - self.speed[index] }
    }

    /// Returns the gains that act on an axis while flying: the gains of its mode and, beyond the range of a constrained
    /// axis, the gains of the constraint. Both add up, because the normal gains compensate the weight.
    pub(super) fn laws(&self, axis: Axis) -> [(Pid, AxisError); 2] {
        let index = axis as usize;
        let wanted_speed = match self.command {
            Command::Velocity(speeds) => f64::from(speeds[index]),
            _ => 0.0,
        };
        let mode = match self.modes[index] {
            AxisMode::Locked => {
                (self.gains.of(GainSet::Locked, axis), self.error(axis, self.locked_at[index], 0.0))
            }
            _ => (self.gains.of(GainSet::Normal, axis), self.error(axis, self.target(axis), wanted_speed)),
        };
        let [least, most] = self.ranges[index].map(f64::from);
        let beyond = match self.side(axis) {
            0 => (Pid::ZERO, AxisError::default()),
            side => {
                let nearest = if side < 0 { least } else { most };
                (self.gains.of(GainSet::Constrained, axis), self.error(axis, nearest, 0.0))
            }
        };
        [mode, beyond]
    }

    /// Advances the integral terms by a cycle of `dt_s`. The stored sum is a force or torque, so that a changed gain acts from then
    /// on. The sum is reset while all integral gains of the axis are zero, and unless the flotor levitates under its gains.
    pub(super) fn integrate(&mut self, dt_s: f64) {
        let are_held = self.flight == Flight::Flying
            && (matches!(self.command, Command::Position | Command::Velocity(_))
                || self.config.force_command == ForceCommand::Adds);
        for axis in Axis::ALL {
            let laws = self.laws(axis);
            let sum = &mut self.integral_n[axis as usize];
            if are_held && laws.iter().any(|(pid, _)| pid.i != 0.0) {
                *sum += laws.iter().map(|(pid, error)| f64::from(pid.i) * error.off * dt_s).sum::<f64>();
            } else {
                *sum = 0.0;
            }
        }
    }

    /// Returns the target of an axis: the desired position, clamped to the range of a constrained axis.
    pub(super) fn target(&self, axis: Axis) -> f64 {
        let (desired, [least, most]) = (self.desired[axis as usize], self.ranges[axis as usize]);
        match self.modes[axis as usize] {
            AxisMode::Constrained => desired.max(f64::from(least)).min(f64::from(most)),
            _ => desired,
        }
    }

    /// Returns the wrench of the boundary sphere: a spring towards home, a damper against outward motion.
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

    /// Returns -1 below the range of a constrained axis, 1 above it, else 0.
    pub(super) fn side(&self, axis: Axis) -> i8 {
        let ([least, most], at) = (self.ranges[axis as usize], self.at[axis as usize]);
        match self.modes[axis as usize] {
            AxisMode::Constrained if at < f64::from(least) => -1,
            AxisMode::Constrained if at > f64::from(most) => 1,
            _ => 0,
        }
    }
}
