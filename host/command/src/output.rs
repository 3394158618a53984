//! Output of commands, for people and for machines.

use crate::platform::results_apart;
use crate::style::for_terminal;
use crate::{CommandError, style};
use flotor_servo::last_stop::{ReportedEnd, exit_process, report_end};
use std::fs::File;
use std::io::Write;
use std::path::Path;
use std::process::ExitCode;
use std::sync::OnceLock;

/// Prints a line; a closed pipe (`flotor plugins | head`) ends the program without a message.
#[macro_export]
macro_rules! say {
    ($($text:tt)*) => { $crate::print_line(format_args!($($text)*)) };
}

/// Returns the exit code of a command, prints its error, and reports its end to the supervisor. Ends the process itself if a plugin's
/// code has not returned, because the exit handlers of the process might wait for that code. Not real-time.
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

/// Standard output, if it is reserved for results.
static RESULTS: OnceLock<File> = OnceLock::new();

/// Reserves standard output for results of this program: what a plugin prints there goes to standard error. Not real-time.
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

/// Prints the line of `say!`.
pub fn print_line(line: std::fmt::Arguments<'_>) {
    if let Err(error) = write_line(format_args!("{}", for_terminal(line))) {
        let code = if error.kind() == std::io::ErrorKind::BrokenPipe { 0 } else { 1 };
        report_end(ReportedEnd::Code(code));
        std::process::exit(code.into());
    }
}

/// Prints a line for people where the command has more to do, or an exit code of its own: a closed pipe does not end the program.
///
/// # Errors
/// If standard output cannot be written; a closed pipe is no error.
pub fn report_line(line: std::fmt::Arguments<'_>) -> Result<(), CommandError> {
    report_text(format_args!("{}", for_terminal(line)))
}

/// Prints a text for machines, unchanged; a closed pipe is no error.
fn report_text(text: std::fmt::Arguments<'_>) -> Result<(), CommandError> {
    match write_line(text) {
        Err(cause) if cause.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(CommandError::file(Path::new("standard output"), "cannot write the result", cause))
        }
        _ => Ok(()),
    }
}

/// Prints a line for people on standard error. Unlike `eprintln!` it does not panic on a closed pipe, which would lose the exit code.
pub fn print_error_line(line: std::fmt::Arguments<'_>) {
    let _ = writeln!(std::io::stderr(), "{}", for_terminal(line));
}

/// Prints a note on standard error; it changes no exit code.
pub fn note(text: impl std::fmt::Display) {
    print_error_line(format_args!("{} {text}", style::warning("note:")));
}

/// Returns the first error, which determines the exit code and which the caller prints last; prints the others.
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

/// Writes a result for machines to a file, `-` for standard output.
///
/// # Errors
/// If the file or standard output cannot be written.
pub fn write_json<T: serde::Serialize>(path: &Path, value: &T) -> Result<(), CommandError> {
    let json =
        serde_json::to_string_pretty(value).map_err(|error| CommandError::Failed(error.to_string()))?;
    if path.as_os_str() == "-" {
        return report_text(format_args!("{json}"));
    }
    std::fs::write(path, json + "\n")
        .map_err(|cause| CommandError::file(path, "cannot write the JSON", cause))
}

/// Prints a result as text, unless JSON is requested on standard output.
///
/// # Errors
/// If the file or standard output cannot be written.
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

/// Writes a picture or a table to the given file, `-` for standard output.
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
