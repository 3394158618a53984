//! Host side of the contract: identifies a plugin file, opens it, compares the struct layouts of both sides, and wraps
//! its tables in types that cannot be called in the wrong order.
//!
//! Order of a load: file -> private copy -> metadata section (ELF, on Windows PE) -> contract version -> `dlopen` (on Windows
//! `LoadLibrary`) -> entry -> kind -> layouts -> function tables -> declarations. No code of the plugin runs before `dlopen`, and a
//! file that fails an earlier check is never passed to `dlopen`: a truncated library would raise SIGBUS there.

#![allow(unsafe_code)] // opens libraries and calls their tables

mod capabilities;
mod declaration;
mod device;
mod error;
mod extension;
mod float_control;
mod guarded;
mod interfaces;
mod library;
mod metadata_file;
mod model;
mod offers;
mod platform;
mod setting;

pub use device::{ActiveDevice, OpenedDevice, Stopper};
pub use error::LoadError;
pub use extension::centerline::Centerline;
pub use extension::independent_stop::Independence;
pub use extension::snapshot::InstanceState;
pub use library::Plugin;
pub use metadata_file::{Metadata, read_metadata};
pub use model::Model;
pub use setting::{Setting, SettingError, nearest};
