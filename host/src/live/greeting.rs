//! What a host says of itself: panels are made of it.

use crate::session::PluginReport;
use flotor_live::{ChangeMessage, Greeting, Outcome, PROTOCOL, PanelPlugin, Subject, WrenchLimits};

/// What is known before the first tick.
pub(super) fn greeting(title: &str, plugins: &[PluginReport], limits: WrenchLimits) -> Greeting {
    Greeting {
        protocol: PROTOCOL,
        flotor_version: env!("CARGO_PKG_VERSION").to_owned(),
        process: std::process::id(),
        title: title.to_owned(),
        plugins: plugins.iter().map(panel).collect(),
        limits,
    }
}

/// Keeps the values in force up to date for those who come later.
pub(super) fn keep(greeting: &mut Greeting, change: &ChangeMessage) {
    if change.outcome != Outcome::Applied || change.subject != Subject::Parameter {
        return;
    }
    let plugin = greeting.plugins.iter_mut().find(|plugin| plugin.name == change.plugin);
    let parameters = plugin.into_iter().flat_map(|plugin| &mut plugin.parameters);
    for parameter in parameters.filter(|parameter| parameter.id == change.parameter) {
        parameter.value.clone_from(&change.value);
    }
}

fn panel(report: &PluginReport) -> PanelPlugin {
    let PluginReport { name, metadata, schema, parameters, .. } = report;
    PanelPlugin::new(name, &metadata.id, metadata.path.clone(), schema, parameters)
}
