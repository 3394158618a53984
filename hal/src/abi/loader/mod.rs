//! Host side of the contract: identifies a plugin file, opens it, compares the struct layouts of both sides, and wraps
//! its tables in types that cannot be called in the wrong order.
//!
//! Order of a load: file -> private copy -> metadata section (ELF, on Windows PE) -> contract version -> `dlopen` (on Windows
//! `LoadLibrary`) -> entry -> kind -> layouts -> function tables -> declarations. No code of the plugin runs before `dlopen`, and a
//! file that fails an earlier check is never passed to `dlopen`: a truncated library would raise SIGBUS there.

mod capabilities;
mod check;
mod declaration;
mod device;
mod error;
mod float_control;
mod guarded;
mod interfaces;
mod library;
mod metadata_file;
mod model;
pub(crate) mod platform;
mod schema;
mod setting;

pub(crate) use declaration::static_list;
pub use device::{ActiveDevice, OpenedDevice, Stopper};
pub use error::LoadError;
pub(crate) use interfaces::Offers;
pub use library::Plugin;
pub use metadata_file::{Metadata, read_metadata};
pub use model::Model;
pub use setting::{Setting, SettingError, nearest};
