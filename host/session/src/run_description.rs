//! Description of a run before its start: the first message of a recording and of a live view.

use crate::scene::{PluginUse, Scene};
use crate::{PluginReport, RunOptions};
use flotor_core::mapping::Blend;
use flotor_hal::ParameterKind;
use flotor_record::{NamedFile, PluginDescription, Role, RunDescription};
use std::path::PathBuf;

/// Creates the description of a run before its start. Not real-time.
///
/// `plugins` are the plugins of the prepared session ([`crate::Session::plugins`]): devices, then models, both in the scene's order.
#[must_use]
pub fn describe(scene: &Scene, options: &RunOptions, plugins: &[PluginReport]) -> RunDescription {
    let devices = (0..).zip(&scene.devices).zip(plugins).map(|((device, used), report)| PluginDescription {
        device,
        ..describe_plugin(&used.plugin, Role::Device, report)
    });
    let models = scene.models.iter().zip(plugins.iter().skip(scene.devices.len()));
    let models = models.map(|(used, report)| PluginDescription {
        device: used.device,
        places_m: used.places_m.clone(),
        shared_with: used.shared_with.clone(),
        blend: used.blend,
        ..describe_plugin(&used.plugin, Role::Model(used.mapping), report)
    });
    RunDescription {
        flotor_version: env!("CARGO_PKG_VERSION").to_owned(),
        rate_hz: scene.rate_hz,
        duration_s: scene.duration_s,
        seed: options.seed,
        clock: options.clock,
        scene_toml: scene.text.clone(),
        plugins: devices.chain(models).collect(),
        couplings: scene.couplings.clone(),
    }
}

fn describe_plugin(used: &PluginUse, role: Role, report: &PluginReport) -> PluginDescription {
    let file = report.metadata.path.file_name().unwrap_or_default();
    let settings = used.parameters.iter().map(|parameter| (parameter.key.clone(), parameter.value.clone()));
    PluginDescription {
        name: report.name.clone(),
        id: report.metadata.id.clone(),
        version: report.metadata.version.clone(),
        file: file.to_string_lossy().into_owned(),
        role,
        device: 0,
        places_m: Vec::new(),
        shared_with: Vec::new(),
        blend: Blend::default(),
        field: report.field,
        latency_s: report.latency_s,
        at_hand: report.at_hand,
        settings: settings.collect(),
        parameters: report.parameters.iter().cloned().chain(contents_of_files(report)).collect(),
    }
}

/// Returns id and path of each parameter of a plugin that names a file; parameters that are empty or name built-in data are left out.
pub fn named_files(report: &PluginReport) -> impl Iterator<Item = (&'static str, PathBuf)> + '_ {
    let files = report.schema.iter().filter(|parameter| parameter.kind() == ParameterKind::File);
    files.filter_map(|parameter| {
        let (_, value) = report.parameters.iter().find(|(id, _)| id == parameter.id())?;
        let is_built_in = parameter.choices().iter().any(|name| name.as_str() == value);
        (!is_built_in && !value.is_empty()).then(|| (parameter.id(), PathBuf::from(value)))
    })
}

/// Returns the contents of the files that a plugin's parameters name, as further parameters for the description. Files that cannot be
/// read are left out. Not real-time.
fn contents_of_files(report: &PluginReport) -> Vec<(String, String)> {
    let content =
        |(parameter, path): (_, PathBuf)| Some(NamedFile::read(&path).ok()?.to_parameters(parameter));
    named_files(report).filter_map(content).flatten().collect()
}
