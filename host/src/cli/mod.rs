//! The `flotor` command: arguments in, exit code out.
//!
//! Exit codes are a contract: 0 ok, 2 usage or configuration, 3 a plugin was refused, 4 device fault, 1 else;
//! 130 after the third signal that asks for an end.

/// Prints a line; a reader that has gone away (`flotor plugins | head`) ends the program without a word.
macro_rules! say {
    ($($text:tt)*) => { $crate::cli::print_line(format_args!($($text)*)) };
}

mod analyse;
mod bench;
mod bridge;
mod calibrate;
mod companion;
mod doctor;
mod emulate;
mod eval;
mod jitter;
mod new;
mod options;
mod plugins;
mod record;
mod reference;
mod replay;
mod run;
mod stability;
mod stopping;
mod stress;
mod study;
mod swap;
mod sweep;
mod validate;
mod view;
mod worker;

pub use reference::reference;

use clap::{CommandFactory, Parser, Subcommand};
use flotor_hal::Fault;
use flotor_hal::abi::loader::LoadError;
use flotor_servo::{EmergencySource, Place, Stuck};
use flotor_session::RunError;
use flotor_session::registry::LookupError;
use flotor_study::dataset::DatasetError;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Haptics from plugins: force models and devices in a safe servo loop.
#[derive(Parser)]
#[command(name = "flotor", version, about, propagate_version = true, max_term_width = 110)]
#[command(after_help = "Examples:\n  \
    flotor                                            feel spring 1 on the simulated flotor for 10 s\n  \
    flotor run --clock virtual --seed 1 --plot run.svg    the same, repeatable, as a picture\n  \
    flotor run scene.toml --set spring.variant=closed-form --record run.mcap\n  \
    flotor eval --model spring --set preset=thesis-2 --poses poses.csv --out -\n\n\
    Exit codes: 0 ok, 2 usage or configuration, 3 a plugin was refused, 4 device fault, 1 anything else.")]
struct Arguments {
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Subcommand)]
enum Command {
    /// Run a scene in the servo loop (without SCENE: the built-in demo)
    Run(run::RunArguments),
    /// Ask the models of a recording again: bit for bit, or with other parameters
    Replay(replay::ReplayArguments),
    /// Show a running host or a recording: the spring in 3D, and traces
    View(view::ViewArguments),
    /// Evaluate a force model at poses from a CSV file
    Eval(eval::EvalArguments),
    /// List the plugins that are found, without running any of them
    Plugins(plugins::PluginsArguments),
    /// Check a plugin file: does it load, answer, and survive bad input
    Validate(validate::ValidateArguments),
    /// Start a plugin of your own: a folder that builds, validates and runs
    New(new::NewArguments),
    /// Measure how well the servo keeps time here, next to a bare loop
    Jitter(jitter::JitterArguments),
    /// Find the stiffest virtual spring that stays stable, next to theory
    Stability(stability::StabilityArguments),
    /// Measure what an evaluation costs and how wrong it is, for many settings of a force model
    Bench(bench::BenchArguments),
    /// Score the numerical stability of a force model
    Stress(stress::StressArguments),
    /// Record a run that is on, from now to its end
    Record(record::RecordArguments),
    /// Replace a model of a run that is on, without a jump in the force
    Swap(swap::SwapArguments),
    /// Put a running host on a network, or bring one from there to this machine
    Bridge(bridge::BridgeArguments),
    /// Sweep a model or a scene over parameters, poses and seeds into a Parquet table
    Sweep(sweep::SweepArguments),
    /// Carry out a perception experiment
    Study(study::StudyArguments),
    /// Analyse the data of a perception experiment
    Analyse(analyse::AnalyseArguments),
    /// Measure how much of the vertical force arrives, and correct it
    Calibrate(calibrate::CalibrateArguments),
    /// Emulate the controller of a device, so that its plugin can be used without hardware
    Emulate(emulate::EmulateArguments),
    /// Look at this machine: what a real-time loop may hope for, and how to improve it
    Doctor(doctor::DoctorArguments),
    /// A process that holds one force model, started by `run` for `isolation = "process"`
    #[command(hide = true)]
    Worker(worker::WorkerArguments),
    /// Print a completion script for a shell
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
}

/// Why a command failed, with its exit code.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub(crate) enum CommandError {
    /// The command line or a configuration says something that cannot be.
    #[error("{0}")]
    Usage(String),
    /// A run could not start.
    #[error(transparent)]
    Run(#[from] RunError),
    /// A device faulted.
    #[error("device fault: {}", .0.advice())]
    DeviceFault(Fault),
    /// A device faulted in a run.
    #[error("{}: device fault: {}{}", path.display(), before_advice(words), fault.advice())]
    RunFault {
        /// The plugin's file.
        path: PathBuf,
        /// What is wrong, and what to do.
        fault: Fault,
        /// What the device itself said; may be empty.
        words: String,
    },
    /// Somebody pressed the emergency stop.
    #[error("emergency stop ({}); the device is stopped and gives no force until the next run", .0.word())]
    EmergencyStop(EmergencySource),
    /// A tick took so long that the watchdog stopped the device.
    #[error(
        "tick {} took longer than the watchdog allows, and it stopped the device; look at the machine with \
         `flotor doctor`, or allow more with `[limits] watchdog_ms`", .0.tick
    )]
    Watchdog(Stuck),
    /// The device sets the pace, and it is a faster one.
    #[error(
        "the device sends {samples_per_s} samples a second and sets the pace, the scene counts {rate_hz} ticks: every limit per \
         second would be too high; set `rate_hz = {samples_per_s}`, or `pacing = \"host\"`"
    )]
    TooFast {
        /// What the device sends.
        samples_per_s: u32,
        /// What the scene says.
        rate_hz: f64,
    },
    /// A plugin was refused.
    #[error("{0}")]
    PluginRefused(String),
    /// A file could not be written or read.
    #[error("{}: {action}: {cause}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What was attempted.
        action: &'static str,
        /// What the system said.
        cause: std::io::Error,
    },
    /// A recording could not be written or read.
    #[error(transparent)]
    Record(#[from] flotor_record::RecordError),
    /// A recording could not be replayed.
    #[error(transparent)]
    Read(#[from] flotor_record::ReadError),
    /// Something found wrong that the output has already told.
    #[error("{0}")]
    Failed(String),
}

impl From<LookupError> for CommandError {
    fn from(error: LookupError) -> Self {
        Self::Run(error.into())
    }
}

impl From<LoadError> for CommandError {
    fn from(error: LoadError) -> Self {
        Self::Run(error.into())
    }
}

impl From<DatasetError> for CommandError {
    fn from(error: DatasetError) -> Self {
        match error {
            DatasetError::File { .. } => Self::Failed(error.to_string()),
            other => Self::Usage(other.to_string()),
        }
    }
}

impl From<flotor_lab::replay::ReplayError> for CommandError {
    fn from(error: flotor_lab::replay::ReplayError) -> Self {
        match error {
            flotor_lab::replay::ReplayError::Read(error) => Self::Read(error),
            flotor_lab::replay::ReplayError::Run(error) => Self::Run(error),
            other => Self::Usage(other.to_string()),
        }
    }
}

impl CommandError {
    fn file(path: &Path, action: &'static str, cause: std::io::Error) -> Self {
        Self::File { path: path.into(), action, cause }
    }

    fn exit_code(&self) -> u8 {
        match self {
            Self::Usage(_) | Self::Read(_) => 2,
            Self::Run(error) => match error {
                RunError::Scene(_) | RunError::Mismatch { .. } => 2,
                RunError::Lookup(LookupError::Unknown { .. }) => 2,
                RunError::Lookup(LookupError::Refused(error)) | RunError::Plugin(error) => {
                    refusal_code(error)
                }
                RunError::Hung { stuck, .. } => match stuck.place {
                    Place::Model(_) => 3,
                    Place::DeviceWait(_) | Place::DeviceRead(_) | Place::DeviceWrite(_) => 4,
                    Place::Waiting | Place::Host => 1,
                },
                RunError::Thread(_) | _ => 1,
            },
            Self::PluginRefused(_) => 3,
            Self::DeviceFault(_)
            | Self::RunFault { .. }
            | Self::EmergencyStop(_)
            | Self::TooFast { .. }
            | Self::Watchdog(_) => 4,
            Self::File { .. } | Self::Record(_) | Self::Failed(_) => 1,
        }
    }
}

/// What a device said, in front of the advice for its fault.
fn before_advice(words: &str) -> String {
    if words.is_empty() { String::new() } else { format!("{words}; ") }
}

/// A plugin that says its parameters do not fit is a configuration error; everything else is a refused plugin.
fn refusal_code(error: &LoadError) -> u8 {
    match error {
        LoadError::Refused { refusal, .. } if refusal.kind == flotor_hal::RefusalKind::Parameter => 2,
        _ => 3,
    }
}

/// Names of the commands that the help lists, in its order. Not real-time.
#[must_use]
pub fn command_names() -> Vec<String> {
    let arguments = Arguments::command();
    let listed = arguments.get_subcommands().filter(|command| !command.is_hide_set());
    listed.map(|command| command.get_name().to_owned()).collect()
}

/// Runs the command of this process.
#[must_use]
pub fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let result = match arguments.command {
        None => run::run(run::RunArguments::default()),
        Some(Command::Run(arguments)) => run::run(arguments),
        Some(Command::Replay(arguments)) => replay::run(&arguments),
        Some(Command::View(arguments)) => view::run(&arguments),
        Some(Command::Eval(arguments)) => eval::run(&arguments),
        Some(Command::Plugins(arguments)) => plugins::run(&arguments),
        Some(Command::Validate(arguments)) => validate::run(&arguments),
        Some(Command::New(arguments)) => new::run(&arguments),
        Some(Command::Jitter(arguments)) => jitter::run(&arguments),
        Some(Command::Stability(arguments)) => stability::run(&arguments),
        Some(Command::Bench(arguments)) => bench::run(&arguments),
        Some(Command::Stress(arguments)) => stress::run(&arguments),
        Some(Command::Record(arguments)) => record::run(&arguments),
        Some(Command::Swap(arguments)) => swap::run(&arguments),
        Some(Command::Bridge(arguments)) => bridge::run(&arguments),
        Some(Command::Sweep(arguments)) => sweep::run(&arguments),
        Some(Command::Study(arguments)) => study::run(&arguments),
        Some(Command::Analyse(arguments)) => analyse::run(&arguments),
        Some(Command::Calibrate(arguments)) => calibrate::run(&arguments),
        Some(Command::Emulate(arguments)) => emulate::run(&arguments),
        Some(Command::Doctor(arguments)) => doctor::run(&arguments),
        Some(Command::Worker(arguments)) => worker::run(arguments),
        Some(Command::Completions { shell }) => {
            clap_complete::generate(shell, &mut Arguments::command(), "flotor", &mut std::io::stdout());
            Ok(())
        }
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            remark(format_args!("{} {error}", style::error("error:")));
            ExitCode::from(error.exit_code())
        }
    }
}

/// What `say!` does.
fn print_line(line: std::fmt::Arguments<'_>) {
    if let Err(error) = writeln!(std::io::stdout(), "{line}") {
        let gone = error.kind() == std::io::ErrorKind::BrokenPipe;
        std::process::exit(if gone { 0 } else { 1 });
    }
}

/// Prints a line where the command has more to do, or an exit code of its own: a reader that has gone away ends
/// nothing.
fn report_line(line: std::fmt::Arguments<'_>) -> Result<(), CommandError> {
    match writeln!(std::io::stdout(), "{line}") {
        Err(cause) if cause.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(CommandError::file(Path::new("standard output"), "cannot write the result", cause))
        }
        _ => Ok(()),
    }
}

/// Prints a line on standard error. `eprintln!` panics where nobody reads it, and the exit code is lost then.
fn remark(line: std::fmt::Arguments<'_>) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

/// Prints something worth knowing that ends nothing, on standard error.
fn note(text: impl std::fmt::Display) {
    remark(format_args!("{} {text}", style::warning("note:")));
}

/// The first error there is: it decides the exit code and is told last. What else went wrong is told here.
fn first_error(results: impl IntoIterator<Item = Result<(), CommandError>>) -> Result<(), CommandError> {
    let mut errors = results.into_iter().filter_map(Result::err);
    let first = errors.next();
    errors.for_each(|error| remark(format_args!("{} {error}", style::error("error:"))));
    first.map_or(Ok(()), Err)
}

/// Writes a result for machines, `-` being standard output.
fn write_json<T: serde::Serialize>(path: &Path, value: &T) -> Result<(), CommandError> {
    let json =
        serde_json::to_string_pretty(value).map_err(|error| CommandError::Failed(error.to_string()))?;
    if path.as_os_str() == "-" {
        return report_line(format_args!("{json}"));
    }
    std::fs::write(path, json + "\n")
        .map_err(|cause| CommandError::file(path, "cannot write the JSON", cause))
}

/// Tells a result: as text to people, unless standard output is asked for the JSON for machines.
fn tell<T: serde::Serialize>(
    json: Option<&Path>,
    value: &T,
    text: impl FnOnce() -> String,
) -> Result<(), CommandError> {
    let told = match json {
        Some(path) if path.as_os_str() == "-" => Ok(()),
        _ => report_line(format_args!("{}", text())),
    };
    first_error([told, json.map_or(Ok(()), |path| write_json(path, value))])
}

/// Writes a picture or a table where it is asked for, `-` being standard output.
fn write_text(path: Option<&Path>, text: impl FnOnce() -> String) -> Result<(), CommandError> {
    let Some(path) = path else { return Ok(()) };
    if path.as_os_str() == "-" {
        return report_line(format_args!("{}", text().trim_end()));
    }
    std::fs::write(path, text()).map_err(|cause| CommandError::file(path, "cannot write the result", cause))
}

/// A line on a terminal that says how a measurement comes along; nothing in a pipe.
struct ProgressLine(indicatif::ProgressBar);

impl ProgressLine {
    fn new() -> Self {
        Self(run::progress_bar(0, "{msg:<44} {wide_bar} {percent:>3} %  {elapsed}"))
    }
}

impl flotor_lab::Progress for ProgressLine {
    fn begin(&self, name: &str, steps: u64) {
        self.0.set_length(steps);
        self.0.set_position(0);
        self.0.set_message(name.to_owned());
    }

    fn advance(&self, steps: u64) {
        self.0.inc(steps);
    }
}

/// Colours, on terminals only.
mod style {
    use std::io::IsTerminal;

    fn painted(code: &str, text: &str, terminal: bool) -> String {
        let wanted = terminal && std::env::var_os("NO_COLOR").is_none();
        if wanted { format!("\x1b[{code}m{text}\x1b[0m") } else { text.to_owned() }
    }

    /// Red and bold, for the first word of an error.
    pub(super) fn error(text: &str) -> String {
        painted("1;31", text, std::io::stderr().is_terminal())
    }

    /// Yellow, for the first word of a warning.
    pub(super) fn warning(text: &str) -> String {
        painted("33", text, std::io::stderr().is_terminal())
    }

    /// Bold, for titles.
    pub(super) fn title(text: &str) -> String {
        painted("1", text, std::io::stdout().is_terminal())
    }
}
