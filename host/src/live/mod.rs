//! The running host, for other programs on this machine to watch and change: viewer, bridges, scripts.
//!
//! ```text
//!  servo -> ring -> observers -> flotor_live::Publication -> socket -> watchers
//!  servo <- Controls, StopSwitch, at a tick boundary <- Handles <- socket <- watchers
//! ```
//!
//! What is said over the socket, and both its ends, are the crate `flotor_live`; here is what this host says of itself, and how it
//! does what it is asked for. Nothing of it runs on the servo's thread. Not real-time.

mod carrier;

pub use carrier::{Carried, Carrier, carry};

use crate::record::{Change, RunDescription};
use crate::servo::StopSwitch;
use crate::session::{Controls, NewValue, Observer, PluginReport};
use crate::trace::TickRecord;
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

/// Lets a prepared run be found, watched and changed.
///
/// # Errors
/// [`PublishError`]; the run goes on without.
pub fn publish(
    directory: &Directory,
    announcement: Announcement<'_>,
    handles: Handles,
) -> Result<Publication, PublishError> {
    announce(directory, announcement, Arc::new(handles))
}

/// Lets a prepared run be found and watched; what else may be asked of it is up to `host`.
///
/// # Errors
/// [`PublishError`]; the run goes on without.
pub fn announce(
    directory: &Directory,
    announcement: Announcement<'_>,
    host: Arc<dyn Serve>,
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
    Publication::open(directory, greeting, run, host)
}

fn panel(report: &PluginReport) -> PanelPlugin {
    let PluginReport { name, metadata, schema, parameters, .. } = report;
    PanelPlugin::new(name, &metadata.id, metadata.path.clone(), schema, parameters)
}

/// An observer, and beside it whoever watches.
pub struct Watched<O> {
    /// The one that is always there.
    pub observer: O,
    /// The others, unless nobody can watch.
    pub publication: Option<Publication>,
}

impl<O> Watched<O> {
    /// Tells those who watch that the run is over.
    pub fn end(self, words: &str) {
        if let Some(publication) = self.publication {
            publication.end(words);
        }
    }
}

impl<O: Observer> Observer for Watched<O> {
    fn observe(&mut self, record: &TickRecord) {
        self.observer.observe(record);
        if let Some(publication) = &self.publication {
            publication.observe(record);
        }
    }

    fn change(&mut self, change: &Change) {
        self.observer.change(change);
        if let Some(publication) = &self.publication {
            publication.change(change);
        }
    }
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
