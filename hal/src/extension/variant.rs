//! Extension `flotor.variant/1`: a model whose settings decide what it serves and whether it remembers.
//!
//! One plugin may hold several laws: a closed form that knows nothing of the past, and an exact solution that
//! follows its equilibrium from tick to tick. [`crate::ModelInfo`] speaks for all of them, before any is made; this
//! extension speaks for one instance, once it is.

use crate::abi::instance::fill;
use crate::abi::interface::table;
use crate::abi::layout::layout;
#[cfg(feature = "loader")]
use crate::abi::loader::Model;
use crate::abi::{Instance, ModelPlug};
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
    /// About this instance, with the settings it was created with. Not real-time.
    fn variant_info(&self) -> VariantInfo;
}

/// `flotor.variant/1`: see [`VariantModel`]. Not real-time.
#[repr(C)]
#[derive(Clone, Copy)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct VariantTable {
    /// Bytes of this table as the plugin knows it.
    pub size: u32,
    /// Reserved, 0.
    pub reserved: u32,
    /// About an instance, with the settings it was created with; a [`crate::abi::CallStatus`] code.
    pub info: Option<unsafe extern "C" fn(instance: Instance, out: *mut VariantInfo) -> u32>,
}

layout! {
    VariantInfo { serves, memory }
    VariantTable { size, reserved, info }
}
unsafe extern "C" fn info<M: VariantModel>(instance: Instance, out: *mut VariantInfo) -> u32 {
    // SAFETY: the contract of every table call.
    unsafe { fill::<ModelPlug<M>, _>(instance, out, |model| Ok(model.variant_info())) }
}

table!(VariantTable: "flotor.variant/1", M: [VariantModel] {
    reserved: 0,
    info: Some(info::<M>),
});

#[cfg(feature = "loader")]
impl Model {
    /// What the instance says about itself, else what its type says.
    pub(crate) fn ask_variant(&mut self) -> VariantInfo {
        let of_type = self.variant;
        let ask = self.extensions.variant.and_then(|table| table.info);
        let told = |variant: VariantInfo| {
            VariantInfo::new(variant.serves().limited_to(of_type.serves()), variant.memory())
        };
        self.asked(ask, of_type).map_or(of_type, told)
    }
}
