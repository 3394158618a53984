//! Extension `flotor.variant/1`: a model whose settings decide what it serves and whether it remembers.
//!
//! One plugin may hold several laws: a closed form that knows nothing of the past, and an exact solution that
//! follows its equilibrium from tick to tick. [`crate::ModelInfo`] speaks for all of them, before any is made; this
//! extension speaks for one instance, once it is.

use crate::{Demand, ForceModel, Memory};

/// What one instance serves and whether it remembers; the same for its whole life. 8 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct VariantInfo {
    serves: Demand,
    memory: u32,
}

impl VariantInfo {
    /// `serves` is at most what [`crate::ModelInfo::serving`] declares for all settings.
    #[must_use]
    pub const fn new(serves: Demand, memory: Memory) -> Self {
        Self { serves, memory: memory as u32 }
    }

    /// Which demands the instance can serve.
    #[must_use]
    pub const fn serves(&self) -> Demand {
        self.serves
    }

    /// Whether its answer depends on the path; anything unknown is taken as path-dependent, the safe reading.
    #[must_use]
    pub const fn memory(&self) -> Memory {
        Memory::from_code(self.memory)
    }
}

/// A force model whose settings decide what it serves and whether it remembers.
pub trait VariantModel: ForceModel {
    /// About this instance, with the settings it was created with. Not real-time.
    fn variant_info(&self) -> VariantInfo;
}
