//! The binary contract: `#[repr(C)]` tables, one exported entry, metadata text in a section of the file.
//!
//! Plugin authors do not need this module: they implement [`crate::ForceModel`] or [`crate::Device`] and write one
//! `export_*!` line. C authors include `include/flotor.h`, which is generated from these files.
//!
//! Rules, for both sides:
//! - Data structs are closed per interface revision; function tables only grow at their end and carry `size`.
//! - Nothing unwinds across the boundary: the trampolines here catch panics.
//! - The side that allocates memory frees it. Text is borrowed: for ever in info structs, for the call in arguments.
//! - Memory that a host passes by pointer is initialised, also for out parameters.
//! - One instance is used by one thread at a time, except `safe_stop`, which may come from any thread.
//! - `get_interface`, `create` and `open` may be called by several threads at once: plugins must synchronise the data
//!   that their instances share.
//! - Unknown interface ids get null; null function pointers mean "not offered".
//! - Libraries are never unloaded.
//!
//! This module and [`crate::extension`] are the only places of the crate with `unsafe` code.
#![allow(unsafe_code)]

mod agreement;
mod device;
mod entry;
mod export;
pub(crate) mod instance;
pub(crate) mod interface;
pub(crate) mod layout;
mod layout_table;
pub mod metadata;
mod model;
mod panics;
mod schema;
mod text;

pub use agreement::Proof;
pub use device::{CycleCode, DeviceTable};
pub(crate) use device::{DeviceAdapter, not_opened};
pub use entry::{
    ABI_CANDIDATE, ABI_MAJOR, ABI_MINOR, CONTRACT, CallStatus, Entry, HOST_QUIET_PANICS, Host, Instance,
    LayoutProof, MAGIC, PluginKind,
};
pub use export::{device_entry, device_entry_with, model_entry, model_entry_with};
pub use interface::{Extensions, Interface, Table};
pub use layout::FieldLayout;
pub use layout_table::LAYOUTS;
pub use model::ForceTable;
pub(crate) use model::ModelAdapter;
pub use schema::check_schema;
pub use text::{Choices, MESSAGE_BYTES, Message, Str};

/// The contract for C: the text of `include/flotor.h`.
pub const C_HEADER: &str = include_str!("../../include/flotor.h");
