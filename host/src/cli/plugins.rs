//! `flotor plugins`: lists the installed plugins from their files, without running any of them.

use clap::Args;
use flotor_command::options::{JsonOption, KeyValue, PluginResultOptions, settings};
use flotor_command::say;
use flotor_command::{CommandError, style, while_preparing};
use flotor_hal::abi::PluginKind;
use flotor_hal::{Input, Mutability, Output, Parameter, ParameterKind, Pose, Wrench};
use flotor_loader::{Metadata, Plugin};
use flotor_session::registry::{Findings, PATH_VARIABLE, Registry, SkippedFolder, installation_is_unknown};
use serde::Serialize;
use std::time::Instant;

/// List the installed plugins, without running any of them.
#[derive(Args)]
#[command(
    after_help = "Examples:\n  flotor plugins\n  flotor plugins spring        parameters, with units and ranges\n  \
    flotor plugins solid --set tool_radius_mm=5      also its error estimate, and its time per tick\n  \
    flotor plugins --json | python3 -m json.tool"
)]
pub(crate) struct PluginsArguments {
    /// Id of a plugin, or path to its file: show its parameters, which loads the plugin (default: list all plugins)
    id: Option<String>,
    /// Setting with which the model's error estimate and time per tick are measured (repeatable)
    #[arg(long = "set", value_name = "KEY=VALUE", requires = "id", conflicts_with = "json")]
    sets: Vec<KeyValue>,
    #[command(flatten)]
    options: PluginResultOptions,
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
    let registry = arguments.options.plugin_path.registry();
    match &arguments.id {
        Some(id) => describe(&registry, id, &arguments.sets, &arguments.options.json),
        None => list(&registry, &arguments.options.json),
    }
}

fn list(registry: &Registry, json: &JsonOption) -> Result<(), CommandError> {
    let listed = registry.found().iter().map(|plugin| Listed {
        id: &plugin.id,
        kind: plugin.kind.name(),
        name: &plugin.name,
        doc: &plugin.doc,
        version: &plugin.version,
        abi: &plugin.abi,
        file: plugin.path.display().to_string(),
    });
    let listed: Vec<_> = listed.collect();
    if !json.write(&listed)? {
        return Ok(());
    }
    for kind in [PluginKind::Device, PluginKind::Model] {
        say!("{}", style::title(&format!("{}s", kind.name())));
        for plugin in listed.iter().filter(|plugin| plugin.kind == kind.name()) {
            say!("  {:<12} {:<8} {}", plugin.id, plugin.version, plugin.doc);
            say!("  {:<12} {:<8} {}", "", "", plugin.file);
        }
    }
    let note = style::warning("note:");
    let Findings { shadowed, ambiguous, broken, skipped, .. } = registry.findings();
    for Metadata { path, id, .. } in shadowed {
        say!("{note} {}: not used, because a plugin listed above has the same id `{id}`", path.display());
    }
    for (one, other) in ambiguous {
        let (one, other, id) = (one.path.display(), other.path.display(), &one.id);
        say!(
            "{note} {one} and {other} have the same id `{id}`: a scene that names it is refused; remove one of them"
        );
    }
    for broken in broken {
        say!("{note} {broken}");
    }
    for SkippedFolder { folder, reason } in skipped {
        say!("{note} {}: not searched: {reason}", folder.display());
    }
    if listed.is_empty() {
        let folders: Vec<String> =
            registry.folders().iter().map(|folder| folder.display().to_string()).collect();
        let place = if folders.is_empty() { String::new() } else { format!(" in {}", folders.join(", ")) };
        say!("no plugins found{place}; add folders with --plugin-path or {PATH_VARIABLE}");
    }
    if let Some(cause) = installation_is_unknown() {
        say!("{note} {cause}");
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

fn describe(registry: &Registry, id: &str, sets: &[KeyValue], json: &JsonOption) -> Result<(), CommandError> {
    let plugin = registry.load_any(id)?;
    let parameters: Vec<Described<'_>> = plugin.parameters().iter().map(described).collect();
    if !json.write(&parameters)? {
        return Ok(());
    }
    print_description(&plugin, &parameters);
    if plugin.metadata().kind == PluginKind::Model {
        print_certificate(&plugin, sets)?;
    } else if !sets.is_empty() {
        return Err(CommandError::Usage(format!(
            "--set: `{id}` is a device, and only models have an error estimate; omit --set"
        )));
    }
    Ok(())
}

/// Number of steps at home for the median time.
const TIMED_TICKS: usize = 1000;

/// Creates a model with some settings, and prints its error estimates and the time of a step, if the model has estimates or settings
/// are given.
fn print_certificate(plugin: &Plugin, sets: &[KeyValue]) -> Result<(), CommandError> {
    let settings = settings(plugin, "--set", sets)?;
    let started = Instant::now();
    let id = &plugin.metadata().id;
    let mut model = match while_preparing(id, || plugin.create_model(&settings)) {
        Ok(model) => model,
        Err(_) if sets.is_empty() => return Ok(()), // requires settings
        Err(error) => return Err(error.into()),
    };
    let ready_s = started.elapsed().as_secs_f64();
    let estimates = model.estimates();
    if estimates.is_empty() && sets.is_empty() {
        return Ok(());
    }
    let home = Input::at_rest(Pose::HOME);
    let mut output = Output::from(Wrench::ZERO);
    let time_ns = || {
        let started = Instant::now();
        let _ = model.step(&home, &mut output);
        started.elapsed().as_nanos()
    };
    let mut times_ns: Vec<u128> = std::iter::repeat_with(time_ns).take(TIMED_TICKS).collect();
    times_ns.sort_unstable();
    let with = if sets.is_empty() { "defaults" } else { "these settings" };
    say!("with {with}: ready in {ready_s:.2} s, a tick at home {} ns (median)", times_ns[TIMED_TICKS / 2]);
    for (detail, value) in estimates {
        say!("  {:<28} {value:.1e}", detail.id());
        say!("  {:<28} {}", "", detail.doc());
    }
    Ok(())
}

fn described(parameter: &Parameter) -> Described<'_> {
    let choices: Vec<&str> = parameter.choices().iter().map(flotor_hal::abi::Str::as_str).collect();
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // an index of a few choices
    let choice = |index: f64| choices.get(index as usize).copied().unwrap_or_default().to_owned();
    let (kind, default) = match parameter.kind() {
        ParameterKind::Real => ("real", parameter.default().to_string()),
        ParameterKind::Choice => ("choice", choice(parameter.default())),
        ParameterKind::Text => ("text", String::new()),
        ParameterKind::File => ("file", String::new()),
    };
    Described {
        id: parameter.id(),
        kind,
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
