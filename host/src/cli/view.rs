//! `flotor view`: starts the viewer, which is a program of its own, and tells it where the plugins are.

use super::CommandError;
use super::companion::Companion;
use crate::record::Recording;
use crate::registry::Registry;
use clap::Args;
use std::ffi::OsString;
use std::path::PathBuf;

/// The viewer, built by name because of its graphics stack.
pub(super) const VIEWER: Companion<'_> =
    Companion { program: "flotor-viewer", build: "cargo build --release -p flotor-viewer" };

/// Show what the hand feels: the spring in 3D, and traces.
#[derive(Args)]
#[command(after_help = "Examples:\n  \
    flotor view                                   the run that goes on in another terminal\n  \
    flotor run --clock virtual --record run.mcap && flotor view run.mcap\n  \
    flotor view --screenshot run.png run.mcap     a picture, without display or GPU\n  \
    flotor view --screenshot run.png --at 2.5 --look light --size 1920x1200 --scale 1.5 run.mcap\n  \
    flotor view --measure 10 run.mcap             pictures made and processor time taken in ten seconds")]
pub(crate) struct ViewArguments {
    /// A recording (without: the running host)
    file: Option<PathBuf>,
    /// Write a picture of a moment; needs no display and no GPU
    #[arg(long, value_name = "OUT.png", requires = "file")]
    screenshot: Option<PathBuf>,
    /// The picture is that of the whole window, with panels
    #[arg(long, requires = "screenshot")]
    window: bool,
    /// Watch the run of this process (default: the newest run)
    #[arg(long, value_name = "PID", conflicts_with = "file")]
    run: Option<u32>,
    /// The moment to show, s (default: that of the largest force)
    #[arg(long, value_name = "SECONDS")]
    at: Option<String>,
    /// Light or dark
    #[arg(long, value_name = "dark|light")]
    look: Option<String>,
    /// Width and height of picture or window (default: 1280x800)
    #[arg(long, value_name = "WxH")]
    size: Option<String>,
    /// Size of text and lines, 1 to 3 (default: 1)
    #[arg(long, value_name = "FACTOR")]
    scale: Option<String>,
    /// Say what the window costs over so many seconds, and close it then
    #[arg(long, value_name = "SECONDS", conflicts_with = "screenshot")]
    measure: Option<String>,
}

pub(crate) fn run(arguments: &ViewArguments) -> Result<(), CommandError> {
    let mut for_viewer: Vec<OsString> = Vec::new();
    let mut add = |name: &str, value: OsString| for_viewer.extend([name.into(), value]);
    if let Some(file) = &arguments.file {
        // Opened here as well: what is wrong with the file is told before anything else is started.
        let recording = Recording::open(file)?;
        plugin_files(&recording).into_iter().for_each(|plugin| add("--plugin", plugin.into()));
    }
    let options = [
        ("--at", &arguments.at),
        ("--look", &arguments.look),
        ("--size", &arguments.size),
        ("--scale", &arguments.scale),
        ("--measure", &arguments.measure),
    ];
    for (name, value) in options {
        value.iter().for_each(|value| add(name, value.into()));
    }
    if let Some(process) = arguments.run {
        add("--run", process.to_string().into());
    }
    if let Some(screenshot) = &arguments.screenshot {
        add("--screenshot", screenshot.into());
    }
    for_viewer.extend(arguments.window.then(|| "--window".into()));
    for_viewer.extend(arguments.file.iter().map(|file| file.into()));
    VIEWER.become_with(&for_viewer)
}

/// Files of the plugins of a recording, as far as they are found; the viewer says what it misses.
fn plugin_files(recording: &Recording) -> Vec<PathBuf> {
    let registry = Registry::search(&[]);
    let plugins = recording.run().plugins.iter();
    let found = plugins.filter_map(|plugin| registry.found().iter().find(|known| known.id == plugin.id));
    found.map(|metadata| metadata.path.clone()).collect()
}
