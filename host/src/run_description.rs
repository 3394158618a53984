//! What a prepared scene says about itself before it runs: the first message of a recording and of a live view.

use crate::mapping::Blend;
use crate::record::{PluginDescription, Role, RunDescription};
use crate::scene::{PluginUse, Scene};
use crate::session::{PluginReport, RunOptions};

/// Puts together what is known of a run before it begins. Not real-time.
///
/// `plugins` are those of the prepared scene: the device, then the models in the scene's order.
#[must_use]
pub fn describe(scene: &Scene, options: &RunOptions, plugins: &[PluginReport]) -> RunDescription {
    let device = std::iter::once((&scene.device, Role::Device, &[][..], Blend::default()));
    let models = scene.models.iter();
    let models = models
        .map(|model| (&model.plugin, Role::Model(model.mapping), model.places_m.as_slice(), model.blend));
    let plugins = device.chain(models).zip(plugins);
    RunDescription {
        flotor_version: env!("CARGO_PKG_VERSION").to_owned(),
        rate_hz: scene.rate_hz,
        duration_s: scene.duration_s,
        seed: options.seed,
        clock: options.clock,
        scene_toml: scene.text.clone(),
        plugins: plugins
            .map(|((used, role, places_m, blend), report)| PluginDescription {
                places_m: places_m.to_vec(),
                blend,
                ..describe_plugin(used, role, report)
            })
            .collect(),
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
        places_m: Vec::new(),
        blend: Blend::default(),
        settings: settings.collect(),
        parameters: report.parameters.clone(),
    }
}
