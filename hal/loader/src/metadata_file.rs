//! Metadata of a plugin file, read without running the plugin's code.

use super::platform::NoSection;
use super::{LoadError, platform};
use flotor_hal::abi::{CONTRACT, PluginKind};
use object::{ReadCache, ReadRef};
use std::fs::File;
use std::path::{Path, PathBuf};

/// Metadata of a plugin, from the section `.flotor` of its file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Metadata {
    /// Path of the plugin file; empty for a plugin linked into this program.
    pub path: PathBuf,
    /// Model or device.
    pub kind: PluginKind,
    /// Id in scenes and commands.
    pub id: String,
    /// Display name; empty if the file has none.
    pub name: String,
    /// Description in one sentence.
    pub doc: String,
    /// Version of the plugin; for a plugin linked into this program, the version of this crate.
    pub version: String,
    /// Contract version of the plugin's build, in the form of [`CONTRACT`].
    pub abi: String,
    /// Name of the exported entry; empty for a plugin linked into this program.
    pub entry: String,
}

/// Reads the metadata of a plugin file; runs and maps no code of the plugin. Not real-time.
///
/// # Errors
/// Any [`LoadError`] that can be found without `dlopen`, except a different contract version, which a list of plugins may
/// show: see [`Metadata::check_contract`].
pub fn read_metadata(path: &Path) -> Result<Metadata, LoadError> {
    let (file, length) = open_regular(path)?;
    // Reads headers, their names and one section, no symbols: a folder of large libraries is listed in a millisecond.
    parse(path, &ReadCache::new(file), length)
}

/// Opens a regular file and returns it with its length, bytes. Other kinds of files are never opened: a pipe would wait
/// for a writer for ever.
pub(super) fn open_regular(path: &Path) -> Result<(File, u64), LoadError> {
    let unreadable = |cause| LoadError::Unreadable { path: path.into(), cause };
    let attributes = std::fs::metadata(path).map_err(unreadable)?;
    if attributes.is_dir() {
        return Err(unreadable(std::io::ErrorKind::IsADirectory.into()));
    }
    if !attributes.is_file() {
        return Err(unreadable(std::io::Error::new(std::io::ErrorKind::InvalidInput, "not a regular file")));
    }
    Ok((File::open(path).map_err(unreadable)?, attributes.len()))
}

impl Metadata {
    /// Checks that the plugin was built for the contract version of this host.
    ///
    /// # Errors
    /// [`LoadError::OtherContract`], unless the version is [`CONTRACT`].
    pub fn check_contract(&self) -> Result<(), LoadError> {
        if self.abi == CONTRACT {
            return Ok(());
        }
        Err(LoadError::OtherContract { path: self.path.clone(), theirs: self.abi.clone() })
    }
}

/// Parses the metadata section of a library.
pub(super) fn parse<'d>(path: &Path, data: impl ReadRef<'d>, length: u64) -> Result<Metadata, LoadError> {
    let text = platform::metadata_section(data, length).map_err(|reason| match reason {
        NoSection::NotALibrary(cause) => LoadError::NotALibrary { path: path.into(), cause },
        NoSection::Truncated { need } => LoadError::Truncated { path: path.into(), have: length, need },
        NoSection::NotAPlugin => LoadError::NotAPlugin { path: path.into() },
    })?;
    let bad = |cause: String| LoadError::BadMetadata { path: path.into(), cause };
    let text = std::str::from_utf8(text).map_err(|cause| bad(cause.to_string()))?;
    let pairs = text.trim_end_matches('\0').lines().map(str::trim).filter(|line| !line.is_empty());
    let malformed = |line: &str| bad(format!("the line `{}` is not `key = \"value\"`", line.escape_debug()));
    let pairs = pairs.map(|line| key_and_value(line).ok_or_else(|| malformed(line)));
    let pairs: Vec<(&str, &str)> = pairs.collect::<Result<_, _>>()?;
    let value = |key: &str| {
        let found = pairs.iter().find(|(name, text)| *name == key && !text.is_empty());
        found.map(|(_, text)| (*text).to_owned()).ok_or_else(|| bad(format!("`{key}` is missing or empty")))
    };
    let kind = match value("kind")?.as_str() {
        "model" => PluginKind::Model,
        "device" => PluginKind::Device,
        other => return Err(bad(format!("kind `{other}` is neither model nor device"))),
    };
    Ok(Metadata {
        path: path.into(),
        kind,
        id: value("id")?,
        name: value("name").unwrap_or_default(),
        doc: value("doc").unwrap_or_default(),
        version: value("version")?,
        abi: value("abi")?,
        entry: value("entry")?,
    })
}

/// Parses a line `key = "value"`, the only form of TOML in metadata.
fn key_and_value(line: &str) -> Option<(&str, &str)> {
    let (key, value) = line.split_once('=')?;
    let value = value.trim().strip_prefix('"')?.strip_suffix('"')?;
    // Reject control characters: the text is printed to terminals.
    let is_plain = |sign: char| !matches!(sign, '"' | '\\') && !sign.is_control();
    value.chars().all(is_plain).then_some((key.trim(), value))
}
