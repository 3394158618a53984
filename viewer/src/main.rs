//! `flotor-viewer`, which `flotor view` starts with the plugins: shows a session or a recording, or writes a picture.

use clap::Parser;
use flotor_drawing::camera::View;
use flotor_hal::terminal::{escaped, escaped_arguments};
use flotor_history::History;
use flotor_history::compared::Compared;
use flotor_history::quantity::Quantity;
use flotor_live::Directory;
use flotor_study::screen::{Screen, StopKey, WindowMessage};
use flotor_viewer::app::{Recorded, RunSelection, Start, Viewer};
use flotor_viewer::devices::Devices;
use flotor_viewer::display_options::DisplayOptions;
use flotor_viewer::experiment::Prompt;
use flotor_viewer::experiment::texts::Texts;
use flotor_viewer::experiment::wire::connect_stdio;
use flotor_viewer::export::{self, ExportError};
use flotor_viewer::palette::Look;
use flotor_viewer::picture::{
    PictureError, PictureOptions, draw_without_window, has_moment, least_height_px, number_of, picture,
    write_png,
};
use flotor_viewer::shape::shapes_of;
use flotor_viewer::ui::export_options::ExportFormat;
use flotor_viewer::ui::plot_stack::{PlotStack, Window};
use flotor_viewer::window::{WindowError, WindowOptions, open};
use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::mpsc::channel;

/// Show a running session or a recording: the model in 3D, and plots over time
#[derive(Parser)]
#[command(name = "flotor-viewer", version, about, max_term_width = 110)]
struct Arguments {
    /// Recording to show; in a window or its picture also a second recording over the first, dashed (default: the newest session)
    #[arg(value_name = "FILE.mcap", num_args = 0..=2)]
    recording: Vec<PathBuf>,
    /// File of a plugin, for drawing its model in a recording; without the file the model is not drawn (repeatable)
    #[arg(long = "plugin", value_name = "PLUGIN")]
    plugins: Vec<PathBuf>,
    /// Write a picture instead of opening a window; needs no display and no GPU
    #[arg(long, value_name = "OUT.png", requires = "recording")]
    screenshot: Option<PathBuf>,
    /// Show the session of this process (default: the newest session)
    #[arg(long, value_name = "PID", conflicts_with = "recording")]
    run: Option<u32>,
    /// Show the screens of an experiment, controlled by lines of JSON on standard input and output
    #[arg(long, requires = "run", conflicts_with = "recording")]
    sitting: bool,
    /// Key of the emergency stop in a sitting
    #[arg(long, value_enum, default_value_t, requires = "sitting")]
    stop_key: StopKey,
    /// With --screenshot: draw the whole window with its panels (default: only the 3D view and the traces)
    #[arg(long, requires = "screenshot")]
    window: bool,
    /// With --screenshot: direction of the view, degrees: -360 to 360 to the right of the front, -2 to 88 above the horizon; and a
    /// zoom, 0.2 to 3 (default: 31.5,13.8,1)
    #[arg(long, value_name = "AZIMUTH,INCLINATION[,ZOOM]", allow_hyphen_values = true)]
    #[arg(requires = "screenshot", conflicts_with = "window")]
    view: Option<View>,
    /// Device whose numbers and traces are shown, where there are several (default: the first)
    #[arg(long, value_name = "NAME", requires = "recording")]
    device: Option<String>,
    /// Time in the recording to show, s (default: the time of the largest force)
    #[arg(long, value_name = "SECONDS", requires = "recording", conflicts_with = "export")]
    at: Option<f64>,
    /// Write the traces of the recording instead of opening a window: as a table (.csv) or a plot (.svg, .png); --look light
    /// is the default
    #[arg(long, value_name = "OUT", requires = "recording", conflicts_with = "screenshot")]
    export: Option<PathBuf>,
    /// Traces shown: force, torque, position, rotation, velocity, angular-velocity, energy, stiffness, lateness (default:
    /// force,position; in a window: the traces of the last window)
    #[arg(
        long,
        value_name = "LIST",
        value_delimiter = ',',
        hide_possible_values = true,
        conflicts_with = "sitting"
    )]
    traces: Vec<Quantity>,
    /// Plot force over position along this axis, beside the traces
    #[arg(long, value_name = "x|y|z", value_parser = axis, conflicts_with = "sitting")]
    force_position: Option<usize>,
    /// Force of an arrow of full length, 0.001 to 10000 N, for comparable pictures (default: the largest force of the run)
    #[arg(long, value_name = "NEWTONS", value_parser = arrow_force, conflicts_with_all = ["sitting", "export"])]
    arrow_force: Option<f64>,
    /// With --export: title of a plot (default: the title of the run)
    #[arg(long, value_name = "TEXT", requires = "export")]
    title: Option<String>,
    /// With --screenshot: draw a screen of a sitting, as `flotor study --screen json` writes it
    #[arg(long, value_name = "JSON", requires = "screenshot", conflicts_with_all = ["window", "view", "traces", "force_position", "device", "arrow_force"], value_parser = screen)]
    screen: Option<Screen>,
    /// With --sitting or --screen: file (TOML) with the texts of the screens, in the language of the person: a translated copy of
    /// viewer/texts/english.toml, with all its keys (default: English)
    #[arg(long, value_name = "FILE", value_parser = texts)]
    texts: Option<Texts>,
    #[command(flatten)]
    request: WindowOptions,
}

/// Parses a force of an arrow in N, such as `20`.
fn arrow_force(text: &str) -> Result<f64, String> {
    let force_n = text.parse().ok().filter(|force_n| (0.001..=10_000.0).contains(force_n));
    force_n.ok_or_else(|| {
        format!("`{text}` is not a valid force of an arrow; write a number from 0.001 to 10000, in N")
    })
}

/// Parses an axis, such as `z`.
fn axis(text: &str) -> Result<usize, String> {
    let known = ["x", "y", "z"].into_iter().position(|name| name == text);
    known.ok_or_else(|| format!("`{text}` is not an axis; write x, y or z"))
}

/// Parses a screen from a line of JSON.
fn screen(text: &str) -> Result<Screen, String> {
    serde_json::from_str(text)
        .map_err(|error| format!("invalid screen: {error}; pass a line of `flotor study --screen json`"))
}

/// Reads the texts from a file, such as `german.toml`.
fn texts(file: &str) -> Result<Texts, String> {
    Texts::read(Path::new(file)).map_err(|error| format!("{file}: {error}"))
}

/// Error message with an exit code: 2 if the recording or an option is wrong, else 1.
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
    let arguments = Arguments::try_parse().unwrap_or_else(|error| {
        let _ = Arguments::parse_from(escaped_arguments());
        error.exit()
    });
    match run(&arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(Failure(text, code)) => {
            eprintln!("error: {}", escaped(&text));
            ExitCode::from(code)
        }
    }
}

fn run(arguments: &Arguments) -> Result<(), Failure> {
    if let Some(out) =
        arguments.screenshot.as_ref().filter(|out| out.extension().is_none_or(|is| is != "png"))
    {
        return Err(Failure::usage(format!(
            "`{}` must end with .png, because the picture is a PNG file",
            out.display()
        )));
    }
    if arguments.texts.is_some() && !arguments.sitting && arguments.screen.is_none() {
        return Err(Failure::usage(
            "--texts has no effect without the screens of a sitting: add --sitting or --screen",
        ));
    }
    fits_file(arguments).map_err(Failure::usage)?;
    let read = |path: &PathBuf| History::read(path).map_err(Failure::usage);
    let is_file = arguments.export.is_some() || arguments.screenshot.is_some() && !arguments.window;
    if arguments.recording.len() > 1 && is_file {
        return Err(Failure::usage(
            "a second recording is shown only in the window and in a picture of the window: give one recording, or \
             `--screenshot` with `--window`",
        ));
    }
    let history = arguments.recording.first().map(read).transpose()?;
    let chosen = chosen(arguments, history.as_deref().unwrap_or_default()).map_err(Failure::usage)?;
    match (history, &arguments.screenshot) {
        (Some(history), None) if arguments.export.is_some() => traces(arguments, history, &chosen),
        (Some(history), Some(out)) if arguments.window || arguments.screen.is_some() => {
            whole_window(arguments, history, &chosen, out)
        }
        (Some(history), Some(out)) => screenshot(arguments, history, chosen, out),
        (history, _) => {
            let start = match history {
                Some(histories) => Start::Recording(recorded(arguments, histories)?),
                None => live(arguments)?,
            };
            let cost = open(start, chosen, arguments.request)?;
            cost.iter().for_each(|cost| println!("{cost}"));
            Ok(())
        }
    }
}

/// Checks that the format of the file of traces is known and supports the options.
fn fits_file(arguments: &Arguments) -> Result<(), String> {
    let Some(out) = &arguments.export else { return Ok(()) };
    let of_picture = [
        (arguments.force_position.is_some(), "--force-position"),
        (arguments.request.size.is_some(), "--size"),
        (arguments.request.look.is_some(), "--look"),
        (arguments.title.is_some(), "--title"),
    ];
    let idle = of_picture.into_iter().find_map(|(is_there, name)| is_there.then_some(name));
    match (ExportFormat::of_file(out)?, idle) {
        (ExportFormat::Csv, Some(name)) => Err(format!(
            "`{}` is a table, and `{name}` applies only to a plot: omit the option, or name a file that ends \
             in .svg or .png",
            out.display()
        )),
        _ => Ok(()),
    }
}

/// Returns the display options of the command line, checked against the recording.
fn chosen(arguments: &Arguments, histories: &[History]) -> Result<DisplayOptions, PictureError> {
    if let Some(at_s) = arguments.at {
        has_moment(histories, at_s)?;
    }
    let device = arguments.device.as_ref().map(|name| number_of(histories, name)).transpose()?;
    let chosen = DisplayOptions::new(device.unwrap_or(0), arguments.traces.clone(), arguments.force_position);
    Ok(chosen.with_arrow_force(arguments.arrow_force))
}

/// Returns the recording of the command line at the requested time, with the second recording.
fn recorded(arguments: &Arguments, histories: Vec<History>) -> Result<Recorded, Failure> {
    let (file, at_s) = (arguments.recording.first().cloned(), arguments.at);
    let second = arguments.recording.get(1).map(|file| Compared::read(file));
    let compared = second.transpose().map_err(Failure::usage)?;
    Ok(Recorded { file, at_s, compared, ..Recorded::new(histories, arguments.plugins.clone()) })
}

/// Selects a running host, for an experimenter or for a person in a sitting.
fn live(arguments: &Arguments) -> Result<Start, Failure> {
    let (directory, process) = (Directory::of_this_user(), arguments.run);
    let wanted = RunSelection { directory, process, plugins: arguments.plugins.clone() };
    if !arguments.sitting {
        return Ok(Start::Live(wanted));
    }
    let no_thread = |cause: std::io::Error| format!("cannot start a thread: {cause}; end other programs");
    let mut prompt = connect_stdio().map_err(no_thread).map_err(Failure::file)?;
    prompt.stop_key = arguments.stop_key;
    prompt.texts = arguments.texts.clone().unwrap_or_else(Texts::english);
    Ok(Start::Sitting(wanted, Box::new(prompt)))
}

/// Writes a picture of the window as it would open on the recording, drawn by the processor.
fn whole_window(
    arguments: &Arguments,
    history: Vec<History>,
    chosen: &DisplayOptions,
    out: &Path,
) -> Result<(), Failure> {
    let (look, size, scale) = of_picture(arguments.request);
    let start = Start::Recording(recorded(arguments, history)?);
    let mut viewer = Viewer::new(&egui::Context::default(), None, start, look);
    viewer.choose(chosen);
    // Keep the experiment's ends of the channels open while the screen is drawn.
    let ((teller, told), (said, _hears)) = (channel(), channel());
    if let Some(screen) = &arguments.screen {
        let mut prompt = Prompt::new(told, said);
        prompt.texts = arguments.texts.clone().unwrap_or_else(Texts::english);
        viewer.rehearse(prompt);
        let _ = teller.send(WindowMessage::Screen(screen.clone())); // the receiver is above
    }
    let image = draw_without_window(size, scale, look, |ui| viewer.show(ui));
    write_png(out, &image).map_err(Failure::file)
}

/// Writes the traces of a recording to a file.
fn traces(arguments: &Arguments, histories: Vec<History>, chosen: &DisplayOptions) -> Result<(), Failure> {
    let Some(out) = &arguments.export else { return Ok(()) };
    let mut devices = Devices::new(histories);
    devices.choose(chosen.device);
    let mut plots = PlotStack::new(Window::Whole);
    plots.choose(chosen);
    plots.export.look = arguments.request.look.unwrap_or(Look::Light);
    if let Some(size) = arguments.request.size {
        plots.export.size_px = size.map(|length| length as f64);
    } else {
        plots.export.size_px[1] = plots.export.size_px[1].max(export::least_height_px(&plots));
    }
    plots.export.title = arguments.title.clone().unwrap_or_default();
    let format = ExportFormat::of_file(out).map_err(Failure::usage)?;
    export::write(devices.history(), devices.name(), &plots, format, out).map_err(|error| match error {
        ExportError::TooLow(_) => Failure::usage(error),
        error => Failure::file(error),
    })
}

/// Returns look, size and scale of a picture, independent of the user's settings.
fn of_picture(request: WindowOptions) -> (Look, [usize; 2], f32) {
    (request.look.unwrap_or_default(), request.size.unwrap_or([1280, 800]), request.scale.unwrap_or(1.0))
}

fn screenshot(
    arguments: &Arguments,
    history: Vec<History>,
    chosen: DisplayOptions,
    out: &Path,
) -> Result<(), Failure> {
    let (look, mut size_px, scale) = of_picture(arguments.request);
    if arguments.request.size.is_none() {
        size_px[1] = size_px[1].max(least_height_px(&chosen, scale));
    }
    let (mut shapes, missing) =
        history.first().map(|first| shapes_of(first.run(), &arguments.plugins)).unwrap_or_default();
    missing.iter().for_each(|reason| eprintln!("note: {}", escaped(&reason.to_string())));
    let options = PictureOptions { size_px, scale, look, view: arguments.view, chosen, at_s: arguments.at };
    let image = picture(history, &mut shapes, &options).map_err(Failure::usage)?;
    write_png(out, &image).map_err(Failure::file)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(options: &[&str]) -> Result<Arguments, clap::Error> {
        Arguments::try_parse_from(["flotor-viewer", "missing.mcap"].iter().chain(options))
    }

    /// Nobody is left to believe that an option did something.
    #[test]
    fn an_option_that_would_do_nothing_is_refused() {
        let screen = ["--screenshot", "run.png", "--screen", r#"{"screen":"over"}"#];
        let traces = ["--export", "run.svg"];
        for (options, idle) in [
            (&traces[..], &["--at=1", "--scale=2", "--measure=5", "--arrow-force=20"][..]),
            (&screen, &["--traces=force", "--force-position=z", "--device=left", "--arrow-force=20"]),
        ] {
            assert!(parsed(options).is_ok(), "{options:?}");
            for idle in idle {
                let refused = parsed(&[options, &[*idle]].concat()).err().expect(idle);
                assert_eq!(refused.kind(), clap::error::ErrorKind::ArgumentConflict, "{refused}");
            }
        }
    }

    #[test]
    fn numbers_have_nothing_that_a_picture_has() {
        for idle in ["--force-position=z", "--size=800x600", "--look=dark", "--title=Wall"] {
            let run = |out| run(&parsed(&["--export", out, idle]).expect("both can be named"));
            let Err(Failure(text, code)) = run("run.csv") else { panic!("{idle} is ignored") };
            let (name, _) = idle.split_once('=').expect("with its value");
            assert!(code == 2 && text.contains(name) && text.contains(".svg"), "{text}");
            let Err(Failure(text, _)) = run("run.svg") else { panic!("there is no recording") };
            assert!(text.contains("missing.mcap"), "{text}");
        }
    }
}
