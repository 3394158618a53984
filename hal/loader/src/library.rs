//! A loaded plugin: a private copy of its file, opened once, never unloaded.

use super::declaration;
use super::interfaces::Interface;
use super::model::{Model, ModelTables};
use super::offers::Offers;
use super::platform::PrivateCopy;
use super::{LoadError, Metadata, OpenedDevice, Setting, metadata_file};
use crate::extension::{DeviceExtensions, ModelExtensions};
use flotor_hal::abi::{
    ABI_CANDIDATE, ABI_MAJOR, ABI_MINOR, CONTRACT, Entry, HOST_QUIET_PANICS, Host, PluginKind, Proof,
};
use flotor_hal::{DeviceInfo, ModelInfo, Parameter};
use object::ReadCache;
use std::path::{Path, PathBuf};

/// Rust runtime that handles a plugin's panics.
#[derive(Clone, Copy)]
enum Runtime {
    /// The plugin's own runtime: the library was opened with `dlopen`.
    Own,
    /// The runtime of this program: the plugin is linked in.
    Shared,
}

/// Plugin whose contract has been checked. Cheap to clone: two pointers to statics and the metadata.
#[derive(Clone)]
pub struct Plugin {
    metadata: Metadata,
    interface: Interface,
    parameters: &'static [Parameter],
    proof: Proof,
}

impl Plugin {
    /// Loads a plugin from a file. Not real-time; runs the plugin's code.
    ///
    /// The checks find mistakes of an author, not malice. [`super::read_metadata`] runs no code of the plugin.
    ///
    /// ```compile_fail,E0133
    /// # use flotor_loader::Plugin;
    /// let plugin = Plugin::load("libjelly.so".as_ref()); // needs `unsafe`: nothing guarantees the file
    /// ```
    ///
    /// # Errors
    /// [`LoadError`], with file, cause and remedy; the process survives all of them.
    ///
    /// # Safety
    /// The caller trusts the file as a program that is started: the code of the file, from its initialisers on, runs in
    /// this process with all permissions of the process. An entry with the magic of a plugin fulfils the contract.
    pub unsafe fn load(path: &Path) -> Result<Self, LoadError> {
        let (mut original, _) = metadata_file::open_regular(path)?;
        let copy_error = |cause: std::io::Error| LoadError::Copy { path: path.into(), cause };
        let copy = PrivateCopy::of(path, &mut original).map_err(copy_error)?;
        let length = copy.file().metadata().map_err(copy_error)?.len();
        let metadata = metadata_file::parse(path, &ReadCache::new(copy.file()), length)?;
        metadata.check_contract()?;
        // SAFETY: the caller trusts the file.
        let entry = unsafe { copy.open(&metadata.entry) };
        let entry = entry.map_err(|cause| LoadError::Link { path: path.into(), cause })?.cast::<Entry>();
        // SAFETY: null, or what the metadata call the entry, in a library that is never unloaded; that it keeps the
        // contract is the caller's trust in the file.
        let plugin = unsafe { Self::from_entry(metadata, entry, Runtime::Own) }?;
        declaration::check(&plugin.interface, &plugin.metadata.id)
            .map_err(|cause| LoadError::BadDeclaration { path: path.into(), cause })?;
        Ok(plugin)
    }

    /// Wraps a plugin that is linked into this program: for debuggers, sanitizers and tests. Not real-time;
    /// runs the plugin's code. Safe, because only the functions behind the export macros create an [`Entry`], with
    /// tables for the type of its instances.
    ///
    /// # Errors
    /// [`LoadError`], as for a file.
    pub fn in_process(entry: &'static Entry) -> Result<Self, LoadError> {
        let metadata = Metadata {
            path: PathBuf::new(),
            // The kind in the entry is the only source here; `from_entry` rejects an unknown kind.
            kind: PluginKind::from_code(entry.kind_code()).unwrap_or(PluginKind::Model),
            id: String::new(),
            name: String::new(),
            doc: String::new(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            abi: CONTRACT.to_owned(),
            entry: String::new(),
        };
        // SAFETY: a whole entry, for ever; in safe code it comes from `model_entry` or `device_entry`, which make
        // none that breaks the contract.
        let mut plugin = unsafe { Self::from_entry(metadata, entry, Runtime::Shared) }?;
        let [id, name, doc] = plugin.interface.texts().map(str::to_owned);
        plugin.metadata = Metadata { id, name, doc, ..plugin.metadata };
        Ok(plugin)
    }

    /// Checks an entry and its tables, each part before its first use.
    ///
    /// # Safety
    /// `entry` is null or the address of at least eight bytes that stay valid for ever. If these bytes are the magic,
    /// they begin an entry that fulfils its contract version: the entry has the declared size, and its pointers and
    /// functions have the declared types.
    unsafe fn from_entry(
        metadata: Metadata,
        entry: *const Entry,
        runtime: Runtime,
    ) -> Result<Self, LoadError> {
        let path = &metadata.path;
        // SAFETY: as this function demands.
        let Some(entry) = (unsafe { Entry::at(entry) }) else {
            return Err(LoadError::NoEntry { path: path.clone(), symbol: metadata.entry.clone() });
        };
        let (major, minor, candidate) = entry.contract();
        if (major, minor, candidate) != (ABI_MAJOR, ABI_MINOR, ABI_CANDIDATE) {
            let candidate = if candidate == 0 { "" } else { "-rc" };
            return Err(LoadError::OtherContract {
                path: path.clone(),
                theirs: format!("{major}.{minor}{candidate}"),
            });
        }
        if PluginKind::from_code(entry.kind_code()) != Some(metadata.kind) {
            return Err(LoadError::OtherEntryKind {
                path: path.clone(),
                metadata: metadata.kind.name(),
                entry: entry.kind_code(),
            });
        }
        // SAFETY: magic, size and contract version were checked just above; the rest this function demands.
        let proof = unsafe { entry.compare_layouts() };
        let proof =
            proof.map_err(|difference| LoadError::LayoutDiffers { path: path.clone(), difference })?;
        if let Some(init) = entry.init() {
            let flags = if matches!(runtime, Runtime::Own) { HOST_QUIET_PANICS } else { 0 };
            let host = Host { size: 16, abi_major: ABI_MAJOR, abi_minor: ABI_MINOR, flags, reserved: 0 };
            // SAFETY: `init` takes a host struct that is valid for the call; the contract says it does not unwind.
            unsafe { init(&raw const host) };
        }
        // SAFETY: the plugin keeps the contract, as this function demands.
        let offers = unsafe { Offers::of(path, entry) }?;
        let interface = Interface::find(&offers, metadata.kind)?;
        let (parameters, count) = interface.parameters();
        // SAFETY: a table's schema is a static array of `parameter_count` parameters of the checked layout, unless that
        // number is above the limit; then no parameter is read.
        let schema = unsafe { declaration::checked_schema(parameters, count) };
        let parameters = schema.map_err(|problem| LoadError::Schema { path: path.clone(), problem })?;
        Ok(Self { metadata, interface, parameters, proof })
    }

    /// Returns the metadata of the plugin.
    #[must_use]
    pub fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    /// Returns true if abi_stable confirmed the layouts as well (feature `layout-proof` in host and plugin); the
    /// contract's own layout tables are always compared.
    #[must_use]
    pub fn layouts_proven(&self) -> bool {
        self.proof == Proof::Proven
    }

    /// Returns the parameter schema of the plugin.
    pub fn parameters(&self) -> &'static [Parameter] {
        self.parameters
    }

    /// Returns the declaration of a model; `None` for a device.
    #[must_use]
    pub fn model_info(&self) -> Option<ModelInfo> {
        match self.interface {
            Interface::Model(ModelTables { force, .. }) => Some(force.info),
            Interface::Device { .. } => None,
        }
    }

    /// Returns the declaration of a device; `None` for a model.
    #[must_use]
    pub fn device_info(&self) -> Option<DeviceInfo> {
        match self.interface {
            Interface::Device { device, .. } => Some(device.info),
            Interface::Model(_) => None,
        }
    }

    /// Creates an instance of the model with the given settings; the plugin sets the other parameters. Not real-time.
    ///
    /// # Errors
    /// [`LoadError::OtherKind`] for a device, [`LoadError::Refused`] if the plugin refuses.
    pub fn create_model(&self, settings: &[Setting]) -> Result<Model, LoadError> {
        let Interface::Model(tables) = self.interface else {
            return Err(self.other_kind(PluginKind::Model));
        };
        Model::create(tables, self.parameters(), settings).map_err(|refusal| self.refused(refusal))
    }

    /// Opens the device with the given settings; the plugin sets the other parameters. Not real-time; may block.
    ///
    /// # Errors
    /// [`LoadError::OtherKind`] for a model, [`LoadError::Refused`] if the plugin refuses.
    pub fn open_device(&self, settings: &[Setting]) -> Result<OpenedDevice, LoadError> {
        let Interface::Device { device, extensions } = self.interface else {
            return Err(self.other_kind(PluginKind::Device));
        };
        OpenedDevice::open(device, extensions, self.parameters(), settings)
            .map_err(|refusal| self.refused(refusal))
    }

    /// Returns the extensions of a device; `None` for a model.
    pub(crate) fn device_extensions(&self) -> Option<&DeviceExtensions> {
        match &self.interface {
            Interface::Device { extensions, .. } => Some(extensions),
            Interface::Model(_) => None,
        }
    }

    /// Returns the extensions of a model; `None` for a device.
    pub(crate) fn model_extensions(&self) -> Option<&ModelExtensions> {
        match &self.interface {
            Interface::Model(tables) => Some(&tables.extensions),
            Interface::Device { .. } => None,
        }
    }

    fn other_kind(&self, wanted: PluginKind) -> LoadError {
        let Metadata { path, id, kind, .. } = &self.metadata;
        LoadError::OtherKind { path: path.clone(), id: id.clone(), found: kind.name(), wanted: wanted.name() }
    }

    fn refused(&self, refusal: flotor_hal::Refusal) -> LoadError {
        LoadError::Refused { path: self.metadata.path.clone(), id: self.metadata.id.clone(), refusal }
    }
}
