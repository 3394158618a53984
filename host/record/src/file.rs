//! Recording file while it is being written: created exclusively, and checked for changes by other programs.

use same_file::Handle;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// Change of a recording file by another program, detected by the recording's writer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FileError {
    /// The file is shorter or longer than the bytes written.
    #[error("another program changed the length of the file from {written} to {found} bytes")]
    Length {
        /// Length as written, bytes.
        written: u64,
        /// Length of the file, bytes.
        found: u64,
    },
    /// The path leads to no file, or to another file.
    #[error("the file was removed or replaced while it was written")]
    Replaced,
}

/// New file with a write buffer.
///
/// The file is created exclusively, so two writers never share a file.
pub(crate) struct NewFile {
    buffer: BufWriter<LengthChecked>,
}

impl NewFile {
    /// Creates the file.
    ///
    /// # Errors
    /// Errors of the system; of kind `AlreadyExists` if anything of that name exists, a link or a pipe included.
    pub(crate) fn create(path: &Path) -> io::Result<Self> {
        Ok(Self::over(File::options().write(true).create_new(true).open(path)?))
    }

    /// Wraps an open, empty file.
    pub(crate) fn over(file: File) -> Self {
        Self { buffer: BufWriter::new(LengthChecked { file, written: 0 }) }
    }

    /// Writes the buffered bytes; fails unless the file is still at the path, in full length.
    ///
    /// # Errors
    /// Errors of the system, or an error that wraps a [`FileError`].
    pub(crate) fn close(&mut self, path: &Path) -> io::Result<()> {
        self.buffer.flush()?;
        let checked = self.buffer.get_ref();
        checked.check().map_err(io::Error::other)?;
        if checked.is_at(path) { Ok(()) } else { Err(io::Error::other(FileError::Replaced)) }
    }

    /// Removes the file, unless the path leads to another file by now.
    pub(crate) fn remove(&self, path: &Path) {
        if self.buffer.get_ref().is_at(path) {
            let _ = fs::remove_file(path);
        }
    }
}

impl Write for NewFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.buffer.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.buffer.flush()
    }
}

/// File that is written sequentially; before each write its length is compared with the number of bytes written.
struct LengthChecked {
    file: File,
    written: u64,
}

impl LengthChecked {
    fn check(&self) -> Result<(), FileError> {
        // Without readable metadata, the next write shows whether the file is usable.
        let found = self.file.metadata().map_or(self.written, |metadata| metadata.len());
        if found == self.written { Ok(()) } else { Err(FileError::Length { written: self.written, found }) }
    }

    /// Returns true if the path names this file.
    fn is_at(&self, path: &Path) -> bool {
        let written = self.file.try_clone().and_then(Handle::from_file);
        matches!((written, Handle::from_path(path)), (Ok(written), Ok(named)) if written == named)
    }
}

impl Write for LengthChecked {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.check().map_err(io::Error::other)?;
        let count = self.file.write(bytes)?;
        self.written += count as u64;
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}
