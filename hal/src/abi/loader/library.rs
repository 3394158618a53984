//! A loaded plugin: a private copy of its file, opened once, never unloaded.

use super::model::{Model, ModelTables};
use super::{LoadError, Metadata, OpenedDevice, Setting, check, metadata_file};
use crate::abi::{
    ABI_MAJOR, ABI_MINOR, ActivityTable, CalibrationTable, CenterlineTable, DetailsTable, DevicePacingTable,
    DeviceTable, EnergyLedgerTable, Entry, ForceTable, HOST_QUIET_PANICS, Host, LinearFieldTable, MAGIC,
    PluginKind, ReachTable, Str, VariantTable, interface_ids, is_spoken,
};
use crate::{DeviceInfo, ModelInfo, Parameter};
use object::ReadCache;
use std::ffi::CString;
use std::fs::File;
use std::os::fd::AsRawFd;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};

/// Whose Rust runtime a plugin's panics happen in.
#[derive(Clone, Copy)]
enum Runtime {
    /// Its own: the library was opened with `dlopen`.
    Own,
    /// This program's: the plugin is linked in.
    Shared,
}

/// A plugin whose contract has been checked. Cheap to clone: it is two pointers to statics and its metadata.
#[derive(Clone)]
pub struct Plugin {
    metadata: Metadata,
    interface: Interface,
    proof: check::Proof,
}

#[derive(Clone, Copy)]
enum Interface {
    Model(ModelTables),
    Device { device: &'static DeviceTable, extensions: DeviceExtensions },
}

/// What a device offers beyond the plain one.
#[derive(Clone, Copy)]
pub(super) struct DeviceExtensions {
    pub(super) ledger: Option<&'static EnergyLedgerTable>,
    pub(super) calibration: Option<&'static CalibrationTable>,
    pub(super) pacing: Option<&'static DevicePacingTable>,
}

impl Plugin {
    /// Loads a plugin from a file. Not real-time. Runs the plugin's code: the caller trusts the file.
    ///
    /// # Errors
    /// [`LoadError`], with file, cause and remedy; the process survives all of them.
    pub fn load(path: &Path) -> Result<Self, LoadError> {
        let (mut original, _) = metadata_file::open_regular(path)?;
        let copy_error = |cause: std::io::Error| LoadError::Copy { path: path.into(), cause };
        let mut copy = file_in_memory(path).map_err(copy_error)?;
        let length = std::io::copy(&mut original, &mut copy).map_err(copy_error)?;
        let metadata = metadata_file::parse(path, &ReadCache::new(&copy), length)?;
        metadata.check_contract()?;
        let entry = open_private_copy(&metadata, copy)?;
        Self::from_entry(metadata, entry, Runtime::Own)
    }

    /// Wraps a plugin that is linked into this program: for debuggers, sanitizers and tests. Not real-time.
    ///
    /// # Errors
    /// [`LoadError`], as for a file.
    pub fn in_process(entry: &'static Entry) -> Result<Self, LoadError> {
        let metadata = Metadata {
            path: PathBuf::new(),
            kind: PluginKind::Model,
            id: String::new(),
            name: String::new(),
            doc: String::new(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            abi: format!("{ABI_MAJOR}.{ABI_MINOR}"),
            entry: String::new(),
        };
        let mut plugin = Self::from_entry(metadata, entry, Runtime::Shared)?;
        let (kind, id, name, doc) = match plugin.interface {
            Interface::Model(ModelTables { force, .. }) => {
                (PluginKind::Model, force.info.id(), force.info.name(), force.info.doc())
            }
            Interface::Device { device, .. } => {
                (PluginKind::Device, device.info.id(), device.info.name(), device.info.doc())
            }
        };
        let (id, name, doc) = (id.to_owned(), name.to_owned(), doc.to_owned());
        plugin.metadata = Metadata { kind, id, name, doc, ..plugin.metadata };
        Ok(plugin)
    }

    fn from_entry(metadata: Metadata, entry: &'static Entry, runtime: Runtime) -> Result<Self, LoadError> {
        let path = &metadata.path;
        let bad_entry = || LoadError::NoEntry { path: path.clone(), symbol: metadata.entry.clone() };
        if entry.magic != MAGIC || (entry.size as usize) < size_of::<Entry>() {
            return Err(bad_entry());
        }
        if !is_spoken(entry.abi_major, entry.abi_minor) {
            return Err(LoadError::OtherContract {
                path: path.clone(),
                theirs: format!("{}.{}", entry.abi_major, entry.abi_minor),
                ours: format!("{ABI_MAJOR}.{ABI_MINOR}"),
            });
        }
        // SAFETY: magic, size and contract version were checked just above.
        let proof = unsafe { check::contract(entry) };
        let proof =
            proof.map_err(|difference| LoadError::LayoutDiffers { path: path.clone(), difference })?;
        if let Some(init) = entry.init {
            let flags = if matches!(runtime, Runtime::Own) { HOST_QUIET_PANICS } else { 0 };
            let host = Host { size: 16, abi_major: ABI_MAJOR, abi_minor: ABI_MINOR, flags, reserved: 0 };
            // SAFETY: `init` takes a host struct that is valid for the call; the contract says it does not unwind.
            unsafe { init(&raw const host) };
        }
        let interface = find_interface(&metadata, entry)?;
        Ok(Self { metadata, interface, proof })
    }

    /// What the plugin says about itself.
    #[must_use]
    pub fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    /// True if the layouts of all contract types were compared; false for C plugins (sizes only).
    #[must_use]
    pub fn layouts_proven(&self) -> bool {
        self.proof == check::Proof::Checked
    }

    /// What the plugin can be told.
    #[must_use]
    pub fn parameters(&self) -> &'static [Parameter] {
        let (parameters, count) = match self.interface {
            Interface::Model(ModelTables { force, .. }) => (force.parameters, force.parameter_count),
            Interface::Device { device, .. } => (device.parameters, device.parameter_count),
        };
        if parameters.is_null() || count == 0 {
            return &[];
        }
        // SAFETY: a table's schema is a static array of `parameter_count` parameters of the checked layout.
        unsafe { std::slice::from_raw_parts(parameters, count as usize) }
    }

    /// What a model says about itself; `None` for a device.
    #[must_use]
    pub fn model_info(&self) -> Option<ModelInfo> {
        match self.interface {
            Interface::Model(ModelTables { force, .. }) => Some(force.info),
            Interface::Device { .. } => None,
        }
    }

    /// What a device says about itself; `None` for a model.
    #[must_use]
    pub fn device_info(&self) -> Option<DeviceInfo> {
        match self.interface {
            Interface::Device { device, .. } => Some(device.info),
            Interface::Model(_) => None,
        }
    }

    /// Makes a model. Not real-time.
    ///
    /// # Errors
    /// [`LoadError::OtherKind`] for a device, [`LoadError::Refused`] if the plugin says no.
    pub fn create_model(&self, settings: &[Setting]) -> Result<Model, LoadError> {
        let Interface::Model(tables) = self.interface else {
            return Err(self.other_kind(PluginKind::Model));
        };
        Model::create(tables, self.parameters(), settings).map_err(|refusal| self.refused(refusal))
    }

    /// Opens a device. Not real-time; may block.
    ///
    /// # Errors
    /// [`LoadError::OtherKind`] for a model, [`LoadError::Refused`] if the plugin says no.
    pub fn open_device(&self, settings: &[Setting]) -> Result<OpenedDevice, LoadError> {
        let Interface::Device { device, extensions } = self.interface else {
            return Err(self.other_kind(PluginKind::Device));
        };
        OpenedDevice::open(device, extensions, self.parameters(), settings)
            .map_err(|refusal| self.refused(refusal))
    }

    fn other_kind(&self, wanted: PluginKind) -> LoadError {
        let Metadata { path, id, kind, .. } = &self.metadata;
        LoadError::OtherKind { path: path.clone(), id: id.clone(), found: kind.word(), wanted: wanted.word() }
    }

    fn refused(&self, refusal: crate::Refusal) -> LoadError {
        LoadError::Refused { path: self.metadata.path.clone(), id: self.metadata.id.clone(), refusal }
    }
}

/// An empty file nobody else can reach, called like `path` for debuggers.
fn file_in_memory(path: &Path) -> std::io::Result<File> {
    let name = path.file_name().map(OsStrExt::as_bytes).unwrap_or_default();
    let name = CString::new(name).unwrap_or_default();
    Ok(rustix::fs::memfd_create(&name, rustix::fs::MemfdFlags::CLOEXEC)?.into())
}

/// Opens a copy in memory, the very bytes that were checked, so that nobody can change the file under a running loop
/// (an overwritten mapped library raises SIGBUS at the next call) and a rebuilt plugin at the same path is new code.
fn open_private_copy(metadata: &Metadata, file: File) -> Result<&'static Entry, LoadError> {
    let path = &metadata.path;
    let copy = format!("/proc/self/fd/{}", file.as_raw_fd());

    use libloading::os::unix::{Library, RTLD_LOCAL, RTLD_NOW};
    // RTLD_NOW: with lazy binding a missing symbol would kill the process in the middle of a tick.
    // SAFETY: opening runs the library's initialisers; that this is trusted code is the contract of `load`.
    let library = unsafe { Library::open(Some(&copy), RTLD_NOW | RTLD_LOCAL) }.map_err(|cause| {
        LoadError::Link { path: path.clone(), cause: whole_cause(&cause).replace(&copy, "it") }
    })?;
    let symbol = metadata.entry.as_str();
    // SAFETY: the symbol is only used as an address here; it is checked to be an `Entry` before it is trusted.
    let found = unsafe { library.get::<*const Entry>(symbol.as_bytes()) }.map(|entry| entry.as_raw_ptr());
    let address = found.unwrap_or(std::ptr::null_mut()).cast::<Entry>();
    // Thread-local destructors make unloading unsound: a library stays for the life of the process. Its file
    // stays open too: the linker knows a library by its path, and a reused descriptor would be the same path.
    std::mem::forget((library, file));
    // SAFETY: null, or a static of at least the magic's size in a library that is never unloaded; its content is
    // compared with the magic first, and `from_entry` checks its size and version before any pointer is followed.
    let entry = unsafe { address.as_ref() };
    entry.ok_or_else(|| LoadError::NoEntry { path: path.clone(), symbol: symbol.to_owned() })
}

fn whole_cause(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(cause) = source {
        text = format!("{text}: {cause}");
        source = cause.source();
    }
    text
}

fn find_interface(metadata: &Metadata, entry: &'static Entry) -> Result<Interface, LoadError> {
    let missing =
        |interface, missing| LoadError::MissingFunction { path: metadata.path.clone(), interface, missing };
    let Some(get_interface) = entry.get_interface else {
        return Err(missing("the entry", "`get_interface`"));
    };
    // SAFETY: an id with static lifetime; the contract of `get_interface` is to answer null or a static table.
    let table = |id| unsafe { get_interface(Str::new(id)) };
    if entry.kind == PluginKind::Device as u32 {
        let id = interface_ids::DEVICE;
        // SAFETY: the table behind this id is a `DeviceTable`, by the contract and the layout check.
        let device = unsafe { table(id).cast::<DeviceTable>().as_ref() };
        let device = device.filter(|table| table.size as usize >= size_of::<DeviceTable>());
        let device = device.ok_or_else(|| missing(id, "its function table"))?;
        let required = [
            ("`open`", device.open.is_some()),
            ("`close`", device.close.is_some()),
            ("`capabilities`", device.capabilities.is_some()),
            ("`activate`", device.activate.is_some()),
            ("`deactivate`", device.deactivate.is_some()),
            ("`read`", device.read.is_some()),
            ("`write`", device.write.is_some()),
            ("`safe_stop`", device.safe_stop.is_some()),
        ];
        if let Some((name, _)) = required.iter().find(|(_, present)| !present) {
            return Err(missing(id, name));
        }
        // SAFETY: as above, for the extension's table.
        let ledger = unsafe { table(interface_ids::ENERGY_LEDGER).cast::<EnergyLedgerTable>().as_ref() };
        // SAFETY: as above, for the extension's table.
        let calibration = unsafe { table(interface_ids::CALIBRATION).cast::<CalibrationTable>().as_ref() };
        let calibration = calibration.filter(|table| table.size as usize >= size_of::<CalibrationTable>());
        // SAFETY: as above, for the extension's table.
        let pacing = unsafe { table(interface_ids::DEVICE_PACING).cast::<DevicePacingTable>().as_ref() };
        let pacing = pacing.filter(|table| table.size as usize >= size_of::<DevicePacingTable>());
        Ok(Interface::Device { device, extensions: DeviceExtensions { ledger, calibration, pacing } })
    } else {
        let id = interface_ids::FORCE;
        // SAFETY: the table behind this id is a `ForceTable`, by the contract and the layout check.
        let force = unsafe { table(id).cast::<ForceTable>().as_ref() };
        let force = force.filter(|table| table.size as usize >= size_of::<ForceTable>());
        let force = force.ok_or_else(|| missing(id, "its function table"))?;
        let required = [
            ("`create`", force.create.is_some()),
            ("`destroy`", force.destroy.is_some()),
            ("`step`", force.step.is_some()),
        ];
        if let Some((name, _)) = required.iter().find(|(_, present)| !present) {
            return Err(missing(id, name));
        }
        // SAFETY: as above, for the tables of the extensions.
        let (centerline, variant, details, activity, field, reach) = unsafe {
            (
                table(interface_ids::CENTERLINE).cast::<CenterlineTable>().as_ref(),
                table(interface_ids::VARIANT).cast::<VariantTable>().as_ref(),
                table(interface_ids::DETAILS).cast::<DetailsTable>().as_ref(),
                table(interface_ids::ACTIVITY).cast::<ActivityTable>().as_ref(),
                table(interface_ids::LINEAR_FIELD).cast::<LinearFieldTable>().as_ref(),
                table(interface_ids::REACH).cast::<ReachTable>().as_ref(),
            )
        };
        Ok(Interface::Model(ModelTables { force, centerline, variant, details, activity, field, reach }))
    }
}
