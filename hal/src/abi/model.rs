//! `flotor.force/1`: function table of a force model, and its implementation for a [`ForceModel`].

use super::Message;
use super::entry::{CallStatus, Instance};
use super::instance::{self, PluginAdapter, call, refusable};
use super::interface::table;
use super::layout::layout;
use crate::{ForceModel, Input, LoopConfig, ModelInfo, Output, Parameter, ParameterValue, Refusal, Settings};
use std::marker::PhantomData;

/// Function table `flotor.force/1`. Statuses are [`super::CallStatus`] codes; `create` and `prepare` return 0, or a
/// [`crate::RefusalKind`] with the reason in the message.
#[repr(C)]
#[derive(Clone, Copy)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct ForceTable {
    /// Size of this table in the plugin's build, bytes.
    pub size: u32,
    /// Number of parameters.
    pub parameter_count: u32,
    /// Parameter schema, constant.
    pub parameters: *const Parameter,
    /// Declaration of the model: id, texts, and the demands and path dependence that cover all settings; constant.
    pub info: ModelInfo,
    /// Creates an instance from explicitly set values and writes the instance to `out`. Not real-time.
    pub create: Option<
        unsafe extern "C" fn(
            values: *const ParameterValue,
            count: u32,
            message: *mut Message,
            out: *mut Instance,
        ) -> u32,
    >,
    /// Frees an instance. Not real-time.
    pub destroy: Option<unsafe extern "C" fn(instance: Instance)>,
    /// Prepares an instance for the loop: its last opportunity to allocate. Not real-time. May be null.
    pub prepare: Option<
        unsafe extern "C" fn(instance: Instance, config: *const LoopConfig, message: *mut Message) -> u32,
    >,
    /// Computes the output (wrench, energy, status) for an input. Real-time: no allocation, lock, system call or
    /// unwinding.
    pub step:
        Option<unsafe extern "C" fn(instance: Instance, input: *const Input, output: *mut Output) -> u32>,
    /// Computes the outputs for `count` inputs in order. Real-time per input. May be null: the host then calls `step`.
    pub step_batch: Option<
        unsafe extern "C" fn(
            instance: Instance,
            count: u64,
            inputs: *const Input,
            outputs: *mut Output,
        ) -> u32,
    >,
    /// Changes the live parameter at `index` at a tick boundary (for a choice, `value` is its index). Real-time. May be
    /// null.
    pub set_parameter: Option<unsafe extern "C" fn(instance: Instance, index: u32, value: f64) -> u32>,
    /// Returns the current value of the parameter at `index`; NaN if unknown. Real-time. May be null.
    pub parameter: Option<unsafe extern "C" fn(instance: Instance, index: u32) -> f64>,
    /// Clears the history, keeps the parameters. Real-time. May be null.
    pub reset: Option<unsafe extern "C" fn(instance: Instance) -> u32>,
    /// Writes the message of the last failure to `message`; empty if there is none. Not real-time. May be null.
    pub last_message: Option<unsafe extern "C" fn(instance: Instance, message: *mut Message)>,
}

layout! {
    ForceTable {
        size, parameter_count, parameters, info, create, destroy, prepare, step, step_batch, set_parameter, parameter,
        reset, last_message,
    }
}
/// Adapter of a [`ForceModel`] for the function tables.
pub(crate) struct ModelAdapter<M>(PhantomData<M>);

impl<M: ForceModel> PluginAdapter for ModelAdapter<M> {
    type State = M;
    type Shared = ();
    const PARAMETERS: &'static [Parameter] = M::PARAMETERS;

    fn make(settings: &Settings<'_>) -> Result<(M, ()), Refusal> {
        Ok((M::create(settings)?, ()))
    }
}

unsafe extern "C" fn prepare<M: ForceModel>(
    instance: Instance,
    config: *const LoopConfig,
    message: *mut Message,
) -> u32 {
    // SAFETY: the contract of every table call: a live instance, used by one thread, and pointers to initialised
    // values that are the callee's for the call.
    unsafe { refusable::<ModelAdapter<M>>(instance, message, |model| model.prepare(&*config)) }
}

unsafe extern "C" fn step<M: ForceModel>(
    instance: Instance,
    input: *const Input,
    output: *mut Output,
) -> u32 {
    // SAFETY: as in `prepare`.
    unsafe {
        call::<ModelAdapter<M>>(instance, |model| {
            output.write(model.step(&*input));
            Ok(())
        })
    }
}

unsafe extern "C" fn step_batch<M: ForceModel>(
    instance: Instance,
    count: u64,
    inputs: *const Input,
    outputs: *mut Output,
) -> u32 {
    if count == 0 {
        return CallStatus::Ok as u32;
    }
    let Ok(count) = usize::try_from(count) else { return CallStatus::Unsupported as u32 };
    // SAFETY: as in `prepare`; `inputs` and `outputs` point at `count` structs each, which do not overlap.
    let (inputs, outputs) = unsafe {
        (std::slice::from_raw_parts(inputs, count), std::slice::from_raw_parts_mut(outputs, count))
    };
    // SAFETY: as in `prepare`.
    unsafe {
        call::<ModelAdapter<M>>(instance, |model| {
            model.step_batch(inputs, outputs);
            Ok(())
        })
    }
}

unsafe extern "C" fn set_parameter<M: ForceModel>(instance: Instance, index: u32, value: f64) -> u32 {
    let set = |model: &mut M| model.set_parameter(index as usize, value).map_err(|_| CallStatus::OutOfRange);
    // SAFETY: as in `prepare`.
    unsafe { instance::set_parameter::<ModelAdapter<M>>(instance, index, value, set) }
}

unsafe extern "C" fn parameter<M: ForceModel>(instance: Instance, index: u32) -> f64 {
    // SAFETY: as in `prepare`.
    unsafe { instance::parameter::<ModelAdapter<M>>(instance, |model| model.parameter(index as usize)) }
}

unsafe extern "C" fn reset<M: ForceModel>(instance: Instance) -> u32 {
    // SAFETY: as in `prepare`.
    unsafe {
        call::<ModelAdapter<M>>(instance, |model| {
            model.reset();
            Ok(())
        })
    }
}

table!(ForceTable: "flotor.force/1", M: [ForceModel] {
    parameter_count: M::PARAMETERS.len() as u32,
    parameters: M::PARAMETERS.as_ptr(),
    info: M::INFO,
    create: Some(instance::create::<ModelAdapter<M>>),
    destroy: Some(instance::destroy::<ModelAdapter<M>>),
    prepare: Some(prepare::<M>),
    step: Some(step::<M>),
    step_batch: Some(step_batch::<M>),
    set_parameter: Some(set_parameter::<M>),
    parameter: Some(parameter::<M>),
    reset: Some(reset::<M>),
    last_message: Some(instance::last_message::<ModelAdapter<M>>),
});
