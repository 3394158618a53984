//! Windows: PE, a copy in the folder for temporary files, `LoadLibrary`.

use super::NoSection;
use flotor_hal::abi::metadata;
use libloading::os::windows::Library;
use object::ReadRef;
use object::pe::{ImageDosHeader, ImageNtHeaders64};
use object::read::pe::ImageNtHeaders;
use std::ffi::{OsStr, c_void};
use std::fs::{File, OpenOptions};
use std::io;
use std::marker::PhantomData;
use std::os::windows::fs::OpenOptionsExt;
use std::os::windows::io::OwnedHandle;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

/// Share mode of the copy (`FILE_SHARE_READ`): other processes may read the file, and neither write nor remove it.
const SHARE_READ: u32 = 1;
/// Folder of the copies, inside the folder for temporary files.
const FOLDER: &str = "flotor-plugins";
/// Minimum age of a removable copy: another process may not have opened a younger copy yet.
const OPENED_WITHIN: Duration = Duration::from_secs(60);

/// Remedy if the private copy, a file in [`FOLDER`], cannot be made.
pub(crate) const COPY_REMEDY: &str = "free space on the drive of the folder for temporary files (`%TEMP%`), and \
                                      allow this user to write there";

/// Returns the remedy if the system cannot link a library.
pub(crate) fn link_remedy(_: &str) -> &'static str {
    "install the missing library or rebuild the plugin"
}

/// Placeholder for a plugin's descriptor: on Windows no other process uses the descriptor yet.
pub(crate) type Handle = PhantomData<OwnedHandle>;

/// Returns a placeholder without duplicating the descriptor.
///
/// # Errors
/// None.
///
/// # Safety
/// As on other systems; here nothing is done with the descriptor.
pub(crate) unsafe fn writable_duplicate(_: i32) -> Result<Handle, String> {
    Ok(PhantomData)
}

/// Private copy in a separate file, which nobody can write or remove while this process lives, so that the plugin's own file can be
/// rebuilt. A loaded library cannot be removed; a later load of any plugin, in any process, removes the copy when it is unused and
/// older than a minute.
pub(crate) struct PrivateCopy {
    path: PathBuf,
    file: File,
}

impl PrivateCopy {
    /// Copies `original` to a new file in [`FOLDER`], named after `path`; removes old unused copies first.
    ///
    /// # Errors
    /// Errors of the operating system.
    pub(crate) fn of(path: &Path, original: &mut File) -> io::Result<Self> {
        static COPIES: AtomicU32 = AtomicU32::new(0);
        let folder = std::env::temp_dir().join(FOLDER);
        std::fs::create_dir_all(&folder)?;
        remove_those_nobody_has(&folder);
        let name = path.file_name().unwrap_or(OsStr::new("plugin.dll")).to_string_lossy();
        let number = COPIES.fetch_add(1, Ordering::Relaxed);
        let path = folder.join(format!("{}-{number}-{name}", std::process::id()));
        io::copy(original, &mut File::create(&path)?)?;
        let file = OpenOptions::new().read(true).share_mode(SHARE_READ).open(&path)?;
        Ok(Self { path, file })
    }

    /// Returns the copy for reading.
    pub(crate) fn file(&self) -> &File {
        &self.file
    }

    /// Loads the copy as a library, for ever; returns the address of a symbol, null if missing.
    ///
    /// # Errors
    /// The error text of the operating system, with all its causes.
    ///
    /// # Safety
    /// The caller trusts the library: opening it runs its initialisers.
    pub(crate) unsafe fn open(self, symbol: &str) -> Result<*const c_void, String> {
        // SAFETY: opening runs the library's initialisers, which the caller trusts.
        let library = unsafe { Library::new(&self.path) }.map_err(|cause| super::whole_cause(&cause))?;
        // SAFETY: the symbol is only used as an address.
        let found = unsafe { library.get::<*const c_void>(symbol.as_bytes()) };
        let address = found.map(|entry| entry.as_raw_ptr()).unwrap_or(std::ptr::null_mut());
        // Thread-local destructors make unloading unsound: a library stays for the life of the process. The file stays
        // open, so that nobody can change the copy.
        std::mem::forget((library, self.file));
        Ok(address.cast_const())
    }
}

/// Removes the copies of earlier processes; the system refuses to remove a copy in use.
fn remove_those_nobody_has(folder: &Path) {
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        let age =
            entry.metadata().and_then(|about| about.modified()).map(|at| at.elapsed().unwrap_or_default());
        if age.is_ok_and(|age| age > OPENED_WITHIN) {
            let _ = std::fs::remove_file(entry.path());
        }
    }
}

/// Returns the bytes of the metadata section.
///
/// # Errors
/// [`NoSection`] if the file is not a complete 64-bit PE library or has no metadata section.
pub(crate) fn metadata_section<'d>(data: impl ReadRef<'d>, length: u64) -> Result<&'d [u8], NoSection> {
    let dos = ImageDosHeader::parse(data)?;
    let mut offset = u64::from(dos.nt_headers_offset());
    let (headers, _) = ImageNtHeaders64::parse(data, &mut offset)?;
    let sections = headers.sections(data, offset)?;
    let need = sections.iter().map(|section| {
        let (at, size) = section.pe_file_range();
        u64::from(at) + u64::from(size)
    });
    let need = need.max().unwrap_or(0);
    if need > length {
        return Err(NoSection::Truncated { need });
    }
    let named = |name: &[u8]| name.strip_suffix(b"\0").unwrap_or(name) == metadata::SECTION.as_bytes();
    let section = sections.iter().find(|section| named(&section.name));
    let section = section.ok_or(NoSection::NotAPlugin)?;
    Ok(section.pe_data(data)?)
}
