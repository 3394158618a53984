//! `flotor stress`: numerical stability score of a force model.

use super::ProgressLine;
use crate::Size;
use clap::{Args, ValueEnum};
use flotor_command::options::{
    KeyValue, ModelOption, PluginResultOptions, duration_s, seed, settings, svg_file,
};
use flotor_command::{CommandError, print_result, style, write_text};
use flotor_hal::abi::PluginKind;
use flotor_judge::stress::{Part, Reach, StressOptions, Symmetry, deliver, score_in_processes};
use flotor_session::step_limit;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

/// Score the numerical stability of a force model.
#[derive(Args)]
#[command(after_help = "Ten measures: M0 totality, M1 continuity, M2 Lipschitz constant, M3 reciprocity, \
    M4 loop energy, M5 sampled energy, M6 closed loop, M7 cost, M8 determinism, M9 search for the worst case; \
    with --symmetry also M10, of a model that can run asynchronously also M11. Each measure runs in its own process, so a call that does not return fails only \
    one measure. `score` is the share of measures that passed; the chapter \"Stability of a model\" of the book has the criterion of each.\n\n\
    Examples:\n  \
    flotor stress spring\n  \
    flotor stress --model spring --set variant=closed-form --json score.json --plot score.svg\n  \
    flotor stress --model ./target/release/libmy_model.so --size full --seed 7")]
pub(crate) struct StressArguments {
    #[command(flatten)]
    model: ModelOption,
    /// Set a parameter of the model (repeatable)
    #[arg(long = "set", value_name = "KEY=VALUE")]
    sets: Vec<KeyValue>,
    /// Number of poses, motions and seeds
    #[arg(long, value_enum, default_value = "short")]
    size: Size,
    /// Seed of poses and motions
    #[arg(long, value_parser = seed, default_value_t = 1, value_name = "N")]
    seed: u64,
    /// Symmetry that the model should have; M10 checks it
    #[arg(long, value_enum)]
    symmetry: Option<Symmetry>,
    /// Compute only this measure, M0 to M9, M11, or with --symmetry M10; any of M2, M3 and M5 computes all three (repeatable; default:
    /// all)
    #[arg(long, value_parser = measure, value_name = "M0", requires_if("M10", "symmetry"))]
    only: Vec<Part>,
    /// Limit of the processor time of one step, such as 5s or 500ms; ten times as long for a step that waits
    /// (default: FLOTOR_STEP_LIMIT_S in seconds, or 1s)
    #[arg(long, value_parser = duration_s, allow_hyphen_values = true, value_name = "TIME")]
    timeout: Option<f64>,
    /// Compute one measure in this process, and write the result into the file of standard input
    #[arg(long, hide = true, value_parser = part)]
    deliver: Option<Part>,
    #[command(flatten)]
    options: PluginResultOptions,
    /// Plot the score
    #[arg(long, value_parser = svg_file, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
}

fn measure(id: &str) -> Result<Part, String> {
    Part::of_measure(id)
        .ok_or_else(|| format!("unknown measure `{id}`; use M0 to M9, M11, or with --symmetry M10"))
}

fn part(word: &str) -> Result<Part, String> {
    Part::from_word(word).ok_or_else(|| format!("unknown part `{word}`"))
}

pub(crate) fn run(arguments: &StressArguments) -> Result<(), CommandError> {
    let plugin = arguments.options.plugin_path.registry().load(arguments.model.name(), PluginKind::Model)?;
    let settings = settings(&plugin, "--set", &arguments.sets)?;
    let StressArguments { size, seed, symmetry, .. } = *arguments;
    let options = StressOptions { size, seed, reach: Reach::default(), symmetry };
    let limit = arguments.timeout.map_or_else(step_limit, Duration::from_secs_f64);
    if let Some(part) = arguments.deliver {
        let line = ProgressLine::new();
        let delivered = deliver(&plugin, &settings, &options, part, limit, &line);
        line.0.finish_and_clear();
        return delivered.map_err(|error| CommandError::Failed(error.to_string()));
    }
    let program = std::env::current_exe()
        .map_err(|cause| CommandError::file(Path::new("flotor-lab"), "cannot find this program", cause))?;
    let one_part = |part: Part| {
        let mut command = Command::new(&program);
        command.args(["stress", "--deliver", part.word(), "--size", size.word()]);
        command.arg(format!("--seed={seed}")).arg(format!("--timeout={}", limit.as_secs_f64()));
        command.arg("--model").arg(arguments.model.name()).args(arguments.options.plugin_path.arguments());
        command.args(arguments.sets.iter().flat_map(|set| ["--set".to_owned(), set.to_string()]));
        if let Some(symmetry) = symmetry.and_then(|symmetry| symmetry.to_possible_value()) {
            command.arg("--symmetry").arg(symmetry.get_name());
        }
        command
    };
    let report = score_in_processes(&plugin, &settings, &options, &arguments.only, one_part)?;
    let text = || format!("{}\n{}", style::title(&report.subject()), report.to_text());
    print_result(arguments.options.json.file(), &report, text)?;
    write_text(arguments.plot.as_deref(), || report.to_svg())?;
    let stuck = |step: &String| CommandError::PluginRefused(format!("{}: {step}", report.model));
    report.stuck.as_ref().map_or(Ok(()), |step| Err(stuck(step)))
}
