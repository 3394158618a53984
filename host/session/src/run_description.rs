//! Description of a run before its start: the first message of a recording and of a live view.

use crate::scene::{DeviceUse, ModelUse, PluginUse, Scene};
use crate::{PluginReport, RunOptions};
use flotor_core::mapping::Blend;
use flotor_hal::ParameterKind;
use flotor_record::{NamedFile, PluginDescription, Role, RunDescription};
use std::path::PathBuf;

/// Creates the description of a run before it begins. Not real-time.
///
/// `plugins` are those of the prepared scene: the devices, then the models, both in the scene's order.
#[must_use]
pub fn describe(scene: &Scene, options: &RunOptions, plugins: &[PluginReport]) -> RunDescription {
    let device = |(number, device): (u16, &DeviceUse)| {
        (device.plugin.clone(), Role::Device, number, Vec::new(), Blend::default(), None)
    };
    let model = |model: &ModelUse| {
        let role = Role::Model(model.mapping);
        (model.plugin.clone(), role, model.device, model.places_m.clone(), model.blend, model.field)
    };
    let devices = (0..).zip(&scene.devices).map(device);
    let plugins = devices.chain(scene.models.iter().map(model)).zip(plugins);
    RunDescription {
        flotor_version: env!("CARGO_PKG_VERSION").to_owned(),
        rate_hz: scene.rate_hz,
        duration_s: scene.duration_s,
        seed: options.seed,
        clock: options.clock,
        scene_toml: scene.text.clone(),
        plugins: plugins
            .map(|((used, role, device, places_m, blend, field), report)| PluginDescription {
                device,
                places_m,
                blend,
                field,
                ..describe_plugin(&used, role, report)
            })
            .collect(),
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
        blend: Blend::default(),
        field: None,
        latency_s: report.latency_s,
        at_hand: report.at_hand,
        settings: settings.collect(),
        parameters: report.parameters.iter().cloned().chain(contents_of_files(report)).collect(),
    }
}

/// Returns the parameters of a plugin that name files, each with its path; names of built-in data are left out.
pub fn named_files(report: &PluginReport) -> impl Iterator<Item = (&'static str, PathBuf)> + '_ {
    let files = report.schema.iter().filter(|parameter| parameter.kind() == ParameterKind::File);
    files.filter_map(|parameter| {
        let (_, value) = report.parameters.iter().find(|(id, _)| id == parameter.id())?;
        let is_built_in = parameter.choices().iter().any(|name| name.as_str() == value);
        (!is_built_in && !value.is_empty()).then(|| (parameter.id(), PathBuf::from(value)))
    })
}

/// Returns the contents of the files that a plugin's parameters name, as further parameters for the description. Files that cannot
/// be read any more are left out. Not real-time.
fn contents_of_files(report: &PluginReport) -> Vec<(String, String)> {
    let content = |(parameter, path): (&'static str, PathBuf)| {
        let file = NamedFile::read(&path).ok()?;
        Some(file.to_parameters(parameter))
    };
    named_files(report).filter_map(content).flatten().collect()
}
