//! Preset `full`: actuators, sensors and faults between the controller and the simulated flotor.
//!
//! One cycle: the last commanded wrench passes through amplifiers, coils and field and moves the flotor for the time of
//! the tick; the cells take a sample, and the sample whose latency has elapsed is returned. Each fault acts where it
//! would in the real machine. The flotor continues to move, whatever is reported to the controller.

use crate::actuation::coils::Coils;
use crate::actuation::{Actuation, ActuationParameters, Wiring};
use crate::faults::{FaultKind, FaultPlan, Faults};
use crate::hand::Pose;
use crate::plant::{State, Wrench};
use crate::sensing::{Sample, Sensing, SensingParameters};
use crate::simulation::Simulation;
use crate::validation::InvalidParameter;
use crate::workspace::SensorRange;
use flotor_hal::{
    Conditions, Cycle, DeviceState, Fault, Tick, Twist, orientation_from_rotation_vector, restorable,
    rotation_vector,
};

/// Parameters of the simulated actuators and sensors of a maglev device, with an optional injected fault.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MachineParameters {
    /// Amplifiers, coils, field, heat.
    pub actuation: ActuationParameters,
    /// Light spots, cells, pose solver, velocity estimator.
    pub sensing: SensingParameters,
    /// Injected fault, if any.
    pub fault: Option<FaultPlan>,
}

impl MachineParameters {
    /// Parameters of the commercial device without a fault: published values, and estimates of unpublished values.
    pub const MAGLEV: Self =
        Self { actuation: ActuationParameters::MAGLEV, sensing: SensingParameters::MAGLEV, fault: None };

    /// Returns the largest force along each axis, N, and torque about each axis, N·m, with all other components zero.
    /// Real-time: bounded, no allocation.
    ///
    /// # Errors
    /// If the wrenches of the six coils are linearly dependent.
    pub fn limits(&self) -> Result<Wrench, InvalidParameter> {
        Ok(Coils::new(&self.actuation.geometry)?.pure_axis_limits())
    }
}

/// Actuators, sensors and fault schedule of a running device.
#[derive(Clone, Debug)]
pub struct Machine {
    actuation: Actuation,
    sensing: Sensing,
    faults: Faults,
    /// Value of the stuck coordinate, m or rad; `None` while no axis is stuck.
    stuck_at: Option<f64>,
}

restorable!(Machine { actuation, sensing, faults, stuck_at });

impl Machine {
    /// Creates a machine with coils at ambient temperature and the flotor in the state `start`. Real-time: bounded, no
    /// allocation.
    ///
    /// # Errors
    /// If a parameter is not physical, the coils are linearly dependent, or the diodes stand in a line.
    pub fn new(parameters: &MachineParameters, start: &State, seed: u64) -> Result<Self, InvalidParameter> {
        let pose = Pose { position_m: start.position_m, orientation: start.orientation };
        Ok(Self {
            actuation: Actuation::new(&parameters.actuation)?,
            sensing: Sensing::new(&parameters.sensing, seed, &pose)?,
            faults: Faults::new(parameters.fault, seed)?,
            stuck_at: None,
        })
    }

    /// Advances the simulation by `tick` under the `commanded` wrench (finite), and writes the sample that arrives to `state`.
    /// Returns `Fresh`, `Stale` (an injected fault) or the fault. Delivered wrench and conditions in `state` are always set;
    /// without a valid pose, pose, twist and sampling time in `state` stay as they are. Real-time: bounded, no allocation.
    pub fn cycle(
        &mut self,
        simulation: &mut Simulation,
        tick: &Tick,
        commanded: &Wrench,
        state: &mut DeviceState,
    ) -> Cycle {
        let dt_s = tick.dt_ns as f64 * 1.0e-9;
        let fault = self.faults.at(tick.time_ns, dt_s);
        let commanded = if fault == Some(FaultKind::CablePull) { &Wrench::ZERO } else { commanded };
        let wiring = match fault {
            Some(FaultKind::CoilOpen(coil)) => Wiring::Open(coil),
            _ => Wiring::Intact,
        };
        let delivered = self.actuation.drive(commanded, wiring, simulation.state().position_m.z, dt_s);
        let (waiting_ticks, early_ns) = self.sensing.latency(tick.dt_ns);
        let stopped = self.move_and_sample(simulation, tick, delivered, (fault, early_ns));
        state.delivered = flotor_hal::Wrench::new(delivered.force_n, delivered.torque_nm);
        let when = |is: bool, condition| if is { condition } else { Conditions::NONE };
        state.conditions = when(self.actuation.is_saturated(), Conditions::SATURATED)
            .with(when(self.sensing.is_noisy(), Conditions::NOISY));

        match fault {
            Some(FaultKind::CablePull) => return Cycle::Fault(Fault::Disconnected),
            Some(FaultKind::OverTemperature) => return Cycle::Fault(Fault::OverTemperature),
            Some(FaultKind::SensorLoss) => return Cycle::Fault(Fault::SensorOutOfRange),
            Some(FaultKind::DroppedSample) => return Cycle::Stale,
            Some(FaultKind::DuplicateSample) => return Cycle::Fresh,
            _ if stopped => return Cycle::Fault(Fault::SensorOutOfRange),
            _ => {}
        }
        if let Some(fault) = self.actuation.fault() {
            return Cycle::Fault(fault);
        }
        let late_ticks = usize::from(fault == Some(FaultKind::LateSample));
        let Sample { taken_ns, pose, velocity } = self.sensing.arrived(waiting_ticks + late_ticks);
        let Some(mut pose) = pose else { return Cycle::Fault(Fault::SensorOutOfRange) };
        match fault {
            Some(FaultKind::StuckAxis(axis)) => self.hold(axis, &mut pose),
            _ => self.stuck_at = None,
        }
        state.pose = flotor_hal::Pose::new(pose.position_m, pose.orientation);
        state.twist = Twist::new(velocity.linear_m_per_s, velocity.angular_rad_per_s);
        state.sampled_ns = taken_ns;
        match SensorRange::of(pose.position_m, pose.orientation) {
            SensorRange::Inside => Cycle::Fresh,
            SensorRange::Outside => Cycle::Fault(Fault::SensorOutOfRange),
        }
    }

    /// Advances the simulation by the tick and samples `early_ns` before its end, or earlier if the clock has jitter.
    /// Returns true if the motion exceeded the physical limits.
    fn move_and_sample(
        &mut self,
        simulation: &mut Simulation,
        tick: &Tick,
        delivered: Wrench,
        (fault, early_ns): (Option<FaultKind>, u64),
    ) -> bool {
        let jitter_ns = match fault {
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a fraction of the tick
            Some(FaultKind::ClockJitter) => (self.faults.jitter() * tick.dt_ns as f64) as u64,
            _ => 0,
        };
        let early_ns = (early_ns + jitter_ns).min(tick.dt_ns);
        let before = simulation.advance(tick.dt_ns - early_ns, delivered);
        let taken_ns = tick.time_ns.saturating_sub(early_ns);
        self.sensing.sample(&simulation.state(), taken_ns, tick.dt_ns as f64 * 1.0e-9);
        let after = simulation.advance(early_ns, delivered);
        before.stopped || after.stopped
    }

    /// Replaces one coordinate of a pose by its value at the start of the fault.
    fn hold(&mut self, axis: usize, pose: &mut Pose) {
        let mut rotation_rad = rotation_vector(pose.orientation);
        let coordinate = match axis {
            0 => &mut pose.position_m.x,
            1 => &mut pose.position_m.y,
            2 => &mut pose.position_m.z,
            3 => &mut rotation_rad.x,
            4 => &mut rotation_rad.y,
            _ => &mut rotation_rad.z,
        };
        *coordinate = *self.stuck_at.get_or_insert(*coordinate);
        if axis >= 3 {
            pose.orientation = orientation_from_rotation_vector(rotation_rad);
        }
    }

    /// Returns the state of amplifiers and coils. Real-time: bounded, no allocation.
    #[must_use]
    pub fn actuation(&self) -> &Actuation {
        &self.actuation
    }
}

#[cfg(test)]
mod tests;
