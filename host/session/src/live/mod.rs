//! The running host, for other programs on this machine to watch and change: viewer, bridges, scripts.
//!
//! ```text
//!  servo -> ring -> observers -> flotor_live::Publication -> socket -> watchers
//!  servo <- Controls, StopSwitch, at a tick boundary <- Handles <- socket <- watchers
//! ```
//!
//! What is said over the socket, and both its ends, are the crate `flotor_live`; here is what this host says of itself, and how it
//! does what it is asked for. Nothing of it runs on the servo's thread. Not real-time.
//!
//! A model that somebody wants in place of another is loaded and made here, on a thread of its own, and goes to the loop when
//! it is ready.

mod carrier;

pub use carrier::{Carried, Carrier, carry};

use crate::registry::Registry;
use crate::scene::Scene;
use crate::{ControlError, Controls, NewValue, Observer, PluginReport};
use flotor_core::Change;
use flotor_core::trace::TickRecord;
use flotor_live::{
    Ask, Directory, Greeting, PROTOCOL, PanelPlugin, Publication, PublishError, Serve, WrenchLimits,
};
use flotor_record::RunDescription;
use flotor_servo::StopSwitch;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

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
    /// Changes parameters and weights, replaces models.
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
    let folders = plugin_folders(&handles.controls, announcement.run);
    announce(directory, announcement, Arc::new(Host { handles, folders, registry: Mutex::new(None) }))
}

/// The folders in which a run's scene has plugins looked for, as they were when it began.
fn plugin_folders(controls: &Controls, run: &RunDescription) -> Vec<PathBuf> {
    let file = controls.scene_file().unwrap_or(Path::new(""));
    let base = file.parent().unwrap_or(Path::new(""));
    // It has been read before.
    let folders = Scene::parse(file, &run.scene_toml).map(|scene| scene.plugin_folders).unwrap_or_default();
    folders.into_iter().map(|folder| base.join(folder)).collect()
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

/// What does as a watcher asks.
struct Host {
    handles: Handles,
    /// Where the scene has plugins looked for.
    folders: Vec<PathBuf>,
    /// Searched when the first model is replaced; kept, so that a file that has not changed is not mapped once more.
    registry: Mutex<Option<Registry>>,
}

impl Host {
    /// On a thread of its own: the one that serves a watcher has too small a stack for plugins.
    fn swap(
        &self,
        model: &str,
        plugin: Option<&str>,
        settings: &[(String, String)],
    ) -> Result<(), ControlError> {
        let refused = |problem: String| ControlError::Refused { model: model.to_owned(), problem };
        let settings: Vec<(&str, &str)> = settings.iter().map(|(k, v)| (k.as_str(), v.as_str())).collect();
        let make = || {
            let mut registry = self.registry.lock().unwrap_or_else(PoisonError::into_inner);
            let registry = registry.get_or_insert_with(|| Registry::search(&self.folders));
            self.handles.controls.swap(registry, model, plugin, &settings)
        };
        std::thread::scope(|scope| {
            let thread = std::thread::Builder::new().name("flotor-swap".to_owned());
            let making = thread.spawn_scoped(scope, make);
            let making =
                making.map_err(|error| refused(format!("there is no thread to make it: {error}")))?;
            making.join().unwrap_or_else(|_| Err(refused("making it panicked".to_owned())))
        })
    }
}

/// Why a model was not replaced, for whoever asked.
fn swap_words(model: &str, error: &ControlError) -> String {
    match error {
        ControlError::Busy => {
            format!("[{model}] what came in last is still fading; try again after a moment")
        }
        other => other.to_string(),
    }
}

impl Serve for Host {
    fn serve(&self, ask: Ask) -> Result<(), String> {
        let Handles { controls, stop } = &self.handles;
        match ask {
            Ask::Watch { .. } | Ask::LookAway => {} // the publication's own
            Ask::Set { values } => {
                let values: Vec<NewValue<'_>> = values
                    .iter()
                    .map(|new| NewValue { plugin: &new.plugin, parameter: &new.parameter, value: &new.value })
                    .collect();
                controls.set_parameters(&values).map_err(|error| error.to_string())?;
            }
            Ask::Weight { model, weight } => {
                controls.set_weight(&model, weight).map_err(|error| error.to_string())?;
            }
            Ask::Swap { model, plugin, settings } => {
                let swapped = self.swap(&model, plugin.as_deref(), &settings);
                swapped.map_err(|error| swap_words(&model, &error))?;
            }
            Ask::Stop => stop.stop(),
            Ask::EmergencyStop => stop.emergency_by_watcher(),
        }
        Ok(())
    }
}
