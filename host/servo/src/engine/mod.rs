//! Where a model runs: in the loop, asynchronously, or in a worker of its own.

pub mod asynchronous;
pub mod process;

use asynchronous::AsynchronousModel;
use flotor_hal::abi::CallStatus;
use flotor_hal::abi::loader::Model;
use flotor_hal::{
    ActiveRegion, Demand, Input, LinearField, LoopConfig, Memory, Output, Refusal, WorkspaceBounds,
};
use process::{Reply, Worker};

/// A model, wherever it runs.
pub enum Engine {
    /// In the loop: fastest, and what breaks the model may break the process.
    Here(Model),
    /// In a process of its own.
    Process(Worker),
    /// Asynchronously; the loop evaluates its local linear model.
    Asynchronous(Box<AsynchronousModel>),
}

/// What came of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stepped {
    /// There is an answer, not looked at yet.
    Answered,
    /// None in time; there may be one in a later tick.
    Late,
    /// None for so long that what it answered before does not hold any more.
    Silent,
    /// The model broke: it panicked, or answered outside the contract.
    Broken,
    /// Its process has ended.
    Gone,
}

impl Engine {
    /// One step; `output` is only meaningful for [`Stepped::Answered`]. Real-time: bounded by the model or its patience, no
    /// allocation.
    pub fn step(&mut self, input: &Input, output: &mut Output) -> Stepped {
        let answered = |status| match status {
            CallStatus::Ok => Stepped::Answered,
            _ => Stepped::Broken,
        };
        match self {
            Self::Here(model) => answered(model.step(input, output)),
            Self::Process(worker) => match worker.step(input) {
                Reply::Answered((status, answer)) => {
                    *output = answer;
                    answered(status)
                }
                Reply::Late => Stepped::Late,
                Reply::Gone => Stepped::Gone,
            },
            Self::Asynchronous(model) => model.step(input, output),
        }
    }

    /// True if a step may come back without an answer and have one in a later tick.
    pub fn may_be_late(&self) -> bool {
        !matches!(self, Self::Here(_))
    }

    /// Changes a live parameter at a tick boundary. Real-time: bounded by the model or its patience, no allocation.
    pub fn set_parameter(&mut self, index: usize, value: f64) -> CallStatus {
        match self {
            Self::Here(model) => model.set_parameter(index, value),
            Self::Process(worker) => match worker.set_parameter(index, value) {
                Reply::Answered(status) => status,
                // Not now: the next step tells whether it is late or gone.
                Reply::Late | Reply::Gone => CallStatus::Unsupported,
            },
            Self::Asynchronous(model) => model.set_parameter(index, value),
        }
    }

    /// The value in force of a parameter before the loop starts; NaN if it has none. Not real-time.
    pub fn parameter(&mut self, index: usize) -> f64 {
        match self {
            Self::Here(model) => model.parameter(index),
            Self::Process(worker) => worker.parameter(index),
            Self::Asynchronous(model) => model.parameter(index),
        }
    }

    /// Which demands the model can serve.
    pub fn serves(&self) -> Demand {
        match self {
            Self::Here(model) => model.serves(),
            Self::Process(worker) => worker.serves(),
            Self::Asynchronous(model) => model.serves(),
        }
    }

    /// Forgets history. Real-time: bounded by the model or its patience, no allocation.
    pub fn reset(&mut self) -> CallStatus {
        match self {
            Self::Here(model) => model.reset(),
            Self::Process(worker) => match worker.reset() {
                Reply::Answered(status) => status,
                // The next step tells whether it is late or gone.
                Reply::Late | Reply::Gone => CallStatus::Ok,
            },
            Self::Asynchronous(model) => model.reset(),
        }
    }

    /// Where the model can act; an asynchronous one is always stepped. Real-time: bounded, no allocation.
    pub fn active_region(&mut self) -> ActiveRegion {
        match self {
            Self::Here(model) => model.active_region(),
            Self::Process(worker) => worker.active_region(),
            Self::Asynchronous(_) => ActiveRegion::EVERYWHERE,
        }
    }

    /// Where the model ends; an asynchronous one has no end. Real-time: bounded, no allocation.
    pub fn workspace_bounds(&mut self) -> WorkspaceBounds {
        match self {
            Self::Here(model) => model.workspace_bounds(),
            Self::Process(worker) => worker.workspace_bounds(),
            Self::Asynchronous(_) => WorkspaceBounds::UNBOUNDED,
        }
    }

    /// Whether it has a linear field. Not real-time.
    pub fn has_linear_field(&self) -> bool {
        match self {
            Self::Here(model) => model.has_linear_field(),
            Self::Process(worker) => worker.has_linear_field(),
            Self::Asynchronous(_) => false,
        }
    }

    /// The field at an input; `field` is only meaningful for [`Stepped::Answered`]. Not real-time.
    pub fn linear_field(&mut self, input: &Input, field: &mut LinearField) -> Stepped {
        let answered = |status| match status {
            CallStatus::Ok => Stepped::Answered,
            _ => Stepped::Broken,
        };
        match self {
            Self::Here(model) => answered(model.linear_field(input, field)),
            Self::Process(worker) => match worker.linear_field(input) {
                Reply::Answered((status, answer)) => {
                    *field = answer;
                    answered(status)
                }
                Reply::Late => Stepped::Late,
                Reply::Gone => Stepped::Gone,
            },
            Self::Asynchronous(_) => Stepped::Broken,
        }
    }

    /// Last chance for the model to allocate; one in a process of its own had it there. Not real-time.
    ///
    /// # Errors
    /// The model's [`Refusal`].
    pub fn prepare(&mut self, config: &LoopConfig) -> Result<(), Refusal> {
        match self {
            Self::Here(model) => model.prepare(config),
            Self::Process(_) | Self::Asynchronous(_) => Ok(()),
        }
    }

    /// Whether the answer depends on the path.
    pub fn memory(&self) -> Memory {
        match self {
            Self::Here(model) => model.memory(),
            Self::Process(worker) => worker.memory(),
            Self::Asynchronous(model) => model.memory(),
        }
    }

    /// Calls so far that left the floating-point environment of the loop's thread changed; what a model changes elsewhere
    /// stays there. Real-time: bounded, no allocation.
    #[inline]
    pub fn float_changes(&self) -> u64 {
        match self {
            Self::Here(model) => model.float_changes(),
            Self::Process(_) | Self::Asynchronous(_) => 0,
        }
    }

    /// What the model said last. Not real-time.
    pub fn last_message(&mut self) -> String {
        match self {
            Self::Here(model) => model.last_message(),
            Self::Process(worker) => worker.last_message(),
            Self::Asynchronous(model) => model.last_message(),
        }
    }
}
