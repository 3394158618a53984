//! The one exported symbol: who made the plugin, for which contract, and where its interfaces are.

use super::Str;
use std::ffi::c_void;

/// First eight bytes of every entry.
pub const MAGIC: [u8; 8] = *b"FLOTOR\r\n";
/// Major version of the contract. Another one is another contract.
pub const ABI_MAJOR: u16 = 1;
/// Minor version of the contract. A later one only adds.
pub const ABI_MINOR: u16 = 0;

/// The draft that was frozen as 1.0 as it stood.
const FROZEN_DRAFT: (u16, u16) = (0, 1);

/// True if a host of this contract loads a plugin made for that one: of the same major version, and no later.
#[must_use]
#[allow(clippy::absurd_extreme_comparisons)] // until there is a 1.1
pub const fn is_spoken(major: u16, minor: u16) -> bool {
    (major == ABI_MAJOR && minor <= ABI_MINOR) || (major == FROZEN_DRAFT.0 && minor == FROZEN_DRAFT.1)
}

/// Ids of the interfaces and extensions a plugin may offer.
pub mod interface_ids {
    /// A force model: [`crate::abi::ForceTable`].
    pub const FORCE: &str = "flotor.force/1";
    /// A device: [`crate::abi::DeviceTable`].
    pub const DEVICE: &str = "flotor.device/1";
    /// Shape of a slender body: [`crate::abi::CenterlineTable`].
    pub const CENTERLINE: &str = "flotor.centerline/1";
    /// What an instance serves and remembers: [`crate::abi::VariantTable`].
    pub const VARIANT: &str = "flotor.variant/1";
    /// Where an instance can act: [`crate::abi::ActivityTable`].
    pub const ACTIVITY: &str = "flotor.activity/1";
    /// A local linear field, for models slower than the loop: [`crate::abi::LinearFieldTable`].
    pub const LINEAR_FIELD: &str = "flotor.linear-field/1";
    /// Where a model ends: [`crate::abi::ReachTable`].
    pub const REACH: &str = "flotor.reach/1";
    /// Numbers about an answer: [`crate::abi::DetailsTable`].
    pub const DETAILS: &str = "flotor.details/1";
    /// Energy account of a plant: [`crate::abi::EnergyLedgerTable`].
    pub const ENERGY_LEDGER: &str = "flotor.energy-ledger/1";
    /// A device that can set the pace: [`crate::abi::DevicePacingTable`].
    pub const DEVICE_PACING: &str = "flotor.device-pacing/1";
    /// Calibration of a device: [`crate::abi::CalibrationTable`].
    pub const CALIBRATION: &str = "flotor.calibration/1";
}

/// What a plugin mainly is.
#[repr(u32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PluginKind {
    /// Offers [`interface_ids::FORCE`].
    Model = 1,
    /// Offers [`interface_ids::DEVICE`].
    Device = 2,
}

impl PluginKind {
    /// Reads a kind from the boundary; `None` for a code that this contract does not know.
    #[must_use]
    pub const fn from_code(code: u32) -> Option<Self> {
        match code {
            1 => Some(Self::Model),
            2 => Some(Self::Device),
            _ => None,
        }
    }

    /// The word in metadata and in lists.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Model => "model",
            Self::Device => "device",
        }
    }
}

/// An opaque instance made and owned by a plugin.
pub type Instance = *mut c_void;

/// Status of one call through a table.
#[repr(u32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CallStatus {
    /// Done.
    Ok = 0,
    /// The plugin panicked, now or earlier; the instance answers nothing any more.
    Panicked = 1,
    /// The call is not allowed in this phase (real-time call on a device that is not active).
    WrongPhase = 2,
    /// A value is out of range.
    OutOfRange = 3,
    /// The plugin does not offer this.
    Unsupported = 4,
}

impl CallStatus {
    /// Reads a status from the boundary; anything unknown counts as a broken plugin.
    #[inline]
    #[must_use]
    pub const fn from_code(code: u32) -> Self {
        match code {
            0 => Self::Ok,
            2 => Self::WrongPhase,
            3 => Self::OutOfRange,
            4 => Self::Unsupported,
            _ => Self::Panicked,
        }
    }
}

/// [`Host::flags`] bit: the plugin has its own Rust runtime and may silence its panic hook.
pub const HOST_QUIET_PANICS: u32 = 1;

/// What a host tells a plugin once, before anything else.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct Host {
    /// Bytes of this struct as the host knows it.
    pub size: u32,
    /// Contract the host speaks.
    pub abi_major: u16,
    /// Contract the host speaks.
    pub abi_minor: u16,
    /// [`HOST_QUIET_PANICS`] or 0.
    pub flags: u32,
    /// Reserved, 0.
    pub reserved: u32,
}

/// Sizes of the data structs as the plugin was compiled: the cheapest check, and the one C plugins have too.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct ContractSizes {
    /// Bytes of [`crate::Input`].
    pub input: u32,
    /// Bytes of [`crate::Output`].
    pub output: u32,
    /// Bytes of [`crate::DeviceState`].
    pub device_state: u32,
    /// Bytes of [`crate::Capabilities`].
    pub capabilities: u32,
    /// Bytes of [`crate::Parameter`].
    pub parameter: u32,
    /// Bytes of [`crate::ParameterValue`].
    pub parameter_value: u32,
}

impl ContractSizes {
    /// The sizes of this build.
    #[must_use]
    #[allow(clippy::cast_possible_truncation)] // a few hundred bytes
    pub const fn of_this_build() -> Self {
        Self {
            input: size_of::<crate::Input>() as u32,
            output: size_of::<crate::Output>() as u32,
            device_state: size_of::<crate::DeviceState>() as u32,
            capabilities: size_of::<crate::Capabilities>() as u32,
            parameter: size_of::<crate::Parameter>() as u32,
            parameter_value: size_of::<crate::ParameterValue>() as u32,
        }
    }
}

/// Lets a host compare layouts field by field; absent (null) in C plugins.
#[repr(C)]
pub struct LayoutProof {
    /// Bytes of this struct.
    pub size: u32,
    /// Reserved, 0.
    pub reserved: u32,
    /// `abi_stable::library::AbiHeader`: says whether the layouts below can be read at all.
    pub abi_stable_header: *const c_void,
    /// Name of a contract type to its `abi_stable::type_layout::TypeLayout`, or null.
    pub layout_of: Option<unsafe extern "C" fn(name: Str) -> *const c_void>,
}

// SAFETY: points at immutable statics of the plugin, which is never unloaded.
unsafe impl Sync for LayoutProof {}

/// The exported static `flotor_entry_<crate>`: plain data, readable before any plugin code runs.
#[repr(C)]
pub struct Entry {
    /// [`MAGIC`].
    pub magic: [u8; 8],
    /// Bytes of this struct as the plugin knows it.
    pub size: u32,
    /// Contract the plugin was built for.
    pub abi_major: u16,
    /// Contract the plugin was built for.
    pub abi_minor: u16,
    /// [`PluginKind`].
    pub kind: u32,
    /// Reserved, 0.
    pub reserved: u32,
    /// Sizes of the data structs in the plugin's build.
    pub sizes: ContractSizes,
    /// Called once after loading. May be null.
    pub init: Option<unsafe extern "C" fn(host: *const Host)>,
    /// Interface id to its table, or null if not offered.
    pub get_interface: Option<unsafe extern "C" fn(id: Str) -> *const c_void>,
    /// Layouts for the host to check, or null.
    pub layout_proof: *const LayoutProof,
}

// SAFETY: an `Entry` is an immutable static; its pointers lead to immutable statics.
unsafe impl Sync for Entry {}

impl Entry {
    /// The entry of a Rust plugin built from this crate.
    #[must_use]
    #[allow(clippy::cast_possible_truncation)] // a hundred bytes
    pub(super) const fn of(
        kind: PluginKind,
        get_interface: unsafe extern "C" fn(id: Str) -> *const c_void,
    ) -> Self {
        Self {
            magic: MAGIC,
            size: size_of::<Entry>() as u32,
            abi_major: ABI_MAJOR,
            abi_minor: ABI_MINOR,
            kind: kind as u32,
            reserved: 0,
            sizes: ContractSizes::of_this_build(),
            init: Some(super::panics::init),
            get_interface: Some(get_interface),
            #[cfg(feature = "layout-proof")]
            layout_proof: &raw const super::proof::PROOF,
            #[cfg(not(feature = "layout-proof"))]
            layout_proof: std::ptr::null(),
        }
    }
}
