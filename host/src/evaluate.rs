//! A force model at given poses, without a loop or a device.
//!
//! A model without history is asked directly, in batches. One with history is taken to each pose the way a
//! hand would: along a straight line in position and rotation vector, in small steps, then held until it has
//! converged.

use flotor_hal::abi::CallStatus;
use flotor_hal::abi::loader::Model;
use flotor_hal::{
    DVec3, Demand, Input, Memory, Output, Pose, StepStatus, Wrench, orientation_from_rotation_vector,
};

/// Position and rotation vector of a handle in the model frame, m and rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Handle {
    /// Position relative to home, m.
    pub position_m: DVec3,
    /// Rotation vector, rad.
    pub rotation_rad: DVec3,
}

impl Handle {
    /// The home pose.
    pub const HOME: Handle = Handle { position_m: DVec3::ZERO, rotation_rad: DVec3::ZERO };

    fn pose(self) -> Pose {
        Pose::new(self.position_m, orientation_from_rotation_vector(self.rotation_rad))
    }

    fn is_finite(self) -> bool {
        self.position_m.is_finite() && self.rotation_rad.is_finite()
    }
}

/// What a model answers at a pose. All numbers are finite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Answer {
    /// Force and torque on the hand, N and N·m; zero where there is no answer.
    pub wrench: Wrench,
    /// Stored energy, J, if the model has one.
    pub energy_j: Option<f64>,
    /// What the model says about the answer.
    pub status: StepStatus,
}

/// Whether poses are independent or successive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Travel {
    /// Each pose is reached from home.
    FromHome,
    /// Each pose is reached from the one before.
    Successive,
}

/// A model that panicked; nothing more can be asked of it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the model stopped answering: {words}")]
pub struct ModelBroke {
    /// What it said.
    pub words: String,
}

/// Largest step of a handle on its way, m.
const STEP_M: f64 = 0.05e-3;
/// Largest turn of a handle on its way, rad.
const STEP_RAD: f64 = 0.002;
/// Longest way that is walked in steps; a pose farther away is approached in as many, larger ones.
const MOST_STEPS: f64 = 1.0e5;
/// Ticks a handle is held at a pose for the model to converge.
const MOST_HOLDS: usize = 2000;
/// Time between steps, ns.
const PERIOD_NS: u64 = 1_000_000;
/// Poses evaluated per call of a model without history.
const BATCH: usize = 1024;

/// Evaluates a model at poses, in order. Not real-time.
pub struct Evaluator {
    model: Model,
    demand: Demand,
    travel: Travel,
    at: Handle,
    tick: u64,
}

impl Evaluator {
    /// Takes a model that was just created.
    #[must_use]
    pub fn new(model: Model, travel: Travel) -> Self {
        let demand = Demand::ALL.limited_to(model.serves());
        Self { model, demand, travel, at: Handle::HOME, tick: 0 }
    }

    /// Answers for all handles, in order.
    ///
    /// # Errors
    /// [`ModelBroke`] if the model panics.
    pub fn evaluate(&mut self, handles: &[Handle]) -> Result<Vec<Answer>, ModelBroke> {
        match self.model.memory() {
            Memory::Stateless => self.evaluate_directly(handles),
            Memory::PathDependent => handles.iter().map(|handle| self.walk_to(*handle)).collect(),
        }
    }

    fn evaluate_directly(&mut self, handles: &[Handle]) -> Result<Vec<Answer>, ModelBroke> {
        let mut answers = Vec::with_capacity(handles.len());
        let mut outputs = vec![Output::default(); BATCH];
        for batch in handles.chunks(BATCH) {
            let inputs: Vec<Input> = batch
                .iter()
                .map(|handle| Input { demand: self.demand, ..Input::at_rest(handle.pose()) })
                .collect();
            let status = self.model.step_batch(&inputs, &mut outputs);
            self.check(status)?;
            answers.extend(batch.iter().zip(&outputs).map(|(handle, output)| self.answer(*handle, output)));
        }
        Ok(answers)
    }

    fn walk_to(&mut self, target: Handle) -> Result<Answer, ModelBroke> {
        if self.travel == Travel::FromHome {
            self.model.reset();
            self.at = Handle::HOME;
        }
        if !target.is_finite() {
            // Nowhere to walk to: the model gets to see the pose once and says what it thinks of it.
            return self.step(target).map(|output| self.answer(target, &output));
        }
        let (from, way_m) = (self.at, target.position_m - self.at.position_m);
        let way_rad = target.rotation_rad - from.rotation_rad;
        let steps = (way_m.length() / STEP_M).max(way_rad.length() / STEP_RAD).ceil().clamp(1.0, MOST_STEPS);
        let mut step = 1.0;
        while step < steps {
            let part = step / steps;
            let between = Handle {
                position_m: from.position_m + way_m * part,
                rotation_rad: from.rotation_rad + way_rad * part,
            };
            self.step(between)?;
            step += 1.0;
        }
        self.at = target;
        let mut output = self.step(target)?;
        for _ in 0..MOST_HOLDS {
            if output.status() != Some(StepStatus::NotConverged) {
                break;
            }
            output = self.step(target)?;
        }
        Ok(self.answer(target, &output))
    }

    fn step(&mut self, handle: Handle) -> Result<Output, ModelBroke> {
        let input = Input {
            time_ns: self.tick * PERIOD_NS,
            dt_ns: PERIOD_NS,
            tick: self.tick,
            demand: self.demand,
            ..Input::at_rest(handle.pose())
        };
        self.tick += 1;
        let mut output = Output::default();
        let status = self.model.step(&input, &mut output);
        self.check(status)?;
        Ok(output)
    }

    fn check(&mut self, status: CallStatus) -> Result<(), ModelBroke> {
        match status {
            CallStatus::Ok => Ok(()),
            _ => Err(ModelBroke { words: self.model.last_message() }),
        }
    }

    fn answer(&self, handle: Handle, output: &Output) -> Answer {
        let no_answer = if handle.is_finite() { StepStatus::OutOfDomain } else { StepStatus::InvalidInput };
        let serves_energy = self.demand.contains(Demand::ENERGY);
        match output.status() {
            Some(status) if output.wrench.is_finite() => Answer {
                wrench: output.wrench,
                energy_j: (serves_energy && output.energy_j.is_finite()).then_some(output.energy_j),
                status,
            },
            _ => Answer { wrench: Wrench::ZERO, energy_j: None, status: no_answer },
        }
    }
}
