//! Loaded force model: an instance and its function table.

use super::guarded::{GuardedInstance, INCOMPLETE};
use super::setting::Setting;
use crate::extension::ModelExtensions;
use flotor_hal::abi::{CallStatus, ForceTable, Instance};
use flotor_hal::{Demand, Input, LoopConfig, Memory, ModelInfo, Output, Parameter, Refusal, VariantInfo};

type StepFn = unsafe extern "C" fn(Instance, *const Input, *mut Output) -> u32;

/// The function tables of a model plugin.
#[derive(Clone, Copy)]
pub(super) struct ModelTables {
    pub(super) force: &'static ForceTable,
    pub(super) extensions: ModelExtensions,
}

/// Instance of a force model, used by one thread at a time and destroyed when dropped.
pub struct Model {
    pub(crate) calls: GuardedInstance,
    /// Copied from the table to save a load in every tick.
    step: StepFn,
    table: &'static ForceTable,
    pub(crate) extensions: ModelExtensions,
    variant: VariantInfo,
    parameters: &'static [Parameter],
}

impl Model {
    pub(super) fn create(
        tables: ModelTables,
        parameters: &'static [Parameter],
        settings: &[Setting],
    ) -> Result<Self, Refusal> {
        let ModelTables { force: table, extensions } = tables;
        let (Some(create), Some(step)) = (table.create, table.step) else {
            return Err(Refusal::broken(INCOMPLETE));
        };
        let nothing = "the plugin reported success but created no model";
        let mut calls = GuardedInstance::create(create, parameters, settings, nothing)?;
        let of_type = VariantInfo::new(table.info.serves(), table.info.memory());
        let declared = calls.query(extensions.variant.and_then(|table| table.info), of_type);
        let variant = declared.map_or(of_type, |variant| variant.limited_to(&of_type));
        Ok(Self { calls, step, table, extensions, variant, parameters })
    }

    /// Returns the model's declaration, which holds for all settings.
    pub fn info(&self) -> &ModelInfo {
        &self.table.info
    }

    /// Returns the parameter schema of the model.
    pub fn parameters(&self) -> &'static [Parameter] {
        self.parameters
    }

    /// Returns the format error of the last message: too long or not UTF-8; `None` if valid. Not real-time.
    #[must_use]
    pub fn message_problem(&mut self) -> Option<String> {
        self.calls.last_message(self.table.last_message).problem()
    }

    /// Returns the demands that the model serves with the settings it was created with.
    pub fn serves(&self) -> Demand {
        self.variant.serves()
    }

    /// Returns the path dependence of the model with the settings it was created with.
    pub fn memory(&self) -> Memory {
        self.variant.memory()
    }

    /// Returns the number of calls so far that changed the rounding mode, flush-to-zero or traps of the thread; the
    /// host restored them each time. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn float_changes(&self) -> u64 {
        self.calls.float_changes
    }

    /// Prepares the model for the loop: its last opportunity to allocate. Not real-time.
    ///
    /// # Errors
    /// The model's [`Refusal`].
    pub fn prepare(&mut self, config: &LoopConfig) -> Result<(), Refusal> {
        let Some(prepare) = self.table.prepare else { return Ok(()) };
        // SAFETY: a live instance, used by this thread only (`&mut`), pointers valid for the call.
        self.calls.refusable(|instance, message| unsafe { prepare(instance, config, message) })
    }

    /// Computes the output for `input`; `output` is valid only if the result is [`CallStatus::Ok`]. Real-time: bounded by
    /// the model, no allocation.
    #[inline]
    pub fn step(&mut self, input: &Input, output: &mut Output) -> CallStatus {
        let step = self.step;
        // SAFETY: as in `prepare`.
        CallStatus::from_code(self.calls.call(|instance| unsafe { step(instance, input, output) }))
    }

    /// Computes the outputs for `inputs` in order, up to the length of the shorter slice; `outputs` are valid only if the
    /// result is [`CallStatus::Ok`]. Real-time per input.
    pub fn step_batch(&mut self, inputs: &[Input], outputs: &mut [Output]) -> CallStatus {
        let count = inputs.len().min(outputs.len());
        if let Some(step_batch) = self.table.step_batch {
            // SAFETY: as in `prepare`; both slices hold at least `count` structs and do not overlap (`&`, `&mut`).
            return CallStatus::from_code(self.calls.call(|instance| unsafe {
                step_batch(instance, count as u64, inputs.as_ptr(), outputs.as_mut_ptr())
            }));
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
        self.calls.set_parameter(self.table.set_parameter, self.parameters, index, value)
    }

    /// Returns the current value of the parameter at `index`, including values set by a preset; NaN if unknown.
    /// Real-time: bounded, no allocation.
    #[must_use]
    pub fn parameter(&mut self, index: usize) -> f64 {
        self.calls.parameter(self.table.parameter, self.parameters, index)
    }

    /// Clears the history of the model and keeps its parameters. Real-time: bounded, no allocation.
    pub fn reset(&mut self) -> CallStatus {
        let Some(reset) = self.table.reset else { return CallStatus::Ok };
        // SAFETY: as in `prepare`.
        CallStatus::from_code(self.calls.call(|instance| unsafe { reset(instance) }))
    }

    /// Returns the model's message about its last failure; empty if there is none. Not real-time.
    #[must_use]
    pub fn last_message(&mut self) -> String {
        self.calls.last_message(self.table.last_message).for_people()
    }

    /// Returns the reason of a call that failed with `status`, for people: the last message, or the status without a message. Not
    /// real-time.
    #[must_use]
    pub fn reason(&mut self, status: CallStatus) -> String {
        match self.last_message() {
            text if text.is_empty() => format!("no message (call status `{}`)", status.name()),
            text => text,
        }
    }
}

impl Drop for Model {
    fn drop(&mut self) {
        if let Some(destroy) = self.table.destroy {
            // SAFETY: the instance came from `create` of this table and is not used after this.
            self.calls.call(|instance| unsafe { destroy(instance) });
        }
    }
}
