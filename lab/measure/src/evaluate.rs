//! Evaluation of a force model at given poses, without a loop or a device.
//!
//! A stateless model is evaluated directly, in batches. A model with memory is moved to each pose as a hand would do:
//! along a straight line in position and rotation vector, in small steps, then held until it has converged. If every
//! pose is reached from home the paths are independent, and all processors share them.

use super::PERIOD_NS;
use flotor_hal::abi::CallStatus;
use flotor_hal::{DVec3, Demand, Input, Memory, Output, Pose, StepStatus, Twist, Wrench};
use flotor_judge::subject::{Subject, call, steps, walk};
use flotor_judge::trajectory::at;
use flotor_loader::{LoadError, Plugin, Setting};
use rayon::prelude::*;

/// Position and rotation vector of a handle in the model frame, m and rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Handle {
    /// Position relative to home, m.
    pub position_m: DVec3,
    /// Rotation vector, rad.
    pub rotation_rad: DVec3,
}

impl Handle {
    /// Home pose.
    pub const HOME: Handle = Handle { position_m: DVec3::ZERO, rotation_rad: DVec3::ZERO };

    fn pose(self) -> Pose {
        at(self.position_m, self.rotation_rad)
    }

    fn is_finite(self) -> bool {
        self.position_m.is_finite() && self.rotation_rad.is_finite()
    }
}

/// Answer of a model at a pose. All numbers are finite.
#[derive(Clone, Debug, PartialEq)]
pub struct Answer {
    /// Force and torque on the hand, N and N·m; zero if the model returned no finite wrench.
    pub wrench: Wrench,
    /// Stored energy, J; `None` if the model has no output `energy`, or if energy or wrench is not finite.
    pub energy_j: Option<f64>,
    /// Status returned by the model. Without a finite wrench or a known status: `OutOfDomain`, or `InvalidInput` for a pose that
    /// is not finite.
    pub status: StepStatus,
    /// Details in the order of the model's [`flotor_hal::Detail`]s, `None` for a value that is not finite; empty if not requested.
    pub details: Vec<Option<f64>>,
}

/// Path of a model with memory to each pose. A stateless model needs no path; for such a model only [`Self::PerTick`] changes the
/// result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Travel {
    /// Straight path from home, with the model reset.
    FromHome,
    /// Straight path from the previous pose.
    Successive,
    /// No path: one step per pose, as in consecutive ticks of a loop.
    PerTick,
}

/// Presence of the model's details in an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Details {
    /// Answer with wrench, energy and status only.
    Omitted,
    /// Answer with details, too.
    Asked,
}

/// Failure of an evaluation.
#[derive(Debug, thiserror::Error)]
pub enum EvaluateError {
    /// The model could not be created.
    #[error(transparent)]
    Load(#[from] LoadError),
    /// A call of the model failed, with this reason.
    #[error("the model failed: {0}")]
    Failed(String),
}

/// Maximum number of steps of a walk; a pose farther away is approached in larger steps.
const MOST_STEPS: f64 = 1.0e5;
/// Poses per batch call of a stateless model.
const BATCH: usize = 1024;

/// Settings of an evaluation.
pub struct Evaluation<'a> {
    /// Plugin of the model.
    pub plugin: &'a Plugin,
    /// Settings of the model.
    pub settings: &'a [Setting],
    /// Path to each pose.
    pub travel: Travel,
    /// Presence of the model's details in the answers.
    pub details: Details,
}

impl<'a> Evaluation<'a> {
    /// Evaluates the model for all handles, in order; the result does not depend on the number of processors.
    /// `on_answer` is called once for each answer, in no particular order and from any thread. Not real-time.
    ///
    /// # Errors
    /// [`EvaluateError`] if the model rejects its settings or fails.
    pub fn answers(
        &self,
        handles: &[Handle],
        on_answer: &(dyn Fn() + Sync),
    ) -> Result<Vec<Answer>, EvaluateError> {
        let mut walker = self.walker()?;
        match (walker.subject.memory(), self.travel) {
            (_, Travel::PerTick) => {
                let tick = |handle: &Handle| walker.tick_at(*handle).inspect(|_| on_answer());
                handles.iter().map(tick).collect()
            }
            (Memory::Stateless, _) => walker.evaluate_directly(handles, on_answer),
            (Memory::PathDependent, Travel::Successive) => {
                let walk = |handle: &Handle| walker.walk_to(*handle).inspect(|_| on_answer());
                handles.iter().map(walk).collect()
            }
            (Memory::PathDependent, Travel::FromHome) => {
                let walk = |slot: &mut Option<Walker<'a>>, handle: &Handle| {
                    let walker = match slot {
                        Some(walker) => walker,
                        None => slot.insert(self.walker()?),
                    };
                    walker.go_home();
                    walker.walk_to(*handle).inspect(|_| on_answer())
                };
                handles.par_iter().map_init(|| None, walk).collect()
            }
        }
    }

    fn walker(&self) -> Result<Walker<'a>, EvaluateError> {
        let subject = Subject::new(self.plugin, self.settings, 0)?;
        Ok(Walker { subject, details: self.details, at: Handle::HOME })
    }
}

/// Handle with the model under evaluation.
struct Walker<'a> {
    subject: Subject<'a>,
    details: Details,
    at: Handle,
}

impl Walker<'_> {
    /// Resets the model to home without history.
    fn go_home(&mut self) {
        self.subject.restart();
        self.at = Handle::HOME;
    }

    fn evaluate_directly(
        &mut self,
        handles: &[Handle],
        on_answer: &(dyn Fn() + Sync),
    ) -> Result<Vec<Answer>, EvaluateError> {
        if self.details == Details::Asked {
            // Details refer to the last step: one pose at a time.
            let ask = |handle: &Handle| self.tick_at(*handle).inspect(|_| on_answer());
            return handles.iter().map(ask).collect();
        }
        let mut answers = Vec::with_capacity(handles.len());
        let mut outputs = vec![Output::default(); BATCH];
        for batch in handles.chunks(BATCH) {
            let inputs: Vec<Input> = batch.iter().map(|handle| self.subject.at_rest(handle.pose())).collect();
            match self.subject.model().step_batch(&inputs, &mut outputs) {
                CallStatus::Ok => {}
                status => return Err(self.failed(status)),
            }
            for (handle, output) in batch.iter().zip(&outputs) {
                answers.push(self.answer(*handle, output)?);
                on_answer();
            }
        }
        Ok(answers)
    }

    /// Makes one step at a pose.
    fn tick_at(&mut self, handle: Handle) -> Result<Answer, EvaluateError> {
        let output = self.step(handle.pose())?;
        self.answer(handle, &output)
    }

    /// Moves the handle to a pose and holds it there until the model has converged.
    fn walk_to(&mut self, target: Handle) -> Result<Answer, EvaluateError> {
        if !target.is_finite() {
            // A non-finite pose has no path: the model is stepped there once and returns its status.
            return self.tick_at(target);
        }
        let (from, way_m) = (self.at, target.position_m - self.at.position_m);
        let way_rad = target.rotation_rad - from.rotation_rad;
        let between = |part: f64| at(from.position_m + way_m * part, from.rotation_rad + way_rad * part);
        self.at = target;
        let steps = steps(way_m, way_rad).clamp(1.0, MOST_STEPS);
        let output = walk(steps, between, target.pose(), |pose| self.step(pose))?;
        self.answer(target, &output)
    }

    fn step(&mut self, pose: Pose) -> Result<Output, EvaluateError> {
        let input = self.subject.input(pose, Twist::ZERO, PERIOD_NS);
        call(self.subject.model(), &input).map_err(|status| self.failed(status))
    }

    fn failed(&mut self, status: CallStatus) -> EvaluateError {
        EvaluateError::Failed(self.subject.model().reason(status))
    }

    fn answer(&mut self, handle: Handle, output: &Output) -> Result<Answer, EvaluateError> {
        let details = self.read_details()?;
        let no_answer = if handle.is_finite() { StepStatus::OutOfDomain } else { StepStatus::InvalidInput };
        let serves_energy = self.subject.model().serves().contains(Demand::ENERGY);
        Ok(match output.status() {
            Some(status) if output.wrench.is_finite() => Answer {
                wrench: output.wrench,
                energy_j: (serves_energy && output.energy_j.is_finite()).then_some(output.energy_j),
                status,
                details,
            },
            _ => Answer { wrench: Wrench::ZERO, energy_j: None, status: no_answer, details },
        })
    }

    fn read_details(&mut self) -> Result<Vec<Option<f64>>, EvaluateError> {
        let count = self.subject.model().details().len();
        if self.details == Details::Omitted || count == 0 {
            return Ok(Vec::new());
        }
        let mut values = vec![f64::NAN; count];
        match self.subject.model().read_details(&mut values) {
            CallStatus::Ok => {
                Ok(values.into_iter().map(|value| value.is_finite().then_some(value)).collect())
            }
            status => Err(self.failed(status)),
        }
    }
}
