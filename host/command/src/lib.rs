//! Command line library shared by Flotor's programs.
//!
//! - [`CommandError`]: errors of commands, with the exit code that is a contract.
//! - [`options`]: options that several commands have, and parsers of option values.
//! - [`say!`], [`print_result`], [`write_json`], [`write_text`]: output of results, human-readable or as JSON.
//! - [`tables`]: results as tables.
//! - [`verdict()`]: the result of a run as that of a command.
//! - [`supervised`]: execution of a command in a child process, whose end counts as an error unless the host has reported success.
//! - [`PluginProcess`]: a process that runs plugin code and ends with the command.
//! - [`stopping`]: signals and keys that end a run.
//! - [`separate`]: separate programs in the folder of this one, which execute some commands.
//! - [`reference()`]: every command with its arguments, for the book; [`whole_program`]: the parser of all commands, for man pages.
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
mod verdict;

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
pub use verdict::{end_notes, end_words, verdict};
