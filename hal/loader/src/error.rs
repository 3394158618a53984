//! Errors of loading a plugin: one readable line with file, cause and remedy.

use super::platform::{COPY_REMEDY, link_remedy};
use flotor_hal::abi::{CONTRACT, PluginKind};
use flotor_hal::{Refusal, RefusalKind};
use std::path::PathBuf;

/// Reason why a plugin was not loaded. Every variant prints one line: file, cause, remedy.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LoadError {
    /// The file cannot be read.
    #[error("{}: cannot read the plugin: {cause}; check the path and its permissions",
        std::path::absolute(path).as_ref().unwrap_or(path).display())]
    Unreadable {
        /// Path of the plugin.
        path: PathBuf,
        /// Error of the operating system.
        cause: std::io::Error,
    },
    /// The file is not a shared library, or a damaged one.
    #[error("{}: not a shared library ({cause}); name the library of a plugin, or build this library again", path.display())]
    NotALibrary {
        /// Path of the plugin.
        path: PathBuf,
        /// Error of the parser.
        cause: object::Error,
    },
    /// The library is shorter than its own tables require.
    #[error("{}: the file is truncated ({have} bytes of at least {need}); copy or build the plugin again", path.display())]
    Truncated {
        /// Path of the plugin.
        path: PathBuf,
        /// Length of the file, bytes.
        have: u64,
        /// Bytes required by the library's tables.
        need: u64,
    },
    /// The library carries no metadata section.
    #[error(
        "{}: a shared library, but not a Flotor plugin (no `.flotor` section); \
         name the library of a plugin, or build this library with `export_model!`, `export_device!` or FLOTOR_METADATA", path.display()
    )]
    NotAPlugin {
        /// Path of the plugin.
        path: PathBuf,
    },
    /// The metadata section is malformed or incomplete.
    #[error("{}: unreadable plugin metadata: {cause}; build the plugin with the export macros or the current header", path.display())]
    BadMetadata {
        /// Path of the plugin.
        path: PathBuf,
        /// Problem with the metadata text.
        cause: String,
    },
    /// The plugin was built for another contract.
    #[error(
        "{}: built for plugin contract {theirs}, but this host has contract {CONTRACT}; rebuild the plugin against this \
         version of Flotor", path.display()
    )]
    OtherContract {
        /// Path of the plugin.
        path: PathBuf,
        /// Contract version of the plugin.
        theirs: String,
    },
    /// The dynamic linker rejected the library.
    #[error("{}: the system cannot link the library: {cause}; {}", path.display(), link_remedy(cause))]
    Link {
        /// Path of the plugin.
        path: PathBuf,
        /// Error text of the linker, with all its causes.
        cause: String,
    },
    /// The private copy could not be created.
    #[error(
        "{}: cannot make a private copy of the plugin: {cause}; {COPY_REMEDY}", path.display()
    )]
    Copy {
        /// Path of the plugin.
        path: PathBuf,
        /// Error of the operating system.
        cause: std::io::Error,
    },
    /// The entry that the metadata names is not exported, or not an entry.
    #[error(
        "{}: no plugin entry `{symbol}` in the library; export the entry with default visibility, and build the plugin \
         with the export macros or the current header", path.display()
    )]
    NoEntry {
        /// Path of the plugin.
        path: PathBuf,
        /// Name of the entry in the metadata.
        symbol: String,
    },
    /// The kind in the entry differs from the kind in the metadata, or is unknown.
    #[error(
        "{}: the metadata have the kind {metadata}, the entry's `kind` is {entry} ({}); make both equal and build \
         the plugin again", path.display(), kind_word(*entry)
    )]
    OtherEntryKind {
        /// Path of the plugin.
        path: PathBuf,
        /// Kind in the metadata.
        metadata: &'static str,
        /// Code of the kind in the entry.
        entry: u32,
    },
    /// A struct of the contract differs between host and plugin.
    #[error("{}: the contract differs: {difference}; rebuild the plugin against this host's flotor-hal", path.display())]
    LayoutDiffers {
        /// Path of the plugin.
        path: PathBuf,
        /// Description of the first difference: struct and field with both layouts, or the missing part.
        difference: String,
    },
    /// The plugin declares an invalid id or list.
    #[error("{}: the plugin declares {cause}, and build the plugin again", path.display())]
    BadDeclaration {
        /// Path of the plugin.
        path: PathBuf,
        /// Invalid declaration, its problem and its correction.
        cause: String,
    },
    /// The interface of the plugin's kind or a required function is missing, or a table is misaligned or too short.
    #[error(
        "{}: {} {missing}; use the export macros or the current header, and build the plugin again",
        path.display(), table_words(interface)
    )]
    MissingFunction {
        /// Path of the plugin.
        path: PathBuf,
        /// Id of the table, or "the entry".
        interface: &'static str,
        /// Predicate of the error text about the table, such as "has no `step`" or "is not aligned".
        missing: &'static str,
    },
    /// The parameter schema has invalid counts or texts.
    #[error("{}: the list of parameters cannot be read: {problem}; correct the list and build the plugin again", path.display())]
    Schema {
        /// Path of the plugin.
        path: PathBuf,
        /// Problem with the schema.
        problem: String,
    },
    /// The plugin is a device where a model is needed, or vice versa.
    #[error("{}: `{id}` is a {found} plugin, but a {wanted} is needed here; name a {wanted} plugin", path.display())]
    OtherKind {
        /// Path of the plugin.
        path: PathBuf,
        /// Id of the plugin.
        id: String,
        /// Kind of the plugin.
        found: &'static str,
        /// Kind required.
        wanted: &'static str,
    },
    /// The plugin refused to create a model or to open a device.
    #[error("{}: `{id}` refused: {refusal}{}", path.display(), advice(refusal.kind))]
    Refused {
        /// Path of the plugin.
        path: PathBuf,
        /// Id of the plugin.
        id: String,
        /// Refusal returned by the plugin.
        refusal: Refusal,
    },
}

impl LoadError {
    /// Returns true if the configuration is at fault: an unreadable file, a plugin of the other kind, or a parameter
    /// refused by the plugin. Otherwise the plugin or the machine is at fault.
    #[must_use]
    pub fn is_configuration(&self) -> bool {
        match self {
            Self::Unreadable { .. } | Self::OtherKind { .. } => true,
            Self::Refused { refusal, .. } => refusal.kind == RefusalKind::Parameter,
            _ => false,
        }
    }
}

/// Returns the remedy for a refusal without one in its reason: only a broken plugin gives none.
const fn advice(kind: RefusalKind) -> &'static str {
    match kind {
        RefusalKind::Broken => "; report this to the author of the plugin",
        RefusalKind::Parameter | RefusalKind::Unsupported | RefusalKind::Resource => "",
    }
}

/// Returns the subject of an error about a table.
fn table_words(interface: &str) -> String {
    if interface.starts_with("flotor.") { format!("the table `{interface}`") } else { interface.to_owned() }
}

fn kind_word(code: u32) -> &'static str {
    PluginKind::from_code(code).map_or("unknown", PluginKind::name)
}
