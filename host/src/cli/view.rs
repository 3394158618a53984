//! `flotor view`: starts the viewer, a separate program, with the paths of the plugins.

use super::bridge::{BRIDGE, Way, is_remote};
use clap::Args;
use flotor_command::options::PluginPathOption;
use flotor_command::separate::{Running, SeparateProgram};
use flotor_command::{CommandError, note};
use flotor_record::{Ending, Recording};
use flotor_session::registry::Registry;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Show a running session or a recording: the model in 3D, and plots over time.
#[derive(Args)]
#[command(after_help = "Examples:\n  \
    flotor view                                   the session in another terminal\n  \
    flotor view zenoh/lab                         a session on another machine (`flotor bridge`)\n  \
    flotor run --clock virtual --record run.mcap && flotor view run.mcap\n  \
    flotor view before.mcap after.mcap            two recordings over each other\n  \
    flotor view --screenshot run.png run.mcap     a picture, without display or GPU\n  \
    flotor view --screenshot run.png --at 2.5 --look light --size 1920x1200 --scale 1.5 run.mcap\n  \
    flotor view --screenshot run.png --view 80,5,1.5 run.mcap\n  \
    flotor view --measure 10 run.mcap             number of pictures and processor time in 10 s")]
pub(crate) struct ViewArguments {
    /// Recording, or zenoh/NAME for a remote session (default: the newest session of this machine)
    #[arg(value_name = "FILE.mcap | zenoh/NAME")]
    file: Option<PathBuf>,
    /// Second recording, drawn over the first (with --screenshot: only with --window): with dashed traces, and the handle as a
    /// transparent ball
    #[arg(value_name = "FILE.mcap", conflicts_with_all = ["export", "screen"])]
    second: Option<PathBuf>,
    /// Write a picture of one moment (PNG); needs no display and no GPU
    #[arg(long, value_name = "OUT.png", requires = "file")]
    screenshot: Option<PathBuf>,
    /// With --screenshot: draw the whole window with its panels (default: only the 3D view and the traces)
    #[arg(long, requires = "screenshot")]
    window: bool,
    /// Show the session of this process (default: the newest session)
    #[arg(long, value_name = "PID", conflicts_with = "file")]
    run: Option<u32>,
    /// Write the traces of the recording as a table (.csv) or a plot (.svg, .png); a plot is light, or dark with --look dark
    #[arg(long, value_name = "OUT", requires = "file", conflicts_with = "screenshot")]
    export: Option<PathBuf>,
    /// Traces shown: force, torque, position, rotation, velocity, angular-velocity, energy, stiffness, lateness (default:
    /// force,position; in a window: the traces of the last window)
    #[arg(long, value_name = "LIST")]
    traces: Option<String>,
    /// Plot force over position along this axis, beside the traces
    #[arg(long, value_name = "x|y|z")]
    force_position: Option<String>,
    /// Force of an arrow of full length, 0.001 to 10000 N; set this force for comparable pictures (default: the largest force of
    /// the run)
    #[arg(long, value_name = "NEWTONS", conflicts_with = "export")]
    arrow_force: Option<String>,
    /// With --export: title of a plot (default: the title of the run)
    #[arg(long, value_name = "TEXT", requires = "export")]
    title: Option<String>,
    /// With --screenshot: draw a screen of a sitting, as `flotor study --screen json` writes it
    #[arg(long, value_name = "JSON", requires = "screenshot", conflicts_with_all = ["window", "view", "traces", "force_position", "device", "arrow_force"])]
    screen: Option<String>,
    /// With --screen: file (TOML) with the texts of the screens in another language: a translated copy of viewer/texts/english.toml,
    /// with all its keys (default: English)
    #[arg(long, value_name = "FILE", requires = "screen")]
    texts: Option<String>,
    /// Device of the recording whose numbers and traces are shown, where there are several (default: the first)
    #[arg(long, value_name = "NAME", requires = "file")]
    device: Option<String>,
    /// Time in the recording to show, s (default: the time of the largest force)
    #[arg(long, value_name = "SECONDS", requires = "file", conflicts_with = "export")]
    at: Option<String>,
    /// Colours: dark or light (default: dark, with --export light; in a window: the look of the last window)
    #[arg(long, value_name = "dark|light")]
    look: Option<String>,
    /// Width and height of picture or window, 64 to 8192 pixels each (default: 1280x800, with --export 1800x1000, higher if the
    /// traces need it; in a window: the size of the last window)
    #[arg(long, value_name = "WxH")]
    size: Option<String>,
    /// Size of text and lines, 1 to 3 (default: 1; in a window: the scale of the last window)
    #[arg(long, value_name = "FACTOR", conflicts_with = "export")]
    scale: Option<String>,
    /// With --screenshot: camera in degrees, -360 to 360 to the right and -2 to 88 above the horizon, and a zoom, 0.2 to 3
    /// (default: 31.5,13.8,1)
    #[arg(long, value_name = "AZIMUTH,INCLINATION[,ZOOM]", allow_hyphen_values = true)]
    #[arg(requires = "screenshot", conflicts_with = "window")]
    view: Option<String>,
    /// Measure the processor time of the window for this duration, 1 to 3600 s, then close the window
    #[arg(long, value_name = "SECONDS", conflicts_with_all = ["screenshot", "export"])]
    measure: Option<String>,
    #[command(flatten)]
    plugin_path: PluginPathOption,
    #[command(flatten)]
    way: Way,
}

pub(crate) fn run(arguments: &ViewArguments) -> Result<(), CommandError> {
    let mut for_viewer: Vec<OsString> = Vec::new();
    let mut add = |name: &str, value: OsString| for_viewer.extend([name.into(), value]);
    let remote = arguments.file.as_deref().filter(|file| is_remote(file.as_os_str()));
    let file = if remote.is_some() { None } else { arguments.file.as_ref() };
    if remote.is_some()
        && let Some(what) = of_recordings_only(arguments)
    {
        return Err(CommandError::Usage(format!(
            "{what} needs a recording: record the session with `flotor record zenoh/NAME --out FILE.mcap`"
        )));
    }
    let registry = arguments.plugin_path.registry();
    if let Some(file) = file {
        // Opened here as well, so that an error in the file is reported before another program starts.
        let recording = Recording::open(file)?;
        plugin_files(&recording, &registry).into_iter().for_each(|plugin| add("--plugin", plugin.into()));
        let written = [
            (&arguments.screenshot, "the picture shows only"),
            (&arguments.export, "the file of traces has only"),
        ];
        if let Some((_, what)) = written.iter().find(|(out, _)| out.is_some()) {
            tell_damage(file, recording, what);
        }
        if let Some(second) = &arguments.second {
            Recording::open(second)?;
        }
    } else {
        // The window may open a recording with any of these plugins.
        registry.found().iter().for_each(|plugin| add("--plugin", plugin.path.clone().into()));
    }
    let options = [
        ("--at", &arguments.at),
        ("--device", &arguments.device),
        ("--traces", &arguments.traces),
        ("--force-position", &arguments.force_position),
        ("--arrow-force", &arguments.arrow_force),
        ("--title", &arguments.title),
        ("--screen", &arguments.screen),
        ("--texts", &arguments.texts),
        ("--look", &arguments.look),
        ("--size", &arguments.size),
        ("--scale", &arguments.scale),
        ("--view", &arguments.view),
        ("--measure", &arguments.measure),
    ];
    let texts = options.into_iter().filter_map(|(name, value)| Some((name, value.as_ref()?.into())));
    let files = [("--export", &arguments.export), ("--screenshot", &arguments.screenshot)];
    let files = files.into_iter().filter_map(|(name, file)| Some((name, file.as_ref()?.into())));
    let run = arguments.run.map(|process| ("--run", process.to_string().into()));
    texts.chain(run).chain(files).for_each(|(name, value)| add(name, value));
    for_viewer.extend(arguments.window.then(|| "--window".into()));
    for_viewer.extend(file.into_iter().chain(&arguments.second).map(|file| file.into()));
    match remote {
        None => SeparateProgram::VIEWER.become_with(&for_viewer),
        Some(name) => view_remote(&arguments.way.arguments("attach", name.as_os_str()), for_viewer),
    }
}

/// Shows a remote session: the bridge republishes the session on this machine for the viewer, and reports loss of the connection and
/// reconnection on the terminal.
fn view_remote(for_bridge: &[OsString], mut for_viewer: Vec<OsString>) -> Result<(), CommandError> {
    let (mut viewer, mut bridge) = (SeparateProgram::VIEWER.command()?, BRIDGE.command()?);
    let cannot = |command: &Command, cause| {
        CommandError::file(command.get_program().as_ref(), "cannot be started", cause)
    };
    let spawned = bridge.args(for_bridge).stdin(Stdio::null()).spawn();
    let running = Running(spawned.map_err(|cause| cannot(&bridge, cause))?);
    for_viewer.extend(["--run".into(), running.0.id().to_string().into()]);
    let shown = viewer.args(&for_viewer).status();
    let shown = shown.map_err(|cause| cannot(&viewer, cause))?;
    drop(running);
    if shown.success() {
        return Ok(());
    }
    // The viewer has printed the reason.
    std::process::exit(shown.code().unwrap_or(1));
}

/// Returns a description of the first given option that requires a recording; `None` without such an option.
fn of_recordings_only(arguments: &ViewArguments) -> Option<&'static str> {
    let all = [
        (arguments.screenshot.is_some(), "a picture of a moment"),
        (arguments.export.is_some(), "a file of traces"),
        (arguments.device.is_some(), "`--device`"),
        (arguments.at.is_some(), "`--at`"),
        (arguments.second.is_some(), "a second recording"),
    ];
    all.into_iter().find_map(|(is_wanted, what)| is_wanted.then_some(what))
}

/// Prints a note if the recording is damaged, because neither a picture nor a file of traces shows the damage.
fn tell_damage(file: &Path, mut recording: Recording, what: &str) {
    let broken = recording.by_ref().find_map(Result::err);
    let damage = match (broken, recording.ending()) {
        (Some(error), _) => error.to_string(),
        (None, Ending::CutOff) => format!("{}: the end of the recording is missing", file.display()),
        (None, _) => return,
    };
    note(format_args!("{damage}; {what} the readable part"));
}

/// Returns the files of the recording's plugins that are installed; the viewer reports the missing plugins.
fn plugin_files(recording: &Recording, registry: &Registry) -> Vec<PathBuf> {
    let plugins = recording.run().plugins.iter();
    let found = plugins.filter_map(|plugin| registry.found().iter().find(|known| known.id == plugin.id));
    found.map(|metadata| metadata.path.clone()).collect()
}
