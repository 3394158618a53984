//! Reference of all commands with their arguments and options, generated from the parser, for the book.

use clap::builder::ValueRange;
use clap::{Arg, Command};
use std::fmt::Write;

/// Returns the parser `program` completed with the arguments of the commands that separate programs execute, from the parsers
/// `separate` of these programs. The one-line descriptions are taken from `program`. Not real-time.
#[must_use]
pub fn whole_program(program: Command, separate: &[Command]) -> Command {
    let described = |command: Command| match separate
        .iter()
        .find_map(|other| other.find_subcommand(command.get_name()))
    {
        Some(described) => described.clone().about(command.get_about().cloned().unwrap_or_default()),
        None => command,
    };
    let mut program = without_help_command(program.mut_subcommands(described));
    program.build();
    program
}

/// Removes the command `help`, which would repeat every other command, on all levels.
fn without_help_command(command: Command) -> Command {
    command.disable_help_subcommand(true).mut_subcommands(without_help_command)
}

/// Returns a Markdown text with a chapter for each command that the help of a program lists. Not real-time.
#[must_use]
pub fn reference(program: &Command) -> String {
    let mut text = String::new();
    offered(program).for_each(|command| chapter(command, "flotor", 2, &mut text));
    text
}

fn offered(command: &Command) -> impl Iterator<Item = &Command> {
    command.get_subcommands().filter(|command| !command.is_hide_set())
}

/// Appends the chapter of a command, and below it the chapters of its subcommands.
fn chapter(command: &Command, above: &str, depth: usize, text: &mut String) {
    let name = format!("{above} {}", command.get_name());
    let about = command.get_long_about().or(command.get_about()).map(ToString::to_string).unwrap_or_default();
    // Writing to a string cannot fail.
    let _ = write!(text, "{} `{name}`\n\n{}.\n\n", "#".repeat(depth), about.trim_end_matches('.'));
    // Every command has `--help` and `--version`.
    let is_own = |argument: &&Arg| !["help", "version"].contains(&argument.get_id().as_str());
    let arguments: Vec<&Arg> =
        command.get_arguments().filter(|argument| !argument.is_hide_set()).filter(is_own).collect();
    if !arguments.is_empty() {
        text.push_str("| Argument | Default | |\n|---|---|---|\n");
        for argument in arguments {
            let _ = writeln!(text, "| `{}` | {} | {} |", usage(argument), default(argument), help(argument));
        }
        text.push('\n');
    }
    if let Some(examples) = command.get_after_help() {
        let _ = write!(text, "```text\n{}\n```\n\n", examples.to_string().trim_end());
    }
    offered(command).for_each(|command| chapter(command, &name, depth + 1, text));
}

fn usage(argument: &Arg) -> String {
    let names: Vec<&str> =
        argument.get_value_names().unwrap_or_default().iter().map(clap::builder::Str::as_str).collect();
    let values = names.join(" ");
    let is_optional = |values: ValueRange| values.min_values() == 0 && values.takes_values();
    match argument.get_long() {
        None => cell(&values),
        Some(long) if argument.get_num_args().is_some_and(is_optional) => {
            cell(&format!("--{long} [{values}]"))
        }
        Some(long) if argument.get_action().takes_values() => cell(&format!("--{long} {values}")),
        Some(long) => format!("--{long}"),
    }
}

fn default(argument: &Arg) -> String {
    if !argument.get_action().takes_values() {
        return String::new();
    }
    let values = argument.get_default_values().iter().map(|value| format!("`{}`", value.to_string_lossy()));
    values.collect::<Vec<_>>().join(" ")
}

fn help(argument: &Arg) -> String {
    let help = argument.get_help().map(ToString::to_string).unwrap_or_default();
    let values = argument.get_possible_values().into_iter().filter(|_| argument.get_action().takes_values());
    let words: Vec<String> = values.map(|value| format!("`{}`", value.get_name())).collect();
    let help = cell(&help);
    if words.is_empty() { help } else { format!("{help}: {}", words.join(", ")) }
}

/// Escapes a text for a cell of a Markdown table.
fn cell(text: &str) -> String {
    text.replace('|', "\\|").split_whitespace().collect::<Vec<_>>().join(" ")
}
