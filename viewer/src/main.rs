//! `flotor-viewer`: pictures of recordings. Started by `flotor view`, which knows where the plugins are.

use clap::{Parser, ValueEnum};
use flotor_viewer::history::History;
use flotor_viewer::palette::Look;
use flotor_viewer::picture::{PictureError, PictureOptions, picture, write_png};
use flotor_viewer::shape::shapes_of;
use std::path::PathBuf;
use std::process::ExitCode;

/// Shows what the hand feels: the spring in 3D, and traces.
#[derive(Parser)]
#[command(name = "flotor-viewer", version, about, max_term_width = 110)]
struct Arguments {
    /// Recording to show
    recording: PathBuf,
    /// File of a plugin whose shape may be drawn (repeatable)
    #[arg(long = "plugin", value_name = "PLUGIN.so")]
    plugins: Vec<PathBuf>,
    /// Write a picture; needs no display and no GPU
    #[arg(long, value_name = "OUT.png")]
    screenshot: PathBuf,
    /// The moment to show, s (default: that of the largest force)
    #[arg(long, value_name = "SECONDS")]
    at: Option<f64>,
    /// Light or dark
    #[arg(long, value_enum, default_value_t = LookOption::Dark)]
    look: LookOption,
    /// Width and height of the picture, pixels
    #[arg(long, value_parser = size, default_value = "1280x800", value_name = "WxH")]
    size: [usize; 2],
    /// Size of text and lines, 1 to 3
    #[arg(long, value_parser = scale, default_value_t = 1.0, value_name = "FACTOR")]
    scale: f32,
}

#[derive(Clone, Copy, ValueEnum)]
enum LookOption {
    Dark,
    Light,
}

/// Why there is nothing to see, with an exit code.
enum Failure {
    /// The recording or an option is wrong.
    Usage(String),
    /// A file could not be written.
    File(String),
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            let (text, code) = match failure {
                Failure::Usage(text) => (text, 2),
                Failure::File(text) => (text, 1),
            };
            eprintln!("error: {text}");
            ExitCode::from(code)
        }
    }
}

fn run(arguments: &Arguments) -> Result<(), Failure> {
    let history = History::read(&arguments.recording).map_err(|error| Failure::Usage(error.to_string()))?;
    let (mut shapes, missing) = shapes_of(history.run(), &arguments.plugins);
    for reason in missing {
        eprintln!("note: {reason}");
    }
    let look = match arguments.look {
        LookOption::Dark => Look::Dark,
        LookOption::Light => Look::Light,
    };
    let options = PictureOptions {
        size_px: arguments.size,
        scale: arguments.scale,
        look,
        at_s: arguments.at,
        ..PictureOptions::default()
    };
    let image =
        picture(&history, &mut shapes, &options).map_err(|error| Failure::Usage(error.to_string()))?;
    write_png(&arguments.screenshot, &image).map_err(|error: PictureError| Failure::File(error.to_string()))
}

/// `1280x800`
fn size(text: &str) -> Result<[usize; 2], String> {
    let wrong = || format!("`{text}` is no size; write 1280x800, each side 64 to 8192 pixels");
    let (width, height) = text.split_once('x').ok_or_else(wrong)?;
    let length =
        |text: &str| text.parse().ok().filter(|length| (64..=8192).contains(length)).ok_or_else(wrong);
    Ok([length(width)?, length(height)?])
}

/// `1.5`
fn scale(text: &str) -> Result<f32, String> {
    let wrong = || format!("`{text}` is no size of text; legal is 1 to 3");
    text.parse().ok().filter(|scale| (1.0..=3.0).contains(scale)).ok_or_else(wrong)
}
