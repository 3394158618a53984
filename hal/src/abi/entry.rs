//! Entry of a plugin, the one exported symbol: kind, contract version, layouts and interface lookup.

use super::layout::layout;
use super::{FieldLayout, Str};
use std::ffi::c_void;

/// First eight bytes of every entry.
pub const MAGIC: [u8; 8] = *b"FLOTOR\r\n";
/// Version of the contract: 1.0, release candidate. A plugin for another version, or for an earlier candidate with
/// different layouts, must be rebuilt.
pub const CONTRACT: &str = "1.0-rc";
/// Major version of the contract; contracts of different major versions are incompatible.
pub const ABI_MAJOR: u16 = 1;
/// Minor version of the contract; a later minor version only adds to the contract.
pub const ABI_MINOR: u16 = 0;
/// 1 for a release candidate of this contract version, 0 for the release.
pub const ABI_CANDIDATE: u32 = 1;

/// Kind of a plugin, by its main interface.
#[repr(u32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PluginKind {
    /// Force model: offers `flotor.force/1`.
    Model = 1,
    /// Device: offers `flotor.device/1`.
    Device = 2,
}

impl PluginKind {
    /// Converts a plugin kind code of the ABI; `None` for an unknown code.
    #[must_use]
    pub const fn from_code(code: u32) -> Option<Self> {
        match code {
            1 => Some(Self::Model),
            2 => Some(Self::Device),
            _ => None,
        }
    }

    /// Returns the name of the kind in metadata and lists: `model` or `device`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Model => "model",
            Self::Device => "device",
        }
    }
}

/// Opaque pointer to an instance of a model or device, created and owned by a plugin.
pub type Instance = *mut c_void;

/// Status returned by a table function.
#[repr(u32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CallStatus {
    /// Success.
    Ok = 0,
    /// The plugin panicked, now or earlier; the instance is disabled.
    Panicked = 1,
    /// The call is not allowed in the current phase of the device (such as `capabilities` of an active device).
    WrongPhase = 2,
    /// A value, an index or a capacity is out of range, or the parameter cannot be changed now.
    OutOfRange = 3,
    /// The plugin does not offer this function.
    Unsupported = 4,
}

impl CallStatus {
    /// Converts a call status code of the ABI; an unknown code counts as [`Self::Panicked`].
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

    /// Returns the name of the status in messages: `ok`, `panicked`, `wrong phase`, `out of range` or `unsupported`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Panicked => "panicked",
            Self::WrongPhase => "wrong phase",
            Self::OutOfRange => "out of range",
            Self::Unsupported => "unsupported",
        }
    }
}

/// [`Host::flags`] bit: the plugin has its own Rust runtime and may replace its panic hook with a silent hook.
pub const HOST_QUIET_PANICS: u32 = 1;

/// Host information that a plugin receives once, before any other call.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct Host {
    /// Size of this struct in the host's build, bytes.
    pub size: u32,
    /// Major version of the host's contract.
    pub abi_major: u16,
    /// Minor version of the host's contract.
    pub abi_minor: u16,
    /// [`HOST_QUIET_PANICS`] or 0.
    pub flags: u32,
    /// Reserved, 0.
    pub reserved: u32,
}

layout! {
    Host { size, abi_major, abi_minor, flags, reserved }
    FieldLayout { name, offset, size }
}

/// Second, independent check of the layouts, by abi_stable; null in C plugins and in builds without the feature
/// `layout-proof`.
#[repr(C)]
pub struct LayoutProof {
    /// Size of this struct in the plugin's build, bytes.
    pub(crate) size: u32,
    /// Reserved, 0.
    pub(crate) reserved: u32,
    /// `abi_stable::library::AbiHeader`; the layouts below are readable only if the header is valid.
    pub(crate) abi_stable_header: *const c_void,
    /// Returns the `abi_stable::type_layout::TypeLayout` of a contract type by name, or null.
    pub(crate) layout_of: Option<unsafe extern "C" fn(name: Str) -> *const c_void>,
}

// SAFETY: points at immutable statics of the plugin, which is never unloaded.
unsafe impl Sync for LayoutProof {}

/// The exported static `flotor_entry_<crate>`: plain data, readable before any plugin code runs.
#[repr(C)]
#[must_use]
pub struct Entry {
    /// [`MAGIC`].
    pub(crate) magic: [u8; 8],
    /// Size of this struct in the plugin's build, bytes.
    pub(crate) size: u32,
    /// Major version of the plugin's contract.
    pub(crate) abi_major: u16,
    /// Minor version of the plugin's contract.
    pub(crate) abi_minor: u16,
    /// Code of a [`PluginKind`].
    pub(crate) kind: u32,
    /// [`ABI_CANDIDATE`] of the contract the plugin was built for.
    pub(crate) abi_candidate: u32,
    /// The layout table of the plugin's build.
    pub(crate) layouts: *const FieldLayout,
    /// Number of rows of `layouts`.
    pub(crate) layout_count: u32,
    /// Reserved, 0.
    pub(crate) reserved: u32,
    /// Called once after loading, before any other function. May be null.
    pub(crate) init: Option<unsafe extern "C" fn(host: *const Host)>,
    /// Returns the table of an interface id, or null if not offered.
    pub(crate) get_interface: Option<unsafe extern "C" fn(id: Str) -> *const c_void>,
    /// Second check of the layouts, or null.
    pub(crate) layout_proof: *const LayoutProof,
}

// SAFETY: an `Entry` is an immutable static; its pointers lead to immutable statics.
unsafe impl Sync for Entry {}

/// The entry as a host reads it.
impl Entry {
    /// Returns the entry at an address; `None` if null, misaligned, too short or without the magic.
    ///
    /// # Safety
    /// `address` is null or the address of at least eight bytes that stay valid for ever. If these bytes are the magic,
    /// they begin an entry that fulfils its contract version: the entry has the declared size, and its pointers and
    /// functions have the declared types.
    #[must_use]
    pub unsafe fn at(address: *const Self) -> Option<&'static Self> {
        if address.is_null() || !address.is_aligned() {
            return None;
        }
        // SAFETY: not null, hence eight bytes at the least, as this function demands; bytes need no alignment.
        let magic = unsafe { address.cast::<[u8; 8]>().read() };
        if magic != MAGIC {
            return None;
        }
        // SAFETY: what has the magic is an entry, as this function demands, and every one says its size behind
        // it.
        let size = unsafe { (&raw const (*address).size).read() };
        if (size as usize) < size_of::<Self>() {
            return None;
        }
        // SAFETY: not null, aligned and, by its own word, whole; it stays for ever, and any bits are an `Entry`.
        Some(unsafe { &*address })
    }

    /// Returns major version, minor version and candidate number of the plugin's contract.
    #[must_use]
    pub const fn contract(&self) -> (u16, u16, u32) {
        (self.abi_major, self.abi_minor, self.abi_candidate)
    }

    /// Returns the code of the plugin's kind.
    #[must_use]
    pub const fn kind_code(&self) -> u32 {
        self.kind
    }

    /// Returns the function that a host calls once after loading; `None` if the plugin has none.
    #[must_use]
    pub const fn init(&self) -> Option<unsafe extern "C" fn(host: *const Host)> {
        self.init
    }

    /// Returns the lookup of the function tables; `None` if the plugin has none.
    #[must_use]
    pub const fn get_interface(&self) -> Option<unsafe extern "C" fn(id: Str) -> *const c_void> {
        self.get_interface
    }
}
