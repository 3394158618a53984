//! Linux: ELF metadata, private copies of plugins in memory files (`memfd_create`), loading with `dlopen`.

use super::NoSection;
use flotor_hal::abi::metadata;
use libloading::os::unix::{Library, RTLD_LOCAL, RTLD_NOW};
use object::elf::FileHeader64;
use object::read::elf::{FileHeader, ProgramHeader, SectionHeader};
use object::{Endianness, ReadRef};
use rustix::fs::{OFlags, fcntl_getfl};
use rustix::io::fcntl_dupfd_cloexec;
use std::ffi::{CString, c_void};
use std::fs::File;
use std::io;
use std::os::fd::{AsRawFd, BorrowedFd, OwnedFd};
use std::os::unix::ffi::OsStrExt;
use std::path::Path;

/// Lowest number of a duplicate descriptor, above the three standard streams.
const LOWEST_DESCRIPTOR: i32 = 3;

/// Duplicate of a plugin's descriptor.
pub(crate) type Handle = OwnedFd;

/// Duplicates a writable descriptor; the duplicate stays open when the plugin closes the original.
///
/// # Errors
/// A description of the problem if the descriptor is negative, closed or not writable.
///
/// # Safety
/// The descriptor is open during the call, as the contract obliges the plugin that owns it.
pub(crate) unsafe fn writable_duplicate(descriptor: i32) -> Result<Handle, String> {
    if descriptor < 0 {
        return Err(format!("names the negative descriptor {descriptor}"));
    }
    // SAFETY: open for the call, as this function demands.
    let theirs = unsafe { BorrowedFd::borrow_raw(descriptor) };
    let no_use = |error| format!("names the descriptor {descriptor}: {error}");
    let mode = fcntl_getfl(theirs).map_err(no_use)?;
    if !mode.intersects(OFlags::WRONLY | OFlags::RDWR) {
        return Err(format!("names the descriptor {descriptor}, which cannot be written"));
    }
    fcntl_dupfd_cloexec(theirs, LOWEST_DESCRIPTOR).map_err(no_use)
}

/// Private copy of a plugin in memory: nobody can change the file under a running loop (an overwritten mapped library
/// raises SIGBUS at the next call), and a rebuilt plugin at the same path is new code.
pub(crate) struct PrivateCopy(File);

impl PrivateCopy {
    /// Copies `original` to memory; the copy has the file name of `path`, for debuggers.
    ///
    /// # Errors
    /// Errors of the operating system.
    pub(crate) fn of(path: &Path, original: &mut File) -> io::Result<Self> {
        let name = path.file_name().map(OsStrExt::as_bytes).unwrap_or_default();
        let name = CString::new(name).unwrap_or_default();
        let mut copy: File = rustix::fs::memfd_create(&name, rustix::fs::MemfdFlags::CLOEXEC)?.into();
        io::copy(original, &mut copy)?;
        Ok(Self(copy))
    }

    /// Returns the copy for reading.
    pub(crate) fn file(&self) -> &File {
        &self.0
    }

    /// Loads the copy as a library, for ever; returns the address of a symbol, null if missing.
    ///
    /// # Errors
    /// The error text of the linker, with all its causes.
    ///
    /// # Safety
    /// The caller trusts the library: opening it runs its initialisers.
    pub(crate) unsafe fn open(self, symbol: &str) -> Result<*const c_void, String> {
        let copy = format!("/proc/self/fd/{}", self.0.as_raw_fd());
        // RTLD_NOW: with lazy binding a missing symbol would kill the process in the middle of a tick.
        // SAFETY: opening runs the library's initialisers, which the caller trusts.
        let library = unsafe { Library::open(Some(&copy), RTLD_NOW | RTLD_LOCAL) }
            .map_err(|cause| super::whole_cause(&cause).replace(&copy, "it"))?;
        // SAFETY: the symbol is only used as an address.
        let found =
            unsafe { library.get::<*const c_void>(symbol.as_bytes()) }.map(|entry| entry.as_raw_ptr());
        // Thread-local destructors make unloading unsound: a library stays for the life of the process. Its file
        // stays open too: the linker knows a library by its path, and a reused descriptor would be the same path.
        std::mem::forget((library, self.0));
        Ok(found.unwrap_or(std::ptr::null_mut()).cast_const())
    }
}

/// Remedy if the private copy, a file in memory, cannot be made.
pub(crate) const COPY_REMEDY: &str =
    "raise the limits of memory, file size and open files (`ulimit -v`, `-f` and `-n`, control group)";

/// Returns the remedy for an error text of the dynamic linker.
pub(crate) fn link_remedy(cause: &str) -> &'static str {
    // Error texts of the C library, each with its remedy.
    const REMEDIES: [(&str, &str); 6] = [
        (
            "static TLS",
            "the memory for thread-local variables is used up by this and earlier plugins (a hot swap unloads no \
             plugin): start the host again, or start with GLIBC_TUNABLES=glibc.rtld.optional_static_tls=16384",
        ),
        ("it: cannot open shared object file", "the host opens plugins through /proc/self/fd: mount /proc"),
        ("cannot open shared object file", "install this library, or set LD_LIBRARY_PATH to its folder"),
        ("undefined symbol", "link the library that has the symbol, and rebuild the plugin"),
        ("' not found", "rebuild the plugin on this system, or install a library of this version"),
        ("cannot allocate memory", "allow more memory (`ulimit -v`, control group)"),
    ];
    let found = REMEDIES.iter().find(|(text, _)| cause.contains(text));
    found.map_or("rebuild the plugin for this system", |(_, remedy)| remedy)
}

/// Returns the bytes of the metadata section.
///
/// # Errors
/// [`NoSection`] if the file is not a complete ELF library or has no metadata section.
pub(crate) fn metadata_section<'d>(data: impl ReadRef<'d>, length: u64) -> Result<&'d [u8], NoSection> {
    // Check the header first: its section table is at the end of the file, which a truncation removes first.
    let header = FileHeader64::<Endianness>::parse(data)?;
    let need = end_of_section_headers(header)?;
    if need > length {
        return Err(NoSection::Truncated { need });
    }
    let endian = header.endian()?;
    let segments = header.program_headers(endian, data)?;
    let sections = header.sections(endian, data)?;
    // `dlopen` maps all segments and raises SIGBUS if the file is shorter.
    let ends =
        segments.iter().map(|segment| segment.p_offset(endian).saturating_add(segment.p_filesz(endian)));
    let ranges = sections.iter().filter_map(|section| section.file_range(endian));
    let need = ends.chain(ranges.map(|(offset, size)| offset.saturating_add(size))).max().unwrap_or(0);
    if need > length {
        return Err(NoSection::Truncated { need });
    }
    let section = sections.section_by_name(endian, metadata::SECTION.as_bytes());
    let (_, section) = section.ok_or(NoSection::NotAPlugin)?;
    Ok(section.data(endian, data)?)
}

/// Returns the file length that the section headers require, bytes.
fn end_of_section_headers(header: &FileHeader64<Endianness>) -> object::Result<u64> {
    let endian = header.endian()?;
    let size = u64::from(header.e_shnum(endian)) * u64::from(header.e_shentsize(endian));
    Ok(header.e_shoff(endian).saturating_add(size))
}

#[cfg(test)]
mod tests {
    use super::link_remedy;
    use crate::Independence;
    use flotor_hal::{IndependentStop, StoppedState};
    use std::io::Read;
    use std::os::fd::AsRawFd;

    #[test]
    fn a_remedy_names_its_cause() {
        for (cause, remedy) in [
            ("it: cannot allocate memory in static TLS block", "optional_static_tls=16384"),
            ("it: cannot open shared object file: No such file or directory", "mount /proc"),
            (
                "libfoo.so.2: cannot open shared object file: No such file or directory",
                "install this library",
            ),
            ("it: undefined symbol: bar", "link the library that has the symbol"),
            (
                "libc.so.6: version `GLIBC_2.99' not found (required by it)",
                "rebuild the plugin on this system",
            ),
            ("it: cannot allocate memory", "allow more memory"),
        ] {
            assert!(link_remedy(cause).contains(remedy), "{cause}: {}", link_remedy(cause));
        }
    }

    #[test]
    fn a_message_and_a_handle_are_kept_beyond_the_plugins_own() {
        let (mut reader, writer) = std::io::pipe().expect("a pipe");
        let told = IndependentStop::by_message(writer.as_raw_fd(), b"stop", StoppedState::Zero, 0);
        let means = Independence::of(&told).expect("it is right");
        drop(writer);
        let Some(Independence::Message { handle, message, state }) = means else { panic!("{means:?}") };
        assert_eq!((message.as_slice(), state), (&b"stop"[..], StoppedState::Zero));
        drop(handle);
        assert_eq!(reader.read(&mut [0; 4]).expect("it ends"), 0, "nobody holds the other end any more");
    }

    #[test]
    fn what_cannot_be_used_is_refused() {
        let (reader, _writer) = std::io::pipe().expect("a pipe");
        let right = IndependentStop::by_message(reader.as_raw_fd(), b"stop", StoppedState::Zero, 0);
        let by_message = |descriptor, message: &[u8]| {
            IndependentStop::by_message(descriptor, message, StoppedState::Zero, 0)
        };
        for (wrong, words) in [
            (right, "cannot be written"),
            (by_message(1_000_000, b"stop"), "names the descriptor 1000000"),
            (by_message(-7, b"stop"), "names the negative descriptor -7"),
            (by_message(reader.as_raw_fd(), &[1; 65]), "has a message of 65 bytes"),
            (by_message(reader.as_raw_fd(), &[]), "has a message of 0 bytes"),
            (by_message(-1, b"stop"), "no descriptor"),
        ] {
            let refused = Independence::of(&wrong).expect_err("it is wrong").to_string();
            assert!(refused.contains(words), "{refused}");
        }
        let own = IndependentStop::by_itself(StoppedState::Landed, 5);
        let own = Independence::of(&own).expect("it is right");
        assert!(matches!(own, Some(Independence::Itself { within_ns: 5, state: StoppedState::Landed })));
        assert!(Independence::of(&IndependentStop::none()).expect("it is right").is_none());
    }
}
