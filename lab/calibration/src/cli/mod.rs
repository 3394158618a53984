//! `flotor calibrate`: measurement and correction of the vertical force. Command line of the program
//! `flotor-calibration`, which `flotor` starts.

mod import;
mod rig;
mod verify;
mod vertical;

use crate::CalibrationError;
use clap::{Args, Subcommand};
use flotor_command::{CommandError, options, supervised, write_text};
use flotor_session::calibration_file::{CalibrationFile, Provenance, Source, today};
use std::ops::RangeInclusive;
use std::path::Path;
use std::process::ExitCode;

/// Calibrate devices; `flotor calibrate` starts this program.
#[derive(Subcommand)]
enum Command {
    Calibrate(CalibrateArguments),
}

/// Function that returns the command-line parser of all commands. Not real-time.
pub const PARSER: fn() -> clap::Command = options::parser_of::<Command>;

/// Runs the command of this process.
#[must_use]
pub fn main() -> ExitCode {
    let Command::Calibrate(arguments) = options::command_of::<Command>();
    flotor_session::on_notice(|notice| flotor_command::note(notice));
    supervised(|| run(&arguments))
}

/// Measure the ratio of delivered to commanded vertical force, and correct it.
#[derive(Args)]
struct CalibrateArguments {
    #[command(subcommand)]
    command: CalibrateCommand,
}

#[derive(Subcommand)]
enum CalibrateCommand {
    /// Measure the ratio of delivered to commanded vertical force at each height, and fit it
    Vertical(vertical::VerticalArguments),
    /// Measure the error without and with a calibration file
    Verify(verify::VerifyArguments),
    /// Write a calibration file from the polynomial of the thesis, or from given coefficients
    Import(import::ImportArguments),
}

fn run(arguments: &CalibrateArguments) -> Result<(), CommandError> {
    match &arguments.command {
        CalibrateCommand::Vertical(arguments) => vertical::run(arguments),
        CalibrateCommand::Verify(arguments) => verify::run(arguments),
        CalibrateCommand::Import(arguments) => import::run(arguments),
    }
}

/// Range of commanded forces, N.
const FORCES_N: RangeInclusive<f64> = 1.0..=50.0;

fn provenance(source: Source, note: Option<String>) -> Provenance {
    let program = format!("flotor {}", env!("CARGO_PKG_VERSION"));
    Provenance { source, program, date: Some(today()), seed: None, note }
}

fn write_calibration(path: &Path, file: &CalibrationFile) -> Result<(), CommandError> {
    let text = file.to_text().map_err(|error| CommandError::Failed(error.to_string()))?;
    write_text(Some(path), || text)
}

fn refused(error: CalibrationError) -> CommandError {
    match error {
        CalibrationError::Plugin(error) => error.into(),
        CalibrationError::Run(error) => error.into(),
        CalibrationError::Fault(fault) => CommandError::DeviceFault(fault),
        CalibrationError::Setting(_)
        | CalibrationError::Refused(_)
        | CalibrationError::SensorRefused(_)
        | CalibrationError::Disconnected => CommandError::PluginRefused(error.to_string()),
        CalibrationError::TooFew { .. }
        | CalibrationError::TooStrong { .. }
        | CalibrationError::Saturated { .. } => CommandError::Usage(error.to_string()),
        other => CommandError::Failed(other.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(arguments: &str) -> String {
        let words = ["flotor", "calibrate"].into_iter().chain(arguments.split(' '));
        match PARSER().try_get_matches_from(words) {
            Ok(_) => String::new(),
            Err(error) => error.to_string(),
        }
    }

    #[test]
    fn the_rig_is_simulated_or_a_device_with_its_sensor() {
        assert!(refusal("vertical").contains("<--simulated|--device <ID>>"), "{}", refusal("vertical"));
        assert!(refusal("vertical --device maglev").contains("--sensor <PORT>"));
        for option in [
            "--sensor X",
            "--set a=b",
            "--patience 5s",
            "--sensor-plugin x",
            "--sensor-set a=b",
            "--device maglev",
        ] {
            let refusal = refusal(&format!("vertical --simulated {option}"));
            assert!(refusal.contains("cannot be used with"), "{option}: {refusal}");
        }
        assert_eq!(refusal("vertical --simulated --seed 3"), "");
        assert_eq!(refusal("vertical --device maglev --sensor X --set a=b"), "");
    }

    #[test]
    fn an_illegal_value_is_told_what_is_legal() {
        for (arguments, words) in [
            ("vertical --simulated --step-mm 0", "the range is 0.01 to 22 mm"),
            ("vertical --simulated --steps 0", "write a whole number from 7 to 200"),
            ("vertical --simulated --force -10,12", "the range is 1 to 50 N"),
            ("vertical --simulated --out nosuch/c.toml", "no folder `nosuch`; create it first"),
            ("import --out c.toml --excess x", "write a number such as 0.75"),
            ("import --out c.toml --range-mm 7", "write FROM,TO, such as -7,7"),
        ] {
            assert!(refusal(arguments).contains(words), "{}", refusal(arguments));
        }
        assert_eq!(refusal("import --out c.toml --range-mm -7,7"), "");
    }
}
