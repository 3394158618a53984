//! `flotor new`: creates the folder of a plugin, or the scene of a mesh file.

use crate::cli::object::object_scene;
use crate::scaffold::{Built, Contract, Language, PluginName, Scaffold, ScaffoldError, Template, scaffold};
use clap::{Args, ValueEnum};
use flotor_command::say;
use flotor_command::{CommandError, command_line, quoted, style};
use flotor_session::registry::Registry;
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// Create a plugin: a folder that builds, passes `validate` and runs; or the scene of a mesh file.
#[derive(Args)]
#[command(after_help = "Examples:\n  flotor new model jelly\n  flotor new device crank\n  \
    flotor new model jelly --language c\n  flotor new model jelly --beside\n  flotor new model jelly --beside --language python\n  flotor new model jelly --vendor\n  \
    flotor new scene duck --object duck.stl\n\nCreates the folder ./NAME with a plugin that builds, passes \
    `flotor validate` and runs in the scene of the same folder; of a scene, the file \
    ./NAME.toml.\nIt overwrites no file.")]
pub(crate) struct NewArguments {
    /// Kind of plugin, or a scene
    #[arg(value_enum)]
    kind: Kind,
    /// Id of the plugin or name of the scene: at most 32 lower-case letters, digits and single hyphens, a letter first
    name: String,
    /// With `scene`: mesh file (STL, OBJ, PLY, GLB) that the scene touches
    #[arg(long, value_name = "FILE")]
    object: Option<PathBuf>,
    /// A model too slow for the loop: it computes asynchronously and publishes contacts
    #[arg(long)]
    beside: bool,
    /// Programming language
    #[arg(long, value_enum, default_value = "rust")]
    language: Language,
    /// With --language rust: folder of the contract's sources (default: the sources of this installation; if there are none, and
    /// without --vendor, the crate of the registry)
    #[arg(long, value_name = "PATH")]
    hal: Option<PathBuf>,
    /// With --language rust: copy the contract's sources into the new folder, which then builds in every checkout
    #[arg(long)]
    vendor: bool,
}

#[derive(Clone, Copy, ValueEnum)]
enum Kind {
    /// Computes the wrench at a pose
    Model,
    /// Measures the pose and exerts a wrench
    Device,
    /// Touches the object of a mesh file
    Scene,
}

pub(crate) fn run(arguments: &NewArguments) -> Result<(), CommandError> {
    let name = PluginName::new(&arguments.name).map_err(ScaffoldError::from)?;
    let template = match (arguments.kind, arguments.beside, &arguments.object) {
        (Kind::Model, false, None) => Template::Model,
        (Kind::Model, true, None) => Template::AsynchronousModel,
        (Kind::Device, false, None) => Template::Device,
        (Kind::Scene, false, Some(file)) => return new_scene(&name, file),
        (Kind::Scene, _, None) => {
            return Err(CommandError::Usage(
                "`flotor new scene` needs a mesh file: add `--object FILE`".to_owned(),
            ));
        }
        (Kind::Device | Kind::Scene, true, _) => {
            let problem =
                "`--beside` is for models: the loop reads and writes a device in every tick; omit it";
            return Err(CommandError::Usage(problem.to_owned()));
        }
        (Kind::Model | Kind::Device, _, Some(_)) => {
            return Err(CommandError::Usage(
                "only a scene has an object: omit `--object`, or use `flotor new scene`".to_owned(),
            ));
        }
    };
    if arguments.language == Language::Python && template != Template::AsynchronousModel {
        let problem = "`--language python` is for models that are too slow for the loop: add `--beside`, or use rust or c";
        return Err(CommandError::Usage(problem.to_owned()));
    }
    refuse_an_id_in_use(&name)?;
    let sources = if arguments.vendor { Contract::copied } else { Contract::of_installation };
    let contract = sources(arguments.hal.as_deref())?;
    let made = scaffold(Path::new("."), &name, template, arguments.language, &contract)?;
    report(&name, &made);
    Ok(())
}

/// Writes the scene of a mesh file.
fn new_scene(name: &PluginName, object: &Path) -> Result<(), CommandError> {
    let scene = object_scene(object, &[], &Registry::search(&[]))?;
    let file = PathBuf::from(format!("{}.toml", name.id()));
    let created =
        std::fs::File::create_new(&file).and_then(|mut created| created.write_all(scene.text.as_bytes()));
    created.map_err(|cause| CommandError::file(&file, "cannot write", cause))?;
    let file = file.display().to_string();
    say!("{file}\n\nNext:\n  {}", command_line(["run", file.as_str(), "--plot", "run.svg"]));
    Ok(())
}

/// Returns an error if another plugin has the id: of two plugins with the same id the first one found hides the other.
fn refuse_an_id_in_use(name: &PluginName) -> Result<(), CommandError> {
    let registry = Registry::search(&[]);
    let Some(known) = registry.found().iter().find(|known| known.id == name.id()) else { return Ok(()) };
    Err(CommandError::Usage(format!(
        "`{0}` is already the id of {1}; choose another, such as `my-{0}`",
        name.id(),
        known.path.display()
    )))
}

fn report(name: &PluginName, made: &Scaffold) {
    say!("{} in {}:", style::title(&name.title()), made.folder.display());
    let first = made.files.first().map_or("", String::as_str);
    say!("  {first:<16} the plugin: change this");
    for file in made.files.iter().skip(1) {
        say!("  {file}");
    }
    say!("\nNext:");
    say!("  cd {}", quoted(&made.folder.display().to_string()));
    if let Some(Built { command, library }) = &made.built {
        say!("  {command}\n  {}", command_line(["validate", library.as_str()]));
    }
    say!("  flotor run scene.toml --plot run.svg");
    if let Some(test) = made.files.iter().find(|file| file.ends_with(".test.toml")) {
        say!("  {}", command_line(["test", test.as_str()]));
    }
}

impl From<ScaffoldError> for CommandError {
    fn from(error: ScaffoldError) -> Self {
        match error {
            ScaffoldError::Write { path, cause } => Self::file(&path, "cannot write", cause),
            other => Self::Usage(other.to_string()),
        }
    }
}
