//! Why a plugin was refused: one readable line with file, cause and remedy.

use super::platform::link_remedy;
use crate::abi::{CONTRACT, PluginKind};
use crate::{Refusal, RefusalKind};
use std::path::PathBuf;

/// Why a plugin was not loaded. Every variant prints one line: file, cause, what to do.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LoadError {
    /// The file cannot be read.
    #[error("{}: cannot read the plugin: {cause}; check the path and its permissions",
        std::path::absolute(path).as_ref().unwrap_or(path).display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What the system said.
        cause: std::io::Error,
    },
    /// The file is no shared library, or a damaged one.
    #[error("{}: not a shared library ({cause}); build the plugin again", path.display())]
    NotALibrary {
        /// The file.
        path: PathBuf,
        /// What the parser said.
        cause: object::Error,
    },
    /// The library ends before its own tables say.
    #[error("{}: the file is truncated ({have} bytes of at least {need}); copy or build it again", path.display())]
    Truncated {
        /// The file.
        path: PathBuf,
        /// Bytes in the file.
        have: u64,
        /// Bytes its tables speak of.
        need: u64,
    },
    /// The library carries no metadata section.
    #[error(
        "{}: a shared library, but not a Flotor plugin (no `.flotor` section); \
         a plugin needs `export_model!`, `export_device!` or FLOTOR_METADATA", path.display()
    )]
    NotAPlugin {
        /// The file.
        path: PathBuf,
    },
    /// The metadata section does not say what it must.
    #[error("{}: unreadable plugin metadata: {cause}; build it with the export macros or the current header", path.display())]
    BadMetadata {
        /// The file.
        path: PathBuf,
        /// What is wrong with the text.
        cause: String,
    },
    /// Built for another contract.
    #[error(
        "{}: built for plugin contract {theirs}, this host speaks {CONTRACT}; rebuild the plugin against this \
         version", path.display()
    )]
    OtherContract {
        /// The file.
        path: PathBuf,
        /// Contract of the plugin.
        theirs: String,
    },
    /// The dynamic linker refused.
    #[error("{}: the system cannot link the library: {cause}; {}", path.display(), link_remedy(cause))]
    Link {
        /// The file.
        path: PathBuf,
        /// What the linker said, all of it.
        cause: String,
    },
    /// No private copy could be made.
    #[error("{}: cannot make a private copy of the plugin: {cause}; check memory limits", path.display())]
    Copy {
        /// The file.
        path: PathBuf,
        /// What the system said.
        cause: std::io::Error,
    },
    /// The entry that the metadata names is not exported, or not an entry.
    #[error("{}: no plugin entry `{symbol}` in the library; export it with default visibility", path.display())]
    NoEntry {
        /// The file.
        path: PathBuf,
        /// The name in the metadata.
        symbol: String,
    },
    /// The entry is of another kind than the metadata say, or of none the contract knows.
    #[error(
        "{}: the metadata say {metadata}, the entry's `kind` is {entry} ({}); make both say the same and build \
         the plugin again", path.display(), kind_word(*entry)
    )]
    OtherEntryKind {
        /// The file.
        path: PathBuf,
        /// What the metadata say.
        metadata: &'static str,
        /// Code of the kind in the entry.
        entry: u32,
    },
    /// A struct of the contract differs between host and plugin.
    #[error("{}: the contract differs: {difference}; rebuild the plugin against this host's flotor-hal", path.display())]
    LayoutDiffers {
        /// The file.
        path: PathBuf,
        /// Which struct and field, on both sides.
        difference: String,
    },
    /// What the plugin declares (ids, texts, parameters) cannot be.
    #[error("{}: it declares {cause}; correct its tables and build it again", path.display())]
    BadDeclaration {
        /// The file.
        path: PathBuf,
        /// What, and what is wrong with it.
        cause: String,
    },
    /// The plugin does not offer the interface its kind promises, or a required function is missing in it.
    #[error("{}: `{interface}` lacks {missing}; a plugin must offer it", path.display())]
    MissingFunction {
        /// The file.
        path: PathBuf,
        /// Which interface.
        interface: &'static str,
        /// Which function, or the whole table.
        missing: &'static str,
    },
    /// Its list of parameters has counts or texts no host reads.
    #[error("{}: its list of parameters cannot be read: {problem}; correct it and build the plugin again", path.display())]
    Schema {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        problem: String,
    },
    /// The plugin is of the other kind.
    #[error("{}: `{id}` is a {found} plugin, but a {wanted} is needed here; name another plugin", path.display())]
    OtherKind {
        /// The file.
        path: PathBuf,
        /// Id of the plugin.
        id: String,
        /// What it is.
        found: &'static str,
        /// What is needed.
        wanted: &'static str,
    },
    /// The plugin itself said no.
    #[error("{}: `{id}` refused: {refusal}{}", path.display(), advice(refusal.kind))]
    Refused {
        /// The file.
        path: PathBuf,
        /// Id of the plugin.
        id: String,
        /// Its reason.
        refusal: Refusal,
    },
}

impl LoadError {
    /// True if the configuration is wrong: it names no file, a plugin of the other kind, or a parameter that the plugin
    /// refuses. Otherwise the plugin is.
    #[must_use]
    pub fn is_configuration(&self) -> bool {
        match self {
            Self::Unreadable { .. } | Self::OtherKind { .. } => true,
            Self::Refused { refusal, .. } => refusal.kind == RefusalKind::Parameter,
            _ => false,
        }
    }
}

/// What to do about a refusal whose reason does not say it: a plugin that broke gives no remedy.
const fn advice(kind: RefusalKind) -> &'static str {
    match kind {
        RefusalKind::Broken => "; report this to the author of the plugin",
        RefusalKind::Parameter | RefusalKind::Unsupported | RefusalKind::Resource => "",
    }
}

fn kind_word(code: u32) -> &'static str {
    PluginKind::from_code(code).map_or("unknown", PluginKind::word)
}
