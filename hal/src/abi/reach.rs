//! Function table of models with an end: `flotor.reach/1`.

use super::Instance;
use crate::Reach;

/// `flotor.reach/1`: see [`crate::BoundedModel`]. Real-time.
#[repr(C)]
#[derive(Clone, Copy)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct ReachTable {
    /// Bytes of this table as the plugin knows it.
    pub size: u32,
    /// Reserved, 0.
    pub reserved: u32,
    /// Where the instance ends, with the parameters now in force; a [`super::CallStatus`] code.
    pub reach: Option<unsafe extern "C" fn(instance: Instance, out: *mut Reach) -> u32>,
}
