//! A force model slower than the loop: computed asynchronously, evaluated in the loop as a local linear model.
//!
//! ```text
//!            pose, velocity                     linear field
//!  the loop ----------------> the model, at its ------------> the loop, every tick:
//!             newest value     own rate          newest value   W0 - K d, faded in over a period
//! ```
//!
//! On a real clock the model has a thread of its own, and neither side waits: a loop that finds no new field goes on with
//! the old one, as long as it is not too old. On the virtual clock it is computed in the tick that looks, at multiples
//! of its period, and its field is held back for the latency the scene declares: the same run, bit for bit, each time.

mod cross_fade;
mod thread;

use crate::{Clock, Engine, Stepped};
use cross_fade::CrossFade;
use flotor_core::mapping::FieldTiming;
use flotor_hal::abi::CallStatus;
use flotor_hal::{Demand, Input, LinearField, LoopConfig, Memory, Output, Refusal, StepStatus};
use thread::ModelThread;

/// Periods without a new field after which the last one says nothing any more: what is older is about a handle that
/// was elsewhere.
const OLDEST_PERIODS: u64 = 10;

/// A model that is computed asynchronously.
pub struct AsynchronousModel {
    computing: Computing,
    fields: CrossFade,
    /// Time of the look the newest field answers, ns; `None` before the first.
    newest_ns: Option<u64>,
    /// When the loop began to ask, ns.
    since_ns: Option<u64>,
    oldest_ns: u64,
    serves: Demand,
    memory: Memory,
    /// Value in force of each parameter before the loop.
    parameters: Vec<f64>,
}

enum Computing {
    /// In the tick that looks, on the virtual clock.
    Inline(Box<Inline>),
    /// On a thread of its own.
    Thread(ModelThread),
}

/// What came of looking for a new field.
#[allow(clippy::large_enum_variant)] // read where it is returned; a box would allocate in the loop
pub enum Arrival {
    /// A new field.
    Field(LinearField),
    /// None yet.
    Nothing,
    /// The model broke: it panicked, or answered outside the contract.
    Broken,
}

impl AsynchronousModel {
    /// The loop a model with this timing is prepared for: a field cannot come more often than the loop looks.
    #[must_use]
    pub fn config(timing: &FieldTiming, config: &LoopConfig) -> LoopConfig {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // checked: 0.1 ms to 1 s
        let period_ns = (1.0e9 / timing.rate_hz).round() as u64;
        LoopConfig { period_ns: period_ns.max(config.period_ns), ..*config }
    }

    /// Prepares the model for its own rate ([`Self::config`]) and starts it, wherever it runs. Not real-time.
    ///
    /// # Errors
    /// The model's [`Refusal`], or why there is no thread.
    pub fn start(
        mut model: Engine,
        parameters: usize,
        timing: &FieldTiming,
        config: &LoopConfig,
        clock: Clock,
    ) -> Result<Self, Refusal> {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // checked: 0.1 ms to 1 s
        let latency_ns = (timing.latency_s * 1.0e9).round() as u64;
        let config = Self::config(timing, config);
        let period_ns = config.period_ns;
        model.prepare(&config)?;
        let parameters = (0..parameters).map(|index| model.parameter(index)).collect();
        let (serves, memory) = (model.serves(), model.memory());
        let computing = match clock {
            Clock::Virtual => Computing::Inline(Box::new(Inline::new(model, period_ns, latency_ns))),
            Clock::Real => Computing::Thread(ModelThread::start(model, period_ns)?),
        };
        Ok(Self {
            computing,
            fields: CrossFade::new(period_ns),
            newest_ns: None,
            since_ns: None,
            oldest_ns: OLDEST_PERIODS * period_ns,
            serves,
            memory,
            parameters,
        })
    }

    /// The wrench of the newest fields at the handle; `output` is only meaningful for [`Stepped::Answered`]. Real-time on a
    /// real clock: bounded, no allocation.
    pub fn step(&mut self, input: &Input, output: &mut Output) -> Stepped {
        let arrival = match &mut self.computing {
            Computing::Inline(inline) => inline.look(input),
            Computing::Thread(thread) => thread.look(input),
        };
        match arrival {
            Arrival::Field(field) if field.is_finite() => {
                self.fields.take(field, &input.pose, input.time_ns);
                self.newest_ns = Some(field.time_ns);
            }
            // As any answer that cannot be used.
            Arrival::Field(field) => {
                *output = field.wrench.into();
                return Stepped::Answered;
            }
            Arrival::Nothing => {}
            Arrival::Broken => return Stepped::Broken,
        }
        let since_ns = *self.since_ns.get_or_insert(input.time_ns);
        if input.time_ns.saturating_sub(self.newest_ns.unwrap_or(since_ns)) > self.oldest_ns {
            return Stepped::Silent;
        }
        let (wrench, is_valid) = self.fields.at(&input.pose, input.time_ns);
        let status = if is_valid { StepStatus::Ok } else { StepStatus::Clamped };
        *output = Output::new(wrench, f64::NAN, status);
        Stepped::Answered
    }

    /// Changes a live parameter before the next field. Real-time: bounded, no allocation.
    pub fn set_parameter(&mut self, index: usize, value: f64) -> CallStatus {
        match &mut self.computing {
            Computing::Inline(inline) => inline.model.set_parameter(index, value),
            Computing::Thread(thread) => thread.set_parameter(index, value),
        }
    }

    /// The value in force of a parameter before the loop.
    pub fn parameter(&self, index: usize) -> f64 {
        self.parameters.get(index).copied().unwrap_or(f64::NAN)
    }

    /// Force and torque, as far as the model serves them: a field has no energy.
    pub fn serves(&self) -> Demand {
        self.serves.limited_to(Demand::WRENCH)
    }

    /// Whether the answer depends on the path.
    pub fn memory(&self) -> Memory {
        self.memory
    }

    /// Forgets history and fields. Real-time: bounded, no allocation.
    pub fn reset(&mut self) -> CallStatus {
        self.fields.clear();
        (self.newest_ns, self.since_ns) = (None, None);
        match &mut self.computing {
            Computing::Inline(inline) => inline.reset(),
            Computing::Thread(thread) => thread.reset(),
        }
    }

    /// What the model said last. Not real-time.
    pub fn last_message(&mut self) -> String {
        match &mut self.computing {
            Computing::Inline(inline) => inline.model.last_message(),
            Computing::Thread(thread) => thread.last_message(),
        }
    }
}

/// A model computed in the loop at multiples of its period; its fields are held back.
struct Inline {
    model: Engine,
    period_ns: u64,
    latency_ns: u64,
    /// When it looks next, ns.
    next_ns: u64,
    looked_ns: Option<u64>,
    /// A field and when it is to be had, ns. A latency is no longer than a period: there is at most one.
    held_back: Option<(u64, LinearField)>,
}

impl Inline {
    fn new(model: Engine, period_ns: u64, latency_ns: u64) -> Self {
        Self { model, period_ns, latency_ns, next_ns: 0, looked_ns: None, held_back: None }
    }

    fn look(&mut self, input: &Input) -> Arrival {
        let due = self.held_back.take_if(|(ready_ns, _)| input.time_ns >= *ready_ns);
        if input.time_ns >= self.next_ns {
            self.next_ns = (input.time_ns / self.period_ns + 1) * self.period_ns;
            let dt_ns = self.looked_ns.map_or(0, |before_ns| input.time_ns - before_ns);
            self.looked_ns = Some(input.time_ns);
            let mut field = LinearField::NONE;
            let demand = self.model.serves().limited_to(Demand::WRENCH);
            match self.model.linear_field(&Input { dt_ns, demand, ..*input }, &mut field) {
                Stepped::Answered => {
                    field.time_ns = input.time_ns;
                    self.held_back = Some((input.time_ns + self.latency_ns, field));
                }
                // Its field may come the next time.
                Stepped::Late | Stepped::Silent => {}
                Stepped::Broken | Stepped::Gone => return Arrival::Broken,
            }
        }
        due.map_or(Arrival::Nothing, |(_, field)| Arrival::Field(field))
    }

    fn reset(&mut self) -> CallStatus {
        (self.held_back, self.looked_ns) = (None, None);
        self.model.reset()
    }
}
