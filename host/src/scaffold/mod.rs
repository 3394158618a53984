//! `flotor new`: a new plugin crate that builds, validates and runs unchanged.
//!
//! The templates are whole files that compile once `your-name` (the id), `your_name` (in symbols), `YourName` (the type), `Your name`
//! (for users) and the placeholders for build commands and paths are replaced. A new crate builds in any folder and on any machine:
//! it depends on a version of the contract, it has a workspace of its own, and the settings for this machine are in a file that git
//! ignores. A plugin in C has a copy of the header.

mod contract;
mod error;
mod name;
mod vendor;

pub use contract::{Contract, ContractFolder};
pub use error::ScaffoldError;
pub use name::{NameError, PluginName};

use crate::platform::{C_COMPILER, canonical};
use flotor_hal::abi::C_HEADER;
use std::env::consts::{DLL_PREFIX, DLL_SUFFIX};
use std::path::{Path, PathBuf};
use vendor::write_file;

/// What a new plugin is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Template {
    /// Model that computes a wrench in every tick.
    Model,
    /// Model that computes contacts asynchronously, at a rate of its own.
    AsynchronousModel,
    /// Device.
    Device,
}

/// Programming language of a plugin.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Language {
    /// A cargo crate
    Rust,
    /// One C file
    C,
    /// One Python file, with `--beside`; it needs no build
    Python,
}

/// Folder of a created plugin, with the paths of its files and the build command.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Scaffold {
    /// Path of the folder.
    pub folder: PathBuf,
    /// Paths of the files, relative to the folder; the first file is the one to edit.
    pub files: Vec<String>,
    /// Build of the plugin; `None` for a language without one.
    pub built: Option<Built>,
}

/// Build of a plugin.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Built {
    /// Command that builds the plugin, to be run in the folder.
    pub command: String,
    /// Path of the built library, relative to the folder.
    pub library: String,
}

/// Creates the plugin `parent/NAME` from the files of a template in a language. Not real-time.
///
/// # Errors
/// If the name clashes with a type of the template, the folder exists (it is not changed) or belongs to Flotor's workspace, path or
/// manifest of the contract cannot be used, or a file cannot be read or written.
pub fn scaffold(
    parent: &Path,
    name: &PluginName,
    template: Template,
    language: Language,
    contract: &Contract,
) -> Result<Scaffold, ScaffoldError> {
    let text = Placeholders::new(name, language, contract);
    let files = files(template, language);
    if files.iter().any(|(path, source)| path.ends_with(".rs") && text.clashes_with(source)) {
        return Err(ScaffoldError::Clash { id: name.id().to_owned(), type_name: name.type_name() });
    }
    if contract.has_as_member(parent) {
        return Err(ScaffoldError::InsideWorkspace(canonical(parent).unwrap_or_else(|_| parent.into())));
    }
    let folder = parent.join(name.id());
    make_folder(&folder)?;
    let mut written = Vec::new();
    for (path, source) in files {
        let path = text.fill(path);
        write_file(&folder.join(&path), &text.fill(source))?;
        written.push(path);
    }
    if language == Language::Rust {
        written.extend(contract.write_beside(&folder)?);
    }
    Ok(Scaffold {
        folder,
        files: written,
        built: (language != Language::Python).then(|| Built {
            command: text.fill(BUILD),
            library: text.fill(&format!("path/to/library/{DLL_PREFIX}your_name{DLL_SUFFIX}")),
        }),
    })
}

/// Returns path and template of each file of a plugin; the file to edit comes first.
fn files(template: Template, language: Language) -> &'static [(&'static str, &'static str)] {
    const IGNORE: (&str, &str) = (".gitignore", "/target\n/ANY_LIBRARY\n/.cargo/config.toml\n");
    const HEADER: (&str, &str) = ("flotor.h", C_HEADER);
    const MODEL_SCENE: (&str, &str) = ("scene.toml", include_str!("templates/model-scene.toml"));
    const SLOW_SCENE: (&str, &str) = ("scene.toml", include_str!("templates/asynchronous-scene.toml"));
    const SLOW_TEST: (&str, &str) = ("your-name.test.toml", include_str!("templates/asynchronous-test.toml"));
    const DEVICE_SCENE: (&str, &str) = ("scene.toml", include_str!("templates/device-scene.toml"));
    const MODEL_TEST: (&str, &str) = ("your-name.test.toml", include_str!("templates/model-test.toml"));
    const MODEL_CURVE: (&str, &str) = ("your-name.csv", include_str!("templates/model.csv"));
    const WORKFLOW: (&str, &str) = (".github/workflows/haptics.yml", include_str!("templates/workflow.yml"));
    const DEVICE_TEST: (&str, &str) = ("your-name.test.toml", include_str!("templates/device-test.toml"));
    const MANIFEST: (&str, &str) = ("Cargo.toml", include_str!("templates/rust/manifest.toml"));
    const STYLE: (&str, &str) = ("rustfmt.toml", "max_width = 110\nuse_small_heuristics = \"Max\"\n");
    match (template, language) {
        (Template::Model, Language::Rust) => {
            const MODEL: (&str, &str) = ("src/lib.rs", include_str!("templates/rust/model.rs"));
            const SHAPE: (&str, &str) = ("src/shape.rs", include_str!("templates/rust/shape.rs"));
            &[MODEL, SHAPE, MODEL_SCENE, MODEL_TEST, MODEL_CURVE, WORKFLOW, MANIFEST, STYLE, IGNORE]
        }
        (Template::AsynchronousModel, Language::Rust) => {
            const MODEL: (&str, &str) = ("src/lib.rs", include_str!("templates/rust/asynchronous.rs"));
            &[MODEL, SLOW_SCENE, SLOW_TEST, WORKFLOW, MANIFEST, STYLE, IGNORE]
        }
        (Template::Device, Language::Rust) => {
            const DEVICE: (&str, &str) = ("src/lib.rs", include_str!("templates/rust/device.rs"));
            &[DEVICE, DEVICE_SCENE, DEVICE_TEST, WORKFLOW, MANIFEST, STYLE, IGNORE]
        }
        (Template::Model, Language::C) => {
            const MODEL: (&str, &str) = ("plugin.c", include_str!("templates/c/model.c"));
            &[MODEL, MODEL_SCENE, MODEL_TEST, MODEL_CURVE, WORKFLOW, HEADER, IGNORE]
        }
        (Template::AsynchronousModel, Language::C) => {
            const MODEL: (&str, &str) = ("plugin.c", include_str!("templates/c/asynchronous.c"));
            &[MODEL, SLOW_SCENE, SLOW_TEST, WORKFLOW, HEADER, IGNORE]
        }
        (Template::Device, Language::C) => {
            const DEVICE: (&str, &str) = ("plugin.c", include_str!("templates/c/device.c"));
            &[DEVICE, DEVICE_SCENE, DEVICE_TEST, WORKFLOW, HEADER, IGNORE]
        }
        // The command refuses any other template.
        (_, Language::Python) => {
            const MODEL: (&str, &str) = ("your_name.py", include_str!("templates/python/model.py"));
            const SCENE: (&str, &str) = ("scene.toml", include_str!("templates/python/scene.toml"));
            const TEST: (&str, &str) = ("your-name.test.toml", include_str!("templates/python/test.toml"));
            &[MODEL, SCENE, TEST]
        }
    }
}

/// Placeholder for the command that builds a plugin.
const BUILD: &str = "BUILD_COMMAND";

/// Placeholders of the templates with their values, which may contain later placeholders.
struct Placeholders([(&'static str, String); 9]);

impl Placeholders {
    fn new(name: &PluginName, language: Language, contract: &Contract) -> Self {
        // Workflows of a forge run on Linux.
        let cc = "cc -std=c11 -O2 -Wall -Wextra -shared -fPIC -o libyour_name.so plugin.c -lm";
        let cargo = "cargo build --release";
        let (build, on_a_forge, built_in) = match language {
            Language::Rust => (cargo, format!("{cargo}{}", contract.option_on_a_forge()), "target/release"),
            Language::C => (C_COMPILER.unwrap_or(cc), cc.to_owned(), "."),
            Language::Python => ("", String::new(), "."),
        };
        Self([
            (BUILD, build.to_owned()),
            ("WORKFLOW_BUILD", on_a_forge),
            ("path/to/library", built_in.to_owned()),
            ("ANY_LIBRARY", format!("{DLL_PREFIX}*{DLL_SUFFIX}")),
            ("your-name", name.id().to_owned()),
            ("your_name", name.symbol()),
            ("YourName", name.type_name()),
            ("Your name", name.title()),
            ("CONTRACT_DEPENDENCY", contract.dependency()),
        ])
    }

    fn fill(&self, template: &str) -> String {
        self.0.iter().fold(template.to_owned(), |text, (placeholder, value)| text.replace(placeholder, value))
    }

    /// Returns true if the Rust template uses a type with the name of the plugin's own type, which would hide it.
    fn clashes_with(&self, template: &str) -> bool {
        let [_, _, _, _, _, _, (_, type_name), ..] = &self.0;
        let code = template.lines().filter(|line| !line.trim_start().starts_with("//"));
        let mut words = code.flat_map(|line| line.split(|c: char| !c.is_alphanumeric() && c != '_'));
        words.any(|word| word == type_name)
    }
}

fn make_folder(folder: &Path) -> Result<(), ScaffoldError> {
    std::fs::create_dir(folder).map_err(|cause| match cause.kind() {
        std::io::ErrorKind::AlreadyExists => ScaffoldError::Exists(folder.into()),
        _ => ScaffoldError::Write { path: folder.into(), cause },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Lines a newcomer has to read: no comments, no blank lines, nothing after the export.
    fn useful_lines(template: &str) -> usize {
        let code = template.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with("//"));
        code.take_while(|line| *line != "#[cfg(test)]").count()
    }

    #[test]
    fn a_useful_model_takes_forty_lines() {
        for template in [Template::Model, Template::AsynchronousModel] {
            let [(_, source), ..] = files(template, Language::Rust) else { panic!("no file to edit") };
            let lines = useful_lines(source);
            assert!((10..=40).contains(&lines), "{template:?}: {lines} lines");
        }
    }

    #[test]
    fn no_placeholder_is_left() {
        let name = PluginName::new("soft-wall").unwrap();
        for language in [Language::Rust, Language::C, Language::Python] {
            let text = Placeholders::new(&name, language, &Contract::Published);
            let templates = [Template::Model, Template::AsynchronousModel, Template::Device];
            for (path, source) in templates.into_iter().flat_map(|template| files(template, language)) {
                let filled = text.fill(source);
                for placeholder in text.0.iter().map(|(placeholder, _)| placeholder) {
                    assert!(!filled.contains(placeholder), "{path} still says {placeholder}");
                }
            }
        }
    }

    #[test]
    fn a_type_of_the_contract_is_no_name() {
        let clashes = |name: &str, template: &str| {
            let name = PluginName::new(name).unwrap();
            Placeholders::new(&name, Language::Rust, &Contract::Published).clashes_with(template)
        };
        assert!(clashes("wrench", include_str!("templates/rust/model.rs")));
        assert!(clashes("model-info", include_str!("templates/rust/model.rs")));
        assert!(clashes("device", include_str!("templates/rust/device.rs")));
        assert!(!clashes("wall", include_str!("templates/rust/model.rs")));
    }
}
