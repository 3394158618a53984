//! Supervision of a command that runs plugin code in a child process: the supervisor waits for the child and returns its exit code.
//!
//! A plugin can end its process without a message and with exit code 0: `_exit`, `exec`, a thread that crashes before the host's
//! handlers are installed. The supervisor runs no plugin code. It forwards signals, and reports an error if the child ends without
//! an end report of the host ([`flotor_servo::last_stop::report_end`]). If the supervisor is killed, the child is requested to end.
//!
//! On Windows, and for process 1 of a container, the process is not divided.

use crate::platform::{die_by, divide};
use crate::{CommandError, exit_code_of, print_error_line, style};
use flotor_servo::THREAD_ADVICE;
use flotor_servo::last_stop::{SignalName, report_end_to};
use std::process::ExitCode;
use std::sync::atomic::AtomicU32;

/// Exit code of a plugin that failed.
const PLUGIN_FAILED: u8 = 3;
/// Exit code if something other than a plugin has killed the process.
const KILLED: u8 = 1;

/// Process in which [`divide`] returns.
pub(crate) enum Side {
    /// The process is not divided.
    Undivided,
    /// The child of a supervisor.
    Child {
        /// Process id of the supervisor.
        supervisor: u32,
        /// Shared memory of the end report.
        report: &'static AtomicU32,
    },
    /// The supervisor of a child that has ended.
    Supervisor(End),
}

/// Kind of end of a supervised process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum End {
    /// Reported end, with this exit code.
    Reported(u8),
    /// Killed by a signal that requests an end.
    Asked(i32),
    /// Exit without a report, with this exit code.
    Left(u8),
    /// Killed by another signal, before the process reported or after it reported success.
    Killed(i32),
}

/// Executes a command in a supervised child process (on Windows, and in process 1 of a container, in this process), and returns the
/// exit code in both processes. Call this function while the process has only one thread. Not real-time.
pub fn supervised(command: impl FnOnce() -> Result<(), CommandError>) -> ExitCode {
    match divide() {
        Ok(Side::Undivided) => exit_code_of(command()),
        Ok(Side::Child { supervisor, report }) => {
            report_end_to(report);
            flotor_live::set_process_number(supervisor);
            exit_code_of(command())
        }
        Ok(Side::Supervisor(end)) => ExitCode::from(code_of(end)),
        Err(cause) => exit_code_of(Err(CommandError::Failed(format!(
            "cannot start a process for the command: {cause}; {THREAD_ADVICE}"
        )))),
    }
}

/// Returns the exit code of a supervised process, and prints a message if the process ended without a report.
fn code_of(end: End) -> u8 {
    let by_plugin = |how: String| {
        let message = format!(
            "a plugin ended the process before the command was complete ({how}); `flotor validate FILE` identifies the plugin"
        );
        (PLUGIN_FAILED, message)
    };
    let (code, message) = match end {
        End::Reported(code) => return code,
        End::Asked(signal) => die_by(signal),
        End::Left(code) => by_plugin(format!("exit code {code}, by `exit`, `_exit` or `exec`")),
        End::Killed(signal) if SignalName(signal).is_a_crash() => by_plugin(SignalName(signal).to_string()),
        End::Killed(signal) => {
            (KILLED, format!("{} ended the process before the command was complete", SignalName(signal)))
        }
    };
    print_error_line(format_args!("{} {message}", style::error("error:")));
    code
}
