//! From a [`ForceModel`] to its function table: the trampolines that keep panics inside the plugin.

use super::entry::{CallStatus, Entry, Instance, PluginKind, interface_ids};
use super::{
    ActivityTable, CenterlineTable, DetailsTable, ForceTable, LinearFieldTable, Message, ReachTable, Str,
    VariantTable, panics,
};
use crate::{
    ActivityRegion, BoundedModel, CenterlineInfo, CenterlineModel, DetailedModel, FieldModel, ForceModel,
    Input, LinearField, LocalModel, LoopConfig, Output, ParameterValue, Pose, Reach, RefusalKind, Settings,
    VariantInfo, VariantModel,
};
use std::ffi::c_void;
use std::marker::PhantomData;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// What an [`Instance`] pointer of a model points at.
struct Slot<M> {
    model: M,
    /// A model that panicked is in an unknown state: it is never called again.
    dead: bool,
    message: Message,
}

impl<M> Slot<M> {
    /// Runs `body` with the model; a panic kills the instance and keeps its words.
    #[inline]
    fn guard(&mut self, body: impl FnOnce(&mut M) -> CallStatus) -> u32 {
        if self.dead {
            return CallStatus::Panicked as u32;
        }
        let model = &mut self.model;
        match catch_unwind(AssertUnwindSafe(|| body(model))) {
            Ok(status) => status as u32,
            Err(panic) => {
                self.dead = true;
                panics::record(panic, &mut self.message);
                CallStatus::Panicked as u32
            }
        }
    }
}

/// Reads `count` values a host passed by pointer.
///
/// # Safety
/// `values` points at `count` values that live for `'a`, or `count` is 0.
pub(super) unsafe fn values_from_raw<'a>(values: *const ParameterValue, count: u32) -> &'a [ParameterValue] {
    if values.is_null() || count == 0 {
        return &[];
    }
    // SAFETY: by the contract of this function.
    unsafe { std::slice::from_raw_parts(values, count as usize) }
}

unsafe extern "C" fn create<M: ForceModel>(
    values: *const ParameterValue,
    count: u32,
    message: *mut Message,
    out: *mut Instance,
) -> u32 {
    // SAFETY: the contract of `create`: `values` and `count` describe a slice valid for the call.
    let values = unsafe { values_from_raw(values, count) };
    // SAFETY: the contract of `create`: `message` and `out` are valid for writes for the call.
    let (message, out) = unsafe { (&mut *message, &mut *out) };
    match catch_unwind(|| M::create(&Settings::new(M::PARAMETERS, values))) {
        Ok(Ok(model)) => {
            *out = Box::into_raw(Box::new(Slot { model, dead: false, message: Message::default() })).cast();
            0
        }
        Ok(Err(refusal)) => {
            message.set(&refusal.reason);
            refusal.kind as u32
        }
        Err(panic) => {
            panics::record(panic, message);
            RefusalKind::Broken as u32
        }
    }
}

unsafe extern "C" fn destroy<M>(instance: Instance) {
    // SAFETY: the contract of `destroy`: `instance` came from `create` of this type and is not used again.
    let slot = unsafe { Box::from_raw(instance.cast::<Slot<M>>()) };
    if let Err(panic) = catch_unwind(AssertUnwindSafe(|| drop(slot))) {
        panics::discard(panic);
    }
}

/// The slot behind an instance.
///
/// # Safety
/// `instance` came from `create::<M>`, is alive, and no other reference to it exists during `'a`.
#[inline]
unsafe fn slot<'a, M>(instance: Instance) -> &'a mut Slot<M> {
    // SAFETY: by the contract of this function.
    unsafe { &mut *instance.cast::<Slot<M>>() }
}

unsafe extern "C" fn prepare<M: ForceModel>(
    instance: Instance,
    config: *const LoopConfig,
    message: *mut Message,
) -> u32 {
    // SAFETY: the contract of every table call: a live instance, used by one thread, pointers valid for the call.
    let (slot, config, message) = unsafe { (slot::<M>(instance), &*config, &mut *message) };
    if slot.dead {
        return RefusalKind::Broken as u32;
    }
    match catch_unwind(AssertUnwindSafe(|| slot.model.prepare(config))) {
        Ok(Ok(())) => 0,
        Ok(Err(refusal)) => {
            message.set(&refusal.reason);
            refusal.kind as u32
        }
        Err(panic) => {
            slot.dead = true;
            panics::record(panic, message);
            RefusalKind::Broken as u32
        }
    }
}

unsafe extern "C" fn step<M: ForceModel>(
    instance: Instance,
    input: *const Input,
    output: *mut Output,
) -> u32 {
    // SAFETY: as in `prepare`.
    let (slot, input, output) = unsafe { (slot::<M>(instance), &*input, &mut *output) };
    slot.guard(|model| {
        *output = model.step(input);
        CallStatus::Ok
    })
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
    let (slot, inputs, outputs) = unsafe {
        (
            slot::<M>(instance),
            std::slice::from_raw_parts(inputs, count),
            std::slice::from_raw_parts_mut(outputs, count),
        )
    };
    slot.guard(|model| {
        model.step_batch(inputs, outputs);
        CallStatus::Ok
    })
}

unsafe extern "C" fn set_parameter<M: ForceModel>(instance: Instance, index: u32, value: f64) -> u32 {
    let Some(parameter) = M::PARAMETERS.get(index as usize) else { return CallStatus::OutOfRange as u32 };
    if parameter.check(value).is_err() || parameter.mutability() != crate::Mutability::Live {
        return CallStatus::OutOfRange as u32;
    }
    // SAFETY: as in `prepare`.
    let slot = unsafe { slot::<M>(instance) };
    slot.guard(|model| match model.set_parameter(index as usize, value) {
        Ok(()) => CallStatus::Ok,
        Err(_) => CallStatus::OutOfRange,
    })
}

unsafe extern "C" fn parameter<M: ForceModel>(instance: Instance, index: u32) -> f64 {
    // SAFETY: as in `prepare`.
    let slot = unsafe { slot::<M>(instance) };
    let mut value = f64::NAN;
    let _ = slot.guard(|model| {
        value = model.parameter(index as usize);
        CallStatus::Ok
    });
    value
}

unsafe extern "C" fn reset<M: ForceModel>(instance: Instance) -> u32 {
    // SAFETY: as in `prepare`.
    let slot = unsafe { slot::<M>(instance) };
    slot.guard(|model| {
        model.reset();
        CallStatus::Ok
    })
}

unsafe extern "C" fn last_message<M>(instance: Instance, message: *mut Message) {
    // SAFETY: as in `prepare`.
    let (slot, message) = unsafe { (slot::<M>(instance), &mut *message) };
    *message = slot.message;
}

unsafe extern "C" fn centerline_info<M: CenterlineModel>(
    instance: Instance,
    out: *mut CenterlineInfo,
) -> u32 {
    // SAFETY: as in `prepare`.
    let (slot, out) = unsafe { (slot::<M>(instance), &mut *out) };
    slot.guard(|model| {
        *out = model.centerline_info();
        CallStatus::Ok
    })
}

unsafe extern "C" fn centerline<M: CenterlineModel>(
    instance: Instance,
    input: *const Input,
    points: *mut Pose,
    capacity: u32,
    count: *mut u32,
) -> u32 {
    if capacity == 0 {
        return CallStatus::OutOfRange as u32;
    }
    // SAFETY: as in `prepare`; `points` has room for `capacity` poses.
    let (slot, input, points, count) = unsafe {
        let points = std::slice::from_raw_parts_mut(points, capacity as usize);
        (slot::<M>(instance), &*input, points, &mut *count)
    };
    slot.guard(|model| {
        *count = u32::try_from(model.centerline(input, points)).unwrap_or(capacity).min(capacity);
        CallStatus::Ok
    })
}

unsafe extern "C" fn region<M: LocalModel>(instance: Instance, out: *mut ActivityRegion) -> u32 {
    // SAFETY: as in `prepare`.
    let (slot, out) = unsafe { (slot::<M>(instance), &mut *out) };
    slot.guard(|model| {
        *out = model.activity();
        CallStatus::Ok
    })
}

unsafe extern "C" fn linear_field<M: FieldModel>(
    instance: Instance,
    input: *const Input,
    field: *mut LinearField,
) -> u32 {
    // SAFETY: as in `prepare`.
    let (slot, input, field) = unsafe { (slot::<M>(instance), &*input, &mut *field) };
    slot.guard(|model| {
        *field = model.linear_field(input);
        CallStatus::Ok
    })
}

unsafe extern "C" fn reach<M: BoundedModel>(instance: Instance, out: *mut Reach) -> u32 {
    // SAFETY: as in `prepare`.
    let (slot, out) = unsafe { (slot::<M>(instance), &mut *out) };
    slot.guard(|model| {
        *out = model.reach();
        CallStatus::Ok
    })
}

unsafe extern "C" fn variant_info<M: VariantModel>(instance: Instance, out: *mut VariantInfo) -> u32 {
    // SAFETY: as in `prepare`.
    let (slot, out) = unsafe { (slot::<M>(instance), &mut *out) };
    slot.guard(|model| {
        *out = model.variant_info();
        CallStatus::Ok
    })
}

unsafe extern "C" fn details<M: DetailedModel>(instance: Instance, values: *mut f64, capacity: u32) -> u32 {
    if (capacity as usize) < M::DETAILS.len() {
        return CallStatus::OutOfRange as u32;
    }
    if M::DETAILS.is_empty() {
        return CallStatus::Ok as u32;
    }
    // SAFETY: as in `prepare`; `values` has room for `capacity` numbers, of which there are enough.
    let (slot, values) =
        unsafe { (slot::<M>(instance), std::slice::from_raw_parts_mut(values, M::DETAILS.len())) };
    slot.guard(|model| {
        model.details(values);
        CallStatus::Ok
    })
}

/// The tables of one model type, as constants that are promoted to statics.
struct Tables<M>(PhantomData<M>);

#[allow(clippy::cast_possible_truncation)] // table sizes and parameter counts are small
impl<M: ForceModel> Tables<M> {
    const FORCE: ForceTable = ForceTable {
        size: size_of::<ForceTable>() as u32,
        parameter_count: M::PARAMETERS.len() as u32,
        parameters: M::PARAMETERS.as_ptr(),
        info: M::INFO,
        create: Some(create::<M>),
        destroy: Some(destroy::<M>),
        prepare: Some(prepare::<M>),
        step: Some(step::<M>),
        step_batch: Some(step_batch::<M>),
        set_parameter: Some(set_parameter::<M>),
        parameter: Some(parameter::<M>),
        reset: Some(reset::<M>),
        last_message: Some(last_message::<M>),
    };
}

#[allow(clippy::cast_possible_truncation)] // table sizes are small
impl<M: CenterlineModel> Tables<M> {
    const CENTERLINE: CenterlineTable = CenterlineTable {
        size: size_of::<CenterlineTable>() as u32,
        reserved: 0,
        info: Some(centerline_info::<M>),
        centerline: Some(centerline::<M>),
    };
}

#[allow(clippy::cast_possible_truncation)] // table sizes are small
impl<M: VariantModel> Tables<M> {
    const VARIANT: VariantTable =
        VariantTable { size: size_of::<VariantTable>() as u32, reserved: 0, info: Some(variant_info::<M>) };
}

#[allow(clippy::cast_possible_truncation)] // table sizes are small
impl<M: LocalModel> Tables<M> {
    const ACTIVITY: ActivityTable =
        ActivityTable { size: size_of::<ActivityTable>() as u32, reserved: 0, region: Some(region::<M>) };
}

#[allow(clippy::cast_possible_truncation)] // table sizes are small
impl<M: FieldModel> Tables<M> {
    const LINEAR_FIELD: LinearFieldTable = LinearFieldTable {
        size: size_of::<LinearFieldTable>() as u32,
        reserved: 0,
        linear_field: Some(linear_field::<M>),
    };
}

#[allow(clippy::cast_possible_truncation)] // table sizes are small
impl<M: BoundedModel> Tables<M> {
    const REACH: ReachTable =
        ReachTable { size: size_of::<ReachTable>() as u32, reserved: 0, reach: Some(reach::<M>) };
}

#[allow(clippy::cast_possible_truncation)] // table sizes and counts are small
impl<M: DetailedModel> Tables<M> {
    const DETAILS: DetailsTable = DetailsTable {
        size: size_of::<DetailsTable>() as u32,
        detail_count: M::DETAILS.len() as u32,
        details: M::DETAILS.as_ptr(),
        values: Some(details::<M>),
    };
}

/// The extensions a model offers, as a list of types: `(WithCenterline, (WithVariant, ()))`. What
/// [`crate::export_model!`] makes of its words.
pub trait Extensions<M> {
    /// The table of an extension of this list, null if it is not in it.
    fn table(id: &str) -> *const c_void;
}

/// The model is a [`CenterlineModel`].
pub struct WithCenterline;
/// The model is a [`VariantModel`].
pub struct WithVariant;
/// The model is a [`DetailedModel`].
pub struct WithDetails;
/// The model is a [`LocalModel`].
pub struct WithActivity;
/// The model is a [`FieldModel`].
pub struct WithField;
/// The model is a [`BoundedModel`].
pub struct WithReach;

impl<M> Extensions<M> for () {
    fn table(_: &str) -> *const c_void {
        std::ptr::null()
    }
}

impl<M: CenterlineModel, Rest: Extensions<M>> Extensions<M> for (WithCenterline, Rest) {
    fn table(id: &str) -> *const c_void {
        match id {
            interface_ids::CENTERLINE => std::ptr::from_ref(&Tables::<M>::CENTERLINE).cast(),
            _ => Rest::table(id),
        }
    }
}

impl<M: VariantModel, Rest: Extensions<M>> Extensions<M> for (WithVariant, Rest) {
    fn table(id: &str) -> *const c_void {
        match id {
            interface_ids::VARIANT => std::ptr::from_ref(&Tables::<M>::VARIANT).cast(),
            _ => Rest::table(id),
        }
    }
}

impl<M: DetailedModel, Rest: Extensions<M>> Extensions<M> for (WithDetails, Rest) {
    fn table(id: &str) -> *const c_void {
        match id {
            interface_ids::DETAILS => std::ptr::from_ref(&Tables::<M>::DETAILS).cast(),
            _ => Rest::table(id),
        }
    }
}

impl<M: LocalModel, Rest: Extensions<M>> Extensions<M> for (WithActivity, Rest) {
    fn table(id: &str) -> *const c_void {
        match id {
            interface_ids::ACTIVITY => std::ptr::from_ref(&Tables::<M>::ACTIVITY).cast(),
            _ => Rest::table(id),
        }
    }
}

impl<M: FieldModel, Rest: Extensions<M>> Extensions<M> for (WithField, Rest) {
    fn table(id: &str) -> *const c_void {
        match id {
            interface_ids::LINEAR_FIELD => std::ptr::from_ref(&Tables::<M>::LINEAR_FIELD).cast(),
            _ => Rest::table(id),
        }
    }
}

impl<M: BoundedModel, Rest: Extensions<M>> Extensions<M> for (WithReach, Rest) {
    fn table(id: &str) -> *const c_void {
        match id {
            interface_ids::REACH => std::ptr::from_ref(&Tables::<M>::REACH).cast(),
            _ => Rest::table(id),
        }
    }
}

unsafe extern "C" fn interface<M: ForceModel, E: Extensions<M>>(id: Str) -> *const c_void {
    match id.as_str() {
        interface_ids::FORCE => std::ptr::from_ref(&Tables::<M>::FORCE).cast(),
        extension => E::table(extension),
    }
}

/// The entry of a model plugin without extensions.
#[must_use]
pub const fn model_entry<M: ForceModel>() -> Entry {
    model_entry_with::<M, ()>()
}

/// The entry of a model plugin with extensions; [`crate::export_model!`] makes a static of it.
#[must_use]
pub const fn model_entry_with<M: ForceModel, E: Extensions<M>>() -> Entry {
    Entry::of(PluginKind::Model, interface::<M, E>)
}

/// Makes a [`crate::ForceModel`] a plugin: `export_model!(Spring);`. Extensions the type implements too are listed
/// behind it: `export_model!(Spring, centerline, variant, details);` for a [`crate::CenterlineModel`],
/// [`crate::VariantModel`] and [`crate::DetailedModel`], `activity` for a [`crate::LocalModel`], `field` for a
/// [`crate::FieldModel`], `reach` for a [`crate::BoundedModel`]. One per crate.
#[macro_export]
macro_rules! export_model {
    (@extensions) => { () };
    (@extensions centerline $($rest:ident)*) => {
        ($crate::abi::WithCenterline, $crate::export_model!(@extensions $($rest)*))
    };
    (@extensions variant $($rest:ident)*) => {
        ($crate::abi::WithVariant, $crate::export_model!(@extensions $($rest)*))
    };
    (@extensions activity $($rest:ident)*) => {
        ($crate::abi::WithActivity, $crate::export_model!(@extensions $($rest)*))
    };
    (@extensions field $($rest:ident)*) => {
        ($crate::abi::WithField, $crate::export_model!(@extensions $($rest)*))
    };
    (@extensions reach $($rest:ident)*) => {
        ($crate::abi::WithReach, $crate::export_model!(@extensions $($rest)*))
    };
    (@extensions details $($rest:ident)*) => {
        ($crate::abi::WithDetails, $crate::export_model!(@extensions $($rest)*))
    };
    ($model:ty $(, $extension:ident)* $(,)?) => {
        $crate::export_entry!(
            $crate::abi::model_entry_with::<$model, $crate::export_model!(@extensions $($extension)*)>(),
            $crate::abi::PluginKind::Model,
            <$model as $crate::ForceModel>::INFO.id(),
            <$model as $crate::ForceModel>::INFO.name(),
            <$model as $crate::ForceModel>::INFO.doc()
        );
    };
}
