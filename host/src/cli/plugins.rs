//! `flotor plugins`: the installed plugins, read from their files without running any of them.

use clap::Args;
use flotor_command::say;
use flotor_command::{CommandError, style, write_json};
use flotor_hal::abi::PluginKind;
use flotor_hal::abi::loader::{Metadata, Plugin};
use flotor_hal::{Mutability, Parameter, ParameterKind};
use flotor_session::registry::{PATH_VARIABLE, Registry, SkippedFolder};
use serde::Serialize;
use std::path::Path;

/// List the installed plugins, without running any of them.
#[derive(Args)]
#[command(
    after_help = "Examples:\n  flotor plugins\n  flotor plugins spring        its parameters, with units and ranges\n  \
    flotor plugins --json | python3 -m json.tool"
)]
pub(crate) struct PluginsArguments {
    /// Id of a plugin: show its parameters (this loads the plugin)
    id: Option<String>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Listed<'a> {
    id: &'a str,
    kind: &'static str,
    name: &'a str,
    doc: &'a str,
    version: &'a str,
    abi: &'a str,
    file: String,
}

pub(crate) fn run(arguments: &PluginsArguments) -> Result<(), CommandError> {
    let registry = Registry::search(&[]);
    match &arguments.id {
        Some(id) => describe(&registry, id, arguments.json),
        None => list(&registry, arguments.json),
    }
}

fn list(registry: &Registry, json: bool) -> Result<(), CommandError> {
    let listed: Vec<Listed<'_>> = registry
        .found()
        .iter()
        .map(|plugin| Listed {
            id: &plugin.id,
            kind: plugin.kind.word(),
            name: &plugin.name,
            doc: &plugin.doc,
            version: &plugin.version,
            abi: &plugin.abi,
            file: plugin.path.display().to_string(),
        })
        .collect();
    if json {
        return write_json(Path::new("-"), &listed);
    }
    for kind in [PluginKind::Device, PluginKind::Model] {
        say!("{}", style::title(&format!("{}s", kind.word())));
        for plugin in listed.iter().filter(|plugin| plugin.kind == kind.word()) {
            say!("  {:<12} {:<8} {}", plugin.id, plugin.version, plugin.doc);
            say!("  {:<12} {:<8} {}", "", "", plugin.file);
        }
    }
    let note = style::warning("note:");
    for Metadata { path, id, .. } in registry.shadowed() {
        say!("{note} {}: not used, because a plugin listed above has the same id `{id}`", path.display());
    }
    for (one, other) in registry.ambiguous() {
        let (one, other, id) = (one.path.display(), other.path.display(), &one.id);
        say!(
            "{note} {one} and {other} have the same id `{id}`: a scene that names it is refused; remove one of them"
        );
    }
    for broken in registry.broken() {
        say!("{note} {broken}");
    }
    for SkippedFolder { folder, reason } in registry.skipped() {
        say!("{note} {}: not searched: {reason}", folder.display());
    }
    if listed.is_empty() {
        let folders: Vec<String> =
            registry.folders().iter().map(|folder| folder.display().to_string()).collect();
        say!("no plugins found in {}; add folders with {PATH_VARIABLE}", folders.join(", "));
    }
    Ok(())
}

#[derive(Serialize)]
struct Described<'a> {
    id: &'a str,
    kind: &'static str,
    unit: &'a str,
    min: f64,
    max: f64,
    default: String,
    choices: Vec<&'a str>,
    live: bool,
    doc: &'a str,
}

fn describe(registry: &Registry, id: &str, json: bool) -> Result<(), CommandError> {
    let plugin = registry.load_any(id)?;
    let parameters: Vec<Described<'_>> = plugin.parameters().iter().map(described).collect();
    if json {
        return write_json(Path::new("-"), &parameters);
    }
    print_description(&plugin, &parameters);
    Ok(())
}

fn described(parameter: &Parameter) -> Described<'_> {
    let choices: Vec<&str> = parameter.choices().iter().map(flotor_hal::abi::Str::as_str).collect();
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // an index of a few choices
    let default = match parameter.kind() {
        ParameterKind::Real => parameter.default().to_string(),
        ParameterKind::Choice => {
            choices.get(parameter.default() as usize).copied().unwrap_or_default().to_owned()
        }
        ParameterKind::Text | ParameterKind::File => String::new(),
    };
    Described {
        id: parameter.id(),
        kind: match parameter.kind() {
            ParameterKind::Real => "real",
            ParameterKind::Choice => "choice",
            ParameterKind::Text => "text",
            ParameterKind::File => "file",
        },
        unit: parameter.unit(),
        min: parameter.min(),
        max: parameter.max(),
        default,
        choices,
        live: parameter.mutability() == Mutability::Live,
        doc: parameter.doc(),
    }
}

fn print_description(plugin: &Plugin, parameters: &[Described<'_>]) {
    let metadata = plugin.metadata();
    say!("{} {} - {}", style::title(&metadata.id), metadata.version, metadata.doc);
    say!("{}, contract {}, layouts {}", metadata.path.display(), metadata.abi, {
        if plugin.layouts_proven() { "compared and proven" } else { "compared" }
    });
    for parameter in parameters {
        let range = match parameter.kind {
            "choice" => parameter.choices.join(" | "),
            "text" => "text".to_owned(),
            "file" if parameter.choices.is_empty() => "a file".to_owned(),
            "file" => format!("a file, or {}", parameter.choices.join(" | ")),
            _ if parameter.unit == "1" => format!("{} to {}", parameter.min, parameter.max),
            _ => format!("{} to {} {}", parameter.min, parameter.max, parameter.unit),
        };
        let live = if parameter.live { ", live" } else { "" };
        let default = if parameter.default.is_empty() { "none" } else { &parameter.default };
        say!("  {:<28} {range} (default {default}{live})", parameter.id);
        say!("  {:<28} {}", "", parameter.doc);
    }
}
