//! User-supplied files: read whole up to a size limit, with errors located by line.

use std::fmt;
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// Maximum size of a text, bytes: hundreds of times the largest table in use.
const MOST_TEXT_BYTES: u64 = 256 << 20;
/// Byte order mark of UTF-8, which some programs write at the start of a text.
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// Problem in a text file, with its line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TextProblem {
    /// Line, from 1; 0 for a problem of the whole file.
    pub line: usize,
    /// Cause and remedy.
    pub problem: String,
}

impl TextProblem {
    /// Builds a problem in the line `line`, counted from 1. Not real-time.
    pub fn at(line: usize, problem: impl Into<String>) -> Self {
        Self { line, problem: problem.into() }
    }

    /// Builds a problem of the whole file. Not real-time.
    pub fn of_file(problem: impl Into<String>) -> Self {
        Self::at(0, problem)
    }

    /// Formats `FILE:LINE: PROBLEM`, without the line for a problem of the whole file. Not real-time.
    #[must_use]
    pub fn in_file(&self, file: impl fmt::Display) -> String {
        match self.line {
            0 => format!("{file}: {}", self.problem),
            line => format!("{file}:{line}: {}", self.problem),
        }
    }
}

/// Opens a regular file for reading. A pipe, whose writer may never come, and a device file, which may have no end, are not
/// opened. Not real-time.
///
/// # Errors
/// Errors of the operating system; of kind `IsADirectory` for a folder, `InvalidInput` for a pipe or a device file.
pub fn open_file(path: &Path) -> io::Result<File> {
    let attributes = std::fs::metadata(path)?;
    if attributes.is_dir() {
        return Err(io::ErrorKind::IsADirectory.into());
    }
    if !attributes.is_file() {
        let problem = "the path is a pipe or a device; write its contents to a file and name the file";
        return Err(io::Error::new(io::ErrorKind::InvalidInput, problem));
    }
    File::open(path)
}

/// Reads a whole regular file of at most `most_bytes` bytes. Not real-time.
///
/// # Errors
/// Errors of [`open_file`]; of kind `FileTooLarge` for a longer file.
pub fn read_file(path: &Path, most_bytes: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open_file(path)?.take(most_bytes.saturating_add(1)).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most_bytes {
        let problem =
            format!("the file has more than {} MiB, the limit; name a smaller file", most_bytes >> 20);
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, problem));
    }
    Ok(bytes)
}

/// Reads a text file of at most 256 MiB, as [`text_from_bytes`] does; `what` describes the file in an error. Not real-time.
///
/// # Errors
/// If the file cannot be read, is larger than 256 MiB or is not a valid text (errors of [`text_from_bytes`]).
pub fn read_text(path: &Path, what: &str) -> Result<String, TextProblem> {
    let bytes = read_file(path, MOST_TEXT_BYTES)
        .map_err(|error| TextProblem::of_file(format!("cannot read {what}: {error}")))?;
    text_from_bytes(bytes)
}

/// Decodes the bytes of a file: drops a byte order mark, and replaces carriage returns by line feeds if the text has no
/// line feed. Not real-time.
///
/// # Errors
/// If the text is UTF-16, is not valid UTF-8 or contains a NUL byte; the error has the first such line.
pub fn text_from_bytes(mut bytes: Vec<u8>) -> Result<String, TextProblem> {
    if bytes.starts_with(BYTE_ORDER_MARK) {
        bytes.drain(..BYTE_ORDER_MARK.len());
    }
    if bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff") {
        return Err(TextProblem::at(1, "the file is UTF-16; save the file as UTF-8"));
    }
    if bytes.contains(&b'\r') && !bytes.contains(&b'\n') {
        bytes.iter_mut().filter(|byte| **byte == b'\r').for_each(|byte| *byte = b'\n');
    }
    if let Some(at) = bytes.iter().position(|byte| *byte == 0) {
        let line = 1 + bytes.iter().take(at).filter(|byte| **byte == b'\n').count();
        return Err(TextProblem::at(
            line,
            "the file contains a byte 0, so it is not a text in UTF-8, or a part of the file was not written; name a text \
             file in UTF-8, or write the file again",
        ));
    }
    String::from_utf8(bytes).map_err(|error| {
        let before = error.as_bytes().iter().take(error.utf8_error().valid_up_to());
        let line = 1 + before.filter(|byte| **byte == b'\n').count();
        TextProblem::at(line, "the file is not UTF-8; save the file as UTF-8")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_line_that_is_no_text_is_told() {
        let path = std::env::temp_dir().join(format!("flotor-text-{}", std::process::id()));
        std::fs::write(&path, b"one\ntwo \xff\nthree\xfe\n").expect("the folder can be written to");
        let told = read_text(&path, "it").map_err(|wrong| wrong.in_file("it.txt"));
        assert_eq!(told.unwrap_err(), "it.txt:2: the file is not UTF-8; save the file as UTF-8");
        std::fs::write(&path, b"\xef\xbb\xbfx,y\n").expect("the folder can be written to");
        assert_eq!(read_text(&path, "it"), Ok("x,y\n".to_owned()), "spreadsheets write a mark first");
        assert_eq!(text_from_bytes(b"x,y\r1,2\r".to_vec()), Ok("x,y\n1,2\n".to_owned()));
        let told = text_from_bytes(b"\xff\xfex\0".to_vec()).map_err(|wrong| wrong.in_file("it.txt"));
        assert_eq!(told.unwrap_err(), "it.txt:1: the file is UTF-16; save the file as UTF-8");
        let told = text_from_bytes(b"x\n\0\0".to_vec()).map_err(|wrong| wrong.line);
        assert_eq!(told, Err(2));
        assert_eq!(read_file(&path, 7).expect("seven bytes").len(), 7);
        assert_eq!(read_file(&path, 6).unwrap_err().kind(), io::ErrorKind::FileTooLarge);
        std::fs::remove_file(&path).expect("it is there");
        let told = read_text(&path, "it").map_err(|wrong| wrong.in_file("it.txt"));
        assert!(told.unwrap_err().starts_with("it.txt: cannot read it: "));
    }

    #[test]
    fn a_file_without_an_end_is_not_read() {
        // Where there is no such file it cannot be read either.
        for path in ["/dev/zero", "/dev/null", "/dev/tty"] {
            read_text(Path::new(path), "it").expect_err("a device file");
        }
        assert_eq!(read_file(&std::env::temp_dir(), 1).unwrap_err().kind(), io::ErrorKind::IsADirectory);
    }
}
