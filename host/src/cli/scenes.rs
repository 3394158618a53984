//! `flotor scenes`: lists and prints Flotor's own scenes, which `flotor run NAME` runs.

use clap::Args;
use flotor_command::options::JsonOption;
use flotor_command::{CommandError, say, style};
use flotor_session::RunError;
use flotor_session::scene::{OWN_SCENES, OwnScene, did_you_mean};
use serde::Serialize;
use std::collections::BTreeSet;

/// List Flotor's own scenes, or print a scene as a template.
#[derive(Args)]
#[command(after_help = "Examples:\n  \
    flotor scenes\n  \
    flotor run wall\n  \
    flotor scenes wall > mine.toml      a scene to edit and run with `flotor run mine.toml`")]
pub(crate) struct ScenesArguments {
    /// Name of a scene: print its text (default: list all scenes)
    #[arg(conflicts_with = "json")]
    name: Option<String>,
    #[command(flatten)]
    json: JsonOption,
}

/// Row of the list of scenes.
#[derive(Serialize)]
struct Listed {
    name: &'static str,
    title: String,
    devices: Vec<String>,
    models: Vec<String>,
}

pub(crate) fn run(arguments: &ScenesArguments) -> Result<(), CommandError> {
    match &arguments.name {
        Some(name) => print(name),
        None => list(&arguments.json),
    }
}

fn print(name: &str) -> Result<(), CommandError> {
    let scene = OWN_SCENES.iter().find(|scene| scene.name == name).ok_or_else(|| {
        let near = did_you_mean(name, OWN_SCENES.iter().map(|scene| scene.name));
        CommandError::Usage(format!("Flotor has no scene `{name}`{near} (`flotor scenes` lists all)"))
    })?;
    say!("{}", scene.text.trim_end());
    Ok(())
}

fn list(json: &JsonOption) -> Result<(), CommandError> {
    let listed = OWN_SCENES.iter().map(Listed::of).collect::<Result<Vec<_>, _>>()?;
    if !json.write(&listed)? {
        return Ok(());
    }
    say!("{}", style::title(&format!("{:<20} {:<22} {:<10} {}", "scene", "devices", "models", "title")));
    for Listed { name, title, devices, models } in &listed {
        say!("{name:<20} {:<22} {:<10} {title}", devices.join(", "), models.join(", "));
    }
    Ok(())
}

impl Listed {
    fn of(own: &OwnScene) -> Result<Self, CommandError> {
        let scene = own.read().map_err(RunError::Scene)?;
        let devices = scene.devices.iter().map(|device| device.plugin.plugin.clone());
        let models = scene.models.iter().map(|model| model.plugin.plugin.clone());
        Ok(Self {
            name: own.name,
            devices: each_once(devices),
            models: each_once(models),
            title: scene.title,
        })
    }
}

/// Returns the names in the given order, without repetitions.
fn each_once(names: impl Iterator<Item = String>) -> Vec<String> {
    let mut seen = BTreeSet::new();
    names.filter(|name| seen.insert(name.clone())).collect()
}
