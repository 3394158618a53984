//! Output of commands: human-readable text, JSON and errors.

use crate::platform::results_apart;
use crate::style::for_terminal;
use crate::{CommandError, style};
use flotor_servo::last_stop::{ReportedEnd, exit_process, report_end};
use std::fs::File;
use std::io::Write;
use std::path::Path;
use std::process::ExitCode;
use std::sync::OnceLock;

/// Prints a formatted line on standard output; a closed pipe (`flotor plugins | head`) ends the program without a message, with
/// exit code 0.
#[macro_export]
macro_rules! say {
    ($($text:tt)*) => { $crate::print_line(format_args!($($text)*)) };
}

/// Prints the error of a command, reports the exit code to the supervisor and returns it. Ends the process at once if a call of a
/// plugin has not returned, because the exit handlers of the process might wait for that call. Not real-time.
pub fn exit_code_of(result: Result<(), CommandError>) -> ExitCode {
    let code = match result {
        Ok(()) => 0,
        Err(error) => {
            print_error_line(format_args!("{} {error}", style::error("error:")));
            error.exit_code()
        }
    };
    let _ = std::io::stdout().flush();
    report_end(ReportedEnd::Code(code));
    if flotor_session::is_abandoned() {
        exit_process(code.into());
    }
    ExitCode::from(code)
}

/// Duplicate of standard output, if that is reserved for results.
static RESULTS: OnceLock<File> = OnceLock::new();

/// Reserves standard output for results of this program: output of plugins to standard output goes to standard error. Not real-time.
///
/// # Errors
/// Errors of the system.
pub fn keep_results_apart() -> Result<(), CommandError> {
    let moved = || {
        let _ = RESULTS.set(results_apart()?);
        Ok(())
    };
    moved().map_err(|cause: std::io::Error| {
        CommandError::file(Path::new("standard output"), "cannot be reserved for the result", cause)
    })
}

/// Writes a line of a result.
fn write_line(line: std::fmt::Arguments<'_>) -> std::io::Result<()> {
    match RESULTS.get() {
        Some(mut results) => writeln!(results, "{line}"),
        None => writeln!(std::io::stdout(), "{line}"),
    }
}

/// Prints a line on standard output, with control characters escaped, for `say!`. Ends the process if the line cannot be written:
/// with code 0 for a closed pipe, otherwise 1.
pub fn print_line(line: std::fmt::Arguments<'_>) {
    if let Err(error) = write_line(format_args!("{}", for_terminal(line))) {
        let code = if error.kind() == std::io::ErrorKind::BrokenPipe { 0 } else { 1 };
        report_end(ReportedEnd::Code(code));
        std::process::exit(code.into());
    }
}

/// Prints a human-readable line without ending the program at a closed pipe: for commands that continue afterwards, or have an exit
/// code of their own.
///
/// # Errors
/// If standard output cannot be written; a closed pipe is not an error.
pub fn report_line(line: std::fmt::Arguments<'_>) -> Result<(), CommandError> {
    report_text(format_args!("{}", for_terminal(line)))
}

/// Prints a machine-readable text unchanged; a closed pipe is not an error.
fn report_text(text: std::fmt::Arguments<'_>) -> Result<(), CommandError> {
    match write_line(text) {
        Err(cause) if cause.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(CommandError::file(Path::new("standard output"), "cannot write the result", cause))
        }
        _ => Ok(()),
    }
}

/// Prints a human-readable line on standard error, with control characters escaped. Unlike `eprintln!`, this function does not
/// panic on a closed pipe: after a panic the exit code would be wrong.
pub fn print_error_line(line: std::fmt::Arguments<'_>) {
    let _ = writeln!(std::io::stderr(), "{}", for_terminal(line));
}

/// Prints a note on standard error, without effect on the exit code.
pub fn note(text: impl std::fmt::Display) {
    print_error_line(format_args!("{} {text}", style::warning("note:")));
}

/// Prints all errors except the first, and returns the first, which determines the exit code and which the caller prints last.
///
/// # Errors
/// The first error of the results.
pub fn first_error(results: impl IntoIterator<Item = Result<(), CommandError>>) -> Result<(), CommandError> {
    let mut errors = results.into_iter().filter_map(Result::err);
    let first = errors.next();
    errors.for_each(|error| {
        print_error_line(format_args!("{} {error}", style::error("error:")));
    });
    first.map_or(Ok(()), Err)
}

/// Writes a result as JSON to a file, `-` for standard output.
///
/// # Errors
/// If the file or standard output cannot be written, or the value has no JSON form; a closed pipe is not an error.
pub fn write_json<T: serde::Serialize>(path: &Path, value: &T) -> Result<(), CommandError> {
    let json =
        serde_json::to_string_pretty(value).map_err(|error| CommandError::Failed(error.to_string()))?;
    if path.as_os_str() == "-" {
        return report_text(format_args!("{json}"));
    }
    std::fs::write(path, json + "\n")
        .map_err(|cause| CommandError::file(path, "cannot write the JSON", cause))
}

/// Writes a result as JSON if `json` is given (`-` for standard output), and prints it as text unless the JSON goes to standard output.
///
/// # Errors
/// If the file or standard output cannot be written, or the value has no JSON form. If both outputs fail, the second error is
/// printed.
pub fn print_result<T: serde::Serialize>(
    json: Option<&Path>,
    value: &T,
    text: impl FnOnce() -> String,
) -> Result<(), CommandError> {
    let printed = match json {
        Some(path) if path.as_os_str() == "-" => Ok(()),
        _ => report_line(format_args!("{}", text())),
    };
    first_error([printed, json.map_or(Ok(()), |path| write_json(path, value))])
}

/// Writes a picture or a table to a file, `-` for standard output; does nothing without a path.
///
/// # Errors
/// If the file or standard output cannot be written.
pub fn write_text(path: Option<&Path>, text: impl FnOnce() -> String) -> Result<(), CommandError> {
    let Some(path) = path else { return Ok(()) };
    if path.as_os_str() == "-" {
        return report_text(format_args!("{}", text().trim_end()));
    }
    std::fs::write(path, text()).map_err(|cause| CommandError::file(path, "cannot write the result", cause))
}
