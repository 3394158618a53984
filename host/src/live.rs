//! The running host, for other programs on this machine to watch and change: viewer, bridges, scripts.
//!
//! ```text
//!  servo -> ring -> observers -> flotor_live::Publication -> socket -> watchers
//!  servo <- Controls, StopSwitch, at a tick boundary <- Handles <- socket <- watchers
//! ```
//!
//! What is said over the socket, and both its ends, are the crate `flotor_live`; here is what this host says of itself, and how it
//! does what it is asked for. Nothing of it runs on the servo's thread. Not real-time.

use crate::record::RunDescription;
use crate::servo::StopSwitch;
use crate::session::{Controls, NewValue, PluginReport};
use flotor_live::{
    Ask, Directory, Greeting, PROTOCOL, PanelPlugin, Publication, PublishError, Serve, WrenchLimits,
};
use std::sync::Arc;

/// What is said of a run before its first tick.
#[derive(Clone, Copy, Debug)]
pub struct Announcement<'a> {
    /// Title of the scene.
    pub title: &'a str,
    /// How the run was set up.
    pub run: &'a RunDescription,
    /// Device first, then the models in the order of the scene.
    pub plugins: &'a [PluginReport],
    /// The most that may reach the hand.
    pub limits: WrenchLimits,
}

/// What reaches a running loop from other threads.
#[derive(Clone)]
pub struct Handles {
    /// Changes parameters and weights.
    pub controls: Controls,
    /// Ends the run.
    pub stop: StopSwitch,
}

/// Lets a prepared run be found and watched.
///
/// # Errors
/// [`PublishError`]; the run goes on without.
pub fn publish(
    directory: &Directory,
    announcement: Announcement<'_>,
    handles: Handles,
) -> Result<Publication, PublishError> {
    let Announcement { title, run, plugins, limits } = announcement;
    let greeting = Greeting {
        protocol: PROTOCOL,
        flotor_version: env!("CARGO_PKG_VERSION").to_owned(),
        process: std::process::id(),
        title: title.to_owned(),
        plugins: plugins.iter().map(panel).collect(),
        limits,
    };
    Publication::open(directory, greeting, run, Arc::new(handles))
}

fn panel(report: &PluginReport) -> PanelPlugin {
    let PluginReport { name, metadata, schema, parameters, .. } = report;
    PanelPlugin::new(name, &metadata.id, metadata.path.clone(), schema, parameters)
}

impl Serve for Handles {
    fn serve(&self, ask: Ask) -> Result<(), String> {
        match ask {
            Ask::Watch { .. } | Ask::LookAway => {} // the publication's own
            Ask::Set { values } => {
                let values: Vec<NewValue<'_>> = values
                    .iter()
                    .map(|new| NewValue { plugin: &new.plugin, parameter: &new.parameter, value: &new.value })
                    .collect();
                self.controls.set_parameters(&values).map_err(|error| error.to_string())?;
            }
            Ask::Weight { model, weight } => {
                self.controls.set_weight(&model, weight).map_err(|error| error.to_string())?;
            }
            Ask::Stop => self.stop.stop(),
            Ask::EmergencyStop => self.stop.emergency_by_watcher(),
        }
        Ok(())
    }
}
