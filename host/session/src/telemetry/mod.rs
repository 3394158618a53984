//! The running host, for other programs on this machine to watch and change: viewer, bridges, scripts.
//!
//! ```text
//!  servo -> ring -> observers -> flotor_live::Publication -> socket -> watchers
//!  servo <- Controls, StopSwitch, at a tick boundary <- Host <- socket <- watchers
//! ```
//!
//! What is said over the socket, and both its ends, are the crate `flotor_live`; here is what this host says of itself, and how it
//! does what it is asked for. Nothing of it runs on the servo's thread. Not real-time.
//!
//! A model that somebody wants in place of another is loaded and made here, on a thread of its own, and goes to the loop when
//! it is ready.

mod pairing;
mod peer_link;

pub use pairing::{LinkCounts, Pairing};
pub use peer_link::{PeerLink, start_peer_link};

use crate::registry::Registry;
use crate::scene::Scene;
use crate::{ControlError, Controls, LatchGuard, NewValue, Observer, PluginReport, Session};
use flotor_core::Change;
use flotor_core::trace::TickRecord;
use flotor_hal::{Demand, Embodiment};
use flotor_live::{
    Ask, Directory, EndKind, Greeting, PROTOCOL, PanelPlugin, Publication, PublishError, RefusalCause, Serve,
    process_number,
};
use flotor_record::RunDescription;
use flotor_servo::{EmergencySource, StopSwitch};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

/// Lets a prepared run be found, watched and changed.
///
/// # Errors
/// [`PublishError`]; the run goes on without.
pub fn publish(
    directory: &Directory,
    scene: &Scene,
    run: &RunDescription,
    session: &Session,
    stop: &StopSwitch,
) -> Result<Publication, PublishError> {
    let folders = scene.plugin_folders.clone();
    let (controls, stop, latch) = (session.controls(), stop.clone(), session.latch().cloned());
    let host = Host { controls, stop, latch, folders, registry: Mutex::new(None) };
    announce(directory, scene, run, session, Arc::new(host))
}

/// Lets a prepared run be found and watched; what else may be asked of it is up to `host`.
///
/// # Errors
/// [`PublishError`]; the run goes on without.
pub fn announce(
    directory: &Directory,
    scene: &Scene,
    run: &RunDescription,
    session: &Session,
    host: Arc<dyn Serve>,
) -> Result<Publication, PublishError> {
    let greeting = Greeting {
        protocol: PROTOCOL,
        flotor_version: env!("CARGO_PKG_VERSION").to_owned(),
        process: process_number(),
        title: if scene.title.is_empty() { "untitled".to_owned() } else { scene.title.clone() },
        plugins: session.plugins().iter().map(panel).collect(),
        limits: session.limits(),
    };
    Publication::open(directory, greeting, run, host, session.observers())
}

fn panel(report: &PluginReport) -> PanelPlugin {
    let PluginReport { name, metadata, schema, parameters, soft_ranges, embodiment, .. } = report;
    let panel = PanelPlugin::new(name, &metadata.id, metadata.path.clone(), schema, parameters, soft_ranges);
    PanelPlugin { is_simulated: *embodiment == Some(Embodiment::Simulated), ..panel }
}

/// An observer, and the clients of the telemetry server.
pub struct Watched<O> {
    /// The one that is always there.
    pub observer: O,
    /// The others, if the telemetry server has started.
    pub publication: Option<Publication>,
}

impl<O> Watched<O> {
    /// Notifies the clients of the end of the run.
    pub fn end(self, words: &str, kind: EndKind) {
        if let Some(publication) = self.publication {
            publication.end(words, kind);
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

    /// That of the observer: each client asks for itself.
    fn demand(&self) -> Demand {
        self.observer.demand()
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
    controls: Controls,
    stop: StopSwitch,
    /// Pressed by an emergency stop before that is answered.
    latch: Option<LatchGuard>,
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
        let cause = RefusalCause::Other;
        let refused = |problem: String| ControlError::Refused { model: model.to_owned(), problem, cause };
        let settings: Vec<(&str, &str)> = settings.iter().map(|(k, v)| (k.as_str(), v.as_str())).collect();
        let make = || {
            let mut registry = self.registry.lock().unwrap_or_else(PoisonError::into_inner);
            let registry = registry.get_or_insert_with(|| Registry::search(&self.folders));
            self.controls.swap(registry, model, plugin, &settings)
        };
        std::thread::scope(|scope| {
            let thread = std::thread::Builder::new().name("flotor-swap".to_owned());
            let making = thread.spawn_scoped(scope, make);
            let making = making
                .map_err(|error| refused(format!("cannot start a thread to create the model: {error}")))?;
            making.join().unwrap_or_else(|_| Err(refused("making it panicked".to_owned())))
        })
    }
}

/// Why it was not done, for whoever asked.
fn refused(error: &ControlError) -> (RefusalCause, String) {
    let cause = match error {
        ControlError::Refused { cause, .. } => *cause,
        ControlError::Busy | ControlError::Ended => RefusalCause::Other,
        _ => RefusalCause::Request,
    };
    (cause, error.to_string())
}

/// The emergency stop of a client: of this run, and of the machine before the client is answered.
///
/// # Errors
/// Only this run stops.
pub fn emergency_stop(stop: &StopSwitch, latch: Option<&LatchGuard>) -> Result<(), (RefusalCause, String)> {
    stop.press(EmergencySource::Watcher);
    let problem = latch.and_then(|latch| latch.press(EmergencySource::Watcher).problem());
    problem.map_or(Ok(()), |problem| Err((RefusalCause::Other, format!("this run stops; {problem}"))))
}

/// The emergency stop of another run of the machine, for a run that has its latch.
pub fn machine_stop(stop: &StopSwitch, latch: Option<&LatchGuard>) {
    if latch.is_some() {
        stop.press(EmergencySource::Latch);
    }
}

impl Serve for Host {
    fn serve(&self, ask: Ask) -> Result<(), (RefusalCause, String)> {
        let Self { controls, stop, latch, .. } = self;
        match ask {
            Ask::Watch { .. } | Ask::LookAway => {} // the publication's own
            Ask::Set { values } => {
                let values: Vec<NewValue<'_>> = values
                    .iter()
                    .map(|new| NewValue { plugin: &new.plugin, parameter: &new.parameter, value: &new.value })
                    .collect();
                controls.set_parameters(&values).map_err(|error| refused(&error))?;
            }
            Ask::Weight { model, weight } => {
                controls.set_weight(&model, weight).map_err(|error| refused(&error))?;
            }
            Ask::Swap { model, plugin, settings } => {
                let swapped = self.swap(&model, plugin.as_deref(), &settings);
                swapped.map_err(|error| refused(&error))?;
            }
            Ask::Stop => stop.stop(),
            Ask::EmergencyStop => return emergency_stop(stop, latch.as_ref()),
            Ask::MachineStop => machine_stop(stop, latch.as_ref()),
        }
        Ok(())
    }
}
