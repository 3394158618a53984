//! Function table of slow models: `flotor.linear-field/1`.

use super::Instance;
use crate::{Input, LinearField};

/// `flotor.linear-field/1`: see [`crate::FieldModel`].
#[repr(C)]
#[derive(Clone, Copy)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct LinearFieldTable {
    /// Bytes of this table as the plugin knows it.
    pub size: u32,
    /// Reserved, 0.
    pub reserved: u32,
    /// The field at an input, the time since the call before having passed; a [`super::CallStatus`] code. Not
    /// real-time, but bounded.
    pub linear_field:
        Option<unsafe extern "C" fn(instance: Instance, input: *const Input, field: *mut LinearField) -> u32>,
}
