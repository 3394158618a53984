//! `flotor view`: starts the viewer, which is a program of its own, and tells it where the plugins are.

use super::CommandError;
use crate::record::{Recording, Role};
use crate::registry::Registry;
use clap::Args;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Name of the viewer's file, beside this program.
const VIEWER: &str = "flotor-viewer";

/// Show what the hand feels: the spring in 3D, and traces.
#[derive(Args)]
#[command(after_help = "Examples:\n  \
    flotor run --clock virtual --record run.mcap && flotor view --screenshot run.png run.mcap\n  \
    flotor view --screenshot run.png --at 2.5 --look light --size 1920x1200 --scale 1.5 run.mcap")]
pub(crate) struct ViewArguments {
    /// A recording
    file: PathBuf,
    /// Write a picture of a moment; needs no display and no GPU
    #[arg(long, value_name = "OUT.png")]
    screenshot: PathBuf,
    /// The moment to show, s (default: that of the largest force)
    #[arg(long, value_name = "SECONDS")]
    at: Option<String>,
    /// Light or dark
    #[arg(long, value_name = "dark|light")]
    look: Option<String>,
    /// Width and height of the picture, pixels (default: 1280x800)
    #[arg(long, value_name = "WxH")]
    size: Option<String>,
    /// Size of text and lines, 1 to 3 (default: 1)
    #[arg(long, value_name = "FACTOR")]
    scale: Option<String>,
}

pub(crate) fn run(arguments: &ViewArguments) -> Result<(), CommandError> {
    let mut viewer = Command::new(beside_this_program()?);
    // Opened here as well: what is wrong with the file is told before anything else is started.
    let recording = Recording::open(&arguments.file)?;
    viewer.arg(&arguments.file).arg("--screenshot").arg(&arguments.screenshot);
    for plugin in plugin_files(&recording) {
        viewer.arg("--plugin").arg(plugin);
    }
    let options = [
        ("--at", &arguments.at),
        ("--look", &arguments.look),
        ("--size", &arguments.size),
        ("--scale", &arguments.scale),
    ];
    for (name, value) in options {
        viewer.args(value.iter().flat_map(|value| [name, value]));
    }
    // This process becomes the viewer: its exit code and its words are those of the command.
    let cause = viewer.exec();
    Err(CommandError::file(Path::new(VIEWER), "cannot start the viewer", cause))
}

/// The viewer's file, which is built by name and lies where this program lies.
fn beside_this_program() -> Result<PathBuf, CommandError> {
    let own = std::env::current_exe().map_err(|cause| CommandError::Failed(cause.to_string()))?;
    let viewer = own.with_file_name(format!("{VIEWER}{}", std::env::consts::EXE_SUFFIX));
    if viewer.is_file() {
        return Ok(viewer);
    }
    Err(CommandError::Usage(format!(
        "the viewer is not built: there is no `{}`; `cargo build --release -p flotor-viewer` builds it",
        viewer.display()
    )))
}

/// Files of the models of a recording, as far as they are found; the viewer says what it misses.
fn plugin_files(recording: &Recording) -> Vec<PathBuf> {
    let registry = Registry::search(&[]);
    let models = recording.run().plugins.iter().filter(|plugin| matches!(plugin.role, Role::Model(_)));
    let found = models.filter_map(|model| registry.found().iter().find(|known| known.id == model.id));
    found.map(|metadata| metadata.path.clone()).collect()
}
