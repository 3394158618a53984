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

mod contacts;
mod source;
mod thread;

use crate::{Clock, Engine, Stepped};
use contacts::contacts;
use flotor_contact::{ContactSetError, CrossFade, FeltStiffness, PublishedContacts};
use flotor_core::asynchronous::FieldTiming;
use flotor_core::mapping::Mapping;
use flotor_core::{period_ns, to_ns};
use flotor_hal::abi::CallStatus;
use flotor_hal::{ContactSet, Demand, Input, LoopConfig, Memory, Output, Refusal, StepStatus, Wrench};
use source::Source;
use thread::ModelThread;

/// Age limit of an answer, in periods of the model: later the handle may have moved too far from the sample.
const OLDEST_PERIODS: u64 = 10;

/// Model with a rate below the loop's; the loop evaluates the model's newest answers.
pub struct AsynchronousModel {
    computing: Computing,
    contacts: PublishedContacts,
    fields: CrossFade,
    /// Reason for which the last contacts were refused, if any were.
    refused: Option<ContactSetError>,
    /// Sample time of the newest answer, ns; `None` before the first answer.
    newest_ns: Option<u64>,
    /// Time of the first step since the last reset, ns.
    since_ns: Option<u64>,
    oldest_ns: u64,
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

    /// Prepares the model for its own rate ([`Self::config`]) and starts it, inline or on a thread; `mapping` is that of its
    /// instance. Not real-time.
    ///
    /// # Errors
    /// The model's [`Refusal`], a refusal with the cause if the system cannot start a thread, or one for a limit of contacts that is not
    /// above 0.
    pub fn start(
        mut model: Engine,
        parameters: usize,
        (timing, mapping): (&FieldTiming, &Mapping),
        config: &LoopConfig,
        clock: Clock,
    ) -> Result<Self, Refusal> {
        let latency_ns = to_ns(timing.latency_s);
        let loop_ns = config.period_ns;
        let config = Self::config(timing, config);
        let contacts = contacts(&timing.contacts, mapping, [loop_ns, config.period_ns])?;
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
            contacts,
            fields: CrossFade::new(period_ns),
            refused: None,
            newest_ns: None,
            since_ns: None,
            oldest_ns: OLDEST_PERIODS * period_ns,
            serves,
            memory,
            parameters,
        })
    }

    /// Evaluates the newest contacts and fields at the handle; `output` is only valid for [`Stepped::Answered`], [`Stepped::Short`] and
    /// [`Stepped::Refused`], and its energy is NaN. Returns [`Stepped::Silent`] after ten periods of the model without an answer, once
    /// contacts have faded. Real-time on a real clock: bounded, no allocation.
    pub fn step(&mut self, input: &Input, output: &mut Output) -> Stepped {
        let mut set = ContactSet::NONE;
        let polled = match &mut self.computing {
            Computing::Inline(inline) => inline.poll(input, &mut set),
            Computing::Thread(thread) => thread.poll(input, &mut set),
        };
        let (field, mut stepped) = (set.bilateral(), Stepped::Answered);
        match polled {
            Stepped::Answered if !field.is_finite() => {
                // Returned, to be rejected as a non-finite output.
                *output = field.wrench.into();
                return Stepped::Answered;
            }
            Stepped::Answered => match self.contacts.publish(&set) {
                Ok(()) => {
                    self.fields.take(field, &input.pose, input.time_ns);
                    self.newest_ns = Some(set.time_ns);
                }
                Err(error) => (self.refused, stepped) = (Some(error), Stepped::Refused),
            },
            Stepped::Broken | Stepped::Gone => return Stepped::Broken,
            _ => {}
        }
        let since_ns = *self.since_ns.get_or_insert(input.time_ns);
        let age_ns = input.time_ns.saturating_sub(self.newest_ns.unwrap_or(since_ns));
        let is_old = age_ns > self.oldest_ns;
        if is_old && self.contacts.is_idle() {
            return Stepped::Silent;
        }
        let (mut wrench, mut is_valid) =
            if is_old { (Wrench::ZERO, false) } else { self.fields.at(&input.pose, input.time_ns) };
        if let Some(touch) = self.contacts.touch(input) {
            wrench = wrench + touch.wrench;
            is_valid &= touch.is_valid;
            if let (Stepped::Answered, Some(shortcoming)) = (stepped, touch.shortcoming) {
                stepped = Stepped::Short(shortcoming);
            }
        }
        let status = if is_valid { StepStatus::Ok } else { StepStatus::Clamped };
        *output = Output::new(wrench, f64::NAN, status);
        stepped
    }

    /// Returns what the hand has felt of the stiffness of contacts so far, in the model frame. Real-time: bounded, no allocation.
    pub fn felt_stiffness(&self) -> FeltStiffness {
        self.contacts.felt_stiffness()
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
        self.contacts.clear();
        self.fields.clear();
        (self.newest_ns, self.since_ns) = (None, None);
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

/// Model computed in the tick of the loop at multiples of the model's period, with delayed answers.
struct Inline {
    source: Source,
    period_ns: u64,
    latency_ns: u64,
    /// Time of the next computation, ns.
    next_ns: u64,
    /// Computed answer with its release time, ns. A latency is at most a period, so there is at most one answer.
    held_back: Option<(u64, ContactSet)>,
}

impl Inline {
    fn new(model: Engine, period_ns: u64, latency_ns: u64) -> Self {
        Self { source: Source::new(model), period_ns, latency_ns, next_ns: 0, held_back: None }
    }

    /// Computes an answer if one is due, and copies the answer whose latency is over to `set`; returns late if there is none.
    fn poll(&mut self, input: &Input, set: &mut ContactSet) -> Stepped {
        let due = self.held_back.take_if(|(ready_ns, _)| input.time_ns >= *ready_ns);
        if input.time_ns >= self.next_ns {
            self.next_ns = (input.time_ns / self.period_ns + 1) * self.period_ns;
            let mut next = ContactSet::NONE;
            match self.source.compute(input, &mut next) {
                Stepped::Answered => self.held_back = Some((input.time_ns + self.latency_ns, next)),
                Stepped::Broken | Stepped::Gone => return Stepped::Broken,
                // The next computation may yield an answer.
                _ => {}
            }
        }
        let Some((_, due)) = due else { return Stepped::Late };
        *set = due;
        Stepped::Answered
    }

    fn reset(&mut self) -> CallStatus {
        self.held_back = None;
        self.source.reset()
    }
}
