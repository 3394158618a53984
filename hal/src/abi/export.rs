//! Entries of plugins in Rust, and the macros that export them.

use super::interface::{Extensions, find};
use super::layout_table::LAYOUTS;
#[cfg(feature = "layout-proof")]
use super::layout_table::proof::PROOF;
use super::{ABI_CANDIDATE, ABI_MAJOR, ABI_MINOR, Entry, MAGIC, PluginKind, Str, device, model, panics};
use crate::{Device, ForceModel};
use std::ffi::c_void;

/// Returns the entry of a plugin built with this crate.
#[allow(clippy::cast_possible_truncation)] // a hundred bytes, some hundred rows
const fn entry(kind: PluginKind, get_interface: unsafe extern "C" fn(id: Str) -> *const c_void) -> Entry {
    Entry {
        magic: MAGIC,
        size: size_of::<Entry>() as u32,
        abi_major: ABI_MAJOR,
        abi_minor: ABI_MINOR,
        kind: kind as u32,
        abi_candidate: ABI_CANDIDATE,
        layouts: LAYOUTS.as_ptr(),
        layout_count: LAYOUTS.len() as u32,
        reserved: 0,
        init: Some(panics::init),
        get_interface: Some(get_interface),
        #[cfg(feature = "layout-proof")]
        layout_proof: &raw const PROOF,
        #[cfg(not(feature = "layout-proof"))]
        layout_proof: std::ptr::null(),
    }
}

unsafe extern "C" fn model_interface<M: ForceModel, E: Extensions<M>>(id: Str) -> *const c_void {
    find::<M, E>(&model::offer::<M>(), id)
}

/// Returns the entry of a model plugin without extensions. In Rust, only this function, [`device_entry`] and
/// their `_with` forms construct an entry, so that every entry of a safe program fulfils the contract:
///
/// ```compile_fail,E0451
/// use flotor_hal::abi::{Entry, MAGIC};
/// let forged = Entry { magic: MAGIC, kind: 1, ..unreachable!() };
/// ```
pub const fn model_entry<M: ForceModel>() -> Entry {
    model_entry_with::<M, ()>()
}

/// Returns the entry of a model plugin with the extensions `E`; used by [`crate::export_model!`].
pub const fn model_entry_with<M: ForceModel, E: Extensions<M>>() -> Entry {
    entry(PluginKind::Model, model_interface::<M, E>)
}

/// Exports a [`crate::ForceModel`] as a plugin: `export_model!(Spring);`. The extensions implemented by the type are
/// listed after the type, by their module names in [`crate::extension`]:
/// `export_model!(Spring, centerline, variant, details);`. One call per crate.
#[macro_export]
macro_rules! export_model {
    ($model:ty $(, $extension:ident)* $(,)?) => {
        $crate::export_plugin!($model, ForceModel, Model, model_entry_with $(, $extension)*);
    };
}

unsafe extern "C" fn device_interface<D: Device, E: Extensions<D>>(id: Str) -> *const c_void {
    find::<D, E>(&device::offer::<D>(), id)
}

/// Returns the entry of a device plugin without extensions.
pub const fn device_entry<D: Device>() -> Entry {
    device_entry_with::<D, ()>()
}

/// Returns the entry of a device plugin with the extensions `E`; used by [`crate::export_device!`].
pub const fn device_entry_with<D: Device, E: Extensions<D>>() -> Entry {
    entry(PluginKind::Device, device_interface::<D, E>)
}

/// Exports a [`crate::Device`] as a plugin: `export_device!(SpaceMouse);`. The extensions implemented by the type are
/// listed after the type, by their module names in [`crate::extension`]:
/// `export_device!(SimulatedFlotor, calibration, pacing);`. One call per crate.
#[macro_export]
macro_rules! export_device {
    ($device:ty $(, $extension:ident)* $(,)?) => {
        $crate::export_plugin!($device, Device, Device, device_entry_with $(, $extension)*);
    };
}
