//! `flotor-viewer`: a running host or a recording in a window, or a picture. Started by `flotor view`, which knows where the
//! plugins are.

use clap::{Parser, ValueEnum};
use flotor_live::Directory;
use flotor_viewer::app::{Start, Viewer, Wanted};
use flotor_viewer::experiment::wire::at_standard_streams;
use flotor_viewer::history::History;
use flotor_viewer::palette::Look;
use flotor_viewer::picture::{PictureOptions, draw_without_window, picture, write_png};
use flotor_viewer::shape::shapes_of;
use flotor_viewer::window::{WindowError, WindowWish, open};
use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

/// Shows what the hand feels: the spring in 3D, and traces.
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
    /// The picture is that of the whole window, with panels
    #[arg(long, requires = "screenshot")]
    window: bool,
    /// The moment to show, s (default: that of the largest force)
    #[arg(long, value_name = "SECONDS")]
    at: Option<f64>,
    /// Light or dark (default: dark; a window: as the last time)
    #[arg(long, value_enum)]
    look: Option<LookOption>,
    /// Width and height of picture or window (default: 1280x800; a window: as the last time)
    #[arg(long, value_parser = size, value_name = "WxH")]
    size: Option<[usize; 2]>,
    /// Size of text and lines, 1 to 3 (default: 1; a window: as the last time)
    #[arg(long, value_parser = scale, value_name = "FACTOR")]
    scale: Option<f32>,
    /// Say what the window costs over so many seconds, 1 to 3600, once it has opened, which may take up to half a minute more, and
    /// close it then
    #[arg(long, value_parser = seconds, value_name = "SECONDS", conflicts_with_all = ["screenshot", "sitting"])]
    measure: Option<Duration>,
}

#[derive(Clone, Copy, ValueEnum)]
enum LookOption {
    Dark,
    Light,
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
    let wish = WindowWish {
        look: arguments.look.map(|look| match look {
            LookOption::Dark => Look::Dark,
            LookOption::Light => Look::Light,
        }),
        size: arguments.size,
        scale: arguments.scale,
        measure: arguments.measure,
    };
    let read = |path: &PathBuf| History::read(path).map_err(Failure::usage);
    let history = arguments.recording.as_ref().map(read).transpose()?;
    match (history, &arguments.screenshot) {
        (Some(history), Some(out)) if arguments.window => whole_window(arguments, history, wish, out),
        (Some(history), Some(out)) => screenshot(arguments, &history, wish, out),
        (history, _) => {
            let start = match history {
                Some(history) => Start::Recording(Box::new(history), arguments.at, arguments.plugins.clone()),
                None => live(arguments)?,
            };
            let cost = open(start, wish)?;
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
    let prompt = at_standard_streams().map_err(Failure::file)?;
    Ok(Start::Sitting(wanted, Box::new(prompt)))
}

/// The window as it would open on the recording, drawn on the processor.
fn whole_window(
    arguments: &Arguments,
    history: History,
    wish: WindowWish,
    out: &Path,
) -> Result<(), Failure> {
    let (look, size, scale) = of_picture(wish);
    let start = Start::Recording(Box::new(history), arguments.at, arguments.plugins.clone());
    let mut viewer = Viewer::new(&egui::Context::default(), None, start, look);
    let image = draw_without_window(size, scale, look, |ui| viewer.show(ui));
    write_png(out, &image).map_err(Failure::file)
}

/// Look, size and scale of a picture: the same for everybody.
fn of_picture(wish: WindowWish) -> (Look, [usize; 2], f32) {
    (wish.look.unwrap_or_default(), wish.size.unwrap_or([1280, 800]), wish.scale.unwrap_or(1.0))
}

fn screenshot(arguments: &Arguments, history: &History, wish: WindowWish, out: &Path) -> Result<(), Failure> {
    let (look, size_px, scale) = of_picture(wish);
    let (mut shapes, missing) = shapes_of(history.run(), &arguments.plugins);
    for reason in missing {
        eprintln!("note: {reason}");
    }
    let options = PictureOptions { size_px, scale, look, at_s: arguments.at };
    let image = picture(history, &mut shapes, &options).map_err(Failure::usage)?;
    write_png(out, &image).map_err(Failure::file)
}

/// `1280x800`
fn size(text: &str) -> Result<[usize; 2], String> {
    let wrong = || format!("`{text}` is no size; write 1280x800, each side 64 to 8192 pixels");
    let (width, height) = text.split_once('x').ok_or_else(wrong)?;
    let length =
        |text: &str| text.parse().ok().filter(|length| (64..=8192).contains(length)).ok_or_else(wrong);
    Ok([length(width)?, length(height)?])
}

/// `10`
fn seconds(text: &str) -> Result<Duration, String> {
    let wrong = || format!("`{text}` is no time to watch a window; legal is 1 to 3600 seconds");
    let seconds: f64 =
        text.parse().ok().filter(|seconds| (1.0..=3600.0).contains(seconds)).ok_or_else(wrong)?;
    Ok(Duration::from_secs_f64(seconds))
}

/// `1.5`
fn scale(text: &str) -> Result<f32, String> {
    let wrong = || format!("`{text}` is no size of text; legal is 1 to 3");
    text.parse().ok().filter(|scale| (1.0..=3.0).contains(scale)).ok_or_else(wrong)
}
