//! Drop-in `libdrd.so` and `libdhd.so`: the 233 functions of Force Dimension's SDK, served by the devices of a Flotor scene. One
//! file has both names, so that both share one state.
//!
//! Lengths in m, forces in N, torques in N·m, angles in rad; x towards the user, y right, z up. A result of 0 is success, 2 a
//! command that was scaled down, -1 an error, whose number the calling thread may read. Functions that set a force wait for the
//! next tick, which paces the program. Encoders and joints are those of a nominal base. For parts that a Flotor device lacks (motors,
//! fingers of a gripper), the functions return the SDK's results for a device without them.
//!
//! Source: the public header of the interface, version 3.17, and a dozen open programs that use it: names, numbers and behaviour
//! only.
#![allow(unsafe_code)] // C entry points; listed in tests/tests/system/architecture.rs
#![allow(non_snake_case)] // the names are another maker's

mod absent;
mod basic;
mod device;
mod error;
mod expert;
mod force;
mod gripper;
mod joints;
mod kept;
mod keyboard;
mod motion;
mod regulation;
mod regulator;

use flotor_compat::{MARKER, export};
use std::ffi::c_char;

export! {
    /// Returns the marker of a drop-in library.
    fn flotor_dropin() -> *const c_char [MARKER.as_ptr().cast()] { MARKER.as_ptr().cast() }
}
