//! Runs of a scene through the library, with a record of every tick.

use crate::library::build_folder;
use flotor_core::Change;
use flotor_core::trace::TickRecord;
use flotor_hal::Demand;
use flotor_live::Directory;
use flotor_servo::{Clock, StopSwitch};
use flotor_session::registry::Registry;
use flotor_session::scene::Scene;
use flotor_session::{Observer, Outcome, RunOptions, Session, Strength};
use std::path::Path;

/// Ticks, parameter changes and outcome of a run.
pub struct Watched {
    /// Record of each tick, in order.
    pub records: Vec<TickRecord>,
    /// Every change of a parameter, with the number of ticks recorded before it.
    pub changes: Vec<(usize, Change)>,
    /// Outcome of the run.
    pub outcome: Outcome,
}

/// Observer that stores all ticks and changes.
#[derive(Default)]
struct Keep {
    records: Vec<TickRecord>,
    changes: Vec<(usize, Change)>,
}

impl Observer for Keep {
    fn observe(&mut self, record: &TickRecord) {
        self.records.push(*record);
    }

    /// Requests all outputs of the models.
    fn demand(&self) -> Demand {
        Demand::ALL
    }

    fn change(&mut self, change: &Change) {
        self.changes.push((self.records.len(), change.clone()));
    }
}

/// Prepares a session from the text of a scene, with the plugins built with the tests and seed 1.
///
/// # Panics
/// If the scene is invalid or a plugin is refused.
pub fn prepared(clock: Clock, scene: &str) -> Session {
    prepared_with(&Registry::search(&[build_folder().join("deps")]), clock, scene)
}

/// Prepares a session as [`prepared`], with the plugins of `registry`, which loads each plugin only once.
fn prepared_with(registry: &Registry, clock: Clock, scene: &str) -> Session {
    seeded(registry, RunOptions { clock, seed: 1 }, scene)
}

fn seeded(registry: &Registry, options: RunOptions, scene: &str) -> Session {
    let scene = Scene::parse(Path::new("scene.toml"), scene).expect("the scene is right");
    let session = Session::prepare(&scene, registry, &options);
    let session = session.unwrap_or_else(|error| panic!("it does not start: {error}"));
    // Without a folder for the latch, an emergency stop of a test concerns its own run only.
    session.latched_in(&Directory::at("/dev/null/no-folder"))
}

/// Runs the text of a scene on the virtual clock, prepared as by [`prepared`].
///
/// # Panics
/// As [`prepared`], or if the run cannot start.
#[must_use]
pub fn watch(scene: &str) -> Watched {
    watch_on(Clock::Virtual, scene)
}

/// Runs the text of a scene on the virtual clock as [`watch`], without the host's force ceiling.
///
/// # Panics
/// As [`watch`].
#[must_use]
pub fn watch_strong(scene: &str) -> Watched {
    keep(prepared(Clock::Virtual, scene).with_strength(Strength::Strong))
}

/// Runs the text of a scene on the virtual clock as [`watch`], with the seed `seed`, and without the plugins built with the tests.
///
/// # Panics
/// As [`watch`].
#[must_use]
pub fn watch_seed(scene: &str, seed: u64) -> Watched {
    keep(seeded(&Registry::search(&[]), RunOptions { clock: Clock::Virtual, seed }, scene))
}

/// Runs the text of a scene on a clock, prepared as by [`prepared`].
///
/// # Panics
/// As [`watch`].
#[must_use]
pub fn watch_on(clock: Clock, scene: &str) -> Watched {
    keep(prepared(clock, scene))
}

/// Runs the text of one of many scenes on the virtual clock; `registry` loads each plugin once for all scenes.
///
/// # Panics
/// As [`watch`].
#[must_use]
pub fn watch_with(registry: &Registry, scene: &str) -> Watched {
    keep(prepared_with(registry, Clock::Virtual, scene))
}

fn keep(session: Session) -> Watched {
    let mut keep = Keep::default();
    let outcome = session.run(&mut keep, &StopSwitch::default());
    let outcome = outcome.unwrap_or_else(|error| panic!("it does not run: {error}"));
    Watched { records: keep.records, changes: keep.changes, outcome }
}
