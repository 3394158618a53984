//! Function tables of force models: `flotor.force/1` and its extensions `flotor.centerline/1`, `flotor.variant/1`,
//! `flotor.details/1` and `flotor.activity/1`.

use super::{Instance, Message};
use crate::{
    ActivityRegion, CenterlineInfo, Detail, Input, LoopConfig, ModelInfo, Output, Parameter, ParameterValue,
    Pose, VariantInfo,
};

/// `flotor.force/1`. Statuses are [`super::CallStatus`] codes; `create` and `prepare` return 0 or a
/// [`crate::RefusalKind`] and say why in the message.
#[repr(C)]
#[derive(Clone, Copy)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct ForceTable {
    /// Bytes of this table as the plugin knows it.
    pub size: u32,
    /// Number of parameters.
    pub parameter_count: u32,
    /// The schema, constant.
    pub parameters: *const Parameter,
    /// What the model says about itself.
    pub info: ModelInfo,
    /// Makes an instance from explicitly set values. Not real-time.
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
    /// Last chance to allocate. Not real-time. May be null.
    pub prepare: Option<
        unsafe extern "C" fn(instance: Instance, config: *const LoopConfig, message: *mut Message) -> u32,
    >,
    /// The wrench for a pose. Real-time: no allocation, lock, system call or unwinding.
    pub step:
        Option<unsafe extern "C" fn(instance: Instance, input: *const Input, output: *mut Output) -> u32>,
    /// `count` poses in order. Real-time per pose. May be null: the host then calls `step`.
    pub step_batch: Option<
        unsafe extern "C" fn(
            instance: Instance,
            count: u64,
            inputs: *const Input,
            outputs: *mut Output,
        ) -> u32,
    >,
    /// Changes a live parameter at a tick boundary. Real-time. May be null.
    pub set_parameter: Option<unsafe extern "C" fn(instance: Instance, index: u32, value: f64) -> u32>,
    /// The value in force. Real-time. May be null.
    pub parameter: Option<unsafe extern "C" fn(instance: Instance, index: u32) -> f64>,
    /// Forgets history. Real-time. May be null.
    pub reset: Option<unsafe extern "C" fn(instance: Instance) -> u32>,
    /// Why the last call failed. Not real-time. May be null.
    pub last_message: Option<unsafe extern "C" fn(instance: Instance, message: *mut Message)>,
}

// SAFETY: an immutable static table; its pointers lead to immutable statics and code.
unsafe impl Sync for ForceTable {}
// SAFETY: as for `Sync`.
unsafe impl Send for ForceTable {}

/// `flotor.centerline/1`: see [`crate::CenterlineModel`]. Not real-time.
#[repr(C)]
#[derive(Clone, Copy)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct CenterlineTable {
    /// Bytes of this table as the plugin knows it.
    pub size: u32,
    /// Reserved, 0.
    pub reserved: u32,
    /// How to draw the body.
    pub info: Option<unsafe extern "C" fn(instance: Instance, out: *mut CenterlineInfo) -> u32>,
    /// Fills up to `capacity` points; how many are valid goes to `count`.
    pub centerline: Option<
        unsafe extern "C" fn(
            instance: Instance,
            input: *const Input,
            points: *mut Pose,
            capacity: u32,
            count: *mut u32,
        ) -> u32,
    >,
}

/// `flotor.activity/1`: see [`crate::LocalModel`]. Real-time.
#[repr(C)]
#[derive(Clone, Copy)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct ActivityTable {
    /// Bytes of this table as the plugin knows it.
    pub size: u32,
    /// Reserved, 0.
    pub reserved: u32,
    /// Where the instance can act, with the parameters now in force.
    pub region: Option<unsafe extern "C" fn(instance: Instance, out: *mut ActivityRegion) -> u32>,
}

/// `flotor.variant/1`: see [`crate::VariantModel`]. Not real-time.
#[repr(C)]
#[derive(Clone, Copy)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct VariantTable {
    /// Bytes of this table as the plugin knows it.
    pub size: u32,
    /// Reserved, 0.
    pub reserved: u32,
    /// About an instance, with the settings it was created with.
    pub info: Option<unsafe extern "C" fn(instance: Instance, out: *mut VariantInfo) -> u32>,
}

/// `flotor.details/1`: see [`crate::DetailedModel`].
#[repr(C)]
#[derive(Clone, Copy)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct DetailsTable {
    /// Bytes of this table as the plugin knows it.
    pub size: u32,
    /// Number of details.
    pub detail_count: u32,
    /// What there is to know, constant.
    pub details: *const Detail,
    /// Writes the numbers of the last step into `capacity` places, `detail_count` at most; NaN where there is none.
    /// Real-time: no allocation, lock, system call or unwinding.
    pub values: Option<unsafe extern "C" fn(instance: Instance, values: *mut f64, capacity: u32) -> u32>,
}

// SAFETY: an immutable static table; its pointers lead to immutable statics and code.
unsafe impl Sync for DetailsTable {}
// SAFETY: as for `Sync`.
unsafe impl Send for DetailsTable {}
