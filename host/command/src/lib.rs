//! Command line library shared by Flotor's programs.
//!
//! - [`CommandError`]: errors of commands, with the exit code that is a contract.
//! - [`options`]: options of several commands, and their parsers.
//! - [`say!`], [`print_result`], [`write_json`], [`write_text`]: results for people and for machines.
//! - [`tables`]: results as tables.
//! - [`supervised`]: a command in its own process, of which no unreported end counts as success.
//! - [`PluginProcess`]: a process for the code of plugins, which ends with the command.
//! - [`stopping`]: signals and keys that end a run.
//! - [`separate`]: programs beside this one that carry out a command.
//! - [`reference()`]: every command with its arguments, for the book; [`whole_program`]: the parser with all of them, for man pages.
//!
//! Not real-time throughout.

mod error;
pub mod options;
mod output;
mod platform;
mod progress;
mod reference;
pub mod separate;
mod shell;
pub mod stopping;
pub mod style;
mod supervision;
pub mod tables;

pub use flotor_session::PluginProcess;

pub use error::{CommandError, before_advice};
pub use output::{
    exit_code_of, first_error, keep_results_apart, note, print_error_line, print_line, print_result,
    report_line, write_json, write_text,
};
pub use platform::INTERRUPTED;
pub use progress::{Redrawn, progress_bar, while_preparing};
pub use reference::{reference, whole_program};
pub use shell::{command_line, quoted};
pub use supervision::supervised;
