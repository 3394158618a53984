//! Loaded force model: an instance and its function table.

use super::float_control::preserving_float_control;
use super::setting::{Setting, index_of, live_index, to_raw};
use crate::abi::{CallStatus, ForceTable, Instance, Message};
use crate::extension::ModelExtensions;
use crate::extension::variant::VariantInfo;
use crate::{Demand, Input, LoopConfig, Memory, ModelInfo, Output, Parameter, Refusal, RefusalKind};

type StepFn = unsafe extern "C" fn(Instance, *const Input, *mut Output) -> u32;

/// The function tables of a model plugin.
#[derive(Clone, Copy)]
pub(super) struct ModelTables {
    pub(super) force: &'static ForceTable,
    pub(super) extensions: ModelExtensions,
}

/// Instance of a force model. Used by one thread at a time.
pub struct Model {
    pub(crate) instance: Instance,
    /// Copied from the table to save a load in every tick.
    step: StepFn,
    table: &'static ForceTable,
    pub(crate) extensions: ModelExtensions,
    pub(crate) variant: VariantInfo,
    parameters: &'static [Parameter],
    /// Number of calls that changed the floating-point environment.
    pub(crate) float_changes: u64,
}

// SAFETY: the contract lets an instance be used by any one thread at a time; `&mut self` sees to "one".
unsafe impl Send for Model {}

impl Model {
    pub(super) fn create(
        tables: ModelTables,
        parameters: &'static [Parameter],
        settings: &[Setting],
    ) -> Result<Self, Refusal> {
        // SAFETY: `settings` outlives the call, and the plugin keeps no copy past it (contract).
        let values = unsafe { to_raw(settings, parameters) }?;
        let table = tables.force;
        let (Some(create), Some(step)) = (table.create, table.step) else {
            return Err(Refusal::broken(
                "a required entry of the function table is null; set every required entry",
            ));
        };
        let mut message = Message::default();
        let mut instance = std::ptr::null_mut();
        let count = u32::try_from(values.len()).unwrap_or(u32::MAX);
        let mut float_changes = 0;
        // SAFETY: all pointers are valid for the call, as the contract of `create` asks.
        let made = || unsafe { create(values.as_ptr(), count, &raw mut message, &raw mut instance) };
        let code = preserving_float_control(&mut float_changes, made);
        refusal_from(code, &message)?;
        if instance.is_null() {
            return Err(Refusal::broken("the plugin reported success but created no model"));
        }
        let variant = VariantInfo::new(table.info.serves(), table.info.memory());
        let extensions = tables.extensions;
        let mut model = Self { instance, step, table, extensions, variant, parameters, float_changes };
        model.variant = model.ask_variant();
        Ok(model)
    }

    /// Calls a function of this instance's tables and returns the value written; `None` if the function is missing or failed.
    pub(crate) fn asked<T>(
        &mut self,
        ask: Option<unsafe extern "C" fn(Instance, *mut T) -> u32>,
        mut answer: T,
    ) -> Option<T> {
        let ask = ask?;
        // SAFETY: a live instance used by this thread only (`&mut`), an out pointer valid for the call.
        let asked = || unsafe { ask(self.instance, &raw mut answer) };
        let code = preserving_float_control(&mut self.float_changes, asked);
        (code == CallStatus::Ok as u32).then_some(answer)
    }

    /// Returns the model's declaration, which holds for all settings.
    #[must_use]
    pub fn info(&self) -> &ModelInfo {
        &self.table.info
    }

    /// Returns the parameter schema of the model.
    #[must_use]
    pub fn parameters(&self) -> &'static [Parameter] {
        self.parameters
    }

    /// Returns the format error of the last message: too long or not UTF-8; `None` if valid. Not real-time.
    #[must_use]
    pub fn message_problem(&mut self) -> Option<String> {
        let mut message = Message::default();
        if let Some(last_message) = self.table.last_message {
            // SAFETY: a live instance, used by this thread only (`&mut`), an out pointer valid for the call.
            unsafe { last_message(self.instance, &raw mut message) };
        }
        message.problem()
    }

    /// Returns the demands that the model serves with the settings it was created with.
    #[must_use]
    pub fn serves(&self) -> Demand {
        self.variant.serves()
    }

    /// Returns the path dependence of the model with the settings it was created with.
    #[must_use]
    pub fn memory(&self) -> Memory {
        self.variant.memory()
    }

    /// Returns the number of calls so far that changed the rounding mode, flush-to-zero or traps of the thread; the
    /// host restored them each time. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn float_changes(&self) -> u64 {
        self.float_changes
    }

    /// Prepares the model for the loop: its last opportunity to allocate. Not real-time.
    ///
    /// # Errors
    /// The model's [`Refusal`].
    pub fn prepare(&mut self, config: &LoopConfig) -> Result<(), Refusal> {
        let Some(prepare) = self.table.prepare else { return Ok(()) };
        let mut message = Message::default();
        // SAFETY: a live instance, used by this thread only (`&mut`), pointers valid for the call.
        let prepared = || unsafe { prepare(self.instance, config, &raw mut message) };
        let code = preserving_float_control(&mut self.float_changes, prepared);
        refusal_from(code, &message)
    }

    /// Computes one step. Real-time: bounded by the model, no allocation. `output` is only meaningful for [`CallStatus::Ok`].
    #[inline]
    pub fn step(&mut self, input: &Input, output: &mut Output) -> CallStatus {
        // SAFETY: as in `prepare`.
        let stepped = || unsafe { (self.step)(self.instance, input, output) };
        CallStatus::from_code(preserving_float_control(&mut self.float_changes, stepped))
    }

    /// Steps through inputs in order, up to the length of the shorter slice. Real-time per pose.
    pub fn step_batch(&mut self, inputs: &[Input], outputs: &mut [Output]) -> CallStatus {
        let count = inputs.len().min(outputs.len());
        if let Some(step_batch) = self.table.step_batch {
            // SAFETY: as in `prepare`; both slices hold at least `count` structs and do not overlap (`&`, `&mut`).
            let stepped =
                || unsafe { step_batch(self.instance, count as u64, inputs.as_ptr(), outputs.as_mut_ptr()) };
            return CallStatus::from_code(preserving_float_control(&mut self.float_changes, stepped));
        }
        for (input, output) in inputs.iter().zip(outputs) {
            match self.step(input, output) {
                CallStatus::Ok => {}
                failed => return failed,
            }
        }
        CallStatus::Ok
    }

    /// Changes a live parameter, by its index in the schema, at a tick boundary (for a choice, `value` is its index).
    /// The value is checked against the schema here and again by the plugin. Real-time: bounded, no allocation.
    pub fn set_parameter(&mut self, index: usize, value: f64) -> CallStatus {
        let Some(set_parameter) = self.table.set_parameter else { return CallStatus::Unsupported };
        let Some(index) = live_index(self.parameters, index, value) else { return CallStatus::OutOfRange };
        // SAFETY: as in `prepare`.
        let set = || unsafe { set_parameter(self.instance, index, value) };
        CallStatus::from_code(preserving_float_control(&mut self.float_changes, set))
    }

    /// Returns the current value of the parameter at `index`, presets resolved; NaN if unknown. Real-time.
    #[must_use]
    pub fn parameter(&mut self, index: usize) -> f64 {
        let Some(parameter) = self.table.parameter else { return f64::NAN };
        let Some(index) = index_of(self.parameters, index) else { return f64::NAN };
        // SAFETY: as in `prepare`.
        preserving_float_control(&mut self.float_changes, || unsafe { parameter(self.instance, index) })
    }

    /// Clears the history. Real-time: bounded, no allocation.
    pub fn reset(&mut self) -> CallStatus {
        let Some(reset) = self.table.reset else { return CallStatus::Ok };
        // SAFETY: as in `prepare`.
        CallStatus::from_code(preserving_float_control(&mut self.float_changes, || unsafe {
            reset(self.instance)
        }))
    }

    /// Returns the model's message about the call that failed. Not real-time.
    #[must_use]
    pub fn last_message(&mut self) -> String {
        let mut message = Message::default();
        if let Some(last_message) = self.table.last_message {
            // SAFETY: as in `prepare`.
            preserving_float_control(&mut self.float_changes, || unsafe {
                last_message(self.instance, &raw mut message)
            });
        }
        message.for_people()
    }
}

impl Drop for Model {
    fn drop(&mut self) {
        if let Some(destroy) = self.table.destroy {
            // SAFETY: the instance came from `create` of this table and is not used after this.
            preserving_float_control(&mut self.float_changes, || unsafe { destroy(self.instance) });
        }
    }
}

/// Converts the return code of a refusable call to a result; 0 is success.
pub(crate) fn refusal_from(code: u32, message: &Message) -> Result<(), Refusal> {
    if code == 0 {
        return Ok(());
    }
    let reason = match message.for_people() {
        text if text.is_empty() => format!("no reason given (code {code})"),
        text => text,
    };
    Err(Refusal { kind: RefusalKind::from_code(code), reason })
}
