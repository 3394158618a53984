//! The binary contract: `#[repr(C)]` tables, one exported entry, text in a section of the file.
//!
//! Plugin authors never come here: they implement [`crate::ForceModel`] or [`crate::Device`] and write one
//! `export_*!` line. C authors include `include/flotor.h`, which is generated from these files.
//!
//! Rules, for both sides:
//! - Data structs are frozen per interface revision; function tables only grow at their end and carry `size`.
//! - Nothing unwinds across the boundary: the trampolines here catch panics.
//! - Whoever allocates frees. Text is borrowed: for ever in info structs, for the call in arguments.
//! - One instance is used by one thread at a time, except `safe_stop`, which may come from any thread.
//! - Unknown interface ids get null; null function pointers mean "not offered".
//! - Libraries are never unloaded.
//!
//! This module and its children are the only place of the crate with `unsafe` code.
#![allow(unsafe_code)]

mod calibration;
mod device;
mod entry;
mod export_device;
mod export_model;
mod field;
mod force;
pub mod metadata;
mod pacing;
mod panics;
#[cfg(feature = "layout-proof")]
pub mod proof;
mod reach;
mod text;

#[cfg(feature = "loader")]
pub mod loader;

pub use calibration::CalibrationTable;
pub use device::{DeviceTable, EnergyLedgerTable};
pub use entry::{
    ABI_MAJOR, ABI_MINOR, CallStatus, ContractSizes, Entry, HOST_QUIET_PANICS, Host, Instance, LayoutProof,
    MAGIC, PluginKind, interface_ids, is_spoken,
};
pub use export_device::device_entry;
pub use export_model::{
    Extensions, WithActivity, WithCenterline, WithDetails, WithField, WithReach, WithVariant, model_entry,
    model_entry_with,
};
pub use field::LinearFieldTable;
pub use force::{ActivityTable, CenterlineTable, DetailsTable, ForceTable, VariantTable};
pub use pacing::DevicePacingTable;
pub use reach::ReachTable;
pub use text::{MESSAGE_BYTES, Message, Str, StrList};
