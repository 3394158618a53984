//! `flotor stress`: the numerical stability score of a force model.

use super::ProgressLine;
use crate::Size;
use crate::stress::{Reach, StressOptions, score};
use clap::Args;
use flotor_command::options::{KeyValue, settings, svg_file, whole};
use flotor_command::{CommandError, print_result, style, write_text};
use flotor_hal::abi::PluginKind;
use flotor_session::registry::Registry;
use std::path::PathBuf;

/// Score the numerical stability of a force model.
#[derive(Args)]
#[command(after_help = "Nine measures: M0 totality, M1 continuity, M2 Lipschitz constant, M3 reciprocity, \
    M4 loop energy, M5 sampled energy, M6 closed loop, M7 cost, M8 determinism. \
    `score` is the share of measures that passed; docs/src/stress.md has the criterion of each.\n\n\
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
    /// How many poses, motions and seeds are tried
    #[arg(long, value_enum, default_value = "short")]
    size: Size,
    /// Seed of poses and motions
    #[arg(long, value_parser = whole, default_value_t = 1, value_name = "N")]
    seed: u64,
    /// Write the score as JSON (- for standard output)
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Plot the score
    #[arg(long, value_parser = svg_file, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
}

pub(crate) fn run(arguments: &StressArguments) -> Result<(), CommandError> {
    let plugin = Registry::search(&[]).load(&arguments.model, PluginKind::Model)?;
    let settings = settings(&plugin, &arguments.sets)?;
    let options = StressOptions { size: arguments.size, seed: arguments.seed, reach: Reach::default() };
    let line = ProgressLine::new();
    let report = score(&plugin, &settings, &options, &line)?;
    line.0.finish_and_clear();
    let text = || format!("{}\n{}", style::title(&report.subject()), report.to_text());
    print_result(arguments.json.as_deref(), &report, text)?;
    write_text(arguments.plot.as_deref(), || report.to_svg())
}
