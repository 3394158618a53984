//! The `flotor` command: parses arguments, runs commands and returns exit codes.
//!
//! Commands without a servo loop are separate programs in the same folder, which shortens a first build.

mod bridge;
mod doctor;
mod emulate;
mod new;
mod object;
mod plugins;
mod record;
mod release;
mod repair;
mod run;
mod scenes;
mod swap;
mod view;
mod watchdog;
mod worker;

use crate::platform::{check_lend, end_with_parent};
use bridge::BRIDGE;
use clap::{Args, CommandFactory, Parser, Subcommand};
use flotor_command::separate::{Built, SeparateProgram};
use flotor_command::{CommandError, exit_code_of, options, say, supervised};
use std::ffi::OsString;
use std::process::ExitCode;
use std::sync::LazyLock;

/// Version, and in a release the commit: `.ci/archive` sets `FLOTOR_COMMIT`. Other builds show no commit, so that a new commit does
/// not force a rebuild.
static VERSION: LazyLock<String> = LazyLock::new(|| {
    let commit = option_env!("FLOTOR_COMMIT").map(|commit| format!(" ({commit})")).unwrap_or_default();
    format!("{}{commit}", env!("CARGO_PKG_VERSION"))
});

/// Runs force models and haptic devices (both are plugins) in a servo loop with safety limits.
#[derive(Parser)]
#[command(name = "flotor", version = VERSION.as_str(), propagate_version = true, max_term_width = 110)]
#[command(after_help = "Examples:\n  \
    flotor                                            the built-in demo: simulate a spring for 10 s\n  \
    flotor run --clock virtual --seed 1 --plot run.svg    the same, repeatable, with a plot\n  \
    flotor run wall                                   another of Flotor's own scenes (`flotor scenes`)\n  \
    flotor run scene.toml --set spring.variant=closed-form --record run.mcap\n  \
    flotor eval --model spring --set preset=thesis-2 --poses poses.csv --out -\n\n\
    Exit codes: 0 ok, 2 usage or configuration, 3 a plugin was refused or failed, 4 device fault, or device\n\
    stopped (emergency stop, watchdog, oscillation), 130 forced end (on Windows another code), 1 anything else.")]
struct Arguments {
    #[command(subcommand)]
    command: Option<Command>,
}

/// Program that measures plugins, loops and recordings.
const LAB: SeparateProgram<'static> = built_with_this("flotor-lab");
/// Program for perception experiments.
const STUDY: SeparateProgram<'static> = built_with_this("flotor-study");
/// Program for the calibration of devices.
const CALIBRATION: SeparateProgram<'static> = built_with_this("flotor-calibration");
/// Program that identifies real objects.
const IDENTIFY: SeparateProgram<'static> = built_with_this("flotor-identify");
/// Program that tests scenes with expectations.
const TEST: SeparateProgram<'static> = built_with_this("flotor-test");
/// Program that lends a device to programs of other makers.
const LEND: SeparateProgram<'static> = built_with_this("flotor-lend");

const fn built_with_this(program: &'static str) -> SeparateProgram<'static> {
    SeparateProgram { program, built: Built::WithThis, build: "cargo build --release" }
}

/// Program that sweeps parameters and writes tables; in its own workspace, because it depends on Parquet.
const SWEEP: SeparateProgram<'static> = SeparateProgram {
    program: "flotor-sweep",
    built: Built::OwnWorkspace("sweep"),
    build: "cargo build --release --manifest-path interop/sweep/Cargo.toml --target-dir target/sweep",
};

/// Arguments of a command that a separate program carries out.
#[derive(Args)]
#[command(disable_help_flag = true, disable_version_flag = true)]
struct Separate {
    /// Arguments and options; `--help` lists them
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, value_name = "ARGUMENTS")]
    arguments: Vec<OsString>,
}

#[derive(Subcommand)]
enum Command {
    /// Run a scene in the servo loop (without SCENE: the built-in demo)
    Run(run::RunArguments),
    /// Re-evaluate the models on a recorded trajectory: bit-exact, or with changed parameters
    Replay(Separate),
    /// Show a running session or a recording: the model in 3D, and plots over time
    View(Box<view::ViewArguments>),
    /// Evaluate a force model at poses from a CSV file
    Eval(Separate),
    /// List Flotor's own scenes, or print a scene as a template
    Scenes(scenes::ScenesArguments),
    /// List the installed plugins, without running any of them
    Plugins(plugins::PluginsArguments),
    /// Check a plugin file against the rules of the contract
    Validate(Separate),
    /// Create a plugin: a folder that builds, passes `validate` and runs; or the scene of a mesh file
    New(new::NewArguments),
    /// Run scenes with expectations: pass or fail, for CI
    Test(Separate),
    /// Measure the timing of the servo on this machine, compared with a bare loop
    Jitter(Separate),
    /// Find the largest stable stiffness of a virtual spring, compared with theory
    Stability(Separate),
    /// Measure cost and error of an evaluation, for many settings of a force model
    Bench(Separate),
    /// Score the numerical stability of a force model
    Stress(Separate),
    /// Attach to a running session and record it until it ends
    Record(record::RecordArguments),
    /// Copy a truncated recording to a file that every MCAP reader accepts
    Repair(repair::RepairArguments),
    /// Hot-swap a model of a running session, without a jump in the force
    Swap(swap::SwapArguments),
    /// Release the emergency stop of this machine: runs may start again
    Release(release::ReleaseArguments),
    /// Publish a running host on a network, or show a remote host here
    Bridge(Separate),
    /// Sweep a model or a scene over parameters, poses and seeds into a Parquet table
    Sweep(Separate),
    /// Run a perception experiment
    Study(Separate),
    /// Analyse the data of a perception experiment
    Analyse(Separate),
    /// Measure the ratio of delivered to commanded vertical force, and correct it
    Calibrate(Separate),
    /// Find the force law of a real object from measured force and displacement
    Identify(Separate),
    /// Emulate the controller of a device, to use its plugin without hardware
    Emulate(emulate::EmulateArguments),
    /// Run an unmodified program, written for another maker's device, on the device of a scene, within the scene's limits
    Lend(Separate),
    /// Check this machine's real-time configuration and suggest fixes
    Doctor(doctor::DoctorArguments),
    /// Process with one force model, started by the host of a run for `isolation = "process"`
    #[command(hide = true)]
    Worker(worker::WorkerArguments),
    /// Process that stops devices when the host has ended, started by the host of a run
    #[command(hide = true)]
    Watchdog(watchdog::WatchdogArguments),
    /// Print a completion script for a shell
    Completions {
        /// Shell of the completion script
        shell: clap_complete::Shell,
    },
}

/// Returns the parser of all commands. Not real-time.
#[must_use]
pub fn command() -> clap::Command {
    Arguments::command()
}

/// Returns the names of the commands that the help lists, in the order of the help. Not real-time.
#[must_use]
pub fn command_names() -> Vec<String> {
    let command = command();
    let listed = command.get_subcommands().filter(|command| !command.is_hide_set());
    listed.map(|command| command.get_name().to_owned()).collect()
}

/// Parses the arguments of this process, runs the command and returns its exit code.
#[must_use]
pub fn main() -> ExitCode {
    let arguments = options::arguments::<Arguments>();
    flotor_session::on_notice(|notice| flotor_command::note(notice));
    let command = arguments.command.unwrap_or_else(|| Command::Run(run::RunArguments::default()));
    if let Command::Run(arguments) = &command
        && arguments.is_lent()
    {
        end_with_parent();
    }
    // Other commands execute no plugin code in this process.
    match matches!(command, Command::Run(_) | Command::Doctor(_)) {
        true => supervised(|| carry_out(command)),
        false => exit_code_of(carry_out(command)),
    }
}

/// Returns the arguments after the command as they were given. The parser removes a leading `--`, which separates scene and program
/// for `lend`.
fn after_the_command() -> Vec<OsString> {
    std::env::args_os().skip(2).collect()
}

fn carry_out(command: Command) -> Result<(), CommandError> {
    match command {
        Command::Run(arguments) => run::run(arguments),
        Command::Replay(separate) => LAB.carry_out("replay", &separate.arguments),
        Command::View(arguments) => view::run(&arguments),
        Command::Eval(separate) => LAB.carry_out("eval", &separate.arguments),
        Command::Scenes(arguments) => scenes::run(&arguments),
        Command::Plugins(arguments) => plugins::run(&arguments),
        Command::Validate(separate) => LAB.carry_out("validate", &separate.arguments),
        Command::New(arguments) => new::run(&arguments),
        Command::Test(separate) => TEST.carry_out("test", &separate.arguments),
        Command::Jitter(separate) => LAB.carry_out("jitter", &separate.arguments),
        Command::Stability(separate) => LAB.carry_out("stability", &separate.arguments),
        Command::Bench(separate) => LAB.carry_out("bench", &separate.arguments),
        Command::Stress(separate) => LAB.carry_out("stress", &separate.arguments),
        Command::Record(arguments) => record::run(&arguments),
        Command::Repair(arguments) => repair::run(&arguments),
        Command::Swap(arguments) => swap::run(&arguments),
        Command::Release(arguments) => release::run(&arguments),
        Command::Bridge(separate) => BRIDGE.become_with(&separate.arguments),
        Command::Sweep(separate) => SWEEP.become_with(&separate.arguments),
        Command::Study(separate) => STUDY.carry_out("study", &separate.arguments),
        Command::Analyse(separate) => STUDY.carry_out("analyse", &separate.arguments),
        Command::Calibrate(separate) => CALIBRATION.carry_out("calibrate", &separate.arguments),
        Command::Identify(separate) => IDENTIFY.carry_out("identify", &separate.arguments),
        Command::Emulate(arguments) => emulate::run(&arguments),
        Command::Lend(_) => check_lend().and_then(|()| LEND.carry_out("lend", &after_the_command())),
        Command::Doctor(arguments) => doctor::run(&arguments),
        Command::Worker(arguments) => worker::run(arguments),
        Command::Watchdog(arguments) => watchdog::run(arguments),
        Command::Completions { shell } => {
            // Written to memory first: the generator panics if its output is closed.
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut Arguments::command(), "flotor", &mut script);
            say!("{}", String::from_utf8_lossy(&script).trim_end());
            Ok(())
        }
    }
}
