//! `flotor identify`: identification of the force law of a real object. Command line of the program `flotor-identify`, which
//! `flotor` starts.

mod output;

use crate::csv;
use crate::fit::Device;
use crate::identification::{Identification, identify};
use crate::law::Law;
use crate::measurement::Measurement;
use crate::recording::{self, Axis, RecordingError};
use clap::{Args, Subcommand, ValueEnum};
use flotor_command::options::{JsonOption, number};
use flotor_command::{CommandError, exit_code_of, note, options};
use flotor_hal::read_text;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Identify the force law of a real object; `flotor identify` starts this program.
#[derive(Subcommand)]
enum Command {
    Identify(IdentifyArguments),
}

/// Function that returns the command-line parser of the program. Not real-time.
pub const PARSER: fn() -> clap::Command = options::parser_of::<Command>;

/// Runs the command of this process.
#[must_use]
pub fn main() -> ExitCode {
    let Command::Identify(arguments) = options::command_of::<Command>();
    exit_code_of(run(&arguments))
}

/// Find the force law of a real object from measured force and displacement, with the errors of its parameters.
#[derive(Args)]
#[command(
    after_help = "A table has a header with `displacement_m` or `displacement_mm` (positive into the object), `force_n` (on the \
    object positive), and `time_s` for laws that depend on the velocity; other columns are ignored. A recording gives the \
    motion and the delivered force along one axis, or the force of its force sensor.\n\n\
    Laws, d the depth beyond `contact_m`, v its velocity:\n  \
    linear         F = k d\n  \
    hertz          F = k d^1.5\n  \
    spring         F = k d + k_c max(0, d - travel)\n  \
    hunt-crossley  F = k d^n (1 + lambda v)\n  \
    zener          F = k d + q,  dq/dt = E v - q / tau\n  \
    hysteresis     F = k d + z,  dz = kappa dd within |z| <= friction\n  \
    table          smooth curve through 17 points\n\n\
    The command chooses the simplest law whose prediction error is within one standard error of the best one. If its \
    residuals are not noise alone, the result is `none of these`.\n\n\
    Examples:\n  \
    flotor identify pressed.csv\n  \
    flotor identify pressed.csv --out ball --json ball.json\n  \
    flotor identify run.mcap --axis z\n  \
    flotor identify pressed.csv --law hertz --force-error 0.5"
)]
struct IdentifyArguments {
    /// Measurement: a table (CSV) or a recording (MCAP)
    #[arg(value_name = "FILE.csv|FILE.mcap")]
    file: PathBuf,
    /// Fit this law only
    #[arg(long, value_name = "NAME")]
    law: Option<LawOption>,
    /// Standard deviation of a slow error of the measured force over the displacement, in % of the force
    #[arg(long, value_name = "PERCENT", default_value = "0", value_parser = number("%", "error", 0.0..=50.0))]
    force_error: f64,
    /// Standard deviation of the device's own dry friction in the measured force, in N
    #[arg(long, value_name = "N", default_value = "0", value_parser = number("N", "friction", 0.0..=50.0))]
    friction: f64,
    /// Axis of the motion in a recording
    #[arg(long, value_name = "AXIS", default_value = "z")]
    axis: AxisOption,
    /// Write pictures, the curve of the force at rest and a scene with it into this folder
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
    #[command(flatten)]
    json: JsonOption,
}

/// Law for `--law`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum LawOption {
    /// Constant stiffness
    Linear,
    /// Ball on a half-space
    Hertz,
    /// Spring whose coils touch
    Spring,
    /// Power of the depth with damping
    HuntCrossley,
    /// Standard linear solid
    Zener,
    /// Spring with dry friction
    Hysteresis,
    /// Smooth curve
    Table,
}

impl From<LawOption> for Law {
    fn from(option: LawOption) -> Self {
        match option {
            LawOption::Linear => Self::Linear,
            LawOption::Hertz => Self::Hertz,
            LawOption::Spring => Self::Spring,
            LawOption::HuntCrossley => Self::HuntCrossley,
            LawOption::Zener => Self::Zener,
            LawOption::Hysteresis => Self::Hysteresis,
            LawOption::Table => Self::Table,
        }
    }
}

/// Axis for `--axis`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum AxisOption {
    /// To the right
    X,
    /// Away from the user
    Y,
    /// Up
    Z,
}

impl From<AxisOption> for Axis {
    fn from(option: AxisOption) -> Self {
        match option {
            AxisOption::X => Self::X,
            AxisOption::Y => Self::Y,
            AxisOption::Z => Self::Z,
        }
    }
}

fn run(arguments: &IdentifyArguments) -> Result<(), CommandError> {
    let IdentifyArguments { file, law, force_error, friction, axis, out, json } = arguments;
    let measurement = measurement(file, (*axis).into())?;
    let laws = law.map_or_else(|| Law::ALL.to_vec(), |law| vec![law.into()]);
    let device = Device { force_error: force_error * 0.01, friction_n: *friction };
    let identified = identify(&measurement, &laws, device);
    let mut identified =
        identified.map_err(|error| CommandError::Usage(format!("{}: {error}", file.display())))?;
    if law.is_some() && identified.law.is_none() {
        note(format_args!(
            "the law `{}` leaves {:.4} N that is not noise; without --law the command searches for a better one",
            identified.closest.id(),
            identified.structure_n
        ));
        identified = Identification { law: Some(identified.closest), ..identified };
    }
    output::write(&measurement, &identified, out.as_deref(), json)
}

/// Reads a recording if the file has the extension `mcap`, otherwise a table.
fn measurement(file: &Path, axis: Axis) -> Result<Measurement, CommandError> {
    if file.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("mcap")) {
        return recording::read(file, axis).map_err(|error| match error {
            RecordingError::Read(error) => error.into(),
            error => CommandError::Usage(error.to_string()),
        });
    }
    let parsed = read_text(file, "the measurement").and_then(|text| csv::parse(&text));
    let parsed = parsed.map_err(|problem| CommandError::Usage(problem.in_file(file.display())))?;
    if !parsed.ignored.is_empty() {
        note(format_args!("{}: ignored columns: {}", file.display(), parsed.ignored.join(", ")));
    }
    Ok(parsed.measurement)
}
