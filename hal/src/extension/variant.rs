//! Extension `flotor.variant/1`: demands and memory of a model that depend on its settings.
//!
//! One plugin may contain several laws: a stateless closed form, and an exact solution that tracks its equilibrium from tick to
//! tick. [`crate::ModelInfo`] covers all of them, before creation; this extension covers one instance.

use crate::abi::instance::fill;
use crate::abi::interface::table;
use crate::abi::layout::layout;
use crate::abi::{Instance, ModelAdapter};
use crate::{Demand, ForceModel, Memory};

/// Demands that one instance serves, and its path dependence; constant over the life of the instance. 8 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct VariantInfo {
    serves: Demand,
    memory: u32,
}

impl VariantInfo {
    /// Declares demands and path dependence; a host ignores demands beyond those of [`crate::ModelInfo::serving`].
    #[must_use]
    pub const fn new(serves: Demand, memory: Memory) -> Self {
        Self { serves, memory: memory as u32 }
    }

    /// Returns the demands that the instance can serve.
    pub const fn serves(&self) -> Demand {
        self.serves
    }

    /// Returns the path dependence of the wrench; an unknown code counts as path-dependent, the safe choice.
    pub const fn memory(&self) -> Memory {
        Memory::from_code(self.memory)
    }

    /// Returns this variant, with its demands limited to those of `most`.
    #[must_use]
    pub const fn limited_to(&self, most: &Self) -> Self {
        Self::new(self.serves().limited_to(most.serves()), self.memory())
    }
}

/// Force model whose demands and memory depend on its settings.
///
/// ```
/// # use flotor_hal::*;
/// # struct Foam { depth_m: f64, look: Shape }
/// # impl ForceModel for Foam {
/// #     const INFO: ModelInfo = ModelInfo::new("foam", "Foam", "A soft ball");
/// #     fn create(_: &Settings<'_>) -> Result<Self, Refusal> {
/// #         Ok(Self { depth_m: 0.0, look: Shape::default() })
/// #     }
/// #     fn step(&mut self, _: &Input) -> Output { Wrench::ZERO.into() }
/// # }
/// /// [`ForceModel::INFO`] holds for all settings; this instance remembers nothing: `export_model!(Foam, variant)`.
/// impl VariantModel for Foam {
///     fn variant_info(&self) -> VariantInfo {
///         VariantInfo::new(Self::INFO.serves(), Memory::Stateless)
///     }
/// }
/// # let foam = Foam { depth_m: 0.0, look: Shape::default() };
/// assert_eq!(foam.variant_info().memory(), Memory::Stateless);
/// ```
pub trait VariantModel: ForceModel {
    /// Returns demands and memory of this instance, with the settings it was created with. Not real-time.
    fn variant_info(&self) -> VariantInfo;
}

/// Function table `flotor.variant/1`: see [`VariantModel`]. Not real-time.
#[repr(C)]
#[derive(Clone, Copy)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct VariantTable {
    /// Size of this table in the plugin's build, bytes.
    pub size: u32,
    /// Reserved, 0.
    pub reserved: u32,
    /// Writes demands and memory of an instance, with the settings it was created with; returns a [`crate::abi::CallStatus`] code.
    pub info: Option<unsafe extern "C" fn(instance: Instance, out: *mut VariantInfo) -> u32>,
}

layout! {
    VariantInfo { serves, memory }
    VariantTable { size, reserved, info }
}
unsafe extern "C" fn info<M: VariantModel>(instance: Instance, out: *mut VariantInfo) -> u32 {
    // SAFETY: the contract of every table call.
    unsafe { fill::<ModelAdapter<M>, _>(instance, out, |model| Ok(model.variant_info())) }
}

table!(VariantTable: "flotor.variant/1", M: [VariantModel] {
    reserved: 0,
    info: Some(info::<M>),
});
