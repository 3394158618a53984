//! `flotor emulate`: the emulator of a device, a separate program.

use clap::{Args, Command};
use flotor_command::CommandError;
use flotor_command::say;
use flotor_command::separate::{Built, SeparateProgram};
use std::ffi::OsString;

/// Emulate the controller of a device, to use its plugin without hardware.
#[derive(Args)]
#[command(
    after_help = "`flotor emulate NAME` executes the program `flotor-NAME-emulator` of the same folder, with all \
    further arguments.\n\nExamples:\n  \
    flotor emulate maglev\n  \
    flotor emulate maglev --transport pty --link /tmp/flotor-tty\n  \
    flotor emulate maglev --pace lockstep --set preset=full\n  \
    flotor emulate maglev --protocol ml-api     for programs written for the Maglev 200\n  \
    flotor emulate falcon                       for the plugin `falcon`, and with `--transport usb` for every program\n  \
    flotor emulate haply-service                for programs written for Haply's service\n  \
    flotor emulate maglev --help                 options of that emulator",
    // After NAME the flag belongs to the emulator.
    disable_help_flag = true
)]
pub(crate) struct EmulateArguments {
    /// Name of the emulator: falcon, haply-service, maglev, or NAME for another program flotor-NAME-emulator
    #[arg(allow_hyphen_values = true, value_name = "NAME")]
    device: String,
    /// Arguments of the emulator; `flotor emulate NAME --help` lists them
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, value_name = "ARGUMENTS")]
    arguments: Vec<OsString>,
}

pub(crate) fn run(arguments: &EmulateArguments) -> Result<(), CommandError> {
    let EmulateArguments { device, arguments } = arguments;
    if ["-h", "--help"].contains(&device.as_str()) {
        let help = EmulateArguments::augment_args(Command::new("flotor emulate")).render_help().to_string();
        say!("{}", help.trim_end());
        return Ok(());
    }
    let is_id = device.starts_with(|c: char| c.is_ascii_alphabetic())
        && device.chars().all(|c| c.is_ascii_alphanumeric() || "-_".contains(c));
    if !is_id {
        return Err(CommandError::Usage(format!(
            "`{device}` is not the name of an emulator: write a letter first, then letters, digits, `-` and `_`; \
             `flotor emulate NAME --help` lists the options"
        )));
    }
    let program = format!("flotor-{device}-emulator");
    let build = match device.as_str() {
        "falcon" => "cargo build --release -p flotor-falcon-emulator",
        "haply-service" => "cargo build --release -p flotor-haply-service",
        _ => "cargo build --release -p flotor-maglev-emulator",
    };
    let emulator = SeparateProgram { program: &program, built: Built::WithThis, build };
    if !["falcon", "haply-service", "maglev"].contains(&device.as_str()) && emulator.command().is_err() {
        let words = format!(
            "there is no emulator `{program}` in the folder of `flotor`; Flotor provides `falcon`, `haply-service` and `maglev`"
        );
        return Err(CommandError::Usage(words));
    }
    emulator.become_with(arguments)
}
