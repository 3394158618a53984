//! `flotor stress`: the numerical stability score of a force model.

use super::eval::settings;
use super::options::KeyValue;
use super::{CommandError, style};
use crate::lab::stress::{Progress, Reach, Size, StressOptions, StressReport, score};
use crate::registry::Registry;
use clap::{Args, ValueEnum};
use flotor_hal::abi::PluginKind;
use indicatif::ProgressBar;
use std::path::PathBuf;

/// `--size`
#[derive(Clone, Copy, Debug, ValueEnum)]
enum SizeOption {
    /// Seconds: a hundredth of a full run, its first poses
    Short,
    /// Minutes: ten million poses and more
    Full,
}

/// Score the numerical stability of a force model.
#[derive(Args)]
#[command(after_help = "Nine measures: M0 totality, M1 continuity, M2 Lipschitz constant, M3 reciprocity,\n\
    M4 loop energy, M5 sampled energy, M6 closed loop, M7 cost, M8 determinism.\n\
    `score` is the share that passed.\n\n\
    Examples:\n  \
    flotor stress --model spring\n  \
    flotor stress --model spring --set variant=closed-form --json score.json --plot score.svg\n  \
    flotor stress --model ./target/release/libmy_model.so --size full --seed 7")]
pub(crate) struct StressArguments {
    /// Id of the model, or path to its plugin file
    #[arg(long, value_name = "ID")]
    model: String,
    /// Set a parameter of the model (repeatable)
    #[arg(long = "set", value_name = "KEY=VALUE")]
    sets: Vec<KeyValue>,
    /// How much to ask
    #[arg(long, value_enum, default_value = "short")]
    size: SizeOption,
    /// Seed of poses and motions
    #[arg(long, default_value_t = 1, value_name = "N")]
    seed: u64,
    /// Write the score as JSON (- for standard output)
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Draw the score as a picture
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
}

pub(crate) fn run(arguments: &StressArguments) -> Result<(), CommandError> {
    let plugin = Registry::search(&[]).load(&arguments.model, PluginKind::Model)?;
    let settings = settings(&plugin, &arguments.sets)?;
    let size = match arguments.size {
        SizeOption::Short => Size::Short,
        SizeOption::Full => Size::Full,
    };
    let options = StressOptions { size, seed: arguments.seed, reach: Reach::default() };
    let line = ProgressLine::new();
    let report = score(&plugin, &settings, &options, &line)?;
    line.0.finish_and_clear();
    tell(arguments, &report)?;
    let Some(path) = &arguments.plot else { return Ok(()) };
    std::fs::write(path, report.to_svg())
        .map_err(|cause| CommandError::file(path, "cannot write the picture", cause))
}

fn tell(arguments: &StressArguments, report: &StressReport) -> Result<(), CommandError> {
    let json_on_stdout = arguments.json.as_ref().is_some_and(|path| path.as_os_str() == "-");
    if !json_on_stdout {
        say!("{}\n{}", style::title(&report.subject()), report.to_text());
    }
    arguments.json.as_ref().map_or(Ok(()), |path| super::write_json(path, report))
}

/// A progress line on a terminal, nothing in a pipe.
struct ProgressLine(ProgressBar);

impl ProgressLine {
    fn new() -> Self {
        Self(super::run::progress_bar(0, "{msg:<36} {wide_bar} {percent:>3} %  {elapsed}"))
    }
}

impl Progress for ProgressLine {
    fn begin(&self, name: &str, steps: u64) {
        self.0.set_length(steps);
        self.0.set_position(0);
        self.0.set_message(name.to_owned());
    }

    fn advance(&self, steps: u64) {
        self.0.inc(steps);
    }
}
