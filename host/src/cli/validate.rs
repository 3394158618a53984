//! `flotor validate`: a plugin file against the rules of the contract.

use super::{CommandError, style, write_json};
use crate::validate::{Finding, validate};
use clap::Args;
use std::path::{Path, PathBuf};

/// Check a plugin file.
#[derive(Args)]
#[command(after_help = "Example:\n  flotor validate target/release/libmy_model.so\n\n\
    Runs the plugin's code in this process: validate only files you would load.")]
pub(crate) struct ValidateArguments {
    /// The plugin's shared library
    plugin: PathBuf,
    /// For machines
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(arguments: &ValidateArguments) -> Result<(), CommandError> {
    let findings = validate(&arguments.plugin);
    let violated = findings.iter().filter(|finding| finding.violation.is_some()).count();
    if arguments.json {
        write_json(Path::new("-"), &findings)?;
    } else {
        say!("{}", style::title(&arguments.plugin.display().to_string()));
        findings.iter().for_each(print);
    }
    if violated == 0 {
        return Ok(());
    }
    let problem = format!("{}: {violated} of {} rules violated", arguments.plugin.display(), findings.len());
    Err(CommandError::PluginRefused(problem))
}

fn print(finding: &Finding) {
    match &finding.violation {
        None => say!("  ok      {:<20} {}", finding.rule, finding.text),
        Some(seen) => say!("  FAILED  {:<20} {}\n          {seen}", finding.rule, finding.text),
    }
}
