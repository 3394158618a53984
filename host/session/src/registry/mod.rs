//! Plugin registry: finds plugins and resolves their ids. Reads the metadata of plugin files; executes the code of a plugin only when
//! the plugin is loaded.

#![allow(unsafe_code)] // `load_file`; listed in tests/tests/system/architecture.rs

mod stamp;

use self::stamp::FileStamp;
use crate::calls::{self, Call, CallError, CallThread};
pub use crate::platform::is_same_file;
use crate::platform::{UNKNOWN_PROGRAM, distrust, user_folder};
use crate::scene::nearest;
use flotor_core::lock;
use flotor_hal::abi::{Entry, PluginKind};
use flotor_loader::{LoadError, Metadata, Plugin, read_metadata};
use flotor_record::NamedFile;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

/// Environment variable with further plugin folders, separated like `PATH`.
pub const PATH_VARIABLE: &str = "FLOTOR_PLUGIN_PATH";

/// Folder that was not searched, with the reason.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SkippedFolder {
    /// Path of the folder.
    pub folder: PathBuf,
    /// Reason and remedy, as text for users.
    pub reason: String,
}

/// Results of a search for plugins.
#[derive(Default)]
pub struct Findings {
    /// Plugins that can be loaded by id, in search order.
    pub found: Vec<Metadata>,
    /// Plugins hidden by an earlier plugin with the same id.
    pub shadowed: Vec<Metadata>,
    /// Pairs of files with the same id in the same folder. A scene that names the id is rejected.
    pub ambiguous: Vec<(Metadata, Metadata)>,
    /// Files that claim to be plugins and cannot be read as such.
    pub broken: Vec<LoadError>,
    /// Folders that were not searched.
    pub skipped: Vec<SkippedFolder>,
}

/// Plugins found, in search order. Of several folders with a plugin of the same id, the first counts; an id with two files in one
/// folder is rejected.
pub struct Registry {
    linked: Vec<Plugin>,
    findings: Findings,
    /// Searched folders, the scene's folders first.
    folders: Vec<PathBuf>,
    /// Number of folders of the scene.
    of_scene: usize,
    loaded: Mutex<Vec<Loaded>>,
}

/// Loaded plugin, with the state of its file when it was loaded.
struct Loaded {
    path: PathBuf,
    stamp: FileStamp,
    /// xxh3-64 of the bytes, which distinguishes a rebuilt file.
    hash: u64,
    plugin: Plugin,
}

/// Location of a plugin.
enum Located<'a> {
    /// Plugin that is linked into this program.
    Linked(&'a Plugin),
    /// File in a searched folder.
    Found(&'a Metadata),
    /// File given by its path.
    Given(&'a Path),
}

/// Reason why an id resolves to no plugin.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LookupError {
    /// No plugin has the id.
    #[error("no {}plugin `{id}`{}{} (`flotor plugins` lists all; {PATH_VARIABLE} adds folders)",
        kind.as_ref().map_or(String::new(), |kind| format!("{} ", kind.name())),
        nearest.as_ref().map_or(String::new(), |n| format!("; did you mean `{n}`?")),
        hint.as_ref().map_or(String::new(), |hint| format!(" ({hint})")))]
    Unknown {
        /// Requested id of the plugin.
        id: String,
        /// Requested kind; `None` for any.
        kind: Option<PluginKind>,
        /// The most similar id of that kind.
        nearest: Option<String>,
        /// Hint: cause for which a file with this name is not used, or a folder of the scene without a plugin.
        hint: Option<String>,
    },
    /// Two files of one folder have the id.
    #[error("`{id}` is the id of two plugins in one folder: `{}` and `{}`; remove one of them", one.display(), other.display())]
    Ambiguous {
        /// Requested id of the plugin.
        id: String,
        /// First file.
        one: PathBuf,
        /// Second file.
        other: PathBuf,
    },
    /// The plugin was found and rejected.
    #[error(transparent)]
    Refused(#[from] LoadError),
    /// The initialisers of the plugin did not return, a stop was requested meanwhile, or the system cannot start a thread.
    #[error(transparent)]
    Calls(#[from] CallError),
}

impl Registry {
    /// Searches for plugins in the folders of a scene, of the environment variable [`PATH_VARIABLE`], of this installation and of the
    /// user, in this order. Not real-time.
    #[must_use]
    pub fn search(scene_folders: &[PathBuf]) -> Self {
        let mut folders = scene_folders.to_vec();
        if let Some(path) = std::env::var_os(PATH_VARIABLE) {
            folders.extend(std::env::split_paths(&path).filter(|folder| !folder.as_os_str().is_empty()));
        }
        folders.extend(own_folders());
        folders.extend(user_folder());
        let mut registry = Self {
            // Part of the host; its `create` fails unless a program provides a port.
            linked: Plugin::in_process(&crate::program::ENTRY).into_iter().collect(),
            findings: Findings::default(),
            folders,
            of_scene: scene_folders.len(),
            loaded: Mutex::new(Vec::new()),
        };
        for folder in registry.folders.clone() {
            registry.scan(&folder);
        }
        registry
    }

    /// Adds a plugin that is linked into this program and takes precedence over files: for plugins of the program itself, and for
    /// debuggers and sanitizers, which cannot inspect libraries. Not real-time.
    ///
    /// # Errors
    /// [`LoadError`], as for a file.
    pub fn with_linked(mut self, entry: &'static Entry) -> Result<Self, LoadError> {
        self.linked.push(Plugin::in_process(entry)?);
        Ok(self)
    }

    fn scan(&mut self, folder: &Path) {
        let Ok(attributes) = std::fs::metadata(folder) else { return };
        if let Some(reason) = distrust(folder, &attributes) {
            self.findings.skipped.push(SkippedFolder { folder: folder.into(), reason });
            return;
        }
        let Ok(entries) = std::fs::read_dir(folder) else { return };
        let mut files: Vec<PathBuf> = entries.filter_map(Result::ok).map(|entry| entry.path()).collect();
        files.retain(|file| {
            file.extension().is_some_and(|extension| extension == std::env::consts::DLL_EXTENSION)
        });
        files.sort();
        let Findings { found, shadowed, ambiguous, broken, .. } = &mut self.findings;
        for file in files {
            match read_metadata(&file) {
                Ok(metadata) => match found.iter().find(|known| known.id == metadata.id) {
                    None => found.push(metadata),
                    // Cargo links its output into two folders: two names of one file are not a conflict.
                    Some(known) if is_same_file(&known.path, &metadata.path) => {}
                    Some(known) if known.path.parent() == metadata.path.parent() => {
                        ambiguous.push((known.clone(), metadata));
                    }
                    Some(_) => shadowed.push(metadata),
                },
                // Other libraries may lie beside plugins; only files that claim to be one are reported.
                Err(LoadError::NotAPlugin { .. }) => {}
                Err(error) => broken.push(error),
            }
        }
    }

    /// Returns the plugins found in files, in search order; without linked plugins.
    #[must_use]
    pub fn found(&self) -> &[Metadata] {
        &self.findings.found
    }

    /// Returns the results of the search: plugins found, hidden, ambiguous and unreadable, and skipped folders.
    #[must_use]
    pub fn findings(&self) -> &Findings {
        &self.findings
    }

    /// Returns the searched folders in order, existing or not.
    #[must_use]
    pub fn folders(&self) -> &[PathBuf] {
        &self.folders
    }

    /// Loads the plugin with an id (or the file at a path), which must be of this kind. Not real-time; runs the plugin's code.
    ///
    /// # Errors
    /// [`LookupError`] if the id is unknown or ambiguous, the plugin is rejected, or its initialisers do not return in time.
    pub fn load(&self, id: &str, kind: PluginKind) -> Result<Plugin, LookupError> {
        self.find(id, Some(kind))
    }

    /// Loads the plugin with an id (or the file at a path), of any kind. Not real-time; runs the plugin's code.
    ///
    /// # Errors
    /// [`LookupError`] if the id is unknown or ambiguous, the plugin is rejected, or its initialisers do not return in time.
    pub fn load_any(&self, id: &str) -> Result<Plugin, LookupError> {
        self.find(id, None)
    }

    /// Checks that an id (or a path to a file) resolves to a plugin, without running its code. Not real-time.
    ///
    /// # Errors
    /// [`LookupError`] if the id is unknown or ambiguous, the file at the path is not a plugin, or the plugin is not of this kind.
    pub fn check(&self, id: &str, kind: PluginKind) -> Result<(), LookupError> {
        match self.locate(id, Some(kind))? {
            Located::Linked(_) | Located::Found(_) => Ok(()),
            Located::Given(path) => Ok(check_kind(&read_metadata(path)?, Some(kind))?),
        }
    }

    /// Returns the file of the plugin with an id (or the path itself), without running its code. Not real-time.
    ///
    /// # Errors
    /// [`LookupError`] if the id is unknown or ambiguous, or belongs to a plugin that is linked into this program.
    pub fn file(&self, id: &str) -> Result<PathBuf, LookupError> {
        match self.locate(id, None)? {
            Located::Linked(_) => Err(self.unknown(id, None)),
            Located::Found(found) => Ok(found.path.clone()),
            Located::Given(path) => Ok(path.into()),
        }
    }

    /// Returns true if a command or a scene names a plugin by the path of its file: the name contains a separator, or is not an id but
    /// the name of a file in the current folder. Not real-time.
    #[must_use]
    pub fn is_path(&self, name: &str) -> bool {
        let mut known = self.linked.iter().map(Plugin::metadata).chain(self.found());
        name.contains(std::path::is_separator)
            || (known.all(|plugin| plugin.id != name) && Path::new(name).is_file())
    }

    fn find(&self, id: &str, kind: Option<PluginKind>) -> Result<Plugin, LookupError> {
        match self.locate(id, kind)? {
            Located::Linked(linked) => Ok(linked.clone()),
            Located::Found(found) => self.open(&found.path),
            Located::Given(path) => {
                let plugin = self.open(path)?;
                check_kind(plugin.metadata(), kind)?;
                Ok(plugin)
            }
        }
    }

    fn locate<'a>(&'a self, id: &'a str, kind: Option<PluginKind>) -> Result<Located<'a>, LookupError> {
        if self.is_path(id) {
            return Ok(Located::Given(Path::new(id)));
        }
        let fits = |plugin: &Metadata| plugin.id == id && kind.is_none_or(|kind| plugin.kind == kind);
        if let Some(linked) = self.linked.iter().find(|plugin| fits(plugin.metadata())) {
            return Ok(Located::Linked(linked));
        }
        let found = self.found().iter().find(|known| known.id == id).ok_or_else(|| self.unknown(id, kind))?;
        check_kind(found, kind)?;
        if let Some((one, other)) = self.findings.ambiguous.iter().find(|(one, _)| one.path == found.path) {
            let (one, other) = (one.path.clone(), other.path.clone());
            return Err(LookupError::Ambiguous { id: id.to_owned(), one, other });
        }
        Ok(Located::Found(found))
    }

    /// Returns the error about an unknown id, with the closest known id and a hint.
    fn unknown(&self, id: &str, kind: Option<PluginKind>) -> LookupError {
        let candidates = self.found().iter().filter(|known| kind.is_none_or(|kind| known.kind == kind));
        let unknown_program = || installation_is_unknown().map(str::to_owned);
        let broken = || self.findings.broken.iter().map(ToString::to_string).find(|text| text.contains(id));
        // Outside the default build, for what they alone need: readers of meshes, the solver of bodies, Python.
        let optional = [
            ("surface", "flotor-surface"),
            ("world", "flotor-world"),
            ("simulator", "flotor-simulator"),
            ("python", "flotor-python-model"),
        ];
        let package = optional.into_iter().find(|(plugin, _)| *plugin == id).map(|(_, package)| package);
        let by_name =
            || package.map(|name| format!("build it in Flotor's sources: `cargo build --release -p {name}`"));
        LookupError::Unknown {
            id: id.to_owned(),
            kind,
            nearest: nearest(id, candidates.map(|known| known.id.as_str())).map(str::to_owned),
            hint: broken().or_else(by_name).or_else(|| self.unbuilt()).or_else(unknown_program),
        }
    }

    /// Returns advice to build the plugins of the first folder of the scene that contains none; `None` if every folder has one.
    fn unbuilt(&self) -> Option<String> {
        let with_plugin: Vec<_> = self.found().iter().filter_map(|known| known.path.parent()).collect();
        let mut of_scene = self.folders.iter().take(self.of_scene);
        let empty = of_scene.find(|folder| !with_plugin.contains(&folder.as_path()))?;
        Some(format!("`{}` contains no plugin: build it first", empty.display()))
    }

    /// Loads a file, or returns the plugin loaded before if the file is unchanged: libraries are never unloaded, so a thousand models
    /// of one plugin share one mapping of the file.
    fn open(&self, path: &Path) -> Result<Plugin, LookupError> {
        // Read before the bytes: a write in between is noticed at the next load.
        let Ok(stamp) = FileStamp::of(path) else { return load_in_time(path) }; // reports the error
        let mut loaded = lock(&self.loaded);
        if let Some(known) = loaded.iter().find(|known| known.path == path && known.stamp.is_same_as(&stamp))
        {
            return Ok(known.plugin.clone());
        }
        let Ok(NamedFile { hash, .. }) = NamedFile::read(path) else { return load_in_time(path) };
        if let Some(known) = loaded.iter_mut().find(|known| known.path == path && known.hash == hash) {
            known.stamp = stamp;
            return Ok(known.plugin.clone());
        }
        let plugin = load_in_time(path)?;
        loaded.push(Loaded { path: path.into(), stamp, hash, plugin: plugin.clone() });
        Ok(plugin)
    }
}

/// Returns the reason why plugins beside this program are not found, if the system does not report the program's path; `None`
/// otherwise.
#[must_use]
pub fn installation_is_unknown() -> Option<&'static str> {
    own_folders().is_empty().then_some(UNKNOWN_PROGRAM)
}

/// Returns the plugin folders of this installation, relative to the program: build folders, and the layout of a release archive.
fn own_folders() -> Vec<PathBuf> {
    let program = flotor_servo::guest::program().cloned().or_else(|| std::env::current_exe().ok());
    let Some(own) = program.as_deref().and_then(Path::parent) else { return Vec::new() };
    // `deps` before the folder itself: `cargo run` refreshes only `deps`, and an older copy may lie above it.
    let beside = ["deps", "", "plugins", "../lib/flotor/plugins"];
    let folder = |name: &str| if name.is_empty() { own.to_path_buf() } else { own.join(name) };
    // Canonical, so that the summary of a run shows no `bin/..`.
    beside.map(folder).map(|folder| folder.canonicalize().unwrap_or(folder)).to_vec()
}

/// Returns true if a plugin belongs to this installation: linked into the program, or located in a plugin folder of the installation.
/// Not real-time.
pub(crate) fn is_installed(plugin: &Path) -> bool {
    let Ok(file) = plugin.canonicalize() else { return plugin.as_os_str().is_empty() };
    let folder = file.parent();
    own_folders().iter().any(|own| own.canonicalize().is_ok_and(|own| Some(own.as_path()) == folder))
}

/// Loads a plugin file, with a time limit for its initialisers.
fn load_in_time(path: &Path) -> Result<Plugin, LookupError> {
    let path = path.to_path_buf();
    let loaded = CallThread::default().run_while(calls::limit(), calls::is_to_begin, move |progress| {
        progress.enter(&path.display().to_string(), Call::Load);
        load_file(&path)
    });
    Ok(loaded??)
}

/// Loads a plugin file; all plugin files of the host are loaded here. Not real-time; runs the plugin's code.
///
/// # Errors
/// [`LoadError`], with file, cause and remedy.
pub fn load_file(path: &Path) -> Result<Plugin, LoadError> {
    // SAFETY: the user who runs this program guarantees the plugins that the scene, the command line and the searched
    // folders name, as for the program itself; folders that anybody may write into are not searched.
    unsafe { Plugin::load(path) }
}

/// Returns an error if a plugin is not of the requested kind; `None` accepts any kind.
fn check_kind(plugin: &Metadata, kind: Option<PluginKind>) -> Result<(), LoadError> {
    let Some(kind) = kind.filter(|kind| *kind != plugin.kind) else { return Ok(()) };
    let Metadata { path, id, kind: found, .. } = plugin.clone();
    Err(LoadError::OtherKind { path, id, found: found.name(), wanted: kind.name() })
}
