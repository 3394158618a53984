//! `flotor validate`: check of a plugin file against the rules of the contract.

use clap::Args;
use flotor_command::options::{KeyValue, PluginResultOptions, duration_s};
use flotor_command::say;
use flotor_command::{CommandError, style};
use flotor_judge::validate::{Check, Figures, Finding, Verdict, check, deliver, validate};
use flotor_servo::last_stop::ignore_no_signal;
use flotor_session::step_limit;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

/// Check a plugin file against the rules of the contract.
#[derive(Args)]
#[command(
    after_help = "Examples:\n  flotor validate spring\n  flotor validate target/release/libmy_model.so\n  \
    flotor validate target/release/libmy_device.so --set port=/dev/ttyACM0\n\n\
    The command runs the plugin's code, each rule in its own process: validate only files that you would load."
)]
pub(crate) struct ValidateArguments {
    /// Id of the plugin, or path to its file
    #[arg(value_name = "ID")]
    plugin: PathBuf,
    /// Set a parameter of the checked instances, such as the port of a device (repeatable)
    #[arg(long = "set", value_name = "KEY=VALUE")]
    sets: Vec<KeyValue>,
    #[command(flatten)]
    options: PluginResultOptions,
    /// Check only this rule, by its name in the output, and `metadata` (repeatable; default: all rules)
    #[arg(long, value_parser = rule, value_name = "RULE")]
    only: Vec<Check>,
    /// Limit of the processor time and of the waiting time of each rule, such as 10s or 500ms; six times as long for the first
    /// instance
    #[arg(long, value_parser = duration_s, allow_hyphen_values = true, value_name = "TIME", default_value = "10s")]
    timeout: f64,
    /// Check one rule in this process, and print the verdict as JSON
    #[arg(long, hide = true, value_parser = rule)]
    rule: Option<Check>,
    /// Write the verdict into the file of standard input instead
    #[arg(long, hide = true, requires = "rule")]
    deliver: bool,
}

fn rule(id: &str) -> Result<Check, String> {
    Check::from_id(id).ok_or_else(|| format!("unknown rule `{id}`; `flotor validate PLUGIN` lists the rules"))
}

pub(crate) fn run(arguments: &ValidateArguments) -> Result<(), CommandError> {
    if let Some(rule) = arguments.rule {
        ignore_no_signal(); // detects a plugin that sends a signal, also in the background of a shell
        if arguments.deliver {
            let delivered = deliver(&arguments.plugin, &arguments.sets, rule, step_limit());
            return delivered.map_err(|error| CommandError::Failed(error.to_string()));
        }
        let verdict = Verdict::of(check(&arguments.plugin, &arguments.sets, rule));
        // On its own line, after any output of the plugin.
        say!(
            "\n{}",
            serde_json::to_string(&verdict).map_err(|error| CommandError::Failed(error.to_string()))?
        );
        return Ok(());
    }
    let plugin = match arguments.plugin.to_str() {
        Some(name) => arguments.options.plugin_path.registry().file(name)?,
        None => arguments.plugin.clone(),
    };
    if !plugin.is_file() {
        let what = if plugin.exists() { "is not a file" } else { "does not exist" };
        return Err(CommandError::Usage(format!(
            "`{}` {what}; `flotor plugins` lists the file of each id",
            plugin.display()
        )));
    }
    let program = std::env::current_exe()
        .map_err(|cause| CommandError::file(Path::new("flotor-lab"), "cannot find this program", cause))?;
    let one_rule = |rule: Check| {
        let mut command = Command::new(&program);
        command.arg("validate").args(["--rule", rule.id(), "--deliver"]).arg(&plugin);
        command.args(arguments.sets.iter().flat_map(|set| ["--set".to_owned(), set.to_string()]));
        command
    };
    let findings = validate(&plugin, &arguments.only, Duration::from_secs_f64(arguments.timeout), one_rule);
    let violated = findings.iter().filter(|finding| finding.violation.is_some()).count();
    if arguments.options.json.write(&findings)? {
        say!("{}", style::title(&plugin.display().to_string()));
        findings.iter().for_each(print);
        let judged = findings.iter().filter(|finding| !finding.has_nothing_to_judge());
        let unchecked: Vec<&str> = judged.filter_map(|finding| finding.unchecked.as_deref()).collect();
        if !unchecked.is_empty() {
            let reasons: BTreeSet<&str> = unchecked.iter().copied().collect();
            let reasons = reasons.into_iter().collect::<Vec<_>>().join("; ");
            say!("{} of {} rules could not be checked: {reasons}", unchecked.len(), findings.len());
        }
    }
    if violated == 0 {
        return Ok(());
    }
    let problem = format!("{}: {violated} of {} rules violated", plugin.display(), findings.len());
    Err(CommandError::PluginRefused(problem))
}

fn print(finding: &Finding) {
    let Finding { rule, text, .. } = finding;
    match &finding.violation {
        None if finding.has_nothing_to_judge() => {
            say!(
                "  -       {rule:<20} {text}\n          not judged: {}",
                finding.unchecked.as_deref().unwrap_or_default()
            );
        }
        None if finding.unchecked.is_some() => say!("  ?       {rule:<20} {text}"),
        None => say!("  ok      {rule:<20} {text}"),
        Some(seen) => say!("  FAILED  {rule:<20} {text}\n          {seen}"),
    }
    if let Some(Figures { stiffness_n_per_m, damping_ns_per_m }) = finding.figures {
        say!("          near home up to {stiffness_n_per_m:.6} N/m and {damping_ns_per_m:.6} N s/m");
    }
}
