//! Telemetry server of a run: other programs on this machine (viewer, bridges, scripts) observe and change the run.
//!
//! ```text
//!  servo -> ring -> observers -> flotor_live::Publication -> socket -> clients
//!  servo <- Controls, StopSwitch, at a tick boundary <- Host <- socket <- clients
//! ```
//!
//! The crate `flotor_live` implements protocol, server and client; this module creates the host's greeting and handles the requests
//! of clients. No code of this module runs in the servo thread. Not real-time.
//!
//! A replacement for a model is loaded and created in a separate thread, then sent to the loop.

mod peer_link;

pub use flotor_live::{LinkCounts, Pairing};
pub use peer_link::{PeerLink, start_peer_link};

use crate::registry::Registry;
use crate::scene::Scene;
use crate::{ControlError, Controls, LatchGuard, NewValue, Observer, PluginReport, Session};
use flotor_core::Change;
use flotor_core::lock;
use flotor_core::trace::TickRecord;
use flotor_hal::{Demand, Embodiment};
use flotor_live::{
    Ask, Directory, EndKind, Greeting, PROTOCOL, PanelPlugin, Publication, PublishError, RefusalCause, Serve,
    process_number,
};
use flotor_record::RunDescription;
use flotor_servo::{EmergencySource, StopSwitch, THREAD_ADVICE};
use std::path::PathBuf;
use std::sync::{Arc, Mutex};

/// Publishes a prepared run in `directory`, so that clients can find, observe and change the run. Not real-time.
///
/// # Errors
/// [`PublishError`]; the session can still run, without clients.
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

/// Publishes a prepared run in `directory`, so that clients can find and observe the run; `host` handles all other requests. Not
/// real-time.
///
/// # Errors
/// [`PublishError`]; the session can still run, without clients.
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

/// Observer of a run that also passes all records and changes to the clients of the telemetry server.
pub struct ObservedRun<O> {
    /// Observer of the run, called before the clients.
    pub observer: O,
    /// Telemetry server; `None` if the server has not started.
    pub publication: Option<Publication>,
}

impl<O> ObservedRun<O> {
    /// Notifies the clients of the end of the run, described by `words`, and stops the telemetry server.
    pub fn end(self, words: &str, kind: EndKind) {
        if let Some(publication) = self.publication {
            publication.end(words, kind);
        }
    }
}

impl<O: Observer> Observer for ObservedRun<O> {
    fn observe(&mut self, record: &TickRecord) {
        self.observer.observe(record);
        if let Some(publication) = &self.publication {
            publication.observe(record);
        }
    }

    /// Returns the demand of the observer alone; the telemetry server requests the outputs for its clients.
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

/// Handler of the requests of clients.
struct Host {
    controls: Controls,
    stop: StopSwitch,
    /// Emergency-stop latch, which an emergency stop presses before the reply; `None` on the virtual clock.
    latch: Option<LatchGuard>,
    /// Plugin folders of the scene.
    folders: Vec<PathBuf>,
    /// Plugins, searched at the first replacement of a model and kept, so that an unchanged file is not mapped again.
    registry: Mutex<Option<Registry>>,
}

impl Host {
    /// Replaces a model in a separate thread: the stack of the thread that serves a client is too small for plugin code.
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
            let mut registry = lock(&self.registry);
            let registry = registry.get_or_insert_with(|| Registry::search(&self.folders));
            self.controls.swap(registry, model, plugin, &settings)
        };
        std::thread::scope(|scope| {
            let thread = std::thread::Builder::new().name("flotor-swap".to_owned());
            let making = thread.spawn_scoped(scope, make);
            let making = making.map_err(|error| {
                refused(format!("cannot start a thread to create the model: {error}; {THREAD_ADVICE}"))
            })?;
            making.join().unwrap_or_else(|_| {
                Err(refused(
                    "the plugin panicked while it created the model; check the plugin with `flotor validate`"
                        .to_owned(),
                ))
            })
        })
    }
}

/// Converts an error to the reply for the client.
fn refused(error: &ControlError) -> (RefusalCause, String) {
    let cause = match error {
        ControlError::Refused { cause, .. } => *cause,
        ControlError::Busy | ControlError::Ended => RefusalCause::Other,
        _ => RefusalCause::Request,
    };
    (cause, error.to_string())
}

/// Performs a client's emergency stop: stops this run, then presses the emergency-stop latch, if there is one, and waits up to 2 s
/// until the other runs confirm the stop. Not real-time.
///
/// # Errors
/// Cause and message if another run may continue, or a later run may start; this run stops in any case.
pub fn emergency_stop(stop: &StopSwitch, latch: Option<&LatchGuard>) -> Result<(), (RefusalCause, String)> {
    stop.press(EmergencySource::Watcher);
    let problem = latch.and_then(|latch| latch.press(EmergencySource::Watcher).problem());
    problem.map_or(Ok(()), |problem| Err((RefusalCause::Other, format!("this run stops; {problem}"))))
}

/// Stops this run for an emergency stop of another run, if this run has an emergency-stop latch (real clock).
pub fn machine_stop(stop: &StopSwitch, latch: Option<&LatchGuard>) {
    if latch.is_some() {
        stop.press(EmergencySource::Latch);
    }
}

impl Serve for Host {
    fn serve(&self, ask: Ask) -> Result<(), (RefusalCause, String)> {
        let Self { controls, stop, latch, .. } = self;
        let changed = match ask {
            Ask::Set { values } => {
                let new = values.iter().map(|new| NewValue {
                    plugin: &new.plugin,
                    parameter: &new.parameter,
                    value: &new.value,
                });
                controls.set_parameters(&new.collect::<Vec<_>>())
            }
            Ask::Weight { model, weight } => controls.set_weight(&model, weight),
            Ask::Swap { model, plugin, settings } => self.swap(&model, plugin.as_deref(), &settings),
            Ask::EmergencyStop => return emergency_stop(stop, latch.as_ref()),
            Ask::Watch { .. } | Ask::Unwatch => Ok(()), // handled by the publication
            Ask::Stop => {
                stop.stop();
                Ok(())
            }
            Ask::MachineStop => {
                machine_stop(stop, latch.as_ref());
                Ok(())
            }
        };
        changed.map_err(|error| refused(&error))
    }
}
