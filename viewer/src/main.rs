//! `flotor-viewer`: a running host or a recording in a window, or a picture. Started by `flotor view`, which knows where the
//! plugins are.

use clap::Parser;
use flotor_live::Directory;
use flotor_viewer::app::{Start, Viewer, Wanted};
use flotor_viewer::camera::View;
use flotor_viewer::experiment::StopKey;
use flotor_viewer::experiment::wire::at_standard_streams;
use flotor_viewer::history::History;
use flotor_viewer::palette::Look;
use flotor_viewer::picture::{PictureOptions, draw_without_window, picture, write_png};
use flotor_viewer::shape::shapes_of;
use flotor_viewer::window::{WindowError, WindowOptions, open};
use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Shows what the hand feels: the model in 3D, and plots over time.
#[derive(Parser)]
#[command(name = "flotor-viewer", version, about, max_term_width = 110)]
struct Arguments {
    /// Recording to show; without one, the newest running host
    recording: Option<PathBuf>,
    /// File of a plugin whose shape may be drawn (repeatable)
    #[arg(long = "plugin", value_name = "PLUGIN.so")]
    plugins: Vec<PathBuf>,
    /// Write a picture instead of opening a window; needs no display and no GPU
    #[arg(long, value_name = "OUT.png", requires = "recording")]
    screenshot: Option<PathBuf>,
    /// Watch the run of this process (default: the newest)
    #[arg(long, value_name = "PID", conflicts_with = "recording")]
    run: Option<u32>,
    /// Show the screens of an experiment, told and answered by lines of JSON on standard input and output
    #[arg(long, requires = "run", conflicts_with = "recording")]
    sitting: bool,
    /// The key that is the emergency stop in a sitting
    #[arg(long, value_enum, default_value_t, requires = "sitting")]
    stop_key: StopKey,
    /// The picture is that of the whole window, with panels
    #[arg(long, requires = "screenshot")]
    window: bool,
    /// From where the picture is seen, degrees: to the right of the front, above the horizon, and a zoom (default: 31.5,13.8)
    #[arg(
        long,
        value_name = "AZIMUTH,INCLINATION[,ZOOM]",
        requires = "screenshot",
        conflicts_with = "window",
        allow_hyphen_values = true
    )]
    view: Option<View>,
    /// Name of the device that numbers and traces are of, where there are several (default: the first)
    #[arg(long, value_name = "NAME", requires = "screenshot")]
    device: Option<String>,
    /// The moment to show, s (default: that of the largest force)
    #[arg(long, value_name = "SECONDS")]
    at: Option<f64>,
    #[command(flatten)]
    request: WindowOptions,
}

/// Why there is nothing to see, with an exit code: 2 where the recording or an option is wrong, else 1.
struct Failure(String, u8);

impl Failure {
    fn usage(error: impl Display) -> Self {
        Self(error.to_string(), 2)
    }

    fn file(error: impl Display) -> Self {
        Self(error.to_string(), 1)
    }
}

impl From<WindowError> for Failure {
    fn from(error: WindowError) -> Self {
        let was_there = matches!(error, WindowError::Lost(_) | WindowError::Broken(_));
        Self(error.to_string(), if was_there { 1 } else { 2 })
    }
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(Failure(text, code)) => {
            eprintln!("error: {text}");
            ExitCode::from(code)
        }
    }
}

fn run(arguments: &Arguments) -> Result<(), Failure> {
    let read = |path: &PathBuf| History::read(path).map_err(Failure::usage);
    let history = arguments.recording.as_ref().map(read).transpose()?;
    match (history, &arguments.screenshot) {
        (Some(history), Some(out)) if arguments.window => whole_window(arguments, history, out),
        (Some(history), Some(out)) => screenshot(arguments, history, out),
        (history, _) => {
            let start = match history {
                Some(history) => Start::Recording(history, arguments.at, arguments.plugins.clone()),
                None => live(arguments)?,
            };
            let cost = open(start, arguments.request)?;
            cost.iter().for_each(|cost| println!("{cost}"));
            Ok(())
        }
    }
}

/// A running host: for an experimenter, or in front of a person in a sitting.
fn live(arguments: &Arguments) -> Result<Start, Failure> {
    let wanted = Wanted { directory: Directory::of_this_user(), process: arguments.run };
    if !arguments.sitting {
        return Ok(Start::Live(wanted));
    }
    let mut prompt = at_standard_streams().map_err(Failure::file)?;
    prompt.stop_key = arguments.stop_key;
    Ok(Start::Sitting(wanted, Box::new(prompt)))
}

/// The window as it would open on the recording, drawn on the processor.
fn whole_window(arguments: &Arguments, history: Vec<History>, out: &Path) -> Result<(), Failure> {
    let (look, size, scale) = of_picture(arguments.request);
    let start = Start::Recording(history, arguments.at, arguments.plugins.clone());
    let mut viewer = Viewer::new(&egui::Context::default(), None, start, look);
    if let Some(name) = &arguments.device {
        viewer.look_at_named(name).map_err(Failure::usage)?;
    }
    let image = draw_without_window(size, scale, look, |ui| viewer.show(ui));
    write_png(out, &image).map_err(Failure::file)
}

/// Look, size and scale of a picture: the same for everybody.
fn of_picture(request: WindowOptions) -> (Look, [usize; 2], f32) {
    (request.look.unwrap_or_default(), request.size.unwrap_or([1280, 800]), request.scale.unwrap_or(1.0))
}

fn screenshot(arguments: &Arguments, history: Vec<History>, out: &Path) -> Result<(), Failure> {
    let (look, size_px, scale) = of_picture(arguments.request);
    let (mut shapes, missing) =
        history.first().map(|first| shapes_of(first.run(), &arguments.plugins)).unwrap_or_default();
    for reason in missing {
        eprintln!("note: {reason}");
    }
    let options = PictureOptions {
        size_px,
        scale,
        look,
        view: arguments.view,
        device: arguments.device.clone(),
        at_s: arguments.at,
    };
    let image = picture(history, &mut shapes, &options).map_err(Failure::usage)?;
    write_png(out, &image).map_err(Failure::file)
}
