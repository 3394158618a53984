//! Force model slower than the loop: computed asynchronously, evaluated in the loop as contacts or as a local linear model.
//!
//! ```text
//!            pose, velocity                     contacts, field
//!  the loop ----------------> the model, at its ---------------> the loop, every tick:
//!             newest value     own rate           newest value     contacts solved ([`flotor_contact`]),
//!                                                                  W0 - K d, faded in over a period
//! ```
//!
//! On a real clock the model runs in a thread of its own, and neither side waits: without a new answer the loop continues with the
//! old one, up to an age limit. On the virtual clock the model is computed in the loop's tick, at multiples of the model's period,
//! and each answer is delayed by the latency in the scene: all runs are identical, bit for bit.
//!
//! A model that several devices share has one instance and a port for each device: its thread takes the newest input of every port,
//! and the contacts of each port are solved at that port.

mod inline;
mod source;
mod thread;

use crate::{Clock, Engine, Stepped};
use flotor_contact::{ContactSetError, FeltStiffness, NewestAnswer};
use flotor_core::asynchronous::{ContactLimits, FieldTiming};
use flotor_core::mapping::Mapping;
use flotor_core::{period_ns, to_ns};
use flotor_hal::abi::CallStatus;
use flotor_hal::{ContactSet, Demand, Input, LoopConfig, Memory, Output, Refusal, StepStatus};
use inline::Inline;
use thread::ModelThread;

/// Model with a rate below the loop's; the loop evaluates the model's newest answers.
pub struct AsynchronousModel {
    computing: Computing,
    /// Newest answer at each port.
    answers: Box<[NewestAnswer]>,
    /// Reason for which the last contacts were refused, if any were.
    refused: Option<ContactSetError>,
    serves: Demand,
    memory: Memory,
    /// Present value of each parameter.
    parameters: Vec<f64>,
}

enum Computing {
    /// In the tick of the loop, on the virtual clock.
    Inline(Box<Inline>),
    /// In a thread of its own, on a real clock.
    Thread(ModelThread),
}

impl AsynchronousModel {
    /// Returns the loop configuration of the model: the period of its own rate, but at least the loop's, and the same seed.
    #[must_use]
    pub fn config(timing: &FieldTiming, config: &LoopConfig) -> LoopConfig {
        LoopConfig { period_ns: period_ns(timing.rate_hz).max(config.period_ns), ..*config }
    }

    /// Prepares the model for its own rate ([`Self::config`]) and starts it, inline or on a thread; `ports` has the mapping
    /// and the limits of each device: one, or those that share the model. Not real-time.
    ///
    /// # Errors
    /// The model's [`Refusal`], a refusal with the cause if the system cannot start a thread, or one for a limit of contacts that is not
    /// above 0.
    pub fn start(
        mut model: Engine,
        parameters: usize,
        (timing, ports): (&FieldTiming, &[(&Mapping, &ContactLimits)]),
        config: &LoopConfig,
        clock: Clock,
    ) -> Result<Self, Refusal> {
        let latency_ns = to_ns(timing.latency_s);
        let loop_ns = config.period_ns;
        let config = Self::config(timing, config);
        let period_ns = config.period_ns;
        let answer = |(mapping, limits): &(&Mapping, &ContactLimits)| {
            let answer = NewestAnswer::new(mapping, limits, [loop_ns, period_ns]);
            answer.map_err(|error| Refusal::parameter(format!("contacts: {error}")))
        };
        let answers = ports.iter().map(answer).collect::<Result<_, Refusal>>()?;
        model.prepare(&config)?;
        let parameters = (0..parameters).map(|index| model.parameter(index)).collect();
        let (serves, memory) = (model.serves(), model.memory());
        let computing = match clock {
            Clock::Virtual => {
                Computing::Inline(Box::new(Inline::new(model, ports.len(), [period_ns, latency_ns])))
            }
            Clock::Real => Computing::Thread(ModelThread::start(model, ports.len(), period_ns)?),
        };
        Ok(Self { computing, answers, refused: None, serves, memory, parameters })
    }

    /// Evaluates the newest contacts and fields at the handle, as [`Self::step_ports`] at its only port. Real-time on a real clock:
    /// bounded, no allocation.
    pub fn step(&mut self, input: &Input, output: &mut Output) -> Stepped {
        match self.begin(std::slice::from_ref(input)) {
            Stepped::Late => self.step_port(0, input, output),
            stepped => stepped,
        }
    }

    /// Evaluates the newest contacts and fields at every port, and writes the result at each to `stepped`. An output is only valid for
    /// [`Stepped::Answered`], [`Stepped::Short`] and [`Stepped::Refused`], and its energy is NaN. At a port the result is
    /// [`Stepped::Silent`] after ten periods of the model without an answer, once contacts have faded. Returns [`Stepped::Broken`] for
    /// a model that has failed. Real-time on a real clock: bounded, no allocation.
    pub fn step_ports(
        &mut self,
        inputs: &[Input],
        outputs: &mut [Output],
        stepped: &mut [Stepped],
    ) -> Stepped {
        if let stepped @ Stepped::Broken = self.begin(inputs) {
            return stepped;
        }
        for (port, ((input, output), stepped)) in inputs.iter().zip(outputs).zip(stepped).enumerate() {
            *stepped = self.step_port(port, input, output);
        }
        Stepped::Answered
    }

    /// Passes the inputs of all ports to the model; returns late, or [`Stepped::Broken`] for a model that has failed.
    fn begin(&mut self, inputs: &[Input]) -> Stepped {
        match &mut self.computing {
            Computing::Inline(inline) => inline.begin(inputs),
            Computing::Thread(thread) => thread.begin(inputs),
        }
    }

    fn step_port(&mut self, port: usize, input: &Input, output: &mut Output) -> Stepped {
        let Some(answer) = self.answers.get_mut(port) else { return Stepped::Broken };
        let mut set = ContactSet::NONE;
        let polled = match &mut self.computing {
            Computing::Inline(inline) => inline.newest(port, &mut set),
            Computing::Thread(thread) => thread.newest(port, &mut set),
        };
        let mut stepped = Stepped::Answered;
        if polled == Stepped::Answered {
            let field = set.bilateral();
            if !field.is_finite() {
                // Returned, to be rejected as a non-finite output.
                *output = field.wrench.into();
                return stepped;
            }
            if let Err(error) = answer.take(&set, input) {
                (self.refused, stepped) = (Some(error), Stepped::Refused);
            }
        }
        let Some(touch) = answer.touch(input) else { return Stepped::Silent };
        if let (Stepped::Answered, Some(shortcoming)) = (stepped, touch.shortcoming) {
            stepped = Stepped::Short(shortcoming);
        }
        let status = if touch.is_valid { StepStatus::Ok } else { StepStatus::Clamped };
        *output = Output::new(touch.wrench, f64::NAN, status);
        stepped
    }

    /// Returns the reductions of contact stiffness at a port so far, in the model frame. Real-time: bounded, no allocation.
    pub fn felt_stiffness(&self, port: usize) -> FeltStiffness {
        self.answers.get(port).map(NewestAnswer::felt_stiffness).unwrap_or_default()
    }

    /// Changes a live parameter before the next answer; unsupported if the thread's queue is full. Real-time: bounded, no allocation.
    pub fn set_parameter(&mut self, index: usize, value: f64) -> CallStatus {
        let status = match &mut self.computing {
            Computing::Inline(inline) => inline.source.model.set_parameter(index, value),
            Computing::Thread(thread) => thread.set_parameter(index, value),
        };
        if let (CallStatus::Ok, Some(present)) = (status, self.parameters.get_mut(index)) {
            *present = value;
        }
        status
    }

    /// Returns the value of a parameter: the last one set, or the initial one; NaN for an unknown one.
    pub fn parameter(&self, index: usize) -> f64 {
        self.parameters.get(index).copied().unwrap_or(f64::NAN)
    }

    /// Returns the outputs that the model can compute, force and torque only: contacts and linear fields have no energy.
    pub fn serves(&self) -> Demand {
        self.serves.limited_to(Demand::WRENCH)
    }

    /// Returns the model's dependence on the path of the handle.
    pub fn memory(&self) -> Memory {
        self.memory
    }

    /// Clears the history of the model and its answers: without force until the next answer. Real-time: bounded, no allocation.
    pub fn reset(&mut self) -> CallStatus {
        self.answers.iter_mut().for_each(NewestAnswer::clear);
        match &mut self.computing {
            Computing::Inline(inline) => inline.reset(),
            Computing::Thread(thread) => thread.reset(),
        }
    }

    /// Returns the last message of the model, or why its last contacts were refused. Not real-time.
    pub fn last_message(&mut self) -> String {
        if let Some(error) = self.refused {
            return error.to_string();
        }
        match &mut self.computing {
            Computing::Inline(inline) => inline.source.model.last_message(),
            Computing::Thread(thread) => thread.last_message(),
        }
    }
}
