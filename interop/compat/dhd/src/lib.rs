//! Drop-in `libdrd.so` and `libdhd.so`: the 233 functions of Force Dimension's SDK, served by the devices of a Flotor scene. One
//! file has both names, so that both share one state.
//!
//! Lengths in m, forces in N, torques in N·m, angles in rad; x towards the user, y right, z up. A result of 0 is success, 2 a
//! command that was scaled down, -1 an error, whose number the calling thread may read. Functions that set a force wait for the
//! next tick, which paces the program. Encoders and joints are those of a nominal base. For parts that a Flotor device lacks (motors,
//! a gripper), the functions return the SDK's results for a device without them.
//!
//! Source: the public header of the interface, version 3.17, and a dozen open programs that use it: names, numbers and behaviour
//! only.
#![allow(unsafe_code)] // C entry points; listed in tests/tests/system/architecture.rs
#![allow(non_snake_case)] // the names are another maker's

/// Exports entry points: on a panic the program gets the value in brackets. A pointer is null or leads to as many values as
/// the entry point states.
macro_rules! export {
    ($($(#[$meta:meta])* fn $name:ident($($argument:ident: $type:ty),* $(,)?) -> $result:ty [$fallback:expr] $body:block)*) => {
        $(
            $(#[$meta])*
            #[unsafe(no_mangle)]
            #[allow(clippy::too_many_arguments, clippy::unused_unit)] // as the interface has it
            pub(crate) extern "C" fn $name($($argument: $type),*) -> $result {
                flotor_compat::guarded($fallback, || $body)
            }
        )*
    };
}

mod absent;
mod basic;
mod device;
mod error;
mod expert;
mod force;
mod joints;
mod kept;
mod keyboard;
mod motion;
mod regulation;

use std::ffi::c_char;

/// Returns the marker of a drop-in library.
#[unsafe(no_mangle)]
pub extern "C" fn flotor_dropin() -> *const c_char {
    flotor_compat::MARKER.as_ptr().cast()
}
