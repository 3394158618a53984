//! A force model a host may call: an instance and its function table.

use super::Setting;
use crate::abi::{
    ActivityTable, CallStatus, CenterlineTable, DetailsTable, ForceTable, Instance, LinearFieldTable,
    Message, ReachTable, VariantTable,
};
use crate::{
    ActivityRegion, CenterlineInfo, Demand, Detail, Input, LinearField, LoopConfig, Memory, ModelInfo,
    Output, Parameter, ParameterValue, Pose, Reach, Refusal, RefusalKind, VariantInfo,
};

type StepFn = unsafe extern "C" fn(Instance, *const Input, *mut Output) -> u32;

/// The function tables of a model plugin.
#[derive(Clone, Copy)]
pub(super) struct ModelTables {
    pub(super) force: &'static ForceTable,
    pub(super) centerline: Option<&'static CenterlineTable>,
    pub(super) variant: Option<&'static VariantTable>,
    pub(super) details: Option<&'static DetailsTable>,
    pub(super) activity: Option<&'static ActivityTable>,
    pub(super) field: Option<&'static LinearFieldTable>,
    pub(super) reach: Option<&'static ReachTable>,
}

/// One instance of a force model. Used by one thread at a time.
pub struct Model {
    instance: Instance,
    /// Copied out of the table: one load less in every tick.
    step: StepFn,
    table: &'static ForceTable,
    extensions: ModelTables,
    variant: VariantInfo,
    parameters: &'static [Parameter],
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
        let values: Vec<ParameterValue> =
            settings.iter().map(|setting| unsafe { setting.to_raw() }).collect();
        let table = tables.force;
        let (Some(create), Some(step)) = (table.create, table.step) else {
            return Err(Refusal::broken("its table has lost a function"));
        };
        let mut message = Message::default();
        let mut instance = std::ptr::null_mut();
        let count = u32::try_from(values.len()).unwrap_or(u32::MAX);
        // SAFETY: all pointers are valid for the call, as the contract of `create` asks.
        let code = unsafe { create(values.as_ptr(), count, &raw mut message, &raw mut instance) };
        refusal_from(code, &message)?;
        if instance.is_null() {
            return Err(Refusal::broken("it reported success but made nothing"));
        }
        let variant = VariantInfo::new(table.info.serves(), table.info.memory());
        let mut model = Self { instance, step, table, extensions: tables, variant, parameters };
        model.variant = model.ask_variant();
        Ok(model)
    }

    /// What the instance says about itself, else what its type says.
    fn ask_variant(&mut self) -> VariantInfo {
        let of_type = self.variant;
        let Some(info) = self.extensions.variant.and_then(|table| table.info) else { return of_type };
        let mut variant = of_type;
        // SAFETY: a live instance used by this thread only (`&mut`), an out pointer valid for the call.
        let code = unsafe { info(self.instance, &raw mut variant) };
        let served = variant.serves().limited_to(of_type.serves());
        if code == CallStatus::Ok as u32 { VariantInfo::new(served, variant.memory()) } else { of_type }
    }

    /// What the model says about itself, whatever its settings.
    #[must_use]
    pub fn info(&self) -> &ModelInfo {
        &self.table.info
    }

    /// What the model can be told.
    #[must_use]
    pub fn parameters(&self) -> &'static [Parameter] {
        self.parameters
    }

    /// Which demands it can serve, with the settings it was created with.
    #[must_use]
    pub fn serves(&self) -> Demand {
        self.variant.serves()
    }

    /// Whether the answer depends on the path, with the settings it was created with.
    #[must_use]
    pub fn memory(&self) -> Memory {
        self.variant.memory()
    }

    /// Last chance for the model to allocate before the loop starts. Not real-time.
    ///
    /// # Errors
    /// The model's [`Refusal`].
    pub fn prepare(&mut self, config: &LoopConfig) -> Result<(), Refusal> {
        let Some(prepare) = self.table.prepare else { return Ok(()) };
        let mut message = Message::default();
        // SAFETY: a live instance, used by this thread only (`&mut`), pointers valid for the call.
        let code = unsafe { prepare(self.instance, config, &raw mut message) };
        refusal_from(code, &message)
    }

    /// One step. Real-time: bounded by the model, no allocation. `output` is only meaningful for [`CallStatus::Ok`].
    #[inline]
    pub fn step(&mut self, input: &Input, output: &mut Output) -> CallStatus {
        // SAFETY: as in `prepare`.
        CallStatus::from_code(unsafe { (self.step)(self.instance, input, output) })
    }

    /// Steps through poses in order; the shorter slice decides how many. Real-time per pose.
    pub fn step_batch(&mut self, inputs: &[Input], outputs: &mut [Output]) -> CallStatus {
        let count = inputs.len().min(outputs.len());
        if let Some(step_batch) = self.table.step_batch {
            // SAFETY: as in `prepare`; both slices hold at least `count` structs and do not overlap (`&`, `&mut`).
            let code =
                unsafe { step_batch(self.instance, count as u64, inputs.as_ptr(), outputs.as_mut_ptr()) };
            return CallStatus::from_code(code);
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
    /// The plugin checks it once more. Real-time: bounded, no allocation.
    pub fn set_parameter(&mut self, index: usize, value: f64) -> CallStatus {
        let Ok(index) = u32::try_from(index) else { return CallStatus::OutOfRange };
        let Some(set_parameter) = self.table.set_parameter else { return CallStatus::Unsupported };
        // SAFETY: as in `prepare`.
        CallStatus::from_code(unsafe { set_parameter(self.instance, index, value) })
    }

    /// The value in force of the parameter at `index`, presets resolved; NaN if unknown. Real-time.
    #[must_use]
    pub fn parameter(&mut self, index: usize) -> f64 {
        let (Some(parameter), Ok(index)) = (self.table.parameter, u32::try_from(index)) else {
            return f64::NAN;
        };
        // SAFETY: as in `prepare`.
        unsafe { parameter(self.instance, index) }
    }

    /// Where the instance can act, with the parameters now in force: everywhere, unless it says otherwise. Real-time:
    /// bounded, no allocation.
    #[must_use]
    pub fn activity(&mut self) -> ActivityRegion {
        let mut region = ActivityRegion::EVERYWHERE;
        let Some(ask) = self.extensions.activity.and_then(|table| table.region) else { return region };
        // SAFETY: as in `prepare`; the out pointer is valid for the call.
        let code = unsafe { ask(self.instance, &raw mut region) };
        if code == CallStatus::Ok as u32 { region } else { ActivityRegion::EVERYWHERE }
    }

    /// Where the instance ends, with the parameters now in force: nowhere, unless it says otherwise. Real-time: bounded, no
    /// allocation.
    #[must_use]
    pub fn reach(&mut self) -> Reach {
        let mut reach = Reach::UNBOUNDED;
        let Some(ask) = self.extensions.reach.and_then(|table| table.reach) else { return reach };
        // SAFETY: as in `prepare`; the out pointer is valid for the call.
        let code = unsafe { ask(self.instance, &raw mut reach) };
        if code == CallStatus::Ok as u32 { reach } else { Reach::UNBOUNDED }
    }

    /// Whether the model can say how its wrench changes around a pose.
    #[must_use]
    pub fn has_linear_field(&self) -> bool {
        self.extensions.field.is_some_and(|table| table.linear_field.is_some())
    }

    /// The field at an input. Not real-time. `field` is only meaningful for [`CallStatus::Ok`].
    pub fn linear_field(&mut self, input: &Input, field: &mut LinearField) -> CallStatus {
        let Some(ask) = self.extensions.field.and_then(|table| table.linear_field) else {
            return CallStatus::Unsupported;
        };
        // SAFETY: as in `prepare`; the out pointer is valid for the call.
        CallStatus::from_code(unsafe { ask(self.instance, input, field) })
    }

    /// Forgets history. Real-time: bounded, no allocation.
    pub fn reset(&mut self) -> CallStatus {
        let Some(reset) = self.table.reset else { return CallStatus::Ok };
        // SAFETY: as in `prepare`.
        CallStatus::from_code(unsafe { reset(self.instance) })
    }

    /// What the model said when a call failed. Not real-time.
    #[must_use]
    pub fn last_message(&mut self) -> String {
        let mut message = Message::default();
        if let Some(last_message) = self.table.last_message {
            // SAFETY: as in `prepare`.
            unsafe { last_message(self.instance, &raw mut message) };
        }
        message.as_str().to_owned()
    }

    /// The model's shape, if it has one. Not real-time: for observers with an instance of their own.
    #[must_use]
    pub fn centerline(&mut self) -> Option<Centerline<'_>> {
        let table = self.extensions.centerline?;
        Some(Centerline { model: self, table })
    }

    /// Which numbers there are about an answer; empty for a model without details.
    #[must_use]
    pub fn details(&self) -> &'static [Detail] {
        match self.extensions.details {
            Some(table) if !table.details.is_null() && table.detail_count > 0 => {
                // SAFETY: a table's list is a static array of `detail_count` details of the checked layout.
                unsafe { std::slice::from_raw_parts(table.details, table.detail_count as usize) }
            }
            _ => &[],
        }
    }

    /// Writes the numbers of the last step, one for each of [`Self::details`]; NaN where there is none.
    /// Real-time: bounded by the model, no allocation.
    pub fn read_details(&mut self, values: &mut [f64]) -> CallStatus {
        let Some(read) = self.extensions.details.and_then(|table| table.values) else {
            return CallStatus::Unsupported;
        };
        let capacity = u32::try_from(values.len()).unwrap_or(u32::MAX);
        // SAFETY: a live instance used by this thread only (`&mut`), room for `capacity` numbers.
        CallStatus::from_code(unsafe { read(self.instance, values.as_mut_ptr(), capacity) })
    }
}

impl Drop for Model {
    fn drop(&mut self) {
        if let Some(destroy) = self.table.destroy {
            // SAFETY: the instance came from `create` of this table and is not used after this.
            unsafe { destroy(self.instance) };
        }
    }
}

/// Turns the code of a refusing call into a [`Refusal`].
pub(super) fn refusal_from(code: u32, message: &Message) -> Result<(), Refusal> {
    if code == 0 {
        return Ok(());
    }
    let reason = match message.as_str() {
        "" => format!("no reason given (code {code})"),
        text => text.to_owned(),
    };
    Err(Refusal { kind: RefusalKind::from_code(code), reason })
}

/// Access to the shape of a model. Not real-time.
pub struct Centerline<'a> {
    model: &'a mut Model,
    table: &'static CenterlineTable,
}

impl Centerline<'_> {
    /// How to draw the body; `None` if the model failed.
    #[must_use]
    pub fn info(&mut self) -> Option<CenterlineInfo> {
        let mut info = CenterlineInfo::default();
        // SAFETY: a live instance used by this thread only, an out pointer valid for the call.
        let code = unsafe { (self.table.info?)(self.model.instance, &raw mut info) };
        (code == CallStatus::Ok as u32).then_some(info)
    }

    /// The centreline at an input, in at most `capacity` points; `None` if the model failed.
    #[must_use]
    pub fn points(&mut self, input: &Input, capacity: usize) -> Option<Vec<Pose>> {
        let mut points = vec![Pose::HOME; capacity];
        let mut count = 0;
        let capacity = u32::try_from(capacity).ok()?;
        // SAFETY: as in `info`; `points` has room for `capacity` poses.
        let code = unsafe {
            (self.table.centerline?)(
                self.model.instance,
                input,
                points.as_mut_ptr(),
                capacity,
                &raw mut count,
            )
        };
        points.truncate(count as usize);
        (code == CallStatus::Ok as u32).then_some(points)
    }
}
