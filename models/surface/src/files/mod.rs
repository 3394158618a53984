//! Readers of mesh files. Each returns the triangles of the file, or an error with its position and remedy. Not real-time.
//!
//! Memory is bounded by the size of the file: a count in a file is checked against the available data.

mod bytes;
mod glb;
mod obj;
mod ply;
mod stl;

use crate::soup::{LARGEST, MOST_TRIANGLES, Soup};
use std::fmt;

/// Position in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum At {
    /// Whole file.
    File,
    /// Line of a text file, from 1.
    Line(usize),
    /// Byte offset in a binary file, from 0.
    Byte(usize),
}

/// Error of reading a mesh file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// Position in the file.
    pub at: At,
    /// Cause and remedy.
    pub problem: String,
}

impl Problem {
    fn file(problem: impl Into<String>) -> Self {
        Self { at: At::File, problem: problem.into() }
    }

    fn line(line: usize, problem: impl Into<String>) -> Self {
        Self { at: At::Line(line), problem: problem.into() }
    }

    fn byte(byte: usize, problem: impl Into<String>) -> Self {
        Self { at: At::Byte(byte), problem: problem.into() }
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.at {
            At::File => f.write_str(&self.problem),
            At::Line(line) => write!(f, "line {line}: {}", self.problem),
            At::Byte(byte) => write!(f, "byte {byte}: {}", self.problem),
        }
    }
}

/// Format of a mesh file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Stereolithography, text or binary.
    Stl,
    /// Wavefront OBJ.
    Obj,
    /// Polygon file format, text or binary.
    Ply,
    /// Binary glTF 2.0.
    Glb,
}

impl Format {
    /// Returns the format of a file, from its first bytes or else from the extension of its name.
    #[must_use]
    pub fn of(name: &str, bytes: &[u8]) -> Option<Self> {
        if bytes.starts_with(b"glTF") {
            return Some(Self::Glb);
        }
        if bytes.starts_with(b"ply\n") || bytes.starts_with(b"ply\r") {
            return Some(Self::Ply);
        }
        let end = name.rsplit('.').next()?.to_ascii_lowercase();
        match end.as_str() {
            "stl" => Some(Self::Stl),
            "obj" => Some(Self::Obj),
            "ply" => Some(Self::Ply),
            "glb" => Some(Self::Glb),
            _ if stl::is_binary(bytes) => Some(Self::Stl),
            _ => None,
        }
    }
}

/// Reads the bytes of a mesh file named `name`.
///
/// # Errors
/// A [`Problem`]: an unknown format, malformed data, a number that is not finite, no triangle, or too many.
pub fn read(name: &str, bytes: Vec<u8>) -> Result<Soup, Problem> {
    let format = Format::of(name, &bytes).ok_or_else(|| {
        Problem::file(
            "the format is unknown: name a file in STL (.stl), OBJ (.obj), PLY (.ply) or binary glTF (.glb)",
        )
    })?;
    let soup = match format {
        Format::Stl => stl::read(bytes),
        Format::Obj => obj::read(bytes),
        Format::Ply => ply::read(bytes),
        Format::Glb => glb::read(&bytes),
    }?;
    if soup.triangles.is_empty() {
        return Err(Problem::file("the file has no triangle; export a surface with faces"));
    }
    if soup.triangles.len() > MOST_TRIANGLES {
        return Err(Problem::file(format!(
            "the file has {} triangles, above the limit of {MOST_TRIANGLES}; reduce the mesh",
            soup.triangles.len()
        )));
    }
    Ok(soup)
}

/// Returns true for a finite coordinate of plausible size.
fn is_usable(x: f64) -> bool {
    x.abs() <= LARGEST // false for NaN
}

const NOT_FINITE: &str = "a coordinate is not finite, or its magnitude is above 1e9; export the mesh again";

/// Decodes a text file (UTF-8).
fn text(bytes: Vec<u8>) -> Result<String, Problem> {
    flotor_hal::text_from_bytes(bytes)
        .map_err(|wrong| Problem { at: At::Line(wrong.line), problem: wrong.problem })
}

/// Returns the index of the next vertex after `count` vertices.
fn next_index(count: usize, at: At) -> Result<u32, Problem> {
    u32::try_from(count)
        .ok()
        .filter(|next| *next < u32::MAX)
        .ok_or_else(|| Problem { at, problem: "there are too many vertices; reduce the mesh".to_owned() })
}
