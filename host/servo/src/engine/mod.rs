//! Execution of a model: in the loop, asynchronously, or in a worker process.

pub mod asynchronous;
pub mod process;
mod stepped;

pub use stepped::Stepped;

use asynchronous::AsynchronousModel;
use flotor_contact::FeltStiffness;
use flotor_core::grip::GripRecord;
use flotor_hal::abi::CallStatus;
use flotor_hal::{
    ActiveRegion, ContactSet, Demand, GripState, Input, LoopConfig, Memory, Output, Refusal, WorkspaceBounds,
};
use flotor_loader::{InstanceState, Model};
use process::Worker;

/// Model, executed in one of three ways.
pub enum Engine {
    /// In the loop thread: fastest, without crash isolation.
    Here(Model),
    /// In a worker process: a crash or hang of the model does not stop the loop.
    Process(Worker),
    /// Asynchronous, at the model's own rate; the loop evaluates its contacts or its local linear model.
    Asynchronous(Box<AsynchronousModel>),
}

/// Calls the same function on every kind of engine.
macro_rules! each {
    ($engine:expr, $model:ident => $call:expr) => {
        match $engine {
            Engine::Here($model) => $call,
            Engine::Process($model) => $call,
            Engine::Asynchronous($model) => $call,
        }
    };
}

impl Engine {
    /// Steps the model, also at a grip in its scale, where an asynchronous model has no effort; the results are only valid for
    /// [`Stepped::Answered`]. Real-time: bounded by the model or its timeout, no allocation.
    #[inline(always)] // in the middle of a tick
    pub fn step(&mut self, input: &Input, output: &mut Output, grip: &mut Option<GripRecord>) -> Stepped {
        match self {
            Self::Here(model) => {
                let stepped = model.step(input, output).into();
                if let (Some(grip), Stepped::Answered) = (grip, stepped) {
                    grip.model = model.grip(input, &grip.state);
                }
                stepped
            }
            Self::Process(worker) => worker.step(input, output, grip),
            Self::Asynchronous(model) => model.step(input, output),
        }
    }

    /// Returns true if several devices can share the model in the loop; false outside the loop thread. Not real-time.
    pub fn has_ports(&self) -> bool {
        matches!(self, Self::Here(model) if model.has_ports())
    }

    /// Returns true if several devices can share the model once it runs asynchronously; false for one that already does, and in a
    /// worker. Not real-time.
    pub fn has_world_contacts(&self) -> bool {
        matches!(self, Self::Here(model) if model.has_world_contacts())
    }

    /// Steps the model once for all its ports. Outputs are only valid if the result is [`Stepped::Answered`]; an asynchronous model
    /// writes to `stepped` the result at each port, as of [`Self::step`]. Returns [`Stepped::Broken`] for a model without ports, and
    /// for a worker. Real-time: bounded by the model, no allocation.
    pub fn step_ports(
        &mut self,
        inputs: &[Input],
        outputs: &mut [Output],
        stepped: &mut [Stepped],
    ) -> Stepped {
        match self {
            Self::Here(model) => model.step_ports(inputs, outputs).into(),
            Self::Process(_) => Stepped::Broken,
            Self::Asynchronous(model) => model.step_ports(inputs, outputs, stepped),
        }
    }

    /// Returns the effort at the grip of a port after [`Self::step_ports`]; 0 for a model without one. Real-time: bounded by the model,
    /// no allocation.
    pub fn grip(&mut self, input: &Input, grip: &GripState) -> f64 {
        match self {
            Self::Here(model) => model.grip(input, grip),
            Self::Process(_) | Self::Asynchronous(_) => 0.0,
        }
    }

    /// Returns true if the output of a step may arrive in a later tick.
    pub fn may_be_late(&self) -> bool {
        !matches!(self, Self::Here(_))
    }

    /// Changes a live parameter at a tick boundary. Real-time: bounded by the model or its timeout, no allocation.
    pub fn set_parameter(&mut self, index: usize, value: f64) -> CallStatus {
        each!(self, model => model.set_parameter(index, value))
    }

    /// Returns the present value of a parameter; NaN if unknown. Not real-time.
    pub fn parameter(&mut self, index: usize) -> f64 {
        each!(self, model => model.parameter(index))
    }

    /// Returns the present values of all parameters of a model in the loop; none of any other. Not real-time.
    pub fn parameters(&mut self) -> Vec<f64> {
        let Self::Here(model) = self else { return Vec::new() };
        (0..model.parameters().len()).map(|index| model.parameter(index)).collect()
    }

    /// Returns the outputs that the model can compute.
    pub fn serves(&self) -> Demand {
        each!(self, model => model.serves())
    }

    /// Clears the history of the model. Real-time: bounded by the model or its timeout, no allocation.
    #[inline(never)] // seldom called
    pub fn reset(&mut self) -> CallStatus {
        each!(self, model => model.reset())
    }

    /// Returns the state of the model, to save or restore; `None` for a model with a history that offers no snapshot, and for a
    /// worker or asynchronous model.
    pub fn state(&mut self) -> Option<InstanceState<'_>> {
        match self {
            Self::Here(model) => model.state(),
            Self::Process(_) | Self::Asynchronous(_) => None,
        }
    }

    /// Returns the active region of the model; everywhere for an asynchronous model. Real-time: bounded, no allocation.
    pub fn active_region(&mut self) -> ActiveRegion {
        match self {
            Self::Here(model) => model.active_region(),
            Self::Process(worker) => worker.active_region(),
            Self::Asynchronous(_) => ActiveRegion::EVERYWHERE,
        }
    }

    /// Returns the workspace bounds of the model; unbounded for an asynchronous model. Real-time: bounded, no allocation.
    pub fn workspace_bounds(&mut self) -> WorkspaceBounds {
        match self {
            Self::Here(model) => model.workspace_bounds(),
            Self::Process(worker) => worker.workspace_bounds(),
            Self::Asynchronous(_) => WorkspaceBounds::UNBOUNDED,
        }
    }

    /// Returns true if the model can run asynchronously; false for a model that already does. Not real-time.
    pub fn has_local_model(&self) -> bool {
        match self {
            Self::Here(model) => model.has_local_model(),
            Self::Process(worker) => worker.has_local_model(),
            Self::Asynchronous(_) => false,
        }
    }

    /// Computes the contacts or the linear field at the input of each port; `sets` are only valid for [`Stepped::Answered`]. Returns
    /// [`Stepped::Broken`] for an asynchronous model, and for several ports of a worker. Not real-time.
    pub fn local_models(&mut self, inputs: &[Input], sets: &mut [ContactSet]) -> Stepped {
        match (self, inputs, sets) {
            (Self::Here(model), inputs, sets) => model.local_models(inputs, sets).into(),
            (Self::Process(worker), [input], [set]) => worker.local_model(input, set),
            (Self::Process(_) | Self::Asynchronous(_), ..) => Stepped::Broken,
        }
    }

    /// Prepares the model for the loop: after this call the model must not allocate. Does nothing for a model in a worker or an
    /// asynchronous model, which is prepared when it starts. Not real-time.
    ///
    /// # Errors
    /// The model's [`Refusal`].
    pub fn prepare(&mut self, config: &LoopConfig) -> Result<(), Refusal> {
        match self {
            Self::Here(model) => model.prepare(config),
            Self::Process(_) | Self::Asynchronous(_) => Ok(()),
        }
    }

    /// Returns the model's dependence on the path of the handle.
    pub fn memory(&self) -> Memory {
        each!(self, model => model.memory())
    }

    /// Returns the number of calls that changed the floating-point environment of the loop thread; 0 for a model outside that
    /// thread. Real-time: bounded, no allocation.
    #[inline]
    pub fn float_changes(&self) -> u64 {
        match self {
            Self::Here(model) => model.float_changes(),
            Self::Process(_) | Self::Asynchronous(_) => 0,
        }
    }

    /// Returns the reductions of contact stiffness at a port, in the model frame. Real-time: bounded, no allocation.
    pub fn felt_stiffness(&self, port: usize) -> FeltStiffness {
        match self {
            Self::Asynchronous(model) => model.felt_stiffness(port),
            Self::Here(_) | Self::Process(_) => FeltStiffness::default(),
        }
    }

    /// Returns the last message of the model. Not real-time.
    pub fn last_message(&mut self) -> String {
        each!(self, model => model.last_message())
    }
}
